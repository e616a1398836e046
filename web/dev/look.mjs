// Screenshots of every screen of the page that `npm run dev` bundles: two sizes, light and dark.
import { chromium } from "playwright-core";
import { createServer } from "node:http";
import { mkdir, readFile } from "node:fs/promises";
import { dirname, extname, join } from "node:path";
import { fileURLToPath } from "node:url";

const root = dirname(dirname(fileURLToPath(import.meta.url)));
const out = join(root, "screenshots");
const types = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml" };
const server = createServer(async (request, response) => {
  const path = new URL(request.url, "http://x").pathname;
  const file = path === "/" ? "lab/index.html" : path === "/p" ? "phone/index.html" : path.replace("/assets/", path.includes("phone") ? "phone/" : "lab/");
  try {
    const body = await readFile(join(root, "dist-dev", file));
    response.writeHead(200, { "content-type": types[extname(file)], "content-security-policy": "default-src 'self'" }).end(body);
  } catch {
    response.writeHead(404).end();
  }
});
await new Promise((done) => server.listen(0, "127.0.0.1", done));
const url = `http://127.0.0.1:${server.address().port}`;
await mkdir(out, { recursive: true });
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });

async function walk(width, height, colorScheme) {
  const page = await browser.newPage({ viewport: { width, height }, colorScheme });
  page.on("console", (m) => m.type() === "error" && console.log("console:", m.text()));
  page.on("pageerror", (e) => console.log("error:", e.message));
  const shot = async (name) => page.screenshot({ path: join(out, `${name}-${width}-${colorScheme}.png`) });
  const step = (n) => page.locator(`nav li:nth-child(${n}) button`).click();
  await page.goto(url);
  await page.waitForTimeout(400);
  await shot("1-connect");
  await page.getByRole("button", { name: "Add a virtual phone" }).click();
  await page.waitForTimeout(400);
  await page.getByRole("button", { name: "Add a virtual phone" }).click();
  await step(3);
  await page.getByRole("button", { name: "Calibrate" }).last().click();
  await page.waitForTimeout(1800);
  await shot("3-calibrate");
  await step(4);
  await page.waitForTimeout(9000);
  await shot("4-tune");
  await step(5);
  await page.getByRole("button", { name: "Start the experiment" }).click();
  await page.waitForTimeout(1300);
  await shot("5-experiment");
  await page.waitForTimeout(1000);
  await shot("6-return");
  await page.waitForTimeout(900);
  await shot("7-result");
  await step(8);
  await page.waitForTimeout(700);
  await shot("8-what-if");
  for (let i = 0; process.argv.includes("--class") && i < 28; i++) { await step(1); await page.getByRole("button", { name: "Add a virtual phone" }).click(); }
  await page.getByRole("button", { name: "Wall" }).click();
  await page.waitForTimeout(700);
  await shot("9-wall");
  await page.close();
}

const sizes = process.argv.includes("--one") ? [[1280, 720, "light"]] : [[1920, 1080, "dark"], [1280, 720, "light"], [1280, 720, "dark"], [1920, 1080, "light"]];
for (const size of sizes) await walk(...size);
const phone = await browser.newPage({ viewport: { width: 390, height: 844 }, deviceScaleFactor: 2 });
await phone.goto(`${url}/p#t=x`);
await phone.screenshot({ path: join(out, "phone.png") });
await browser.close();
server.close();
