// The phone page in a real browser over real TLS, against a server that can refuse, stall and vanish.
//
// | of the issue | test |
// |---|---|
// | Generic Sensor API, rate, quantisation, permissions in words | a phone at rest sends raw readings |
// | else DeviceMotion/DeviceOrientation | without the sensor interface |
// | POST batches with resend and acknowledgement | a lost connection; batches that are refused |
// | a clear message to whoever can act on it | a full lab; what the lab says; a wrong token; refused permission |
// | hidden page, wake lock | a hidden page |
// | small and dependency-free, old phones | the page is small |
import assert from "node:assert/strict";
import { createServer } from "node:https";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { atTheEnd, certificate, launch, picture, suite, test, until, web } from "./browser.mjs";
import { phone } from "./scripted_phone.mjs";

const TOKEN = "Zm9yIHRlc3RzIG9ubHkhIQ";
const TYPES = { html: "text/html; charset=utf-8", js: "text/javascript", css: "text/css", svg: "image/svg+xml", json: "application/json" };
const PAGE = { "/p": "index.html", "/assets/phone.js": "phone.js", "/assets/phone.css": "phone.css", "/assets/icon.svg": "icon.svg", "/assets/program.json": "program.json" };

/** Serves the page and takes batches. `answer` may be replaced by a test. */
async function lab(port = 0) {
  const batches = [];
  const server = createServer(certificate(), async (request, response) => {
    const path = request.url;
    const headers = { "content-security-policy": "default-src 'self'", "cache-control": "no-store" };
    if (PAGE[path]) {
      const file = PAGE[path];
      response.writeHead(200, { ...headers, "content-type": TYPES[file.split(".").pop()] });
      return response.end(await readFile(join(web, "dist/phone", file)));
    }
    if (path !== "/in" || request.method !== "POST") return response.writeHead(404, headers).end();
    let text = "";
    for await (const part of request) text += part;
    const body = JSON.parse(text);
    const [status, reply] = request.headers["x-northing-token"] === TOKEN ? self.answer(body) : [401, { error: "wrong token" }];
    if (status === 200) batches.push(body);
    response.writeHead(status, { ...headers, "content-type": "application/json" }).end(JSON.stringify(reply));
  });
  const self = {
    batches,
    answer: (body) => [200, { ack: body.seq, recv_ns: 1, commands: [] }],
    close: () => new Promise((done) => { server.closeAllConnections(); server.close(done); }),
  };
  await new Promise((done) => server.listen(port, "127.0.0.1", done));
  atTheEnd(self.close);
  self.port = server.address().port;
  self.url = `https://127.0.0.1:${self.port}/p#t=${TOKEN}`;
  return self;
}

const rows = (batches, pick) => batches.flatMap(pick);

await suite(async () => {
  const browser = await launch();

  await test("a phone at rest sends raw readings of every sensor", async () => {
    const server = await lab();
    const device = await phone(browser, server.url);
    await device.page.fill("#name", "Bench 7");
    await device.page.click("#go");
    await until("readings of all sensors", () => ["a", "g", "m", "q"].every((c) => rows(server.batches, (b) => b.gs[c]).length > 5));
    await until("the state", async () => (await device.state()).startsWith("Sending"));
    await picture(device.page, "phone-streaming");
    assert.deepEqual(rows(server.batches, (b) => b.dm), [], "motion events are not sent beside the sensor interface");
    const [, x, y, z] = rows(server.batches, (b) => b.gs.a).at(-1);
    assert.ok(Math.hypot(x, y, z - 9.8) < 0.7, `specific force ${x} ${y} ${z}`);
    assert.ok(Math.abs(rows(server.batches, (b) => b.gs.m).at(-1)[2] - 22) < 2);
    assert.ok(rows(server.batches, (b) => b.gs.q).at(-1)[4] > 0.999);
    assert.equal(server.batches.at(-1).name, "Bench 7");
    assert.equal(server.batches.at(-1).v, 1);
    await until("the rate", async () => /Gyroscope\d+ Hzgranted/.test(await device.page.locator("#sensors li").nth(1).textContent()));
    const sequence = server.batches.map((b) => b.seq);
    assert.deepEqual([...sequence].sort((a, b) => a - b), sequence.map((_, i) => i), "every batch once, numbered from 0");
    await device.close();
    await server.close();
  });

  await test("without the sensor interface, motion events carry the same rest", async () => {
    const server = await lab();
    const device = await phone(browser, server.url, undefined, { init: () => { for (const name of ["Accelerometer", "Gyroscope", "Magnetometer", "AbsoluteOrientationSensor"]) delete window[name]; } });
    await device.page.click("#go");
    await until("motion events", () => rows(server.batches, (b) => b.dm).length > 5 && rows(server.batches, (b) => b.do).length >= 1);
    const row = rows(server.batches, (b) => b.dm).at(-1);
    assert.equal(row.length, 10);
    assert.ok(Math.abs(row[6] - 9.8) < 0.5, `acceleration including gravity ${row}`);
    assert.deepEqual(rows(server.batches, (b) => b.gs.a), []);
    // The list is written once a second, the readings come at once.
    await until("the words", async () => /motion events/.test(await device.page.locator("#sensors").textContent()));
    await device.close();
    await server.close();
  });

  await test("a lost connection and its return lose no batch", async () => {
    let server = await lab();
    const device = await phone(browser, server.url);
    await device.page.click("#go");
    await until("some batches", () => server.batches.length > 10);
    const { port } = server, before = [...server.batches];
    await server.close();
    await until("the page to notice", async () => !(await device.state()).startsWith("Sending"));
    await until("a longer pause", () => device.taken().then((n) => n > 300));
    server = await lab(port);
    await until("the backlog", async () => server.batches.length > 25 && (await device.page.locator("#link dd").nth(1).textContent()) < "3");
    const seen = new Set([...before, ...server.batches].map((b) => b.seq));
    const last = Math.max(...seen);
    const missing = Array.from({ length: last }, (_, i) => i).filter((seq) => !seen.has(seq));
    assert.deepEqual(missing, []);
    await until("the state", async () => (await device.state()).startsWith("Sending"));
    await device.close();
    await server.close();
  });

  await test("batches that are refused for now come again, those refused for ever do not", async () => {
    const server = await lab();
    const tries = new Map();
    server.answer = (body) => {
      const n = (tries.get(body.seq) ?? 0) + 1;
      tries.set(body.seq, n);
      if (body.seq === 3 && n < 3) return [429, { error: "too fast" }];
      if (body.seq === 5) return [400, { error: "gs.a[0]: expected 4 numbers" }];
      return [200, { ack: body.seq, commands: [] }];
    };
    const device = await phone(browser, server.url);
    await device.page.click("#go");
    await until("batches after the fifth", () => tries.has(9));
    assert.equal(tries.get(3), 3);
    assert.equal(tries.get(5), 1);
    await until("the count of what was given up", async () => /Given up1/.test(await device.page.locator("#link").textContent()));
    await device.close();
    await server.close();
  });

  await test("a wrong token is said in words and not tried again", async () => {
    const server = await lab();
    let asked = 0;
    const device = await phone(browser, server.url.replace(TOKEN, "wrong"));
    device.page.on("request", (r) => r.method() === "POST" && asked++);
    await device.page.click("#go");
    await until("the refusal", async () => /does not know this code/.test(await device.detail()));
    const then = asked;
    const readings = await device.taken();
    await until("a second of readings", async () => (await device.taken()) > readings + 150);
    assert.equal(asked, then);
    assert.ok(then <= 2);
    assert.equal(server.batches.length, 0);
    await device.close();
    await server.close();
  });

  await test("a page without a token says to scan again and cannot start", async () => {
    const server = await lab();
    const device = await phone(browser, server.url.split("#")[0]);
    assert.match(await device.state(), /No code/);
    assert.ok(await device.page.locator("#go").isDisabled());
    await device.close();
    await server.close();
  });

  await test("what the lab says is shown while it says it", async () => {
    const server = await lab();
    let commands = [{ say: "Calibrating: do not touch the phone." }, {}, { say: "No gyroscope." }];
    server.answer = (body) => [200, { ack: body.seq, commands }];
    const device = await phone(browser, server.url);
    await picture(device.page, "phone-start");
    await device.start();
    await until("the words", async () => (await device.said()) === "Calibrating: do not touch the phone. No gyroscope.");
    commands = [];
    await until("silence", async () => (await device.said()) === "The lab asks for nothing now.");
    await device.close();
    await server.close();
  });

  await test("a full lab is said in its words, and what was throttled arrives when there is room", async () => {
    const server = await lab();
    let full = true;
    server.answer = (body) => (full ? [503, { error: "the lab is full: it takes 64 devices" }] : [200, { ack: body.seq, commands: [] }]);
    const device = await phone(browser, server.url);
    await device.start();
    await until("the words", async () => /the lab is full: it takes 64 devices/.test(await device.detail()));
    full = false;
    server.batches.length = 0;
    await until("room", async () => (await device.state()).startsWith("Sending"));
    await until("the first batch", () => server.batches.some((b) => b.seq === 0));
    await device.close();
    await server.close();
  });

  await test("a hidden page tells the lab and asks for the screen again when it is back", async () => {
    const server = await lab();
    const device = await phone(browser, server.url, undefined, { init: () => {
      window.northingLocks = 0;
      Object.defineProperty(navigator, "wakeLock", { value: { request: () => (window.northingLocks++, Promise.resolve({})) } });
      Object.defineProperty(document, "visibilityState", { get: () => window.northingVisibility ?? "visible" });
    } });
    await device.start();
    await until("Sending", async () => (await device.state()).startsWith("Sending"));
    const turn = (visibility) => device.page.evaluate((v) => { window.northingVisibility = v; document.dispatchEvent(new Event("visibilitychange")); }, visibility);
    assert.equal(await device.page.evaluate(() => window.northingLocks), 1);
    await turn("hidden");
    await until("the event", () => rows(server.batches, (b) => b.events).some((e) => e.kind === "hidden"));
    await until("the state", async () => (await device.state()) === "Paused");
    await turn("visible");
    await until("the other event", () => rows(server.batches, (b) => b.events).some((e) => e.kind === "visible"));
    assert.equal(await device.page.evaluate(() => window.northingLocks), 2);
    await device.close();
    await server.close();
  });

  await test("refused permission is explained and the button stays", async () => {
    const server = await lab();
    const device = await phone(browser, server.url, undefined, { init: () => { DeviceMotionEvent.requestPermission = () => Promise.resolve("denied"); } });
    await device.page.click("#go");
    await until("the explanation", async () => (await device.state()) === "Sensors refused");
    await picture(device.page, "phone-permission-refused");
    assert.ok(await device.page.locator("#go").isEnabled());
    assert.equal(server.batches.length, 0);
    await device.close();
    await server.close();
  });

  await test("in Spanish everything on the page is Spanish, and the button turns it back", async () => {
    const server = await lab();
    server.answer = (body) => [200, { ack: body.seq, commands: [{ say: "Calibrating: do not touch the phone. 3 s left.", under_way: { what: "calibration", remaining_s: 2.4 } }] }];
    const device = await phone(browser, server.url, undefined, { locale: "es-ES" });
    assert.equal(await device.state(), "Listo para empezar");
    await device.start();
    await until("Enviando", async () => (await device.state()).startsWith("Enviando"));
    await until("the words", async () => (await device.said()) === "Calibrando: no toques el teléfono. Quedan 3 s.");
    await picture(device.page, "phone-spanish");
    await device.page.click("#language");
    await until("the words", async () => (await device.said()) === "Calibrating: do not touch the phone. 3 s left.");
    await until("Sending", async () => (await device.state()).startsWith("Sending"));
    assert.equal(await device.page.evaluate(() => document.documentElement.lang), "en");
    await device.close();
    await server.close();
  });

  await test("the page is small, under 15 kB as it travels, and asks for no newer language than ES2019", async () => {
    const sizes = await Promise.all(["index.html", "phone.js", "phone.css"].map(async (f) => (await readFile(join(web, "dist/phone", `${f}.gz`))).length));
    assert.ok(sizes.reduce((a, b) => a + b) < 15_000, `${sizes}`);
    const script = await readFile(join(web, "dist/phone/phone.js"), "utf8");
    assert.ok(!/\?\.[a-z[(]|\?\?|\bimport\b|\bexport\b/i.test(script.replace(/"[^"]*"|`[^`]*`/g, "")), "newer syntax");
  });
}, 200);
