// axe finds nothing in any state of the photograph tab, in both themes and at both widths; everything is reached by keys.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import type { Browser } from "playwright-core";
import { demo, until, view } from "./scene.js";
import { PHONE, type Server, WIDE, accessible, browser, faultsOf, open, serve } from "./server.js";

let chromium: Browser;
let server: Server;
before(async () => {
  [chromium, server] = await Promise.all([browser(), serve()]);
});
after(async () => {
  await chromium.close();
  await server.stop();
});

for (const colorScheme of ["light", "dark"] as const) {
  for (const [width, size] of [["wide", WIDE], ["phone", PHONE]] as const) {
    test(`photograph, ${colorScheme}, ${width}`, async () => {
      const page = await open(chromium, server, "photograph", { ...size, colorScheme });
      const state = (name: string) => accessible(page, `${name}, ${colorScheme}, ${width}`);
      await page.getByRole("button", { name: "Try the example" }).waitFor();
      await state("first screen");
      await page.getByRole("button", { name: "Try the example" }).click();
      await page.locator("[data-step=answer] [data-status=ok]").waitFor();
      await state("answer");
      await page.getByRole("button", { name: "Details" }).click();
      await page.locator(".question").first().click();
      await page.locator("[data-step=marks] summary").click();
      await page.getByRole("button", { name: "Bird's-eye view", exact: true }).click();
      await page.getByRole("button", { name: "Change" }).click();
      await state("everything open");
      await page.getByRole("button", { name: "Export" }).click();
      await state("menu");
      await page.keyboard.press("Escape");
      await page.locator(".views > .viewport").first().press("?");
      await state("keys");
      await page.keyboard.press("Escape");
      await page.locator("[data-step=measure]").getByRole("button", { name: "Area" }).click();
      await state("measuring");
      await small(page);
      assert.deepEqual(faultsOf(page), []);
      await page.context().close();
    });
  }
}

/** No text below 14 px, nothing that is operated below 32 px. */
async function small(page: import("playwright-core").Page) {
  const found = await page.evaluate(() => {
    const faults: string[] = [];
    for (const element of document.querySelectorAll<HTMLElement>("body *")) {
      if (!element.checkVisibility() || element.closest(".visually-hidden")) continue;
      const hasText = [...element.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.textContent!.trim());
      if (hasText && parseFloat(getComputedStyle(element).fontSize) < 14) faults.push(`text: ${element.outerHTML.slice(0, 100)}`);
      const box = element.getBoundingClientRect();
      const isField = element.matches("input[type=checkbox]") || element.closest(".chip");
      if (element.matches("button, input, select, summary") && !isField && box.height < 32) faults.push(`${box.height} px: ${element.outerHTML.slice(0, 100)}`);
    }
    return faults;
  });
  assert.deepEqual(found, []);
}

test("four clicks without a pointer", async () => {
  const page = await open(chromium, server);
  await demo(page);
  const stage = page.locator(".views > .viewport");
  await stage.focus();
  // The middle of the view is the pointer; arrows pan where nothing is selected, and move what is.
  for (const [name, keys] of [["A", ["ArrowLeft", "ArrowLeft", "ArrowLeft"]], ["B", ["ArrowRight", "ArrowRight"]], ["C", ["ArrowRight", "ArrowRight"]], ["D", ["ArrowUp", "ArrowUp", "ArrowUp"]]] as const) {
    for (const key of keys) await stage.press(key);
    await stage.press("Enter");
    await page.locator("[data-step=marks] .cut", { hasText: name }).waitFor();
    const placed = (await view(page)).points.find((point) => point.name === name)!;
    await stage.press("ArrowDown");
    await until(async () => Math.abs((await view(page)).points.find((point) => point.name === name)!.v_px - placed.v_px - 1) < 1e-9);
    await stage.press("Escape");
  }
  for (const [a, b, metres] of [["A", "B", 1], ["B", "C", 1], ["D", "A", 2.2], ["D", "C", 1.5]] as const) {
    const field = page.locator(".distances").getByLabel(`Distance ${a} to ${b} in metres`);
    await field.focus();
    await page.keyboard.type(String(metres));
    await page.keyboard.press("Enter");
  }
  await until(async () => (await view(page)).distances.length === 4);
  await page.locator("[data-step=answer] .status").first().waitFor();
  assert.deepEqual(faultsOf(page), []);
  await page.context().close();
});
