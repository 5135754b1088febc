// Four clicks on a photograph whose truth is known, both poses of an ambiguous view, measuring, and what is kept.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { MARKS, camera, click, clicks, demo, figure, fourClicks, pixel, shown, until, view, type Pixel } from "./scene.js";
import { Watch, drawn } from "./cameras.js";
import { PHONE, type Server, browser, faultsOf, open, serve } from "./server.js";

let chromium: Browser;
let server: Server;
before(async () => {
  [chromium, server] = await Promise.all([browser(), serve()]);
});
after(async () => {
  await chromium.close();
  await server.stop();
});

async function ended(page: Page) {
  assert.deepEqual(faultsOf(page), []);
  await page.context().close();
}

async function downloaded(page: Page, menu: string, item: string): Promise<{ name: string; bytes: Buffer; path: string }> {
  await page.getByRole("button", { name: menu }).first().click();
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: item, exact: true }).click()]);
  const path = join(mkdtempSync(join(tmpdir(), "resight-page-")), download.suggestedFilename());
  await download.saveAs(path);
  return { name: download.suggestedFilename(), bytes: readFileSync(path), path };
}

async function measure(page: Page, what: string, points: Pixel[]) {
  await page.locator("[data-step=measure]").getByRole("button", { name: what, exact: true }).click();
  for (const at of points) await click(page, at);
  if (what === "Area" || what === "Polyline") await page.locator(".viewport").first().press("Enter");
  await page.getByRole("button", { name: "Stop", exact: true }).click();
}

test("four clicks give the pose within its ±", async () => {
  const page = await open(chromium, server);
  await fourClicks(page);
  await page.getByRole("button", { name: "Details" }).click();
  const truth = camera();
  for (const [name, value] of [["height", truth.height], ["tilt", truth.tilt], ["x", truth.x], ["y", truth.y]] as const) {
    const { value: said, half, words } = await figure(page, name);
    assert(Math.abs(said - value) <= half, `${name}: ${words}, in truth ${value}`);
    // Degrees of the tilt, pitches of the others.
    const most = name === "tilt" ? 3 : 0.25 * Math.abs(truth.height);
    assert(0 < half && half < most, `${name}: ${words}`);
  }
  await ended(page);
});

/** The edges of the board's tags lie at whole pitches, and so do lines of the grid. */
test("the grid is drawn over the real lines to 1 px", async () => {
  const page = await open(chromium, server);
  await fourClicks(page);
  const { box, scale, at } = await shown(page);
  const samples: { along: [number, number]; screen: Pixel }[] = [];
  for (let line = 0; line <= 3; line++) {
    for (const s of [0.35, 0.6, 1.3, 1.7, 2.4, 2.7, 3.2]) {
      for (const [x, y, ahead] of [[line, s, [line, s + 0.01]], [s, line, [s + 0.01, line]]] as [number, number, Pixel][]) {
        const [a, b] = [at(pixel(x, y)), at(pixel(...ahead))];
        const long = Math.hypot(b[0] - a[0], b[1] - a[1]);
        samples.push({ along: [(b[0] - a[0]) / long, (b[1] - a[1]) / long], screen: [a[0] - box.x, a[1] - box.y] });
      }
    }
  }
  const off = await page.evaluate((samples) => {
    const canvas = document.querySelector<HTMLCanvasElement>(".views > .viewport > canvas:nth-of-type(3)")!;
    const { data } = canvas.getContext("2d")!.getImageData(0, 0, canvas.width, canvas.height);
    // How much of the grid's colour is at a place: bright and rather blue.
    const grid = (x: number, y: number) => {
      const i = 4 * (Math.round(y) * canvas.width + Math.round(x));
      const [r, g, b, alpha] = [data[i]!, data[i + 1]!, data[i + 2]!, data[i + 3]!];
      return 90 < b - r && 120 < g ? alpha / 255 : 0;
    };
    return samples.map(({ along: [dx, dy], screen: [x, y] }) => {
      let [sum, moment] = [0, 0];
      for (let k = -16; k <= 16; k++) {
        const by = k / 4;
        const weight = grid(x - 0.5 - by * dy, y - 0.5 + by * dx);
        [sum, moment] = [sum + weight, moment + weight * by];
      }
      return sum < 1 ? null : Math.abs(moment / sum);
    });
  }, samples);
  // Marks, axes and letters lie over a few places.
  const seen = off.filter((x) => x !== null).map((x) => x / scale);
  assert(0.6 * samples.length < seen.length, `${seen.length} of ${samples.length} places`);
  const worst = Math.max(...seen);
  console.log(`grid off by at most ${worst.toFixed(2)} px at ${seen.length} places`);
  assert(worst <= 1, `${worst} px`);
  await ended(page);
});

test("both poses of an ambiguous view are shown, and either can be chosen", async () => {
  const page = await open(chromium, server);
  // The camera stands in the critical plane of these four, and their distances are rough.
  await clicks(page, [...MARKS.slice(0, 3), ["D", 1, 3, [0.2, 0.1]]]);
  await page.locator("[data-step=answer] [data-status=ambiguous]").waitFor();
  const bar = page.locator(".choice-bar");
  await bar.waitFor();
  await page.getByRole("button", { name: "Details" }).click();
  const before = await figure(page, "heading");
  await bar.getByRole("button", { name: "ghost" }).click();
  await page.getByText("You chose between two poses").waitFor();
  const after = await figure(page, "heading");
  assert(1 < Math.abs(after.value - before.value), `${before.words} and ${after.words}`);
  await bar.getByRole("button", { name: "take the other" }).click();
  await page.getByText("Two poses fit").waitFor();
  assert.deepEqual(await figure(page, "heading"), before);
  await ended(page);
});

test("what is measured is true, sorts, is exported, saved and read by the program", async () => {
  const page = await open(chromium, server);
  await fourClicks(page);
  await measure(page, "Length", [pixel(0, 1), pixel(3, 1)]);
  await measure(page, "Area", [pixel(0, 0), pixel(2, 0), pixel(2, 2), pixel(0, 2)]);
  await measure(page, "Position", [pixel(1, 3)]);
  await measure(page, "Polyline", [pixel(0, 0), pixel(1, 0), pixel(1, 1)]);
  const rows = page.locator("[data-measurement]");
  await rows.nth(3).waitFor();

  const csv = (await downloadedCsv(page)).split("\n").slice(1).filter(Boolean).map((line) => line.split(","));
  // A position has three values: x, y, z.
  for (const [i, truth] of [3, 4, 1, 3, 0, 2].entries()) {
    const [name, , , low, high] = csv[i]!;
    assert(Number(low) <= truth && truth <= Number(high), `${name}: ${low} … ${high}, in truth ${truth}`);
  }
  await page.getByRole("button", { name: "Sort by value" }).click();
  assert.equal(await rows.first().getAttribute("data-measurement"), "position 1");
  await page.getByRole("button", { name: "Sort by value" }).click();
  assert.equal(await rows.first().getAttribute("data-measurement"), "area 1");

  const figures = await page.locator(".answer-figures").textContent();
  for (const [item, begins] of [["Report (HTML)", "<!doctype html>"], ["SVG", "<svg"], ["PNG", "\x89PNG"], ["Bird's-eye view (PNG)", "\x89PNG"], ["OpenCV", ""], ["JSON", "{"]] as const) {
    const { bytes } = await downloaded(page, "Export", item);
    assert(bytes.toString("latin1").startsWith(begins) && 100 < bytes.length, item);
  }
  const saved = await downloaded(page, "Session", "Save as one file");
  const said = execFileSync(process.env.RESIGHT_PROGRAM!, ["measure", saved.path], { encoding: "utf8" });
  for (const name of ["length 1", "area 1"]) assert(said.includes(name), said);

  const other = await open(chromium, server);
  await other.locator("input[type=file][accept='.toml']").first().setInputFiles(saved.path);
  await other.locator("[data-figure=height]").waitFor();
  assert.equal(await other.locator(".answer-figures").textContent(), figures);
  await other.locator("[data-measurement]").nth(3).waitFor();
  await ended(other);
  await ended(page);
});

async function downloadedCsv(page: Page): Promise<string> {
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Download CSV" }).click()]);
  return readFileSync((await download.path())!, "utf8");
}

test("a page that is loaded again goes on where it was", async () => {
  const page = await open(chromium, server);
  await fourClicks(page);
  const figures = await page.locator(".answer-figures").textContent();
  await page.reload();
  await page.locator("[data-figure=height]").waitFor();
  assert.equal(await page.locator(".answer-figures").textContent(), figures);
  for (let i = 0; i < 5; i++) await page.getByRole("button", { name: "Undo" }).click();
  await page.locator(".chip[data-missing=true]").waitFor();
  await ended(page);
});

test("marks are moved by keys and the hand, and taken back in one step", async () => {
  const page = await open(chromium, server);
  await fourClicks(page);
  const mark = async () => (await view(page)).points[1]!;
  const before = await mark();
  const stage = page.locator(".views > .viewport");
  await stage.focus();
  await page.keyboard.press("2");
  for (let i = 0; i < 4; i++) await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Shift+ArrowDown");
  await until(async () => Math.abs((await mark()).v_px - before.v_px - 0.1) < 1e-6);
  const moved = await mark();
  assert(Math.abs(moved.u_px - before.u_px - 4) < 1e-6, `${moved.u_px} from ${before.u_px}`);
  for (let i = 0; i < 5; i++) await page.keyboard.press("Control+z");
  await until(async () => (await mark()).u_px === before.u_px);

  // Twenty moves of the hand are one step.
  const { at } = await shown(page);
  const [x, y] = at([before.u_px, before.v_px]);
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let i = 1; i <= 20; i++) await page.mouse.move(x + i, y - i / 2);
  await page.mouse.up();
  await until(async () => 15 < (await mark()).u_px - before.u_px);
  await page.getByRole("button", { name: "Undo" }).click();
  await until(async () => (await mark()).u_px === before.u_px);
  await ended(page);
});

test("snapping shows what it would do, and can be refused", async () => {
  const page = await open(chromium, server);
  await demo(page);
  await page.getByLabel("Snap to").selectOption("corner");
  const [u, v] = pixel(0, 0);
  const mark = async () => (await view(page)).points[0]!;
  await click(page, [u + 2, v + 1.5]);
  const bar = page.locator(".choice-bar.snap");
  await bar.waitFor();
  const clicked = await mark();
  assert(1 < Math.hypot(clicked.u_px - u, clicked.v_px - v), "it snapped before it was allowed to");
  await page.locator(".views > .viewport").press("Escape");
  await bar.waitFor({ state: "detached" });
  assert.deepEqual(await mark(), clicked);
  await page.locator(".views > .viewport").press("s");
  await bar.waitFor();
  await page.locator(".views > .viewport").press("Enter");
  await until(async () => Math.hypot((await mark()).u_px - u, (await mark()).v_px - v) < 0.7);
  assert((await mark()).sigma_px < 1);
  await ended(page);
});

test("a tag is found, and its pose is there", async () => {
  const page = await open(chromium, server);
  await demo(page);
  await page.getByRole("button", { name: /Tag or board/ }).click();
  await page.locator("[data-step=marks] input[type=file]").setInputFiles("../testdata/demo/grid.toml");
  await page.locator("[data-step=answer] [data-status=ok]").waitFor();
  assert.match((await page.locator("[data-step=marks] header").textContent())!, /64|6\d/);
  await ended(page);
});

test("two photographs put a point in space", async () => {
  const page = await open(chromium, server);
  await fourClicks(page);
  await page.locator(".photos input[type=file]").setInputFiles({ name: "second.png", mimeType: "image/png", buffer: readFileSync("../testdata/demo/left.png") });
  await page.getByText("Click A, which another photograph shows too.").waitFor();
  await page.getByRole("button", { name: "left.png", exact: true }).click();
  await page.getByText("A B C D").waitFor();
  await ended(page);
});

test("a frame of a running camera becomes a photograph, and dragging on it delays no frame", async () => {
  const watch = new Watch(["gate"], await drawn(chromium, [0]));
  watch.start();
  const live = await serve(watch.session());
  const page = await open(chromium, live);
  try {
    const menu = page.getByRole("button", { name: "Take a frame from a running camera" });
    await menu.click();
    await page.getByRole("button", { name: "gate", exact: true }).click();
    await page.locator(".photos").getByRole("button", { name: "gate.png" }).waitFor();
    // Its lens comes with it.
    await page.locator("[data-step=lens][data-done=true]").waitFor();
    const { lens } = await view(page);
    assert.deepEqual([lens?.state, lens?.model], ["given", "pinhole"]);
    await page.getByRole("button", { name: /Tag or board/ }).click();
    await page.locator("[data-step=marks] input[type=file]").setInputFiles(watch.file("tag.toml"));
    await page.locator("[data-figure=height]").waitFor();
    const [mark] = (await view(page)).points;
    const { at } = await shown(page, { width: 640, height: 480 });
    const [x, y] = at([mark!.u_px, mark!.v_px]);
    await page.mouse.move(x, y);
    await page.mouse.down();
    for (let i = 1; i <= 100; i++) {
      await page.mouse.move(x + 8 * Math.sin(i / 5), y);
      await page.waitForTimeout(16);
    }
    await page.mouse.up();
    const [camera] = (await (await fetch(`${live.address}/api/live`)).json()).cameras;
    assert.equal(camera.dropped, 0);
    assert(camera.is_fresh && 5 < camera.fps, JSON.stringify(camera));
    await ended(page);
  } finally {
    await live.stop();
    watch.end();
  }
});

test("on a phone a finger moves the selected mark without covering it", async () => {
  const page = await open(chromium, server, "photograph", PHONE);
  await page.getByRole("button", { name: "Try the example" }).tap();
  await page.locator(".sheet .handle .status").waitFor();
  const { at } = await shown(page, { width: 640, height: 480 });
  const mark = async () => (await view(page)).points[0]!;
  const before = await mark();
  await page.touchscreen.tap(...at([before.u_px, before.v_px]));
  await page.locator("[data-step=marks] summary").click();
  assert.equal(await page.locator("[data-step=marks] tr[data-selected=true] th").textContent(), "A");
  // Far from the mark: it moves by as much as the finger does.
  const [x, y] = at([90, 410]);
  const client = await page.context().newCDPSession(page);
  const touch = (type: "touchStart" | "touchMove" | "touchEnd", dx = 0) =>
    client.send("Input.dispatchTouchEvent", { type, touchPoints: type === "touchEnd" ? [] : [{ x: x + dx, y }] });
  await touch("touchStart");
  for (let i = 1; i <= 10; i++) await touch("touchMove", i);
  await touch("touchEnd");
  const { scale } = await shown(page, { width: 640, height: 480 });
  await until(async () => Math.abs((await mark()).u_px - before.u_px - 10 / scale) < 1);
  await ended(page);
});
