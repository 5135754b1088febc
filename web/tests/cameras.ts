// Cameras that a test points: images of a tag, drawn by the browser and put into a folder that the program watches, ten a second.
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, renameSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import type { Browser } from "playwright-core";
import { file } from "./server.js";

const WIDTH = 640;
const HEIGHT = 480;
const FOCAL = 600;
/** The middle of the printed tag on its sheet, mm, and where the sheet hangs: rotation about x, then y, rad, and place, m. */
const MIDDLE_MM = [113.25, 137.8] as const;
const TILT = [0.3, -0.5] as const;
const PLACE_M = [0.03, -0.02, 0.5] as const;
const VARIANTS = 8;

type Corner = [number, number];

/** Images of a tag for each angle by which the camera is turned right, degrees; each several times, with a noise of its own. */
export async function drawn(browser: Browser, anglesDeg: number[]): Promise<Map<number, Buffer[]>> {
  const folder = mkdtempSync(join(tmpdir(), "resight-tag-"));
  execFileSync(process.env.RESIGHT_PROGRAM!, ["print", "--kind", "tag", "--id", "3", "--size-m", "0.1", "-o", join(folder, "tag.svg")], { stdio: "ignore" });
  const svg = readFileSync(join(folder, "tag.svg"), "utf8");
  rmSync(folder, { recursive: true });
  const path = /<path fill-rule="evenodd" d="([^"]*)"/.exec(svg)![1]!;
  const tag = path.split("Z").filter(Boolean).map((part) => [...part.matchAll(/[ML]([\d.]+) ([\d.]+)/g)].map(([, x, y]): Corner => [Number(x), Number(y)]));
  const sheet: Corner[] = [[45, 70], [181, 70], [181, 206], [45, 206]];
  const page = await browser.newPage();
  const images = new Map<number, Buffer[]>();
  for (const angle of anglesDeg) {
    const seen = (outline: Corner[]) => outline.map((corner) => projected(corner, (angle * Math.PI) / 180));
    const urls = await page.evaluate(draw, { sheet: seen(sheet), tag: tag.map(seen), n: VARIANTS, WIDTH, HEIGHT });
    images.set(angle, urls.map((url) => Buffer.from(url.split(",")[1]!, "base64")));
  }
  await page.close();
  return images;
}

/** A place on the sheet, mm, in the image of a camera that is turned right; (0.5, 0.5) is the middle of the first pixel, as canvases have it. */
function projected([xMm, yMm]: Corner, right: number): Corner {
  const [x0, y0] = [(xMm - MIDDLE_MM[0]) / 1e3, (yMm - MIDDLE_MM[1]) / 1e3];
  const [about, over] = TILT;
  const [y1, z1] = [y0 * Math.cos(about), y0 * Math.sin(about)];
  const [x2, z2] = [x0 * Math.cos(over) + z1 * Math.sin(over), z1 * Math.cos(over) - x0 * Math.sin(over)];
  const [x, y, z] = [x2 + PLACE_M[0], y1 + PLACE_M[1], z2 + PLACE_M[2]];
  const [xNow, zNow] = [x * Math.cos(right) - z * Math.sin(right), z * Math.cos(right) + x * Math.sin(right)];
  return [WIDTH / 2 + (FOCAL * xNow) / zNow, HEIGHT / 2 + (FOCAL * y) / zNow];
}

interface Drawing { sheet: Corner[]; tag: Corner[][]; n: number; WIDTH: number; HEIGHT: number }

function draw({ sheet, tag, n, WIDTH, HEIGHT }: Drawing): string[] {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [WIDTH, HEIGHT];
  const pen = canvas.getContext("2d")!;
  const fill = (outlines: Corner[][], colour: string) => {
    pen.fillStyle = colour;
    pen.beginPath();
    for (const outline of outlines) {
      outline.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      pen.closePath();
    }
    pen.fill("evenodd");
  };
  return Array.from({ length: n }, (_, variant) => {
    fill([[[0, 0], [WIDTH, 0], [WIDTH, HEIGHT], [0, HEIGHT]]], "#7c8287");
    fill([sheet], "#e8e8e8");
    fill(tag, "#202020");
    const image = pen.getImageData(0, 0, WIDTH, HEIGHT);
    let seed = 1 + variant;
    for (let i = 0; i < image.data.length; i += 4) {
      seed = (seed * 1103515245 + 12345) % 2147483648;
      const noise = ((seed >> 16) % 7) - 3;
      for (let k = 0; k < 3; k++) image.data[i + k]! += noise;
    }
    pen.putImageData(image, 0, 0);
    return canvas.toDataURL("image/png");
  });
}

/** A camera whose folder gets an image every 100 ms, of how it is turned now. */
export class Camera {
  angle = 0;
  private n = 0;
  private timer: NodeJS.Timeout | undefined;
  readonly folder: string;

  constructor(readonly name: string, root: string, private readonly images: Map<number, Buffer[]>, readonly everyMs = 100) {
    this.folder = join(root, `frames-${name.replace(/\W+/g, "-")}`);
    mkdirSync(this.folder);
  }

  start() {
    this.timer ??= setInterval(() => this.shoot(), this.everyMs);
  }

  stop() {
    clearInterval(this.timer);
    this.timer = undefined;
  }

  private shoot() {
    const all = this.images.get(this.angle)!;
    const name = String(this.n++).padStart(8, "0");
    // The program sees whole files only.
    const unfinished = join(this.folder, `${name}.part`);
    writeFileSync(unfinished, all[this.n % all.length]!);
    renameSync(unfinished, join(this.folder, `${name}.png`));
  }
}

/** A folder for a session, its cameras, and its file. */
export class Watch {
  readonly root = mkdtempSync(join(tmpdir(), "resight-live-"));
  readonly cameras: Camera[];

  constructor(names: string[], images: Map<number, Buffer[]>, everyMs?: number) {
    this.cameras = names.map((name) => new Camera(name, this.root, images, everyMs));
  }

  file(name: string) {
    return join(this.root, name);
  }

  /** Writes the session's file; `keys` are further lines of it. */
  session(keys = ""): string {
    writeFileSync(this.file("camera.toml"), [
      'model = "pinhole"', `width_px = ${WIDTH}`, `height_px = ${HEIGHT}`, `fx_px = ${FOCAL}.0`, `fy_px = ${FOCAL}.0`,
      `cx_px = ${(WIDTH - 1) / 2}`, `cy_px = ${(HEIGHT - 1) / 2}`,
    ].join("\n"));
    writeFileSync(this.file("tag.toml"), 'kind = "tag"\nfamily = "tag36h11"\nid = 3\nsize_m = 0.1\n');
    const tables = this.cameras.map(({ name, folder }) => `[camera.${JSON.stringify(name)}]\nfile = ${JSON.stringify(this.file("camera.toml"))}\nsource = ${JSON.stringify(`${folder}/`)}\n`);
    const text = `learn = 20\nstale_after_s = 3\n${keys}\n${tables.join("\n")}\n[target.tag]\nfile = ${JSON.stringify(this.file("tag.toml"))}\n`;
    writeFileSync(this.file("session.toml"), text);
    return this.file("session.toml");
  }

  start() {
    this.cameras.forEach((camera) => camera.start());
  }

  end() {
    this.cameras.forEach((camera) => camera.stop());
    rmSync(this.root, { recursive: true, force: true });
  }
}

export { file };
