// The scene of testdata/demo: where its camera was when the image was drawn, and where points of its board appear.
import { readFileSync } from "node:fs";
import type { Page } from "playwright-core";
import { file } from "./server.js";

export type Pixel = [number, number];

/** Distance from a tag to the next, metres: 45 mm and 0.3 of it. */
export const PITCH_M = 0.0585;

const K = { fx: 742, fy: 744, cx: 404.5, cy: 297 };
const [K1, K2, P1, P2, K3] = [-0.28, 0.11, 0.0006, -0.0004, -0.02];

function truth(name: string): { rotation: number[][]; translation: number[] } {
  const text = readFileSync(file("testdata/demo/truth.toml"), "utf8");
  const table = text.split(`[${name}]`)[1]!;
  const numbers = (key: string) => new RegExp(`${key} = \\[([^\\]]*)\\]`).exec(table)![1]!.split(",").map(Number);
  const [w, x, y, z] = numbers("rotation_wxyz") as [number, number, number, number];
  const rotation = [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
  return { rotation, translation: numbers("translation_m") };
}

const POSE = truth("left_from_grid");

/** Pixel of a point of the board, in pitches. */
export function pixel(x: number, y: number, z = 0): Pixel {
  const at = [x, y, z].map((coordinate) => coordinate * PITCH_M);
  const [X, Y, Z] = POSE.rotation.map((row, i) => row.reduce((sum, r, k) => sum + r * at[k]!, POSE.translation[i]!)) as [number, number, number];
  const [a, b] = [X / Z, Y / Z];
  const r2 = a * a + b * b;
  const radial = 1 + r2 * (K1 + r2 * (K2 + r2 * K3));
  const u = a * radial + 2 * P1 * a * b + P2 * (r2 + 2 * a * a);
  const v = b * radial + P1 * (r2 + 2 * b * b) + 2 * P2 * a * b;
  return [K.fx * u + K.cx, K.fy * v + K.cy];
}

/** Where the camera was, in pitches, and its tilt in degrees below the level of the board. */
export function camera(): { x: number; y: number; height: number; tilt: number } {
  const centre = [0, 1, 2].map((k) => -POSE.rotation.reduce((sum, row, i) => sum + row[k]! * POSE.translation[i]!, 0) / PITCH_M);
  return { x: centre[0]!, y: centre[1]!, height: centre[2]!, tilt: (Math.asin(-POSE.rotation[2]![2]!) * 180) / Math.PI };
}

export const IMAGE = { path: "testdata/demo/left.png", width: 800, height: 600 };

/** How the photograph of a size lies on the page when it is shown as a whole. */
export async function shown(page: Page, size: { width: number; height: number } = IMAGE) {
  const box = (await page.locator(".views > .viewport").boundingBox())!;
  const scale = Math.min(box.width / size.width, box.height / size.height, 8);
  const x = box.x + box.width / 2 - scale * (size.width / 2 - 0.5);
  const y = box.y + box.height / 2 - scale * (size.height / 2 - 0.5);
  return { box, scale, at: ([u, v]: Pixel): Pixel => [x + scale * u, y + scale * v] };
}

/** Drops the demo's photograph on the page, and its camera file. */
export async function demo(page: Page) {
  await page.locator("input[type=file][accept='image/png,image/jpeg']").first().setInputFiles(file(IMAGE.path));
  await page.locator("[data-step=lens] input[type=file]").setInputFiles(file("testdata/demo/left.toml"));
  await page.locator("[data-step=lens][data-done=true]").waitFor();
}

export async function click(page: Page, at: Pixel) {
  const { at: screen } = await shown(page);
  const [x, y] = screen(at);
  await page.mouse.move(x, y);
  await page.mouse.click(x, y);
}

/** Types a distance into the field drawn between two marks. */
export async function distance(page: Page, a: string, b: string, metres: number) {
  const field = page.locator(".chip").getByLabel(`Distance ${a} to ${b} in metres`);
  await field.fill(String(metres));
  await field.press("Enter");
}

/** A number of the answer with its ±. */
export async function figure(page: Page, name: string): Promise<{ value: number; half: number; words: string }> {
  const words = (await page.locator(`[data-figure=${name}] .value`).textContent())!;
  const [value, half] = words.split("±").map((part) => parseFloat(part)) as [number, number];
  return { value, half, words };
}

/** Marks as a hand would place them: off by up to a third of a pixel. */
export const MARKS: [string, number, number, Pixel][] = [
  ["A", 0, 0, [0.2, -0.1]],
  ["B", 2, 0, [-0.1, 0.25]],
  ["C", 3, 0, [0.05, -0.2]],
  ["D", 3, 3, [-0.2, 0.1]],
];

/** The four clicks on the demo's board, with distances in pitches that are exact to a millimetre of metres. */
export async function fourClicks(page: Page) {
  await clicks(page, MARKS);
  for (const [a, b] of [["A", "B"], ["B", "C"], ["D", "A"], ["D", "C"]]) {
    const field = page.getByLabel(`Standard deviation of ${a} to ${b} in metres`);
    await field.fill("0.002");
    await field.press("Tab");
  }
  await until(async () => (await view(page)).distances.every((d) => d.sigma_m === 0.002));
  await page.locator("[data-step=answer] [data-status=ok]").waitFor();
}

interface SeenView {
  points: { name: string; u_px: number; v_px: number; sigma_px: number }[];
  distances: { sigma_m: number }[];
  lens: { state: string; model: string } | null;
}

/** What the program says of the session that a page has open. */
export async function view(page: Page): Promise<SeenView> {
  const session = await page.evaluate(() => JSON.parse(sessionStorage.getItem("resight session")!).session);
  const { origin } = new URL(page.url());
  return (await fetch(`${origin}/api/session/view?session=${session}`)).json();
}

/** Waits until something holds. */
export async function until(holds: () => Promise<boolean>) {
  for (let i = 0; i < 200; i++) {
    if (await holds()) return;
    await new Promise((done) => setTimeout(done, 50));
  }
  throw new Error(`it never came to hold: ${holds}`);
}

/** Clicks four marks and types their distances. */
export async function clicks(page: Page, marks: typeof MARKS) {
  await demo(page);
  for (const [name, x, y, [du, dv]] of marks) {
    const [u, v] = pixel(x, y);
    await click(page, [u + du, v + dv]);
    await page.locator("[data-step=marks] .cut", { hasText: name }).waitFor();
  }
  const at = Object.fromEntries(marks.map(([name, x, y]) => [name, [x, y] as Pixel]));
  for (const [a, b] of [["A", "B"], ["B", "C"], ["D", "A"], ["D", "C"]] as const) {
    await distance(page, a, b, Math.hypot(at[a]![0] - at[b]![0], at[a]![1] - at[b]![1]));
  }
  await page.locator("[data-figure=height]").waitFor();
}
