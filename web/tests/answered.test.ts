// Who is answered: other names, other pages, a token; many tabs at once.
import assert from "node:assert/strict";
import { chmodSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import type { AddressInfo } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import type { Browser } from "playwright-core";
import { another, browser, faultsOf, open, serve } from "./server.js";

let chromium: Browser;
before(async () => {
  chromium = await browser();
});
after(() => chromium.close());

test("a page of another address gets nothing, by fetch, by form or by WebSocket", async () => {
  const server = await serve();
  const foreign = createServer((_, response) => response.setHeader("Content-Type", "text/html").end("<!doctype html><title>x</title>"));
  await new Promise<void>((done) => foreign.listen(0, "127.0.0.1", done));
  const page = await chromium.newPage();
  await page.goto(`http://127.0.0.1:${(foreign.address() as AddressInfo).port}/`);
  const got = await page.evaluate(async (address) => {
    const asked = async (init: RequestInit) => fetch(`${address}/api/session`, init).then((r) => r.status, () => "refused");
    const socket = await new Promise((done) => {
      const made = new WebSocket(`${address.replace("http", "ws")}/ws/session?session=x`);
      made.onopen = () => done("open");
      made.onerror = () => done("refused");
    });
    return {
      json: await asked({ method: "POST", headers: { "Content-Type": "application/json" }, body: "{}" }),
      plain: await asked({ method: "POST", headers: { "Content-Type": "text/plain" }, body: "{}" }),
      // The answer to this one cannot be read; that it is refused, the server's own tests show.
      blind: await fetch(`${address}/api/live`, { mode: "no-cors" }).then((r) => r.type, () => "refused"),
      socket,
    };
  }, server.address);
  assert.deepEqual([got.json, got.plain, got.socket], ["refused", "refused", "refused"]);
  assert.notEqual(got.blind, "basic");
  await page.close();
  foreign.close();
  await server.stop();
});

test("a name that was made to point here is not answered", async () => {
  const server = await serve();
  const port = new URL(server.address).port;
  const rebound = await browser("--host-resolver-rules=MAP evil.example 127.0.0.1");
  const page = await rebound.newPage();
  const response = await page.goto(`http://evil.example:${port}/`);
  assert.equal(response!.status(), 421);
  assert.equal((await page.goto(`http://localhost:${port}/`))!.status(), 200);
  await rebound.close();
  await server.stop();
});

test("a token is asked for, a wrong one named, the right one remembered until the tab is closed", async () => {
  const folder = mkdtempSync(join(tmpdir(), "resight-token-"));
  const token = "0123456789abcdef0123456789abcdef";
  writeFileSync(join(folder, "token"), token);
  chmodSync(join(folder, "token"), 0o600);
  const server = await serve("--token-file", join(folder, "token"));
  const page = await open(chromium, server, "rig");
  await page.getByRole("button", { name: "Try the example" }).click();
  await page.getByRole("textbox", { name: "Token" }).fill("wrong".repeat(8));
  await page.getByRole("button", { name: "Use it" }).click();
  await page.getByRole("button", { name: "Try the example" }).click();
  await page.getByText("does not know this token").waitFor();
  await page.getByRole("textbox", { name: "Token" }).fill(token);
  await page.getByRole("button", { name: "Use it" }).click();
  await page.getByRole("button", { name: "Try the example" }).click();
  await page.locator("[data-summary]").waitFor();
  assert(!page.url().includes(token));
  assert.deepEqual(faultsOf(page), []);
  await page.close();
  await server.stop();
  rmSync(folder, { recursive: true });
});

/** A browser keeps six connections to a host at a time: what streams must not take them. */
test("ten tabs of one browser are all answered", async () => {
  const server = await serve();
  const first = await open(chromium, server, "rig");
  const tabs = [first];
  for (let i = 1; i < 10; i++) tabs.push(await another(first, server, "rig"));
  for (const page of tabs) await page.getByRole("button", { name: "Try the example" }).click();
  for (const page of tabs) await page.locator("[data-summary]").waitFor({ timeout: 20_000 });
  await first.context().close();
  await server.stop();
});
