// Screenshots of every screen of the real program with virtual phones: `node dev/look_live.mjs [WIDTHxHEIGHT-SCHEME ...]`.
// NORTHING names the program; pictures land in screenshots/.
import { chromium } from "playwright-core";
import { spawn } from "node:child_process";
import { mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";

const root = dirname(dirname(fileURLToPath(import.meta.url)));
const out = join(root, "screenshots");
mkdirSync(out, { recursive: true });
const folder = mkdtempSync(join(tmpdir(), "northing-look-"));
const child = spawn(process.env.NORTHING, ["live", "--port", "0", "--no-open", "--json", "--data-dir", folder, "--web-dir", join(root, "dist")], { stdio: ["ignore", "pipe", "inherit"] });
process.once("exit", () => { child.kill(); rmSync(folder, { recursive: true, force: true }); });
const ready = await new Promise((done) => createInterface({ input: child.stdout }).once("line", (line) => done(JSON.parse(line))));
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });

const wanted = process.argv.slice(2);
const sizes = wanted.length ? wanted : ["1280x720-light", "1920x1080-dark", "1280x720-dark", "1920x1080-light"];
const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
page.on("pageerror", (e) => console.log("error:", e.message));
page.on("console", (m) => m.type() === "error" && console.log("console:", m.text()));
/** One picture of each size and scheme. */
async function shot(name) {
  for (const size of sizes) {
    const [, width, height, colorScheme] = /(\d+)x(\d+)-(\w+)/.exec(size);
    await page.setViewportSize({ width: Number(width), height: Number(height) });
    await page.emulateMedia({ colorScheme });
    await page.waitForTimeout(450);
    await page.screenshot({ path: join(out, `${name}-${size}.png`) });
  }
}
const step = (n) => page.locator(`nav li:nth-child(${n}) button`).click();
const button = (name) => page.getByRole("button", { name, exact: true });
const add = async (motion, magnetised) => {
  await step(1);
  await page.locator(".virtual select").first().selectOption(motion);
  if (magnetised) await page.locator(".virtual input[type=checkbox]").check();
  await button("Add a virtual phone").click();
  await page.waitForTimeout(400);
  if (magnetised) await page.locator(".virtual input[type=checkbox]").uncheck();
};
const pick = (name) => page.locator("aside .pick", { hasText: name }).click();

await page.goto(ready.lab);
await page.waitForTimeout(500);
await shot("01-empty");
await add("rest");
await step(3);
await button("Noise (Allan)").click();
await shot("02-allan-before");
await button("Record a rest").click();
await add("gentle");
await pick("Virtual phone 2");
await shot("03-connected");
await step(2);
await shot("04-place");
await step(3);
await button("At rest").click();
await page.locator(".panel input[type=range]").fill("5");
await button("Calibrate").last().click();
await page.locator(".panel .verdict.good b", { hasText: "Calibrated" }).waitFor({ timeout: 20_000 });
await shot("05-calibrated");
await step(4);
await page.waitForTimeout(3000);
await page.locator("[data-estimator-choice=usque]").check();
await page.locator("[data-estimator-choice=mekf3]").check();
await page.waitForTimeout(2500);
await shot("06-tune");
await step(5);
await page.locator(".panel input[type=text]").fill("First");
await page.locator(".panel input[type=range]").fill("60");
await shot("07-experiment-before");
await button("Start the experiment").click();
await page.waitForTimeout(2000);
await shot("08-experiment");
await add("tumble", true);
await pick("Virtual phone 3");
await step(3);
await button("Magnetometer").click();
await shot("09-magnetometer-before");
await button("Start turning").click();
await page.waitForTimeout(17_000);
await shot("10-magnetometer-turning");
await page.waitForTimeout(15_000);
await shot("11-magnetometer-later");
await button("Finish").click();
await page.waitForTimeout(1000);
await shot("12-magnetometer-applied");
await pick("Virtual phone 2");
await step(6);
await shot("13-return");
await step(7);
await page.locator(".panel .final, .panel .verdict.warn").first().waitFor({ timeout: 90_000 });
await shot("14-result");
await step(8);
await page.waitForTimeout(1500);
await shot("15-what-if");
await pick("Virtual phone 1");
await step(3);
await button("Noise (Allan)").click();
await button("Stop and analyse").click();
await page.waitForTimeout(2500);
await shot("16-allan");
for (let i = 4; i <= 30; i++) await add(["gentle", "brisk", "tumble"][i % 3]);
await button("Wall").click();
await page.waitForTimeout(3000);
const began = performance.now();
const frames = await page.evaluate(() => new Promise((done) => { let n = 0; const end = performance.now() + 3000; const next = () => { n++; performance.now() < end ? requestAnimationFrame(next) : done(n); }; requestAnimationFrame(next); }));
console.log(`wall of 30: ${(frames / ((performance.now() - began) / 1000)).toFixed(1)} frames a second`);
await shot("17-wall");
await browser.close();
process.exit(0);
