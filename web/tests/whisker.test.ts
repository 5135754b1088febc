// The tab Whisker: files dropped, the sweep played, the verdict; wrong files.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import type { Browser, BrowserContextOptions } from "playwright-core";
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

const CANVAS = ".viewport canvas";
const FILES = ["testdata/whisker/whisker.json", "testdata/whisker/hub.csv"];

async function example(options: BrowserContextOptions = WIDE) {
  const page = await open(chromium, server, "whisker", options);
  await page.getByRole("button", { name: "Try the example" }).click();
  await page.locator("[data-object]").waitFor();
  return page;
}

test("whisker and readings give the square, its truth within its error bars", async () => {
  const page = await open(chromium, server, "whisker");
  await drop(page, FILES);
  await page.locator("[data-object]").waitFor();
  assert.equal(await page.locator("[data-object] [data-status]").textContent(), "✓square");
  const truth = JSON.parse(readFileSync(file("testdata/whisker/square.json"), "utf8"));
  const parameter = async (name: string) => {
    const text = (await page.locator("[data-table=parameters] tr").filter({ hasText: name }).locator("td").textContent())!.replace("−", "-");
    const [value, sigma] = text.split(" ± ").map(parseFloat);
    return { value: value!, sigma: sigma! };
  };
  const side = await parameter("side");
  assert(Math.abs(side.value - 1e3 * (truth.object ?? truth).side) < 3 * side.sigma, JSON.stringify(side));
  assert.match((await page.locator("[data-figure=mu] .value").textContent())!, /^0\.\d+ ± 0\.\d+/);
  assert.equal(await page.locator("[data-record] [data-status]").getAttribute("data-status"), "ok");
  assert.deepEqual(faultsOf(page), []);
  await page.close();
});

test("the slider and Play move the whisker, and pausing holds it", async () => {
  const page = await example();
  const first = await looks(page, CANVAS);
  assert(2000 < first.drawn, `${first.drawn} pixels drawn`);
  const slider = page.getByRole("slider");
  const at = async () => Number(await slider.inputValue());
  const before = await at();
  await slider.focus();
  await page.keyboard.press("ArrowRight");
  assert.equal(await at(), before + 1);
  assert.match((await page.locator("[data-now] h2").textContent())!, new RegExp(`^Reading ${before + 2} of `));
  assert.notEqual((await looks(page, CANVAS)).sum, first.sum);
  await page.keyboard.press("Home");
  assert.equal(await at(), 0);
  await page.getByRole("button", { name: "Play" }).click();
  await page.waitForFunction(() => Number(document.querySelector<HTMLInputElement>("input[type=range]")!.value) > 5);
  await page.getByRole("button", { name: "Pause" }).click();
  const held = await at();
  await page.waitForTimeout(400);
  assert.equal(await at(), held);
  // To its end, where it stops by itself.
  await page.keyboard.press("Tab");
  await slider.focus();
  await page.keyboard.press("End");
  const last = await at();
  await slider.evaluate((element, value) => {
    (element as HTMLInputElement).value = String(value);
    element.dispatchEvent(new Event("input", { bubbles: true }));
  }, last - 3);
  await page.getByRole("button", { name: "Play" }).click();
  await page.getByRole("button", { name: "Play" }).waitFor();
  assert.equal(await at(), last);
  assert.deepEqual(faultsOf(page), []);
  await page.close();
});

test("sweeps, the near view and what is drawn can be chosen; keys move and zoom", async () => {
  const page = await example();
  const changes = async (what: string, act: () => Promise<unknown>) => {
    const before = await looks(page, CANVAS);
    await act();
    assert.notEqual((await looks(page, CANVAS)).sum, before.sum, what);
  };
  await changes("sweep", () => page.getByLabel("Sweep", { exact: true }).selectOption({ index: 1 }));
  await changes("near", () => page.getByRole("button", { name: "Contacts, near" }).click());
  for (const name of ["All shapes", "95 % ellipses", "Outline"]) await changes(name, () => page.getByRole("checkbox", { name }).click());
  await page.locator(".viewport").focus();
  for (const key of ["+", "ArrowLeft", "0"]) await changes(key, () => page.keyboard.press(key));
  await page.close();
});

test("a sweep that decides nothing says what would", async () => {
  const page = await open(chromium, server, "whisker");
  const rows = readFileSync(file("testdata/whisker/hub.csv"), "utf8").split("\n");
  const short = [rows[0], ...rows.slice(1).filter((row) => row.startsWith("0,")).slice(0, 60)].join("\n");
  await drop(page, [FILES[0]!, { name: "hub.csv", text: short }]);
  await page.locator("[data-object]").waitFor();
  assert.match((await page.locator("[data-object] [data-status]").textContent())!, /not decided/);
  assert.match((await page.locator("[data-object]").textContent())!, /Not decided: .*Next: /);
  await page.close();
});

test("wrong files get one sentence, and what was shown stays", async () => {
  const page = await open(chromium, server, "whisker");
  for (const [files, said] of [
    [[FILES[1]!], /give the whisker file/],
    [[FILES[0]!], /there are no readings/],
    [[{ name: "notes.txt", text: "hello" }], /notes\.txt/],
    [[FILES[0]!, { name: "hub.csv", text: "sweep,sample,hub_angle,hub_x,hub_y,fx,fy,mz\n0,0,a,0,0,0,0,0\n" }], /hub\.csv: line 2/],
  ] as const) {
    await drop(page, [...files]);
    const note = page.locator(".note.bad");
    await note.filter({ hasText: said }).waitFor();
    assert.equal(await note.count(), 1);
  }
  await drop(page, FILES);
  await page.locator("[data-object]").waitFor();
  await drop(page, [FILES[1]!]);
  await page.locator(".note.bad").waitFor();
  assert.equal(await page.locator("[data-object] [data-status]").textContent(), "✓square");
  assert.deepEqual(faultsOf(page), []);
  await page.close();
});

for (const colorScheme of ["light", "dark"] as const) {
  for (const [width, size] of [["wide", WIDE], ["phone", PHONE]] as const) {
    test(`accessible: ${colorScheme}, ${width}`, async () => {
      const page = await example({ ...size, colorScheme });
      await looks(page, CANVAS);
      await accessible(page, "the example");
      if (process.env.SCREENSHOTS) await page.screenshot({ path: `${process.env.SCREENSHOTS}/whisker-${width}-${colorScheme}.png` });
      assert.deepEqual(faultsOf(page), []);
      await page.close();
    });
  }
}
