// What the browser tests share: a Chromium with scripted sensors, a self-made certificate, and checks that count.
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const web = dirname(dirname(fileURLToPath(import.meta.url)));
export const screenshots = process.env.NORTHING_SCREENSHOTS ?? join(web, "screenshots");
mkdirSync(screenshots, { recursive: true });

/** A Chromium. WebGL by software; the magnetometer is behind a feature. */
export function launch() {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: [
      "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
      "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--enable-features=GenericSensorExtraClasses",
    ],
  });
}

/** Key and certificate for 127.0.0.1, as files that are gone afterwards. */
export function certificate() {
  const folder = mkdtempSync(join(tmpdir(), "northing-browser-"));
  const [key, cert] = [join(folder, "key.pem"), join(folder, "cert.pem")];
  execFileSync("openssl", ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-keyout", key, "-out", cert, "-days", "2", "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"], { stdio: "ignore" });
  const made = { key: readFileSync(key), cert: readFileSync(cert) };
  rmSync(folder, { recursive: true });
  return made;
}

const SENSORS = ["accelerometer", "linear-acceleration", "gravity", "gyroscope", "absolute-orientation", "relative-orientation", "magnetometer"];

/**
 * A page whose sensors follow `motion(t)`: specific force (m/s²), rate (rad/s), field (µT), attitude (x, y, z, w).
 * Overrides come before the page: a page that already listens gets nothing.
 */
export async function phone(browser, url, motion, { init } = {}) {
  const context = await browser.newContext({ viewport: { width: 390, height: 844 }, ignoreHTTPSErrors: true });
  const page = await context.newPage();
  if (init) await page.addInitScript(init);
  const cdp = await context.newCDPSession(page);
  for (const type of SENSORS) await cdp.send("Emulation.setSensorOverrideEnabled", { enabled: true, type, metadata: { available: true, minimumFrequency: 1, maximumFrequency: 60 } });
  await page.goto(url);
  const started = performance.now();
  let stopped = false;
  const feed = async () => {
    while (!stopped) {
      const { force, rate, field, attitude } = motion((performance.now() - started) / 1000);
      const xyz = ([x, y, z]) => ({ xyz: { x, y, z } });
      const quaternion = { quaternion: { x: attitude[0], y: attitude[1], z: attitude[2], w: attitude[3] } };
      const readings = { accelerometer: xyz(force), "linear-acceleration": xyz([0, 0, 0]), gravity: xyz(force), gyroscope: xyz(rate), magnetometer: xyz(field), "absolute-orientation": quaternion, "relative-orientation": quaternion };
      await Promise.all(Object.entries(readings).map(([type, reading]) => cdp.send("Emulation.setSensorOverrideReadings", { type, reading }).catch(() => undefined)));
      await new Promise((done) => setTimeout(done, 15));
    }
  };
  const feeding = feed();
  return {
    page,
    state: () => page.locator("#state").textContent(),
    detail: () => page.locator("#detail").textContent(),
    close: async () => {
      stopped = true;
      await feeding;
      await context.close();
    },
  };
}

/** At rest, screen up, top to the north. */
export const atRest = () => ({ force: [0, 0, 9.81], rate: [0, 0, 0], field: [0, 22, -42], attitude: [0, 0, 0, 1] });

let passed = 0, failed = 0;
const only = process.argv[2];

/** Runs one test and says how it went. */
export async function test(name, body) {
  if (only && !name.includes(only)) return;
  const begun = performance.now();
  try {
    await body();
    passed++;
    console.log(`ok      ${name} (${((performance.now() - begun) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failed++;
    console.log(`FAILED  ${name}\n        ${error.stack ?? error}`);
  }
}

/** The closing line; the exit code says whether all went well. */
export function finish() {
  console.log(`\n${passed} passed, ${failed} failed`);
  process.exitCode = failed || !passed ? 1 : 0;
}

/** Waits until `check` gives something true, and returns it. */
export async function until(what, check, seconds = 20) {
  const end = performance.now() + seconds * 1000;
  let last;
  while (performance.now() < end) {
    last = await check();
    if (last) return last;
    await new Promise((done) => setTimeout(done, 100));
  }
  throw new Error(`waited ${seconds} s for ${what}`);
}
