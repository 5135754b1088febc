// The pictures of the tabs in docs/serve.md and docs/capture.md, but for those of watched cameras (tests/screenshots-live.ts).
// Use: RESIGHT_PROGRAM=… npm run screenshots
import { spawn } from "node:child_process";
import { once } from "node:events";
import { cpSync, mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { PHONE, WIDE, browser, open, serve } from "./dist-tests/server.js";

const FOLDER = "../docs/images";
// One pixel of the picture for each of the page: the pictures stay small.
const SIZES = { wide: WIDE, phone: { ...PHONE, deviceScaleFactor: 1 } };

async function photograph(page, shoot, hasBirdseye) {
  await page.getByRole("button", { name: "Try the example" }).waitFor();
  await page.getByRole("button", { name: "Try the example" }).click();
  await page.locator("[data-step=answer] [data-status=ok]").waitFor();
  await page.waitForTimeout(500);
  await shoot("photograph");
  if (!hasBirdseye) return;
  await page.getByRole("button", { name: "Bird's-eye view", exact: true }).click();
  await page.locator(".birdseye[data-ready=true]").waitFor();
  await page.waitForTimeout(300);
  await shoot("birdseye");
}

/** The example of a tab of results. */
async function results(chromium, server, tab, isReady) {
  const page = await open(chromium, server, tab, { ...WIDE, colorScheme: "light" });
  await page.getByRole("button", { name: "Try the example" }).click();
  await page.locator(isReady).waitFor();
  await page.waitForTimeout(500);
  await page.screenshot({ path: `${FOLDER}/serve-${tab}.png` });
  await page.context().close();
}

/** A capture of the photographs of the example, in a folder of its own: the page shows paths as they were typed. */
async function capture(chromium) {
  const folder = mkdtempSync(join(tmpdir(), "resight-capture-"));
  const examples = "../examples/photo";
  const needed = readdirSync(examples).filter((name) => /^(left0.*\.jpg|board\.toml)$/.test(name));
  needed.forEach((name) => cpSync(join(examples, name), join(folder, name)));
  const args = ["capture", "left0*.jpg", "--target", "board.toml", "-o", "left.toml", "--serve", "127.0.0.1:0"];
  const child = spawn(process.env.RESIGHT_PROGRAM, args, { cwd: folder, stdio: ["ignore", "ignore", "pipe"] });
  try {
    let said = "";
    while (!/http:\/\/[\d.:]+/.test(said)) said += (await once(child.stderr, "data"))[0];
    child.stderr.resume();
    const page = await open(chromium, { address: /http:\/\/[\d.:]+/.exec(said)[0] }, "live", { ...WIDE, colorScheme: "light" });
    await page.getByText("The source gives no more images").waitFor({ timeout: 120_000 });
    await page.waitForTimeout(500);
    await page.screenshot({ path: `${FOLDER}/serve-capture.png` });
    await page.context().close();
  } finally {
    child.kill("SIGKILL");
    rmSync(folder, { recursive: true });
  }
}

const [chromium, server] = await Promise.all([browser(), serve()]);
try {
  for (const [size, options] of Object.entries(SIZES)) {
    for (const colorScheme of ["light", "dark"]) {
      const page = await open(chromium, server, "photograph", { ...options, colorScheme });
      await photograph(page, (name) => page.screenshot({ path: `${FOLDER}/serve-${name}-${size}-${colorScheme}.png` }), size === "wide" && colorScheme === "dark");
      await page.context().close();
    }
  }
  await results(chromium, server, "rig", "[data-summary]");
  await results(chromium, server, "whisker", "[data-object]");
  await capture(chromium);
} finally {
  await chromium.close();
  await server.stop();
}
