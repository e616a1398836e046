// Measures the lab page's first contentful paint: ten loads from nothing, each in a browser context of its own.
//
//   NORTHING=../target/debug/northing node dev/first_paint.mjs
import { launch, suite, test } from "../tests/browser.mjs";
import { startLab } from "../tests/program.mjs";

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  await test("first paint", async () => {
    const found = [];
    for (let k = 0; k < 10; k++) {
      const context = await browser.newContext({ viewport: { width: 1280, height: 720 } });
      const page = await context.newPage();
      await page.goto(lab.ready.lab);
      await page.waitForFunction(() => performance.getEntriesByName("first-contentful-paint").length > 0);
      found.push(await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0].startTime));
      await context.close();
    }
    found.sort((a, b) => a - b);
    console.log(`first contentful paint: ${found[0].toFixed(0)} ms the best of ten, ${found[5].toFixed(0)} the median, ${found[9].toFixed(0)} the worst`);
  });
}, 120);
