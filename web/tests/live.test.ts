// The tab Live: a camera that is turned and put back, an alarm that waits, a new reference, clients that are slow, a program that goes.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, readdirSync } from "node:fs";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { Watch, drawn } from "./cameras.js";
import { PHONE, type Server, WIDE, accessible, browser, faultsOf, open, serve } from "./server.js";

const LONG = "the camera whose name has more than forty letters";
const SLOW_MS = 60_000;
const DEGREES = 180 / Math.PI;

let chromium: Browser;
let images: Map<number, Buffer[]>;
before(async () => {
  chromium = await browser();
  images = await drawn(chromium, [0, 0.2, 0.4]);
});
after(() => chromium.close());

async function started(names: string[], keys = ""): Promise<{ watch: Watch; server: Server; stop(): Promise<void> }> {
  const watch = new Watch(names, images);
  watch.start();
  const server = await serve(watch.session(keys));
  const stop = async () => {
    await server.stop();
    watch.end();
  };
  return { watch, server, stop };
}

const tile = (page: Page, name: string) => page.locator(`.tile[data-camera="${name}"]`);

async function reaches(page: Page, name: string, state: string) {
  await page.waitForSelector(`.tile[data-camera="${name}"][data-state="${state}"]`, { timeout: SLOW_MS });
}

async function view(server: Server, name: string) {
  const live = await (await fetch(`${server.address}/api/live`)).json();
  return live.cameras.find((camera: { name: string }) => camera.name === name);
}

async function until<T>(what: string, ask: () => Promise<T>, is: (value: T) => boolean): Promise<T> {
  const end = performance.now() + SLOW_MS;
  for (;;) {
    const value = await ask();
    if (is(value)) return value;
    assert(performance.now() < end, `${what}: ${JSON.stringify(value)}`);
    await new Promise((done) => setTimeout(done, 100));
  }
}

test("a camera that is turned raises an alarm, which waits; put back, its arrow shrinks", { timeout: 240_000 }, async () => {
  const { watch, server, stop } = await started(["gate", LONG]);
  const page = await open(chromium, server, "live");
  try {
    for (const name of ["gate", LONG]) await reaches(page, name, "steady");
    const order = () => page.locator(".tile").evaluateAll((all) => all.map((one) => (one as HTMLElement).dataset.camera));
    assert.deepEqual(await order(), ["gate", LONG]);
    const [, second] = watch.cameras;
    second!.angle = 0.4;
    await reaches(page, LONG, "drifted");
    assert.deepEqual(await order(), [LONG, "gate"], "the alarm raises its camera");
    assert.equal(await page.locator("dialog[open]").count(), 0, "an alarm opens nothing by itself");
    const moved = await until("the way back", () => view(server, LONG), (one) => one.way_back?.rotation_rad[1] < 0);
    assert(Math.abs(-moved.way_back.rotation_rad[1] * DEGREES - 0.4) < 0.05, JSON.stringify(moved.way_back));
    assert.match(moved.way_back.words, /^rotate left 0\.[34]\d*° ± /);
    await page.waitForFunction((name) => document.querySelector(`.tile[data-camera="${name}"] .back`)?.textContent?.includes("rotate left"), LONG);
    const arrow = async () => Number(await tile(page, LONG).locator("svg.way-back").getAttribute("data-length"));
    const before = await arrow();
    await accessible(page, "grid with an alarm");
    second!.angle = 0.2;
    const nearer = await until("half of the way", () => view(server, LONG), (one) => Math.abs(-one.way_back?.rotation_rad[1] * DEGREES - 0.2) < 0.03);
    assert(Math.abs(-nearer.way_back.rotation_rad[1] * DEGREES - 0.2) < 0.05, JSON.stringify(nearer.way_back));
    await until("a shorter arrow", arrow, (length) => length < before - 3);
    second!.angle = 0;
    await reaches(page, LONG, "steady");
    assert.equal(await tile(page, LONG).getAttribute("data-alarm"), "true", "it still waits");
    await tile(page, LONG).getByRole("button", { name: /Acknowledge/ }).click();
    await page.waitForSelector(`.tile[data-camera="${LONG}"][data-alarm="false"]`);
    assert.deepEqual(await order(), ["gate", LONG]);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth);
    assert(wide, "a long name does not widen the page");
    assert.deepEqual(faultsOf(page), []);
  } finally {
    await page.close();
    await stop();
  }
});

test("a new reference is asked for, shown against the old one, and the old one is kept", { timeout: 240_000 }, async () => {
  const watch = new Watch(["gate"], images);
  watch.start();
  const reference = watch.file("gate.ref.toml");
  const server = await serve(watch.session(`save_reference = ["gate=${reference}"]\nhistory = "${watch.file("history.sqlite")}"`));
  const page = await open(chromium, server, "live");
  try {
    await reaches(page, "gate", "steady");
    assert(existsSync(reference));
    watch.cameras[0]!.angle = 0.4;
    await reaches(page, "gate", "drifted");
    await tile(page, "gate").getByRole("button", { name: /full size/ }).click();
    await page.waitForSelector(".one[data-camera=gate]");
    await page.getByRole("button", { name: "Set as new reference" }).click();
    const dialog = page.locator("dialog[open]");
    await dialog.locator(".comparison").waitFor();
    assert.match((await dialog.textContent())!, /rotated .*right 0\.[34]/);
    assert.equal((await view(server, "gate")).state, "drifted", "asking changes nothing");
    await accessible(page, "asking for a new reference");
    await dialog.getByRole("button", { name: "Set new reference" }).click();
    await until("steady where it is", () => view(server, "gate"), (one) => one.state === "steady");
    const [compared] = await until("both references", async () => (await fetch(`${server.address}/api/live/reference?camera=gate`)).json(), ([one]) => one.earlier);
    assert(Math.abs(compared.changed.rotation_rad[1] * DEGREES - 0.4) < 0.1, JSON.stringify(compared.changed));
    const kept = readdirSync(watch.root).filter((name) => name.startsWith("gate.ref.toml"));
    assert.deepEqual(kept.sort(), ["gate.ref.toml", "gate.ref.toml.old1"]);
    await page.waitForSelector("text=reference before");
    const strip = await (await fetch(`${server.address}/api/live/strip?camera=gate&bins=50`)).json();
    assert.equal(strip.is_from_history, true);
    assert.equal(strip.bins.length, 50);
    assert(strip.bins.some((bin: { state: string }) => bin.state === "drifted"), JSON.stringify(strip.bins));
    await accessible(page, "one camera");
    assert.deepEqual(faultsOf(page), []);
  } finally {
    await page.close();
    await server.stop();
    watch.end();
  }
});

/** A client as the page is one, run in a page of the program; counts what it gets in a time. */
function client(page: Page, acknowledges: boolean, forMs: number): Promise<{ pictures: number; states: number; longestMs: number }> {
  return page.evaluate(([acknowledges, forMs]) => new Promise<{ pictures: number; states: number; longestMs: number }>((done) => {
    const socket = new WebSocket("/ws/live", ["resight"]);
    socket.binaryType = "arraybuffer";
    const got = { pictures: 0, states: 0, longestMs: 0 };
    let last = performance.now();
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") {
        got.states++;
        got.longestMs = Math.max(got.longestMs, performance.now() - last);
        last = performance.now();
        return;
      }
      got.pictures++;
      if (acknowledges) socket.send(JSON.stringify({ ack: got.pictures }));
    };
    setTimeout(() => {
      socket.close();
      done(got);
    }, forMs as number);
  }), [acknowledges, forMs] as const);
}

test("a slow client does not slow the others", { timeout: 120_000 }, async () => {
  const { server, stop } = await started(["gate", "yard"]);
  const page = await open(chromium, server, "photograph");
  try {
    await until("steady", () => view(server, "gate"), (one) => one.state === "steady");
    const deaf = await deafClient(server);
    const [silent, quick] = await Promise.all([client(page, false, 5000), client(page, true, 5000)]);
    assert.equal(silent.pictures, 1, "no second picture before the first is acknowledged");
    assert(20 < quick.pictures, `${quick.pictures} pictures in 5 s`);
    assert(quick.longestMs < 2000 && 8 < quick.states, JSON.stringify(quick));
    assert(8 < silent.states, "states come without acknowledgement");
    assert.equal((await view(server, "gate")).dropped + (await view(server, "yard")).dropped, 0);
    deaf();
  } finally {
    await page.close();
    await stop();
  }
});

/** Opens a WebSocket and reads nothing of it. */
async function deafClient(server: Server): Promise<() => void> {
  const { connect } = await import("node:net");
  const { hostname, port, host } = new URL(server.address);
  const socket = connect(Number(port), hostname);
  socket.pause();
  socket.write(`GET /ws/live HTTP/1.1\r\nHost: ${host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n`);
  return () => socket.destroy();
}

test("without frames a camera is hatched, and without the program nothing is shown as if live", { timeout: 120_000 }, async () => {
  const { watch, server, stop } = await started(["gate", "yard"]);
  const page = await open(chromium, server, "live");
  try {
    for (const name of ["gate", "yard"]) await reaches(page, name, "steady");
    await page.waitForSelector(".tile[data-camera=gate] canvas[data-frame]");
    watch.cameras[0]!.stop();
    await page.waitForSelector(".tile[data-camera=gate][data-live=false] .hatch", { timeout: SLOW_MS });
    await accessible(page, "a camera without frames");
    assert.match((await tile(page, "gate").textContent())!, /not live/);
    assert.equal(await tile(page, "yard").getAttribute("data-live"), "true");
    await server.stop();
    await page.waitForSelector(".tile[data-camera=yard][data-live=false] .hatch", { timeout: 10_000 });
    await page.getByText("does not answer").first().waitFor();
    assert.equal(await page.locator(".tile[data-live=true]").count(), 0);
    // The same session at the same address: the page connects by itself.
    const again = spawn(process.env.RESIGHT_PROGRAM!, ["serve", "--listen", new URL(server.address).host, watch.file("session.toml")], { stdio: "ignore" });
    await page.waitForSelector(".tile[data-camera=yard][data-live=true]", { timeout: SLOW_MS });
    again.kill();
  } finally {
    await page.close();
    await stop();
  }
});

test("`watch --serve` shows a session that runs in a terminal", { timeout: 120_000 }, async () => {
  const watch = new Watch(["gate"], images);
  watch.start();
  const child = spawn(process.env.RESIGHT_PROGRAM!, ["watch", watch.session(), "--serve", "127.0.0.1:0"], { stdio: ["ignore", "ignore", "pipe"] });
  const address = await new Promise<string>((found) => {
    let said = "";
    child.stderr.on("data", (text) => {
      said += text;
      const at = /http:\/\/[\d.:]+/.exec(said);
      if (at) found(at[0]);
    });
  });
  const server: Server = { address, process: child, stop: async () => void child.kill() };
  const page = await open(chromium, server, "live");
  try {
    await reaches(page, "gate", "steady");
    await page.waitForSelector(".tile[data-camera=gate] canvas[data-frame]");
    await tile(page, "gate").getByRole("button", { name: /full size/ }).click();
    await page.getByRole("button", { name: "Set as new reference" }).waitFor();
    assert.deepEqual(faultsOf(page), []);
  } finally {
    await page.close();
    await server.stop();
    watch.end();
  }
});

test("without a session the tab says how to start one", async () => {
  const server = await serve();
  const page = await open(chromium, server, "live");
  await page.getByText("resight serve session.toml").waitFor();
  await accessible(page, "no session");
  assert.deepEqual(faultsOf(page), []);
  await page.close();
  await server.stop();
});

interface DrawnName { text: string; left: number; right: number; base: number }

/** The names that the next drawing in space holds, and where. */
function namesInSpace(page: Page): Promise<DrawnName[]> {
  return page.evaluate(() => new Promise<DrawnName[]>((done) => {
    const drawn: DrawnName[] = [];
    const { fillText } = CanvasRenderingContext2D.prototype;
    CanvasRenderingContext2D.prototype.fillText = function (text: string, x: number, y: number) {
      fillText.call(this, text, x, y);
      if (!this.canvas.matches(".live-space canvas")) return;
      drawn.push({ text, left: x, right: x + this.measureText(text).width, base: y });
      // All names of a drawing are drawn at once.
      if (drawn.length === 1) setTimeout(() => {
        CanvasRenderingContext2D.prototype.fillText = fillText;
        done(drawn);
      });
    };
  }));
}

test("ten cameras, both themes, both widths: nothing that axe finds", { timeout: 240_000 }, async () => {
  const names = [...Array.from({ length: 9 }, (_, i) => `camera ${i + 1}`), LONG];
  const watch = new Watch(names, images, 400);
  watch.start();
  const server = await serve(watch.session());
  try {
    for (const colorScheme of ["light", "dark"] as const) {
      for (const size of [WIDE, PHONE]) {
        const page = await open(chromium, server, "live", { ...size, colorScheme });
        const at = `${colorScheme}, ${size.viewport.width} px`;
        await page.waitForSelector(`.tile[data-camera="${LONG}"] canvas[data-frame]`, { timeout: SLOW_MS });
        assert.equal(await page.locator(".tile").count(), 10);
        await accessible(page, `grid, ${at}`);
        const tooWide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert(tooWide <= 0, `${at}: wider than the screen by ${tooWide} px`);
        const small = await page.evaluate(() => [...document.querySelectorAll("button, select, input")].filter((one) => one.checkVisibility() && one.getBoundingClientRect().height < 32).map((one) => one.outerHTML.slice(0, 80)));
        assert.deepEqual(small, [], at);
        for (const view of ["Points", "In space"]) {
          await page.getByRole("button", { name: view }).click();
          await page.waitForSelector(view === "Points" ? ".shares rect" : ".live-space canvas", { timeout: SLOW_MS });
          await accessible(page, `${view}, ${at}`);
        }
        // Ten cameras that stand where one does: some names find a side, none lies over another, and the list is no wider than the page.
        const names = await namesInSpace(page);
        assert(0 < names.length && names.length < 10, `${at}: ${names.length} names`);
        for (const [i, a] of names.entries()) {
          for (const b of names.slice(0, i)) {
            const isApart = a.right < b.left || b.right < a.left || 14 <= Math.abs(a.base - b.base);
            assert(isApart, `${at}: ${a.text} lies over ${b.text}`);
          }
        }
        const list = await page.evaluate(() => [".places", ".places tbody tr"].map((one) => document.querySelector(one)!.getBoundingClientRect().right - innerWidth));
        assert(list.every((over) => over <= 0), `${at}: ${list}`);
        await page.getByRole("button", { name: "Cameras" }).click();
        await page.getByRole("button", { name: /Show camera 1 / }).click();
        await page.waitForSelector(".one .plot canvas", { timeout: SLOW_MS });
        await accessible(page, `one camera, ${at}`);
        assert.deepEqual(faultsOf(page), [], at);
        await page.context().close();
      }
    }
  } finally {
    await server.stop();
    watch.end();
  }
});
