// From pointer move to mark and answer drawn on a 12-megapixel photograph: a mark is dragged for 300 moves, and p50, p95 and p99 are printed by stages.
// "Move to drawn" is what the bar is about: from the time stamp of the move, through the page's handler, the program's answer and everything
// that hangs on it, to the overlay drawn with it. "Frame painted" further holds the wait for the browser's next frame and that frame's work.
// LENGTHS says how many lengths are measured besides (50), THROTTLE by how much the processor of the page is slowed down (1). On Linux the time is
// printed too that processors spend on a move, in the program and in the page's own thread, and how long these wait for a processor that is
// busy with something else.
// The same moves over an empty page, which asks the program nothing and draws one dot, say what browser and machine take by themselves.
// Use: RESIGHT_PROGRAM=… npm run drag
import { readFileSync, readdirSync } from "node:fs";
import { loadavg } from "node:os";
import { WIDE, browser, open, serve } from "../dist-tests/server.js";

const [WIDTH, HEIGHT] = [4000, 3000];
const MOVES = 300;
const LENGTHS = Number(process.env.LENGTHS ?? 50);
const THROTTLE = Number(process.env.THROTTLE ?? 1);
const BAR_MS = THROTTLE === 1 ? 16 : 33;

/** Time that threads of a process were on processors, and that they could have been and waited, ms; NaN where the system does not state it. */
function processorMs(pid, isCounted = () => true) {
  try {
    const tasks = readdirSync(`/proc/${pid}/task`).filter(isCounted);
    const of = tasks.map((task) => readFileSync(`/proc/${pid}/task/${task}/schedstat`, "utf8").split(" ").map((ns) => Number(ns) / 1e6));
    return { worked: of.reduce((sum, [worked]) => sum + worked, 0), waited: of.reduce((sum, [, waited]) => sum + waited, 0) };
  } catch {
    return { worked: NaN, waited: NaN };
  }
}

/** The process of the page: that of a renderer which has worked most. */
async function rendererOf(browser) {
  const { processInfo } = await (await browser.newBrowserCDPSession()).send("SystemInfo.getProcessInfo");
  return processInfo.filter(({ type }) => type === "renderer").sort((a, b) => b.cpuTime - a.cpuTime)[0]?.id;
}

/** A camera 5 m above a plane, looking 35° down; pixel of a place on it. */
function pixel(x, y) {
  const tilt = (35 * Math.PI) / 180;
  const [ahead, down] = [y, 5];
  const z = ahead * Math.cos(tilt) + down * Math.sin(tilt);
  const v = down * Math.cos(tilt) - ahead * Math.sin(tilt);
  const f = WIDTH / 2 / Math.tan((30 * Math.PI) / 180);
  return [(f * x) / z + WIDTH / 2 - 0.5, (f * v) / z + HEIGHT / 2 - 0.5];
}

/** What moves with a point in the hand: over the picture and the outlines of what is measured, under the values. */
const OVERLAY = ".views > .viewport > canvas:nth-of-type(3)";

/** Notes for each move that is sent when it happened, reached the page, was sent and answered, and when the overlay was drawn with the answer. */
function instrument(overlay) {
  window.moves = [];
  let last = null;
  const sent = new Map();
  const undrawn = [];
  const following = [];
  document.addEventListener("DOMContentLoaded", () => {
    const panels = new MutationObserver((changes) => {
      if (!changes.some(({ target }) => target.parentElement?.closest(".answer-figures"))) return;
      following.splice(0).forEach((move) => (move.followed_ms = performance.now()));
    });
    panels.observe(document.body, { subtree: true, characterData: true });
  });
  // Before the page's own listeners; a browser that tells of a move twice tells first of it raw.
  const begin = (event) => {
    if (last?.happened_ms !== event.timeStamp) last = { happened_ms: event.timeStamp, begun_ms: performance.now() };
  };
  addEventListener("pointerrawupdate", begin, true);
  addEventListener("pointermove", begin, true);
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (data) {
    const { seq, command } = JSON.parse(data);
    if (command?.drag) sent.set(seq, Object.assign(last, { sent_ms: performance.now() }));
    send.call(this, data);
  };
  const { set } = Object.getOwnPropertyDescriptor(WebSocket.prototype, "onmessage");
  Object.defineProperty(WebSocket.prototype, "onmessage", {
    set(handler) {
      set.call(this, (event) => {
        // First in a whole view, last in the changes of one.
        const seq = typeof event.data === "string" ? Number(/(?<=^\{)"seq":(\d+)|"seq":(\d+)(?=\}$)/.exec(event.data)?.slice(1).find(Boolean)) : NaN;
        const move = sent.get(seq);
        if (move) undrawn.push(Object.assign(move, { answered_ms: performance.now() }));
        sent.delete(seq);
        handler.call(this, event);
      });
    },
  });
  // The overlay begins by being cleared; it is drawn when whatever hangs on that has run, and on the screen at the end of the next frame.
  const clear = CanvasRenderingContext2D.prototype.clearRect;
  CanvasRenderingContext2D.prototype.clearRect = function (...box) {
    clear.apply(this, box);
    // The mark is drawn by itself, where the hand has it, within the handler.
    const move = last;
    if (this.canvas.className === "hand" && move) queueMicrotask(() => (move.marked_ms ??= performance.now()));
    const isOverlay = this.canvas.matches(overlay);
    if (!isOverlay || !undrawn.length) return;
    const moves = undrawn.splice(0);
    const after = (then) => {
      const channel = new MessageChannel();
      channel.port1.onmessage = () => then(performance.now());
      channel.port2.postMessage(0);
    };
    after((drawn_ms) => moves.forEach((move) => window.moves.push(Object.assign(move, { drawn_ms }))));
    following.push(...moves);
    requestAnimationFrame(() => after((painted_ms) => moves.forEach((move) => Object.assign(move, { painted_ms }))));
  };
}

/** Moves the pointer around a place, a move a frame. */
async function moved(page, x, y) {
  for (let i = 1; i <= MOVES; i++) {
    await page.mouse.move(x + 20 * Math.sin(i / 15), y + 12 * Math.sin(i / 10));
    await page.waitForTimeout(16);
  }
}

async function throttle(page) {
  if (THROTTLE !== 1) await (await page.context().newCDPSession(page)).send("Emulation.setCPUThrottlingRate", { rate: THROTTLE });
}

/** The moves over an empty page: each is sent as a command that is none, which the program refuses at once, and a dot is drawn with that. */
async function emptyPage(chromium, server) {
  const context = await chromium.newContext({ ...WIDE, bypassCSP: true });
  const page = await context.newPage();
  await page.goto(`${server.address}/healthz`);
  const { session } = await (await page.request.post(`${server.address}/api/session`, { data: {} })).json();
  await page.evaluate((session) => new Promise((ready) => {
    document.body.innerHTML = `<canvas width="1280" height="800"></canvas>`;
    const pen = document.querySelector("canvas").getContext("2d");
    const socket = new WebSocket(`ws://${location.host}/ws/session?session=${session}`, ["resight"]);
    const sent = new Map();
    window.moves = [];
    addEventListener("pointerrawupdate", ({ timeStamp, clientX, clientY }) => {
      const seq = sent.size + 1;
      sent.set(seq, { happened_ms: timeStamp, begun_ms: performance.now(), at: [clientX, clientY] });
      socket.send(JSON.stringify({ seq }));
      sent.get(seq).sent_ms = performance.now();
    });
    socket.onmessage = ({ data }) => {
      const move = sent.get(JSON.parse(data).seq);
      move.answered_ms = performance.now();
      pen.clearRect(0, 0, 1280, 800);
      pen.fillRect(...move.at, 9, 9);
      move.drawn_ms = performance.now();
      window.moves.push(move);
    };
    socket.onopen = ready;
  }), session);
  await throttle(page);
  await page.mouse.move(640, 400);
  await moved(page, 640, 400);
  const moves = await page.evaluate(() => window.moves);
  await context.close();
  return moves;
}

const [chromium, server] = await Promise.all([browser(), serve()]);
try {
  const page = await open(chromium, server);
  await page.addInitScript(instrument, OVERLAY);
  const photograph = await page.evaluate(async ([width, height]) => {
    const canvas = new OffscreenCanvas(width, height);
    const context = canvas.getContext("2d");
    for (let i = 0; i < 20000; i++) {
      context.fillStyle = `hsl(${(i * 37) % 360} 30% ${30 + (i % 50)}%)`;
      context.fillRect((i * 7919) % width, (i * 6151) % height, 90, 60);
    }
    const blob = await canvas.convertToBlob({ type: "image/jpeg", quality: 0.9 });
    const bytes = new Uint8Array(await blob.arrayBuffer());
    let text = "";
    for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
    return btoa(text);
  }, [WIDTH, HEIGHT]);
  const input = page.locator("input[type=file][accept='image/png,image/jpeg']").first();
  await input.setInputFiles({ name: "large.jpg", mimeType: "image/jpeg", buffer: Buffer.from(photograph, "base64") });
  await page.locator("[data-step=lens]").waitFor({ timeout: 120000 });

  const session = await page.evaluate(() => JSON.parse(sessionStorage.getItem("resight session")).session);
  const command = (one) => page.request.post(`${server.address}/api/session/command?session=${session}`, { data: { command: one } });
  await command({ kind: "set_lens", lens: { by: "field_of_view", hfov_deg: 60 } });
  await command({ kind: "set_template", template: "four_points" });
  const marks = { A: [-2, 5], B: [2, 5], C: [2, 9], D: [-2, 9] };
  for (const [name, [x, y]] of Object.entries(marks)) {
    const [u_px, v_px] = pixel(x, y);
    await command({ kind: "put_point", name, u_px, v_px });
  }
  for (const [a, b] of ["AB", "CA", "CB", "DA", "DB"]) {
    const distance_m = Math.hypot(marks[a][0] - marks[b][0], marks[a][1] - marks[b][1]);
    await command({ kind: "set_distance", a, b, distance_m, sigma_m: 0.005 });
  }
  for (let i = 0; i < LENGTHS; i++) {
    const [x, y] = [-2 + 0.4 * (i % 10), 5.2 + 0.7 * Math.floor(i / 10)];
    await command({ kind: "add_measurement", name: `length ${i}`, what: "length", points: [pixel(x, y), pixel(x + 0.3, y + 0.2)] });
  }
  await page.reload();
  await page.locator("[data-figure=height]").waitFor();
  await page.waitForTimeout(1500);

  await throttle(page);
  const box = await page.locator(".views > .viewport").boundingBox();
  const scale = Math.min(box.width / WIDTH, box.height / HEIGHT);
  const [u, v] = pixel(...marks.D);
  const x = box.x + box.width / 2 + scale * (u - WIDTH / 2 + 0.5);
  const y = box.y + box.height / 2 + scale * (v - HEIGHT / 2 + 0.5);
  await page.mouse.move(x, y);
  await page.mouse.down();
  const renderer = await rendererOf(chromium);
  const spent = () => ({ program: processorMs(server.process.pid), page: processorMs(renderer, (task) => Number(task) === renderer) });
  const before = spent();
  await moved(page, x, y);
  const after = spent();
  await page.mouse.up();
  await page.waitForTimeout(300);
  const moves = await page.evaluate(() => window.moves);
  await page.context().close();
  console.log(`${moves.length} answers drawn to ${MOVES} moves on ${WIDTH} × ${HEIGHT} px with ${LENGTHS} lengths, processor ÷ ${THROTTLE}, ms:`);
  const p95 = report(moves);
  console.log("the same moves over an empty page, ms:");
  report(await emptyPage(chromium, server));
  console.log(`load of the machine: ${loadavg().map((load) => load.toFixed(1)).join(", ")}`);
  process.exitCode = moves.length < MOVES / 2 || BAR_MS < p95 ? 1 : 0;
  const perMove = (who, what) => `${((after[who][what] - before[who][what]) / MOVES).toFixed(2)} ms`;
  for (const [what, words] of [["worked", "on processors"], ["waited", "waiting for a processor"]]) {
    console.log(`${words}, for a move: program ${perMove("program", what)}, page ${perMove("page", what)}`);
  }
} finally {
  await chromium.close();
  await server.stop();
}

/** Prints the stages of the moves, those that the page has; returns the 95th percentile of the whole. */
function report(moves) {
  const stages = [
    ["until the page has it", "happened_ms", "begun_ms"],
    ["until it is sent", "begun_ms", "sent_ms"],
    ["until it is answered", "sent_ms", "answered_ms"],
    ["until it is drawn", "answered_ms", "drawn_ms"],
    ["handler to drawn", "begun_ms", "drawn_ms"],
    ["move to mark drawn", "happened_ms", "marked_ms"],
    ["move to frame painted", "happened_ms", "painted_ms"],
    ["move to panels changed", "happened_ms", "followed_ms"],
    ["move to drawn", "happened_ms", "drawn_ms"],
  ];
  const rows = stages.map(([name, from, to]) => {
    const all = moves.map((move) => move[to] - move[from]).filter(Number.isFinite).sort((a, b) => a - b);
    const at = (share) => all[Math.min(all.length - 1, Math.floor(share * all.length))];
    return { name, p50: at(0.5), p95: at(0.95), p99: at(0.99) };
  });
  const words = (ms) => ms.toFixed(1).padStart(5);
  for (const { name, p50, p95, p99 } of rows.filter(({ p50 }) => p50 !== undefined)) console.log(`${name.padEnd(24)} p50 ${words(p50)}  p95 ${words(p95)}  p99 ${words(p99)}`);
  return rows.at(-1).p95;
}
