// The pictures of docs/serve.md: `npm run build`, build the program, then RESIGHT_PROGRAM=… node screenshots.mjs
import { spawn } from "node:child_process";
import { once } from "node:events";
import { createInterface } from "node:readline";
import { chromium } from "playwright-core";

const FOLDER = "../docs/images";
const FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"];
const SIZES = {
  wide: { viewport: { width: 1280, height: 800 } },
  phone: { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true },
};

const program = process.env.RESIGHT_PROGRAM;
if (!program) throw new Error("RESIGHT_PROGRAM names no program; set it to the path of `resight`.");
const server = spawn(program, ["serve", "--listen", "127.0.0.1:0"], { stdio: ["ignore", "pipe", "inherit"] });
const [address] = await once(createInterface({ input: server.stdout }), "line");
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: FLAGS });

async function photograph(page, shoot) {
  await page.getByRole("button", { name: "Try the example" }).waitFor();
  await shoot("first");
  await page.getByRole("button", { name: "Try the example" }).click();
  await page.locator("[data-step=answer] [data-status=ok]").waitFor();
  await page.waitForTimeout(500);
  await shoot("photograph");
  await page.getByRole("button", { name: "Bird's-eye view", exact: true }).click();
  await page.waitForTimeout(1500);
  await shoot("birdseye");
}

try {
  for (const [size, options] of Object.entries(SIZES)) {
    for (const colorScheme of ["light", "dark"]) {
      const page = await browser.newPage({ ...options, colorScheme });
      await page.goto(address);
      await photograph(page, (name) => page.screenshot({ path: `${FOLDER}/serve-${name}-${size}-${colorScheme}.png` }));
      await page.close();
    }
  }
} finally {
  await browser.close();
  server.kill();
}
