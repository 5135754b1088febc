// The pictures of the tabs in docs/serve.md, but for those of watched cameras (tests/screenshots-live.ts) and of a capture (tests/capture.test.ts
// with SCREENSHOTS). Use: RESIGHT_PROGRAM=… npm run screenshots
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

/** The example of a tab of results, in front of what it looks like when it is opened. */
async function results(chromium, server, tab, isReady) {
  const page = await open(chromium, server, tab, { ...WIDE, colorScheme: "light" });
  await page.getByRole("button", { name: "Try the example" }).click();
  await page.locator(isReady).waitFor();
  await page.waitForTimeout(500);
  await page.screenshot({ path: `${FOLDER}/serve-${tab}.png` });
  await page.context().close();
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
} finally {
  await chromium.close();
  await server.stop();
}
