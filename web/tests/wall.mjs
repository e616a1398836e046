// The wall of a class, in a real browser: boxes, lost phones, orders to all, the results board.
//
// | of the issue | test |
// |---|---|
// | names in their order, lamps, state, angles with labels and units | boxes stand in the order of names |
// | a phone that lost its connection says so and for how long | a phone that is gone says since when |
// | calibrate all, each refusal told | calibrate all |
// | start all, countdown, results board ranked by consistency | start all |
// | stop all | stop all |
import assert from "node:assert/strict";
import { request } from "node:https";
import { launch, suite, test, until } from "./browser.mjs";
import { openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";

/** A batch of the phone page with a second of rest. */
const batch = (lab, device, name) => new Promise((done, fail) => {
  const rows = (values) => Array.from({ length: 50 }, (_, k) => [k * 20, ...values.map((v) => v + 0.001 * ((k * 7) % 5))]);
  const body = { v: 1, device, name, session: "s", seq: 0, ua: "", platform: "android", sent_ms: 1000, dm: [], gs: { a: rows([0, 0, 9.8]), g: rows([0, 0, 0]), m: rows([0, 22, -42]), q: [] }, do: [], events: [] };
  const headers = { "content-type": "application/json", "x-northing-token": lab.token };
  const post = request({ host: "127.0.0.1", port: lab.port + 1, path: "/in", method: "POST", rejectUnauthorized: false, headers }, (response) => response.resume().on("end", () => done(response.statusCode)));
  post.on("error", fail).end(JSON.stringify(body));
});

/** By what factor the worse mean NIS of a row is off, as the board counts. */
const factor = (row) => {
  const cell = row.results[row.subject];
  return Math.exp(Math.max(...[cell.nis_acc, cell.nis_mag].filter((v) => v !== null).map((v) => Math.abs(Math.log(v / 3)))));
};
const RANKS = ["consistent", "conservative", "overconfident"];
const rank = (row) => { const at = RANKS.indexOf(row.results[row.subject].verdict); return at < 0 ? 3 : at; };

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const { page } = view;
  const say = (...messages) => page.evaluate((all) => new Promise((done) => {
    const socket = new WebSocket(`ws://${location.host}/api/ws`);
    socket.onopen = () => { for (const one of all) socket.send(JSON.stringify(one)); socket.close(); done(); };
  }), messages);
  const cell = (name) => page.locator(".cell", { has: page.locator("b", { hasText: new RegExp(`^${name}$`) }) });
  const stateOf = async (name) => cell(name).locator(".cell-state").getAttribute("data-state");

  assert.equal(await batch(lab, "ada", "Ada's phone"), 200);
  await say(...[1, 2, 3].map((seed) => ({ type: "virtual_phone", action: "add", motion: "rest", seed })));
  await until("three phones", async () => (await lab.status()).devices.filter((d) => d.delivers && d.source === "virtual").length === 3);
  await say(...["Zoe", "Anna 10", "Anna 2"].map((name, i) => ({ type: "rename", device: `virtual-${i + 1}`, name })));
  await page.getByRole("button", { name: "Wall" }).click();

  await test("boxes stand in the order of names, with lamps, state, and angles with labels and units", async () => {
    const names = ["Ada's phone", "Anna 2", "Anna 10", "Zoe"];
    await until("the order", async () => JSON.stringify(await page.locator(".cell .pick").allTextContents()) === JSON.stringify(names));
    for (const name of names.slice(1)) {
      await until("its lamps", async () => (await cell(name).locator(".cell-lamps .lamp").count()) >= 2);
      assert.match(await cell(name).locator(".cell-lamps .spoken").first().textContent(), /^Accelerometer: ./);
      assert.deepEqual(await cell(name).locator("dt").allTextContents(), ["yaw", "pitch", "roll"]);
      // Lamps may come before the first estimate.
      await until("its angles", async () => {
        const angles = await cell(name).locator("dd").allTextContents();
        return angles.length === 3 && angles.every((text) => /^−?\d+°$/.test(text));
      });
      await until("its rest", async () => (await stateOf(name)) === "rests");
      assert.match(await cell(name).locator(".cell-state").textContent(), /^At rest.*not calibrated$/);
    }
  });

  await test("a phone that is gone says since when, and the time goes on", async () => {
    await until("the loss", async () => (await stateOf("Ada's phone")) === "lost");
    const seconds = async () => Number(/^Connection lost for (\d+) s/.exec(await cell("Ada's phone").locator(".cell-state").textContent())?.[1]);
    const first = await until("the seconds", seconds);
    await until("more of them", async () => (await seconds()) > first + 1);
    const { silent_s } = await lab.device("Ada's phone");
    assert.ok(Math.abs(silent_s - (await seconds())) < 3, `${silent_s}`);
    // Its lamps do not stay green.
    for (const lamp of await cell("Ada's phone").locator(".cell-lamps .lamp").all()) assert.match(await lamp.getAttribute("class"), /idle/);
  });

  await test("calibrate all: each counts down, and the one that is gone refuses in words", async () => {
    await page.locator(".orders input[type=number]").first().fill("6");
    await page.getByRole("button", { name: "Calibrate all" }).click();
    await page.locator(".told li").waitFor();
    assert.match(await page.locator(".told p").textContent(), /^3 calibrate\. 1 did not:/);
    assert.equal(await page.locator(".told li").count(), 1);
    assert.match(await page.locator(".told li[data-refused=ada]").textContent(), /^Ada's phone It has stopped sending\. Nothing for \d+ s\./);
    const left = async () => Number(/^Calibrating, (\d+) s left/.exec(await cell("Zoe").locator(".cell-state").textContent())?.[1]);
    const first = await until("the countdown", left, 15);
    await until("less of it", async () => (await stateOf("Zoe")) !== "calibrates" || (await left()) < first);
    await until("all", async () => (await lab.status()).devices.filter((d) => d.is_calibrated).length === 3);
    assert.equal((await lab.device("Ada's phone")).is_calibrated, false);
    await until("the word", async () => /At rest.*calibrated/.test(await cell("Zoe").locator(".cell-state").textContent()));
  });

  await test("start all: each counts down, and the board ranks by consistency", async () => {
    // One states ten times the noise that there is: its error is as small as the others', its NIS is not what it should be.
    const { settings } = await lab.device("Anna 2");
    await say({ type: "settings", device: "virtual-3", settings: { accelerometer_std: 10 * settings.accelerometer_std } });
    await page.locator(".orders input[type=number]").nth(1).fill("8");
    await page.locator(".orders input[type=text]").fill("Together");
    await page.getByRole("button", { name: "Start all" }).click();
    await until("the answer", async () => /^3 began\. 1 did not:/.test(await page.locator(".told p").textContent()));
    await until("the countdown", async () => /^Experiment, \d+ s left/.test(await cell("Anna 10").locator(".cell-state").textContent()), 15);
    await view.picture("30-wall-experiment");
    await until("three places", async () => (await page.locator(".board tbody tr").count()) === 3, 60);
    const { experiments } = await lab.status();
    assert.deepEqual(experiments.map((row) => row.name), ["Together", "Together", "Together"]);
    const expected = [...experiments].sort((a, b) => rank(a) - rank(b) || factor(a) - factor(b)).map((row) => row.device_id);
    const shown = await page.locator(".board tbody tr").evaluateAll((rows) => rows.map((row) => row.dataset.standing));
    assert.deepEqual(shown, expected);
    const off = experiments.find((row) => row.device_id === "virtual-3");
    assert.ok(factor(off) > 10, `its NIS is off by ${factor(off)}`);
    const told = await page.locator(".board tr[data-standing=virtual-3]").textContent();
    assert.match(told, /÷ \d\d/, told);
    assert.deepEqual((await page.locator(".board .tag").allTextContents()).filter((text) => !/^(Consistent|Conservative|Overconfident|no verdict)$/.test(text.trim())), []);
    await until("the word", async () => (await stateOf("Zoe")) === "done");
    await view.picture("31-wall-results");
    // A name leads to its result.
    await page.locator(".board").getByRole("button", { name: "Zoe" }).click();
    await page.locator(".panel h3", { hasText: "Together" }).waitFor();
    await page.getByRole("button", { name: "Wall" }).click();
  });

  await test("stop all ends what is under way", async () => {
    await page.locator(".orders input[type=number]").nth(1).fill("300");
    await page.getByRole("button", { name: "Start all" }).click();
    await until("three", async () => (await lab.status()).devices.filter((d) => d.is_experimenting).length === 3);
    await page.getByRole("button", { name: "Stop all" }).click();
    await until("none", async () => (await lab.status()).devices.every((d) => !d.is_experimenting));
    await until("told", async () => /^4 stopped\./.test(await page.locator(".told p").textContent()));
  });

  await test("the page had nothing to complain about", () => assert.deepEqual(view.complaints, []));
}, 400);
