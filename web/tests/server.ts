// The program under test, a browser, and pages of both. RESIGHT_PROGRAM names the program. Where PAGE_DIR is set, the page is that build and
// not the one compiled in: its three files are replaced on their way, with the program's own headers.
import { type ChildProcess, spawn } from "node:child_process";
import { once } from "node:events";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { createInterface } from "node:readline";
import assert from "node:assert/strict";
import { type Browser, type BrowserContextOptions, type Page, chromium } from "playwright-core";

const FLAGS = [
  "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
  "--disable-background-networking", "--disable-component-update", "--disable-sync",
];
const TYPES = { "": "text/html; charset=utf-8", "app.js": "text/javascript; charset=utf-8", "app.css": "text/css; charset=utf-8" };

/** Files of the repository. */
export const ROOT = resolve(process.cwd(), "..");
export const file = (name: string) => join(ROOT, name);

export interface Server {
  address: string;
  process: ChildProcess;
  stop(): Promise<void>;
}

/** Starts `resight serve` on a free port, with further arguments. */
export async function serve(...args: string[]): Promise<Server> {
  const program = process.env.RESIGHT_PROGRAM;
  assert(program, "RESIGHT_PROGRAM names no program; set it to the path of `resight`.");
  const listen = args.includes("--listen") ? [] : ["--listen", "127.0.0.1:0"];
  const child = spawn(program, ["serve", ...listen, ...args], { stdio: ["ignore", "pipe", "inherit"] });
  const [address] = (await once(createInterface({ input: child.stdout }), "line")) as [string];
  const stop = async () => {
    if (child.exitCode !== null || child.signalCode !== null) return;
    child.kill();
    await once(child, "exit");
  };
  return { address: address.replace(/\/$/, ""), process: child, stop };
}

export const EXECUTABLE = process.env.CHROMIUM ?? "/usr/bin/chromium";
/** A page that was replaced has no address of its own, and would not be allowed to ask this machine. */
export const ARGUMENTS = [...FLAGS, ...(process.env.PAGE_DIR ? ["--disable-features=LocalNetworkAccessChecks"] : [])];

/** Debian's Chromium, headless. */
export function browser(...more: string[]): Promise<Browser> {
  return chromium.launch({ executablePath: EXECUTABLE, args: [...ARGUMENTS, ...more] });
}

export const WIDE = { viewport: { width: 1280, height: 800 } };
export const PHONE = { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 };

/** A page of the program. Errors of the page fail the test that closes it with `page.close()` through `faultsOf`. */
export async function open(browser: Browser, server: Server, tab = "photograph", options: BrowserContextOptions = WIDE): Promise<Page> {
  const context = await browser.newContext({ acceptDownloads: true, ...options });
  const page = await context.newPage();
  const faults: string[] = [];
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => {
    // A refused request is written there by the browser itself.
    if (message.type() === "error" && !message.text().startsWith("Failed to load resource")) faults.push(message.text());
  });
  FAULTS.set(page, faults);
  await prepared(page, server);
  await page.goto(`${server.address}/#${tab}`);
  return page;
}

/** Lets a page be that of PAGE_DIR. */
export async function prepared(page: Page, server: Server) {
  if (process.env.PAGE_DIR) await replaced(page, server, process.env.PAGE_DIR);
}

/** Another tab beside a page, in the same window. */
export async function another(beside: Page, server: Server, tab: string): Promise<Page> {
  const page = await beside.context().newPage();
  await prepared(page, server);
  await page.goto(`${server.address}/#${tab}`);
  return page;
}

const FAULTS = new WeakMap<Page, string[]>();

/** What went wrong in a page: exceptions, and what the browser reported, violations of the policy among it. */
export function faultsOf(page: Page): string[] {
  return FAULTS.get(page) ?? [];
}

async function replaced(page: Page, server: Server, folder: string) {
  for (const [name, type] of Object.entries(TYPES)) {
    await page.route(`${server.address}/${name}`, async (route) => {
      const response = await route.fetch();
      const body = readFileSync(join(folder, name || "index.html"));
      await route.fulfill({ response, body, headers: { ...response.headers(), "content-type": type, "content-length": String(body.length) } });
    });
  }
}

/** Fails with every violation that axe finds. */
export async function accessible(page: Page, what: string) {
  const axe = createRequire(join(process.cwd(), "package.json")).resolve("axe-core/axe.min.js");
  // Evaluated and not added as a script: the page's policy allows no other scripts.
  await page.evaluate(readFileSync(axe, "utf8"));
  const found = await page.evaluate(async () => {
    const { violations } = await (window as unknown as { axe: { run(): Promise<{ violations: Violation[] }> } }).axe.run();
    return violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html.slice(0, 160) + " " + (node.any[0]?.message ?? "")).join("\n    ")}`);
  });
  assert.deepEqual(found, [], `${what}:\n${found.join("\n")}`);
}

interface Violation {
  id: string;
  nodes: { html: string; any: { message: string }[] }[];
}
