// The tab Rig: files dropped, the view turned by mouse, fingers and keys, tables; wrong files.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import type { Browser, BrowserContextOptions, Page } from "playwright-core";
import { type Server, PHONE, WIDE, accessible, browser, faultsOf, file, open, serve } from "./server.js";
import { drop, looks } from "./results.js";

let chromium: Browser;
let server: Server;
before(async () => {
  [chromium, server] = await Promise.all([browser(), serve()]);
});
after(async () => {
  await chromium.close();
  await server.stop();
});

const CANVAS = ".space-canvas";
const answer = JSON.parse(readFileSync(file("examples/rig/answer.json"), "utf8"));

async function shown(page: Page) {
  await page.locator("[data-summary]").waitFor();
}

async function example(options: BrowserContextOptions = WIDE) {
  const page = await open(chromium, server, "rig", options);
  await page.getByRole("button", { name: "Try the example" }).click();
  await shown(page);
  return page;
}

test("an answer and a rig file that are dropped are shown with the numbers of the answer", async () => {
  const page = await open(chromium, server, "rig");
  await drop(page, ["examples/rig/answer.json", "examples/rig/rig.toml"]);
  await shown(page);
  assert.equal(await page.locator("[data-summary] [data-status]").getAttribute("data-status"), "ok");
  assert.match((await page.locator("[data-figure=rms] .value").textContent())!, new RegExp(`^${answer.rms_px.toFixed(3)} px`));
  assert.match((await page.locator("[data-figure=used] .value").textContent())!, new RegExp(`^${answer.n_used} of ${answer.n_seen}`));
  const rows = page.locator("[data-table=cameras] tbody tr");
  assert.equal(await rows.count(), Object.keys(answer.cameras).length);
  const left = answer.cameras.left.rig_from_cam.translation_m.map((x: number) => (1e3 * x).toFixed(0).replace("-", "−").replace("−0", "0"));
  const text = (await rows.filter({ hasText: "left" }).textContent())!;
  for (const mm of left) assert(text.includes(mm.slice(0, -1)), `${text} should hold ${mm}`);
  assert.equal(await page.locator("[data-table=views] tbody tr").count(), answer.views.length);
  assert.equal(await page.locator("[data-table=pairs] tbody tr").count(), answer.pairs.length);
  assert.equal(await page.locator("[data-table=rejected] tbody tr").count(), answer.rejected.length);
  assert.match((await page.locator("[data-caption]").textContent())!, /95 %.*\d/);
  // Shares: a whole 1 and less are distinguished by class and by number.
  const cells = await page.locator("[data-table=views] td[class^=share]").evaluateAll((all) => all.map((cell) => [cell.className, cell.textContent!] as const));
  assert(cells.length > 40 && cells.every(([name, words]) => (name === "share-10") === (words === "100")));
  assert(cells.some(([, words]) => words !== "100"));
  assert.deepEqual(faultsOf(page), []);
  await page.close();
});

test("mouse, wheel, keys and buttons turn the view, and 0 brings it back", async () => {
  const page = await example();
  const first = await looks(page, CANVAS);
  assert(2000 < first.drawn, `${first.drawn} pixels drawn`);
  const box = (await page.locator(CANVAS).boundingBox())!;
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const changes = async (what: string, act: () => Promise<void>) => {
    const before = await looks(page, CANVAS);
    await act();
    assert.notEqual((await looks(page, CANVAS)).sum, before.sum, what);
  };
  await changes("a drag", async () => {
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 60, y + 20, { steps: 4 });
    await page.mouse.up();
  });
  await changes("the wheel", () => page.mouse.wheel(0, -200));
  for (const key of ["ArrowLeft", "ArrowUp", "+", "-", "Shift+ArrowRight"]) await changes(key, () => page.keyboard.press(key));
  for (const name of ["From above", "From the side", "Nearer"]) await changes(name, () => page.getByRole("button", { name }).click());
  for (const name of ["Ellipsoids", "Names", "Lines of sight", "Targets"]) await changes(name, () => page.getByLabel(name, { exact: true }).click());
  for (const name of ["Ellipsoids", "Names", "Lines of sight", "Targets"]) await page.getByLabel(name, { exact: true }).click();
  await page.locator(CANVAS).focus();
  await page.keyboard.press("0");
  assert.deepEqual(await looks(page, CANVAS), first);
  assert.deepEqual(faultsOf(page), []);
  await page.close();
});

test("a view that is chosen is shown alone", async () => {
  const page = await example();
  const all = await looks(page, CANVAS);
  await page.locator("[data-table=views] tbody th button").nth(3).click();
  assert.equal(await page.locator("[data-view-now]").textContent(), `View ${answer.views[3].view}`);
  const one = await looks(page, CANVAS);
  assert.notEqual(one.sum, all.sum);
  await page.getByRole("button", { name: "Next view" }).click();
  assert.equal(await page.locator("[data-view-now]").textContent(), `View ${answer.views[4].view}`);
  await page.locator("[data-table=views] tbody th button").nth(4).click();
  assert.equal(await page.locator("[data-view-now]").textContent(), "All views");
  assert.equal((await looks(page, CANVAS)).sum, all.sum);
  await page.close();
});

test("one finger turns, two zoom", async () => {
  const page = await example(PHONE);
  const client = await page.context().newCDPSession(page);
  const box = (await page.locator(CANVAS).boundingBox())!;
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const touch = (type: "touchStart" | "touchMove" | "touchEnd", points: [number, number][]) =>
    client.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([px, py], id) => ({ x: px, y: py, id })) });
  const first = await looks(page, CANVAS);
  await touch("touchStart", [[x, y]]);
  await touch("touchMove", [[x + 40, y]]);
  await touch("touchEnd", []);
  const turned = await looks(page, CANVAS);
  assert.notEqual(turned.sum, first.sum);
  await touch("touchStart", [[x - 20, y], [x + 20, y]]);
  await touch("touchMove", [[x - 60, y], [x + 60, y]]);
  await touch("touchEnd", []);
  assert.notEqual((await looks(page, CANVAS)).sum, turned.sum);
  await page.close();
});

test("wrong files get one sentence, and what was shown stays", async () => {
  const page = await open(chromium, server, "rig");
  for (const [files, said] of [
    [["testdata/formats/target_tag.toml"], /this is a target/],
    [[{ name: "notes.txt", text: "hello" }], /^notes\.txt: .*\.$/],
    [[{ name: "broken.json", text: '{"status": "ok", "cameras": {"a": 3}}' }], /broken\.json: this is no answer/],
    [["examples/rig/answer.json", "examples/rig/answer.json"], /second answer/],
  ] as const) {
    await drop(page, [...files]);
    const note = page.locator(".note.bad");
    await note.filter({ hasText: said }).waitFor();
    assert.equal(await note.count(), 1);
    assert.equal(await note.getAttribute("role"), "alert");
  }
  await drop(page, ["examples/rig/rig.toml"]);
  await shown(page);
  assert.equal(await page.locator(".note.bad").count(), 0);
  await drop(page, [{ name: "notes.txt", text: "hello" }]);
  await page.locator(".note.bad").waitFor();
  assert.equal(await page.locator("[data-table=cameras] tbody tr").count(), 4, "the rig is still there");
  assert.deepEqual(faultsOf(page), []);
  await page.close();
});

test("names are text, whatever they hold", async () => {
  const page = await open(chromium, server, "rig");
  const hostile = "<img src=x onerror=alert(1)>";
  const text = readFileSync(file("examples/rig/answer.json"), "utf8").replaceAll('"left"', JSON.stringify(hostile));
  await drop(page, [{ name: "a.json", text }]);
  await shown(page);
  assert.equal(await page.locator("img[src=x]").count(), 0);
  assert((await page.locator("[data-table=cameras]").textContent())!.includes(hostile));
  assert.deepEqual(faultsOf(page), []);
  await page.close();
});

for (const colorScheme of ["light", "dark"] as const) {
  for (const [width, size] of [["wide", WIDE], ["phone", PHONE]] as const) {
    test(`accessible: ${colorScheme}, ${width}`, async () => {
      const empty = await open(chromium, server, "rig", { ...size, colorScheme });
      await empty.getByRole("button", { name: "Try the example" }).waitFor();
      await accessible(empty, "before there are files");
      await empty.close();
      const page = await example({ ...size, colorScheme });
      await looks(page, CANVAS);
      await accessible(page, "the example");
      if (process.env.SCREENSHOTS) await page.screenshot({ path: `${process.env.SCREENSHOTS}/rig-${width}-${colorScheme}.png` });
      assert.deepEqual(faultsOf(page), []);
      await page.close();
    });
  }
}
