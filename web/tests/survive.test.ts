// Work survives: a connection that is lost for long, a browser that dies in the middle of a save, a restart under several windows.
import assert from "node:assert/strict";
import { once } from "node:events";
import { mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { type AddressInfo, type Socket, connect, createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { type Browser, type Page, chromium as launcher } from "playwright-core";
import { click, demo, fourClicks, pixel, until, view } from "./scene.js";
import { ARGUMENTS, EXECUTABLE, type Server, another, browser, open, prepared, serve } from "./server.js";

let chromium: Browser;
before(async () => {
  chromium = await browser();
});
after(() => chromium.close());

const idOf = (page: Page) => page.evaluate(() => JSON.parse(sessionStorage.getItem("resight session")!).session as string);
const measured = (page: Page) => page.locator("[data-measurement] strong").allTextContents();

/** Measures a length of the demo's board. */
async function length(page: Page, y: number) {
  const before = await page.locator("[data-measurement]").count();
  await page.locator("[data-step=measure]").getByRole("button", { name: "Length", exact: true }).click();
  await click(page, pixel(0.5, y));
  await click(page, pixel(3, y));
  await page.locator("[data-measurement] strong").nth(before).waitFor();
  await page.locator("[data-step=measure]").getByRole("button", { name: "Stop" }).click();
}

/** Waits until the browser has kept the page's session with so many measurements. */
async function kept(page: Page, id: string, n: number) {
  const isKept = () => page.evaluate(async ([id, n]) => {
    // The page itself creates it.
    if (!(await indexedDB.databases()).some(({ name, version }) => name === "resight" && version === 2)) return false;
    const database = await new Promise<IDBDatabase>((done) => {
      const request = indexedDB.open("resight");
      request.onsuccess = () => done(request.result);
    });
    const session = await new Promise<{ text: string } | undefined>((done) => {
      const request = database.transaction("sessions").objectStore("sessions").get(id as string);
      request.onsuccess = () => done(request.result);
    });
    database.close();
    return session?.text.split("[[session.measurements]]").length === (n as number) + 1;
  }, [id, n] as const);
  await until(isKept);
}

/** A way to a program that can be cut: its connections end, and no others are made until it is mended. */
class Cable {
  private isCut = false;
  private ends = new Set<Socket>();
  private to = 0;
  private listener = createServer((from) => {
    if (this.isCut) return void from.destroy();
    const on = connect(this.to, "127.0.0.1");
    for (const [end, other] of [[from, on], [on, from]] as const) {
      this.ends.add(end);
      end.on("error", () => {});
      end.on("close", () => {
        this.ends.delete(end);
        other.destroy();
      });
      end.pipe(other);
    }
  });

  /** Starts a program that is reached through it, and at an address of its own. */
  async serve(): Promise<Server & { own: string }> {
    this.listener.listen(0, "127.0.0.1");
    await once(this.listener, "listening");
    const name = `127.0.0.1:${(this.listener.address() as AddressInfo).port}`;
    const server = await serve("--allowed-host", name);
    this.to = Number(new URL(server.address).port);
    const stop = async () => {
      this.listener.close();
      this.cut();
      await server.stop();
    };
    return { ...server, address: `http://${name}`, own: server.address, stop };
  }

  cut() {
    this.isCut = true;
    this.ends.forEach((end) => end.destroy());
  }

  mend() {
    this.isCut = false;
  }
}

/** A laptop that is closed: its connection ends, and comes back after long. What was done before is there, and work continues. */
test("a lost connection costs nothing", { timeout: 120_000 }, async () => {
  const cable = new Cable();
  const server = await cable.serve();
  const page = await open(chromium, server);
  await fourClicks(page);
  await length(page, 0.5);
  const before = await measured(page);
  const id = await idOf(page);
  cable.cut();
  await page.waitForTimeout(4000);
  // What is tried meanwhile is refused in a sentence, and what is shown stays.
  await page.getByRole("button", { name: "Undo" }).first().click();
  await page.getByText(/does not answer/i).first().waitFor();
  assert.deepEqual(await measured(page), before);
  cable.mend();
    // By itself, within the longest pause between two attempts.
  await page.waitForTimeout(9000);
  await length(page, 1.5);
  assert.equal(await idOf(page), id);
  assert.equal((await measured(page))[0], before[0]);
  await page.context().close();
  await server.stop();
});

/** While the connection is lost the program lets the session go for others: the page brings its own copy. */
test("a lost connection and a session that went cost nothing", { timeout: 120_000 }, async () => {
  const cable = new Cable();
  const server = await cable.serve();
  const page = await open(chromium, server);
  await fourClicks(page);
  await length(page, 0.5);
  const [before, id] = [await measured(page), await idOf(page)];
  await kept(page, id, 1);
  cable.cut();
  // More sessions than the program keeps.
  for (let i = 0; i < 33; i++) {
    const headers = { "Content-Type": "application/json" };
    await fetch(`${server.own}/api/session`, { method: "POST", headers, body: "{}" });
  }
  cable.mend();
  await until(async () => (await idOf(page)) !== id);
  await page.getByText("Opening").waitFor({ state: "detached" });
  assert.deepEqual(await measured(page), before);
  await length(page, 1.5);
  await page.context().close();
  await server.stop();
});

/** The process of a browser by the folder of its profile. */
function processOf(folder: string): number {
  for (const name of readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
    try {
      const words = readFileSync(`/proc/${name}/cmdline`, "utf8").split("\0");
      if (words.includes(`--user-data-dir=${folder}`) && !words.some((word) => word.startsWith("--type="))) return Number(name);
    } catch {
      // It has ended.
    }
  }
  throw new Error("no such browser");
}

/** A browser that is killed while it writes: the next one offers what was written as a whole before. */
test("a crash in the middle of a save leaves the last good one", { timeout: 120_000 }, async () => {
  const folder = mkdtempSync(join(tmpdir(), "resight-browser-"));
  const server = await serve();
  const launch = () => launcher.launchPersistentContext(folder, { executablePath: EXECUTABLE, args: ARGUMENTS, viewport: { width: 1280, height: 800 } });
  const context = await launch();
  const page = context.pages()[0] ?? (await context.newPage());
  await prepared(page, server);
  await page.goto(`${server.address}/#photograph`);
  await fourClicks(page);
  await length(page, 0.5);
  await kept(page, await idOf(page), 1);
  const before = await measured(page);
  // From now on a save never ends: everything is written but its last step.
  await page.evaluate(() => {
    const { put } = IDBObjectStore.prototype;
    IDBObjectStore.prototype.put = function (...args) {
      const request = put.apply(this, args);
      if (this.name !== "sessions") return request;
      const again = () => {
        (window as unknown as { isSaving: boolean }).isSaving = true;
        this.count().onsuccess = again;
      };
      request.addEventListener("success", again);
      return request;
    };
  });
  await length(page, 1.5);
  await page.waitForFunction(() => (window as unknown as { isSaving?: boolean }).isSaving);
  process.kill(processOf(folder), "SIGKILL");
  await context.close().catch(() => {});
  const next = await launch();
  const other = await next.newPage();
  await prepared(other, server);
  await other.goto(`${server.address}/#photograph`);
  await other.getByRole("button", { name: "Go on with it" }).click();
  await other.locator("[data-measurement] strong").first().waitFor();
  assert.deepEqual(await measured(other), before);
  assert.equal((await view(other)).points.length, 4);
  await next.close();
  await server.stop();
  rmSync(folder, { recursive: true, force: true });
});

/** Two windows of one session and a third of another one: after a restart each has its own work, and the two still follow each other. */
test("windows have their own work after a restart", { timeout: 120_000 }, async () => {
  const server = await serve();
  const page = await open(chromium, server);
  await fourClicks(page);
  await length(page, 0.5);
  const id = await idOf(page);
  const beside = await another(page, server, "photograph");
  await beside.evaluate((id) => sessionStorage.setItem("resight session", JSON.stringify({ session: id, photo: 0 })), id);
  await beside.reload();
  await beside.locator("[data-measurement] strong").waitFor();
  const third = await another(page, server, "photograph");
  await demo(third);
  const [before, own] = [await measured(page), await idOf(third)];
  await Promise.all([kept(page, id, 1), kept(third, own, 0)]);
  await server.stop();
  const again = await serve("--listen", `127.0.0.1:${new URL(server.address).port}`);
  await until(async () => (await idOf(page)) !== id && (await idOf(beside)) !== id && (await idOf(third)) !== own);
  assert.equal(await idOf(beside), await idOf(page));
  assert.notEqual(await idOf(third), await idOf(page));
  assert.deepEqual([await measured(page), await measured(beside), await measured(third)], [before, before, []]);
  await length(page, 1.5);
  await beside.locator("[data-measurement] strong").nth(1).waitFor();
  await page.context().close();
  await again.stop();
});
