// A capture of intrinsics on the tab Live: photographs, views taken back, two browsers, an end on the page, a target that is not there.
import assert from "node:assert/strict";
import { type ChildProcess, spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { PHONE, type Server, WIDE, accessible, browser, faultsOf, file, open } from "./server.js";

const SLOW_MS = 120_000;
const SIZES = [["wide", WIDE], ["phone", PHONE]] as const;

let chromium: Browser;
before(async () => {
  chromium = await browser();
});
after(() => chromium.close());

interface Capture {
  server: Server;
  folder: string;
  output: string;
  process: ChildProcess;
  end(): Promise<void>;
}

/** `resight capture` on the photographs of the examples, shown on a page. */
async function capture(...more: string[]): Promise<Capture> {
  const folder = mkdtempSync(join(tmpdir(), "resight-capture-"));
  const output = join(folder, "camera.toml");
  const target = more.includes("--target") ? [] : ["--target", file("examples/photo/board.toml")];
  const args = ["capture", file("examples/photo/left0*.jpg"), ...target, "-o", output, "--serve", "127.0.0.1:0", ...more];
  const child = spawn(process.env.RESIGHT_PROGRAM!, args, { stdio: ["ignore", "ignore", "pipe"] });
  const address = await new Promise<string>((found, failed) => {
    let said = "";
    child.stderr.on("data", (text) => {
      said += text;
      const at = /http:\/\/[\d.:]+/.exec(said);
      if (at) found(at[0]);
    });
    child.once("exit", () => failed(new Error(said)));
  });
  const stop = async () => {
    if (child.exitCode !== null || child.signalCode !== null) return;
    child.kill("SIGINT");
    await once(child, "exit");
  };
  const end = async () => {
    await stop();
    rmSync(folder, { recursive: true, force: true });
  };
  return { server: { address, process: child, stop }, folder, output, process: child, end };
}

/** Waits until all photographs were looked at. */
async function shown(page: Page) {
  await page.waitForSelector(".capture", { timeout: SLOW_MS });
  await page.getByText("The source gives no more images").waitFor({ timeout: SLOW_MS });
}

const nKept = async (page: Page) => Number(await page.locator(".capture").getAttribute("data-n-kept"));
const keeps = (page: Page, n: number) => page.waitForSelector(`.capture[data-n-kept="${n}"]`, { timeout: SLOW_MS });

/** Pixels over the picture that are drawn in a colour about this one. */
function drawnPixels(page: Page): Promise<number> {
  return page.locator(".capture .viewport canvas").nth(1).evaluate((canvas) => {
    const { width, height } = canvas as HTMLCanvasElement;
    const { data } = (canvas as HTMLCanvasElement).getContext("2d")!.getImageData(0, 0, width, height);
    let n = 0;
    for (let i = 3; i < data.length; i += 4) if (0 < data[i]!) n++;
    return n;
  });
}

async function photographed(page: Page, name: string) {
  const folder = process.env.SCREENSHOTS;
  if (!folder) return;
  mkdirSync(folder, { recursive: true });
  await page.screenshot({ path: join(folder, `capture-${name}.png`) });
}

for (const [name, size] of SIZES) {
  test(`photographs are captured, a view is taken back, and the page ends it: ${name}`, { timeout: 300_000 }, async () => {
    const keep = join(mkdtempSync(join(tmpdir(), "resight-kept-")), "kept");
    const running = await capture("--keep", keep);
    const page = await open(chromium, running.server, "live", size);
    const other = await open(chromium, running.server, "live", WIDE);
    try {
      await shown(page);
      const n = await nKept(page);
      assert(5 < n, `${n} views are kept`);
      const state = await (await fetch(`${running.server.address}/api/capture`)).json();
      assert.equal(state.state.views.length, n);
      const focal = state.state.parameters.find((one: { name: string }) => one.name === "fx_px");
      const said = await page.locator('[data-figure="fx_px"] .value').textContent();
      assert.equal(said, `${focal.value.toFixed(1)} ± ${focal.sigma.toFixed(1)} px`);
      assert(5000 < (await drawnPixels(page)), "points, cells and the next view are drawn");
      assert.match((await page.locator(".newest").textContent())!, /Newest image: .*Next view: Put the target /s);
      assert.match((await page.locator(".missing").first().textContent())!, /needed/);
      await accessible(page, `capture, ${name}`);
      const tooWide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert(tooWide <= 0, `wider than the screen by ${tooWide} px`);
      await photographed(page, name);
      const last = `view-00${n}`;
      assert(existsSync(join(keep, `${last}.png`)));
      await page.getByRole("button", { name: `Take ${last} back` }).click();
      await keeps(page, n - 1);
      await keeps(other, n - 1);
      assert(!existsSync(join(keep, `${last}.png`)), "its image is gone too");
      await page.getByRole("button", { name: "Finish" }).click();
      const dialog = page.locator("dialog[open]");
      assert.match((await dialog.textContent())!, /Finish before it is enough\?.*needed.*camera\.toml/s);
      assert(!existsSync(running.output), "asking writes nothing");
      await accessible(page, `asking for the end, ${name}`);
      const ended = once(running.process, "exit");
      await dialog.getByRole("button", { name: "Finish" }).click();
      for (const one of [page, other]) {
        await one.getByText(`The camera is written to ${running.output}`).waitFor({ timeout: 20_000 });
      }
      assert.deepEqual(await ended, [1, null], "not enough: exit status 1");
      assert.match(readFileSync(running.output, "utf8"), /fx_px/);
      await accessible(page, `after the end, ${name}`);
      assert.equal(await page.getByRole("button", { name: "Finish" }).count(), 0);
      // The program is gone, and the page does not say that anything is wrong.
      await new Promise((done) => setTimeout(done, 1500));
      assert.equal(await page.getByText("does not answer").count(), 0);
      await photographed(page, `${name}-end`);
      assert.deepEqual([...faultsOf(page), ...faultsOf(other)], []);
    } finally {
      await page.context().close();
      await other.context().close();
      await running.end();
      rmSync(join(keep, ".."), { recursive: true, force: true });
    }
  });

  test(`without its target the page says what is there, and writes nothing: ${name}`, { timeout: 300_000 }, async () => {
    const folder = mkdtempSync(join(tmpdir(), "resight-board-"));
    const board = join(folder, "board.toml");
    writeFileSync(board, 'kind = "chessboard"\nrows = 4\ncolumns = 7\nsquare_m = 0.025\n');
    const running = await capture("--target", board);
    const page = await open(chromium, running.server, "live", size);
    try {
      await shown(page);
      await page.getByText("6 × 9 inner corners is there").first().waitFor({ timeout: SLOW_MS });
      assert.equal(await page.locator('[data-status="not_found"]').count(), 1);
      assert(await page.getByRole("button", { name: "Finish" }).isDisabled());
      const refused = await fetch(`${running.server.address}/api/capture/finish`, { method: "POST", headers: { "Content-Type": "application/json" }, body: "{}" });
      assert.equal(refused.status, 409);
      assert.match((await refused.json()).error.message, /There is no camera to write yet: no target was found/);
      await accessible(page, `no target, ${name}`);
      await photographed(page, `${name}-nothing`);
      running.process.kill("SIGINT");
      await page.getByText("no camera was written").waitFor({ timeout: 20_000 });
      assert(!existsSync(running.output));
      assert.deepEqual(faultsOf(page), []);
    } finally {
      await page.context().close();
      await running.end();
      rmSync(folder, { recursive: true, force: true });
    }
  });
}

test("without -o there is nothing to finish, and that is said before anything is read", async () => {
  const child = spawn(process.env.RESIGHT_PROGRAM!, ["capture", file("examples/photo/left0*.jpg"), "--target", file("examples/photo/board.toml"), "--serve", "127.0.0.1:0"], { stdio: ["ignore", "ignore", "pipe"] });
  let said = "";
  child.stderr.on("data", (text) => (said += text));
  const [code] = await once(child, "exit");
  assert.equal(code, 2);
  assert.match(said, /--output/);
});
