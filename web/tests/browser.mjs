// What the browser tests share: a Chromium, checks that count, and an end that always comes.
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const web = dirname(dirname(fileURLToPath(import.meta.url)));
export const screenshots = process.env.NORTHING_SCREENSHOTS ?? join(web, "screenshots");
mkdirSync(screenshots, { recursive: true });

// ---- The end: whatever happens, nothing that was started stays.

const endings = [];
/** Runs at the end, also of a failed test file; the newest first. */
export const atTheEnd = (ending) => endings.push(ending);

let passed = 0, failed = 0, ending = false;

async function end(code) {
  if (ending) return;
  ending = true;
  const patience = new Promise((done) => setTimeout(done, 8_000).unref());
  for (const close of endings.reverse()) await Promise.race([Promise.resolve().then(close).catch(() => undefined), patience]);
  console.log(`\n${passed} passed, ${failed} failed`);
  // Also ends what still waits: a browser that hangs is killed by Playwright at exit.
  process.exit(code);
}

for (const signal of ["SIGTERM", "SIGINT", "SIGHUP"]) process.once(signal, () => { failed++; console.log(`FAILED  ended by ${signal}`); void end(1); });

/** Runs a whole test file; it takes no longer than `seconds`. */
export async function suite(body, seconds = 240) {
  const limit = setTimeout(() => { failed++; console.log(`FAILED  the tests took more than ${seconds} s`); void end(1); }, seconds * 1000);
  try {
    await body();
  } catch (error) {
    failed++;
    console.log(`FAILED  outside of a test\n        ${error.stack ?? error}`);
  }
  clearTimeout(limit);
  await end(failed || !passed ? 1 : 0);
}

const only = process.argv[2];

/** Runs one test and says how it went; the others go on. */
export async function test(name, body, seconds = 150) {
  if (ending || (only && !name.includes(only))) return;
  const begun = performance.now();
  let limit;
  const late = new Promise((_, fail) => { limit = setTimeout(() => fail(new Error(`took more than ${seconds} s`)), seconds * 1000); });
  try {
    await Promise.race([body(), late]);
    passed++;
    console.log(`ok      ${name} (${((performance.now() - begun) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failed++;
    console.log(`FAILED  ${name}\n        ${error.stack ?? error}`);
  } finally {
    clearTimeout(limit);
  }
}

let pollMs = 50;
/** How often `until` looks: seldom where many wait at once, for looking costs, too. */
export const lookEvery = (ms) => { pollMs = ms; };

/** Waits until `check` gives something true, and returns it. */
export async function until(what, check, seconds = 60) {
  const last = performance.now() + seconds * 1000;
  let value, wrong;
  while (performance.now() < last) {
    try {
      value = await check();
      wrong = undefined;
    } catch (error) {
      wrong = error;
    }
    if (value) return value;
    await new Promise((done) => setTimeout(done, pollMs));
  }
  throw new Error(`waited ${seconds} s for ${what}${wrong ? `: ${wrong.message}` : ""}`);
}

// ---- The browser.

/** A Chromium without a window. WebGL by software; the magnetometer is behind a feature. */
export async function launch() {
  const browser = await chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    handleSIGTERM: false,
    handleSIGINT: false,
    handleSIGHUP: false,
    args: [
      // Root has no sandbox; the pages are our own.
      "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
      "--disable-dev-shm-usage", "--disable-gpu-compositing", "--disable-gpu-rasterization", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--enable-features=GenericSensorExtraClasses",
      // Several pages are looked at at once.
      "--disable-background-timer-throttling", "--disable-backgrounding-occluded-windows", "--disable-renderer-backgrounding",
    ],
  });
  atTheEnd(() => browser.close());
  return browser;
}

/** A picture of a page in light and in dark: `NAME.png`, `NAME-dark.png`. */
export async function picture(page, name) {
  for (const scheme of ["dark", "light"]) {
    await page.emulateMedia({ colorScheme: scheme });
    // One frame with the new colours.
    await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    await page.screenshot({ path: join(screenshots, `${name}${scheme === "dark" ? "-dark" : ""}.png`) });
  }
}

/** Key and certificate for 127.0.0.1, as files that are gone afterwards. */
export function certificate() {
  const folder = mkdtempSync(join(tmpdir(), "northing-browser-"));
  const [key, cert] = [join(folder, "key.pem"), join(folder, "cert.pem")];
  try {
    execFileSync("openssl", ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-keyout", key, "-out", cert, "-days", "2", "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"], { stdio: "ignore" });
    return { key: readFileSync(key), cert: readFileSync(cert) };
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
}
