// Pictures of the tab Live for the book and for whoever looks at the page: node dist-tests/screenshots-live.js FOLDER, after `tsc -p tests`.
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import type { Page } from "playwright-core";
import { Watch, drawn } from "./cameras.js";
import { PHONE, WIDE, browser, open, serve } from "./server.js";

const [, , folder] = process.argv;
const pause = (ms: number) => new Promise((done) => setTimeout(done, ms));

async function main(folder: string) {
  mkdirSync(folder, { recursive: true });
  const chromium = await browser();
  const images = await drawn(chromium, [0, 0.2, 0.4]);
  const watch = new Watch(["gate", "yard entrance", "loading bay", "the camera above the northern railway crossing"], images, 200);
  watch.start();
  const server = await serve(watch.session(`history = "${watch.file("history.sqlite")}"\nsave_reference = ["gate=${watch.file("gate.ref.toml")}"]`));
  const first = await open(chromium, server, "live");
  const reaches = (page: Page, name: string, state: string) => page.waitForSelector(`.tile[data-camera="${name}"][data-state="${state}"]`, { timeout: 120_000 });
  for (const { name } of watch.cameras) await reaches(first, name, "steady");
  watch.cameras[1]!.angle = 0.4;
  await reaches(first, "yard entrance", "drifted");
  watch.cameras[1]!.angle = 0.2;
  watch.cameras[2]!.stop();
  await first.waitForSelector('.tile[data-camera="loading bay"][data-live=false]', { timeout: 30_000 });
  await pause(4000);
  for (const [theme, colorScheme] of [["light", "light"], ["dark", "dark"]] as const) {
    for (const [width, size] of [["wide", WIDE], ["phone", PHONE]] as const) {
      const page = await open(chromium, server, "live", { ...size, colorScheme });
      const shot = async (what: string) => {
        await pause(700);
        await page.screenshot({ path: join(folder, `live-${what}-${width}-${theme}.png`) });
      };
      await page.waitForSelector(".tile[data-camera=gate] canvas[data-frame]", { timeout: 30_000 });
      await shot("grid");
      await page.getByRole("button", { name: "Points" }).click();
      await shot("points");
      await page.getByRole("button", { name: "In space" }).click();
      await page.waitForSelector(".live-space canvas");
      await shot("space");
      await page.getByRole("button", { name: "Cameras" }).click();
      await page.getByRole("button", { name: "Show yard entrance at full size" }).click();
      await page.waitForSelector(".one .plot canvas");
      await pause(1500);
      await shot("camera");
      await page.getByRole("button", { name: "Set as new reference" }).click();
      await page.waitForSelector("dialog[open] .comparison");
      await shot("reference");
      await page.context().close();
    }
  }
  await chromium.close();
  await server.stop();
  watch.end();
}

if (folder) await main(folder);
