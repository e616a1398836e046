// What the wall of a class costs the teacher's browser: `NORTHING=PROGRAM PHONES=30 HZ=30 node dev/wall_load.mjs`.
// Drawing is by software here, in the browser's process for graphics; scripts are what a computer with a graphics card runs, too.
import { launch, suite, test, until } from "../tests/browser.mjs";
import { mainThread, openLab } from "../tests/lab_page.mjs";
import { startLab } from "../tests/program.mjs";

const phones = Number(process.env.PHONES ?? 30), hz = Number(process.env.HZ ?? 30);

await suite(async () => {
  const lab = await startLab();
  const view = await openLab(await launch(), lab), { page } = view;
  await test(`${phones} phones at ${hz} frames/s`, async () => {
    await page.evaluate((count) => new Promise((done) => {
      const socket = new WebSocket(`ws://${location.host}/api/ws`);
      socket.onopen = () => {
        for (let seed = 1; seed <= count; seed++) socket.send(JSON.stringify({ type: "virtual_phone", action: "add", motion: "gentle", seed }));
        socket.close();
        done();
      };
    }), phones);
    await until("all phones", async () => (await lab.status()).devices.filter((d) => d.delivers).length === phones);
    await page.locator("label.rate select").selectOption(String(hz));
    await page.getByRole("button", { name: "Wall", exact: true }).click();
    await until("their attitudes", async () => (await page.locator(".cell dd").count()) >= 3 * phones);
    await page.evaluate(() => {
      window.frames = 0;
      const count = () => { window.frames++; window.requestAnimationFrame(count); };
      count();
    });
    const before = await page.evaluate(() => window.frames), seconds = 15;
    const { script, tasks } = await mainThread(page, seconds);
    const drawn = ((await page.evaluate(() => window.frames)) - before) / seconds;
    console.log(`wall of ${phones}, asked for ${hz} frames/s, ${drawn.toFixed(1)} drawn by software: scripts ${(100 * script).toFixed(0)} % of the main thread (${((1000 * script) / drawn).toFixed(1)} ms a frame), all of its tasks ${(100 * tasks).toFixed(0)} %`);
  });
}, 200);
