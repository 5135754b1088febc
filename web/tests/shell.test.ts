// The frame: four tabs, reached by keys and by address, without a fault.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import type { Browser } from "playwright-core";
import { type Server, browser, faultsOf, open, serve } from "./server.js";

let chromium: Browser;
let server: Server;
before(async () => {
  [chromium, server] = await Promise.all([browser(), serve()]);
});
after(async () => {
  await chromium.close();
  await server.stop();
});

test("tabs are reached by keys, and the address remembers them", async () => {
  const page = await open(chromium, server, "live");
  assert.equal(await page.locator("[role=tab][aria-selected=true]").textContent(), "Live");
  await page.locator("[role=tab][aria-selected=true]").focus();
  for (const name of ["rig", "whisker", "photograph"]) {
    await page.keyboard.press("ArrowRight");
    assert.equal(await page.evaluate(() => location.hash), `#${name}`);
  }
  assert.deepEqual(faultsOf(page), []);
  await page.close();
});
