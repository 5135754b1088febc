// What cannot be used is said in a sentence at its step, and nothing is lost.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { crc32 } from "node:zlib";
import type { Browser, Page } from "playwright-core";
import { readFileSync } from "node:fs";
import { click, demo, fourClicks, pixel } from "./scene.js";
import { type Server, browser, faultsOf, file, open, serve } from "./server.js";

let chromium: Browser;
let server: Server;
before(async () => {
  [chromium, server] = await Promise.all([browser(), serve()]);
});
after(async () => {
  await chromium.close();
  await server.stop();
});

const IMAGES = "input[type=file][accept='image/png,image/jpeg']";

/** A chunk of a PNG. */
function chunk(name: string, data: Buffer): Buffer {
  const all = Buffer.alloc(12 + data.length);
  all.writeUInt32BE(data.length, 0);
  all.write(name, 4, "latin1");
  data.copy(all, 8);
  all.writeUInt32BE(crc32(all.subarray(4, 8 + data.length)), 8 + data.length);
  return all;
}

/** A PNG whose head claims 20 000 × 15 000 px, and whose pixels are not there. */
function hugePng(bytes = 1000): Buffer {
  const head = Buffer.alloc(13);
  head.writeUInt32BE(20000, 0);
  head.writeUInt32BE(15000, 4);
  head.set([8, 0, 0, 0, 0], 8);
  return Buffer.concat([Buffer.from("\x89PNG\r\n\x1a\n", "latin1"), chunk("IHDR", head), chunk("IDAT", Buffer.alloc(bytes, 0x78))]);
}

async function refused(page: Page, step: string, words: RegExp) {
  const note = page.locator(step === "photograph" ? ".note.bad" : `[data-step=${step}] .note`).first();
  await note.waitFor();
  assert.match((await note.textContent())!, words);
}

test("images that are none, on the first screen and beside an open one", async () => {
  const page = await open(chromium, server);
  const inputs: [string, Buffer, RegExp][] = [
    ["huge.png", hugePng(), /20000×15000 px; the limit is 64 Mpx/],
    ["notes.png", Buffer.from("dear diary\n"), /no photograph|PNG|JPEG/i],
    ["torn.jpg", readFileSync(file("examples/photo/left03.jpg")).subarray(0, 4000), /no photograph|is torn/],
  ];
  for (const [name, buffer, words] of inputs) {
    await page.locator(IMAGES).first().setInputFiles({ name, mimeType: name.endsWith("jpg") ? "image/jpeg" : "image/png", buffer });
    await refused(page, "photograph", words);
  }
  await page.getByRole("button", { name: "Try the example" }).click();
  await page.locator("[data-step=answer] [data-status=ok]").waitFor();
  const figures = await page.locator(".answer-figures").textContent();
  for (const [name, buffer, words] of inputs) {
    await page.locator(`.photos ${IMAGES}`).setInputFiles({ name, mimeType: "image/png", buffer });
    await refused(page, "photograph", words);
    assert.equal(await page.locator(".answer-figures").textContent(), figures);
  }
  assert.deepEqual(faultsOf(page), []);
  await page.context().close();
});

test("a camera file for another size, and one that is none", async () => {
  const page = await open(chromium, server);
  await demo(page);
  const text = readFileSync(file("testdata/demo/left.toml"), "utf8");
  await page.getByRole("button", { name: "Change" }).click();
  for (const [name, contents, words] of [
    ["other.toml", text.replace("width_px = 800", "width_px = 1000"), /1000/],
    ["poem.toml", "roses are red", /poem|camera|TOML|format/i],
  ] as const) {
    await page.locator("[data-step=lens] input[type=file]").setInputFiles({ name, mimeType: "text/plain", buffer: Buffer.from(contents) });
    await refused(page, "lens", words);
    // The one that was stated is still in use.
    assert.match((await page.locator("[data-step=lens] header").textContent())!, /left|camera/);
  }
  assert.deepEqual(faultsOf(page), []);
  await page.context().close();
});

test("points all on a line: a sentence, and the last answer stays, marked old", async () => {
  const page = await open(chromium, server);
  await fourClicks(page);
  const figures = await page.locator(".answer-figures").textContent();
  // D is put onto the line of A, B and C, and its distances with it.
  await page.getByRole("button", { name: /Three on a line/ }).click();
  await page.getByRole("button", { name: /My own points/ }).click();
  for (const [i, name] of ["A", "B", "C", "D"].entries()) {
    for (const [axis, value] of [["x", i], ["y", 0], ["z", 0]] as const) {
      const field = page.getByLabel(`${axis} of ${name} in metres`);
      await field.fill(String(value));
      await field.press("Tab");
    }
  }
  await refused(page, "marks", /line/);
  await page.locator("[data-step=answer] [data-status=old]").waitFor();
  assert.equal(await page.locator(".answer-figures").textContent(), figures);
  assert.deepEqual(faultsOf(page), []);
  await page.context().close();
});

test("distances that are none, and that contradict each other", async () => {
  const page = await open(chromium, server);
  await fourClicks(page);
  const field = page.locator(".chip").getByLabel("Distance A to B in metres");
  await field.fill("two");
  await field.press("Enter");
  await refused(page, "marks", /number of metres/);
  await field.fill("2");
  await field.press("Enter");
  await page.locator("[data-step=marks] .note.bad").waitFor({ state: "detached" });
  await page.getByRole("button", { name: "+ Add a distance" }).click();
  await page.locator("tfoot select").first().selectOption("A");
  await page.locator("tfoot select").last().selectOption("C");
  const wrong = page.locator("tfoot input");
  await wrong.fill("9");
  await wrong.press("Enter");
  await refused(page, "marks", /contradicts/);
  assert.deepEqual(faultsOf(page), []);
  await page.context().close();
});

test("a tab closed while it sends: the program goes on", async () => {
  const page = await open(chromium, server);
  const other = await open(chromium, server);
  await other.getByRole("button", { name: "Try the example" }).click();
  await other.locator("[data-step=answer] [data-status=ok]").waitFor();
  const slow = await page.context().newCDPSession(page);
  await slow.send("Network.emulateNetworkConditions", { offline: false, latency: 0, downloadThroughput: 1e6, uploadThroughput: 1e5 });
  await page.locator(IMAGES).first().setInputFiles({ name: "large.png", mimeType: "image/png", buffer: hugePng(3 << 20) });
  await page.getByText(/Sending large.png/).waitFor();
  await page.context().close();
  assert.equal(await (await fetch(`${server.address}/healthz`)).text(), "ok\n");
  await click(other, pixel(0, 0));
  await other.getByRole("button", { name: "Undo" }).click();
  await other.locator("[data-measurement]").waitFor({ state: "detached" });
  assert.deepEqual(faultsOf(other), []);
  await other.context().close();
});
