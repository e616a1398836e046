// The whole lab in a real browser: the program itself, phones over real TLS, the page from calibration to what-if.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { request as httpRequest } from "node:http";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { atRest, finish, launch, phone, screenshots, test, until, web } from "./browser.mjs";

/** Starts the program and waits for its first line. */
async function start() {
  const folder = mkdtempSync(join(tmpdir(), "northing-lab-"));
  const [command, ...before] = process.env.NORTHING ? [process.env.NORTHING] : ["cargo", "run", "-q", "-p", "northing", "--"];
  const child = spawn(command, [...before, "live", "--port", "0", "--no-open", "--json", "--data-dir", folder, "--web-dir", join(web, "dist")], { cwd: dirname(web), stdio: ["ignore", "pipe", "inherit"] });
  const lines = createInterface({ input: child.stdout });
  const ready = await new Promise((done, fail) => {
    lines.once("line", (line) => done(JSON.parse(line)));
    child.once("exit", (code) => fail(new Error(`the program ended with ${code}`)));
    child.once("error", fail);
  });
  assert.equal(ready.event, "ready");
  const token = ready.phone.split("#t=")[1];
  const port = Number(new URL(ready.lab).port);
  return {
    ready, port, token,
    // The certificate names this address too; the first one on the list may be another network's.
    phoneUrl: (t = token) => `https://127.0.0.1:${port + 1}/p#t=${t}`,
    status: async () => (await fetch(new URL("/api/status", ready.lab))).json(),
    device: async (name) => (await (await fetch(new URL("/api/status", ready.lab))).json()).devices.find((d) => d.name === name),
    stop: () => new Promise((done) => child.once("exit", () => { rmSync(folder, { recursive: true, force: true }); done(); }).kill("SIGTERM")),
  };
}

const lab = await start();
const browser = await launch();
const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
const complaints = [];
page.on("pageerror", (error) => complaints.push(error.message));
page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
await page.goto(lab.ready.lab);

const shot = (name) => page.screenshot({ path: join(screenshots, `lab-${name}.png`) });
const step = (n) => page.locator(`nav li:nth-child(${n}) button`).click();
const numberIn = (text) => Number(text.replace("−", "-").replace(/[^\d.-]/g, ""));
const pick = (name) => page.locator("aside .pick", { hasText: name }).click();
/** The angle from the MEKF to another attitude, as the page shows it. */
const angleTo = async (name) => numberIn(await page.locator(".ghosts tr", { hasText: name }).locator("td").textContent());
/** Yaw, pitch and roll as the page shows them. */
const angles = async () => (await page.locator(".angles dd span:first-child").allTextContents()).map(numberIn);

await test("the page opens with QR code and addresses", async () => {
  await page.locator(".qr img").waitFor();
  await until("the QR code", () => page.locator(".qr img").evaluate((img) => img.complete && img.naturalWidth > 0));
  assert.match(await page.locator("code.url").first().textContent(), /^https:.*#t=/);
  await shot("1-connect");
});

await test("a virtual phone is calibrated at rest", async () => {
  await page.getByRole("button", { name: "Add a virtual phone" }).click();
  await page.locator("aside .pick", { hasText: "Virtual phone 1" }).waitFor();
  await step(3);
  await page.locator(".panel input[type=range]").fill("5");
  await page.getByRole("button", { name: "Calibrate", exact: true }).and(page.locator(".panel button")).click();
  await page.locator(".panel .verdict.good b", { hasText: "Calibrated" }).waitFor({ timeout: 20_000 });
  const force = await page.locator(".compact tr", { hasText: "Specific force" }).locator("td").allTextContents();
  const length = Math.hypot(...force.map(numberIn));
  assert.ok(Math.abs(length - 9.81) < 0.15, `gravity ${length}`);
  await shot("3-calibrate");
});

await test("nothing moves on the page while data streams, and nothing overflows", async () => {
  await step(4);
  await page.waitForTimeout(1500);
  const shifted = await page.evaluate(() => new Promise((done) => {
    let sum = 0;
    new PerformanceObserver((list) => { for (const entry of list.getEntries()) sum += entry.value; }).observe({ type: "layout-shift" });
    setTimeout(() => done(sum), 4000);
  }));
  assert.ok(shifted < 0.002, `layout shift ${shifted}`);
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth && document.documentElement.scrollHeight <= innerHeight));
});

await test("every control can be reached with the keyboard", async () => {
  await page.keyboard.press("1");
  await page.locator(".panel h2", { hasText: "Connect" }).waitFor();
  const count = await page.locator("button:not([disabled]):visible, input:visible, select:visible, summary:visible").count();
  const seen = new Set();
  for (let i = 0; i < count + 8; i++) {
    await page.keyboard.press("Tab");
    seen.add(await page.evaluate(() => { const e = document.activeElement; return [...document.querySelectorAll("*")].indexOf(e); }));
  }
  assert.ok(seen.size >= count, `${seen.size} of ${count}`);
});

/** Rests for 6 s, tips its right edge down by 60° in 4 s, rests. Roll is +60° then, whatever the heading. */
const tipped = (t) => {
  const [from, to, angle] = [6, 10, Math.PI / 3];
  const u = Math.min(1, Math.max(0, (t - from) / (to - from)));
  const a = angle * (u - Math.sin(2 * Math.PI * u) / (2 * Math.PI));
  const rate = u > 0 && u < 1 ? (angle / (to - from)) * (1 - Math.cos(2 * Math.PI * u)) : 0;
  const [c, s] = [Math.cos(a), Math.sin(a)];
  // Turned by `a` about the body's y axis.
  return { force: [-9.81 * s, 0, 9.81 * c], rate: [0, rate, 0], field: [42 * s, 22, -42 * c], attitude: [0, Math.sin(a / 2), 0, Math.cos(a / 2)] };
};

await test("two phones over TLS, one at rest and one turned: the page shows each as its script says", async () => {
  const anna = await phone(browser, lab.phoneUrl(), atRest);
  await anna.page.fill("#name", "Anna");
  await anna.page.click("#go");
  const ben = await phone(browser, lab.phoneUrl(), tipped);
  await ben.page.fill("#name", "Ben");
  await ben.page.click("#go");
  for (const [name, tip] of [["Anna", 0], ["Ben", 60]]) {
    await page.locator("aside .pick", { hasText: name }).waitFor({ timeout: 20_000 });
    await pick(name);
    await until(`${name}'s attitude`, async () => {
      const [yaw, pitch, roll] = (await angles()).map((v) => (v * Math.PI) / 180);
      if ([yaw, pitch, roll].some(Number.isNaN)) return false;
      // The angle between the body's z axis and up does not depend on the order of the angles.
      const tilt = (Math.acos(Math.cos(pitch) * Math.cos(roll)) * 180) / Math.PI;
      return Math.abs(tilt - tip) < 2;
    }, 30);
    assert.equal((await lab.device(name)).lost, 0);
  }
  await shot("2-two-phones");
  await ben.page.screenshot({ path: join(screenshots, "phone-live.png") });

  const before = await lab.device("Anna");
  await anna.page.context().setOffline(true);
  await anna.page.waitForTimeout(3000);
  await anna.page.context().setOffline(false);
  await until("the return", async () => (await anna.state()).startsWith("Sending"), 30);
  await until("the backlog", async () => (await lab.device("Anna")).received > before.received + 100, 30);
  assert.equal((await lab.device("Anna")).lost, 0, "a lost connection and its return lose nothing");
  await anna.close();
  await ben.close();
});

await test("without WebSocket the phone page sends by POST", async () => {
  const device = await phone(browser, lab.phoneUrl(), atRest, { init: () => { window.WebSocket = class { constructor() { throw new Error("refused"); } }; } });
  await device.page.fill("#name", "Cleo");
  await device.page.click("#go");
  await until("Cleo", async () => (await lab.device("Cleo"))?.received > 100, 30);
  assert.match(await device.page.locator("#link").textContent(), /By POST/);
  await device.close();
});

await test("a wrong token gets nothing in", async () => {
  const { devices } = await lab.status();
  const device = await phone(browser, lab.phoneUrl("wrong"), atRest);
  await device.page.click("#go");
  await until("the refusal", async () => /does not know this code/.test(await device.detail()));
  assert.equal((await lab.status()).devices.length, devices.length);
  await device.close();
});

await test("a foreign Host is refused", async () => {
  const status = await new Promise((done, fail) => httpRequest({ host: "127.0.0.1", port: lab.port, path: "/api/status", headers: { host: "evil.example" } }, (r) => { r.resume(); done(r.statusCode); }).on("error", fail).end());
  assert.ok(status >= 400 && status < 500, `${status}`);
});

await test("an experiment ends with numbers that fit the truth", async () => {
  await pick("Virtual phone 1");
  await step(4);
  await shot("4-tune");
  await page.getByRole("button", { name: "Next: experiment" }).click();
  await page.locator(".panel input[type=text]").fill("First");
  // The script of 75 s: it rests from 70 s until 10 s into the next round.
  await until("the next rest", async () => {
    const phase = (await lab.device("Virtual phone 1")).duration_s % 75;
    return phase > 71.5 && phase < 74;
  }, 90);
  await page.getByRole("button", { name: "Start the experiment" }).click();
  await page.waitForTimeout(15_000);
  const angle = await angleTo("Truth");
  assert.ok(angle < 3, `${angle} degrees from the truth`);
  await shot("5-experiment");
  await page.locator(".panel .final").waitFor({ timeout: 90_000 });
  await shot("7-result");
  const shown = async (name, value) => numberIn(await page.locator(`tr[data-estimator=${name}] [data-value=${value}]`).textContent());
  const row = (await lab.status()).experiments.find((r) => r.name === "First");
  assert.equal(await shown("mekf", "calculated"), Number(row.results.mekf.calculated_error_deg.toFixed(2)));
  assert.equal(await shown("mekf", "estimated"), Number(row.results.mekf.estimated_error_deg.toFixed(2)));
  assert.ok((await shown("mekf", "rms")) < 2, "RMS error against the truth");
  assert.ok((await shown("mekf", "calculated")) < 2, "the script ends where it began");
  assert.notEqual(await page.locator(".final [data-verdict]").getAttribute("data-verdict"), "none");
  await page.locator(".experiments th", { hasText: "First" }).waitFor();
  for (const [file, start] of [["report.html", "<!doctype html>"], ["recording.csv", ""], ["estimates.tum", ""]]) {
    const response = await fetch(new URL(`/api/experiments/${row.id}/${file}`, lab.ready.lab));
    assert.equal(response.status, 200, file);
    const text = await response.text();
    assert.ok(text.length > 1000 && text.toLowerCase().startsWith(start), file);
  }
});

await test("what-if runs the recording again at once, and back again", async () => {
  await step(8);
  const now = page.locator("tr[data-estimator=mekf] [data-value=calculated]");
  const row = (await lab.status()).experiments.find((r) => r.name === "First");
  await now.waitFor();
  assert.equal(numberIn(await now.textContent()), Number(row.results.mekf.calculated_error_deg.toFixed(2)), "the same numbers give the same result");
  const nis = page.locator("tr[data-estimator=mekf] td").last();
  const before = await nis.textContent();
  // Calibrated, R is the simulated sensor's own noise and the NIS about 3; with 1 m/s^2 it is far too small.
  assert.ok(numberIn(before) > 1 && numberIn(before) < 10, before);
  await page.locator("input[data-parameter=accelerometer_std]").fill("0");
  await until("a NIS far too small", async () => numberIn(await nis.textContent()) < 0.5);
  await page.locator(".what-if-plots .chart").nth(2).waitFor();
  await page.waitForTimeout(300);
  await shot("8-what-if");
  await page.getByRole("button", { name: "Back to the numbers" }).click();
  await until("the NIS of before", async () => (await nis.textContent()) === before);
});

await test("the wall shows every device", async () => {
  await page.getByRole("button", { name: "Wall" }).click();
  assert.equal(await page.locator(".cell").count(), (await lab.status()).devices.length);
  await page.waitForTimeout(500);
  await shot("9-wall");
});

await test("the page had nothing to complain about", () => assert.deepEqual(complaints, []));

await browser.close();
await lab.stop();
finish();
