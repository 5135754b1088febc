// From pointer move to answer drawn on a 12-megapixel photograph: a mark is dragged for 300 moves, and p50, p95 and p99 are printed.
// Counted is what the page does: the handler of the move until it sends, the answer of the program, and drawing it (the rest of a frame's
// wait for the screen is the browser's). Use: RESIGHT_PROGRAM=… npm run drag
import { browser, open, serve } from "../dist-tests/server.js";

const [WIDTH, HEIGHT] = [4000, 3000];
const MOVES = 300;
const BAR_MS = 16;

/** A camera 5 m above a plane, looking 35° down; pixel of a place on it. */
function pixel(x, y) {
  const tilt = (35 * Math.PI) / 180;
  const [ahead, down] = [y, 5];
  const z = ahead * Math.cos(tilt) + down * Math.sin(tilt);
  const v = down * Math.cos(tilt) - ahead * Math.sin(tilt);
  const f = WIDTH / 2 / Math.tan((30 * Math.PI) / 180);
  return [(f * x) / z + WIDTH / 2 - 0.5, (f * v) / z + HEIGHT / 2 - 0.5];
}

/** Notes when a move began and when the answer to what it sent was drawn. */
function instrument() {
  window.times = [];
  window.drawing = [];
  let begun = 0;
  const sent = new Map();
  addEventListener("pointermove", () => (begun = performance.now()), true);
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (data) {
    const { seq, command } = JSON.parse(data);
    if (command?.drag) sent.set(seq, begun);
    send.call(this, data);
  };
  const { set } = Object.getOwnPropertyDescriptor(WebSocket.prototype, "onmessage");
  Object.defineProperty(WebSocket.prototype, "onmessage", {
    set(handler) {
      set.call(this, (event) => {
        const seq = typeof event.data === "string" ? Number(/^\{"seq":(\d+)/.exec(event.data)?.[1]) : NaN;
        const answered = performance.now();
        handler.call(this, event);
        // Once everything that hangs on the answer has run.
        const channel = new MessageChannel();
        channel.port1.onmessage = () => {
          const now = performance.now();
          if (sent.has(seq)) {
            window.times.push(now - sent.get(seq));
            window.drawing.push(now - answered);
          }
          sent.delete(seq);
        };
        channel.port2.postMessage(0);
      });
    },
  });
}

const [chromium, server] = await Promise.all([browser(), serve()]);
try {
  const page = await open(chromium, server);
  await page.addInitScript(instrument);
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
  await command({ kind: "add_measurement", name: "length 1", what: "length", points: [pixel(-1, 6), pixel(1, 6)] });
  await page.reload();
  await page.locator("[data-figure=height]").waitFor();
  await page.waitForTimeout(1500);

  const box = await page.locator(".views > .viewport").boundingBox();
  const scale = Math.min(box.width / WIDTH, box.height / HEIGHT);
  const [u, v] = pixel(...marks.D);
  const x = box.x + box.width / 2 + scale * (u - WIDTH / 2 + 0.5);
  const y = box.y + box.height / 2 + scale * (v - HEIGHT / 2 + 0.5);
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let i = 1; i <= MOVES; i++) {
    await page.mouse.move(x + 20 * Math.sin(i / 15), y + 12 * Math.sin(i / 10));
    await page.waitForTimeout(16);
  }
  await page.mouse.up();
  await page.waitForTimeout(300);
  const sorted = (values) => values.sort((a, b) => a - b);
  const of = (values, share) => values[Math.min(values.length - 1, Math.floor(share * values.length))];
  const times = sorted(await page.evaluate(() => window.times));
  const drawing = sorted(await page.evaluate(() => window.drawing));
  const at = (share) => of(times, share);
  console.log(`of these drawing: p50 ${of(drawing, 0.5).toFixed(1)} ms, p95 ${of(drawing, 0.95).toFixed(1)} ms`);
  console.log(`${times.length} answers drawn to ${MOVES} moves on ${WIDTH} × ${HEIGHT} px: p50 ${at(0.5).toFixed(1)} ms, p95 ${at(0.95).toFixed(1)} ms, p99 ${at(0.99).toFixed(1)} ms`);
  process.exitCode = times.length < MOVES / 2 || BAR_MS < at(0.95) ? 1 : 0;
} finally {
  await chromium.close();
  await server.stop();
}
