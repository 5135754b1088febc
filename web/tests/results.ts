// What the tests of results share: dropping files, and looking at a canvas.
import { readFileSync } from "node:fs";
import { basename, join } from "node:path";
import type { Page } from "playwright-core";
import { ROOT } from "./server.js";

/** Drops files of the repository, or texts, on the page. */
export async function drop(page: Page, files: (string | { name: string; text: string })[]) {
  const given = files.map((one) => (typeof one === "string" ? { name: basename(one), text: readFileSync(join(ROOT, one), "utf8") } : one));
  const transfer = await page.evaluateHandle((all) => {
    const data = new DataTransfer();
    for (const { name, text } of all) data.items.add(new File([text], name));
    return data;
  }, given);
  await page.dispatchEvent(".results-drop", "drop", { dataTransfer: transfer });
}

/** A canvas as a number that changes when it does, and how many of its pixels are drawn on. */
export async function looks(page: Page, selector: string): Promise<{ sum: number; drawn: number }> {
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  return page.locator(selector).last().evaluate((element) => {
    const canvas = element as HTMLCanvasElement;
    const { data } = canvas.getContext("2d")!.getImageData(0, 0, canvas.width, canvas.height);
    let [sum, drawn] = [0, 0];
    for (let i = 0; i < data.length; i += 4) {
      if (data[i + 3] === 0) continue;
      drawn += 1;
      sum = (sum * 31 + i + data[i]! + 7 * data[i + 1]! + 13 * data[i + 2]!) % 1_000_000_007;
    }
    return { sum, drawn };
  });
}
