// The panels beside the path, in a real browser, against what is known about the virtual phones.
//
// | of the issue | test |
// |---|---|
// | magnetometer calibration with live coverage sphere and ellipsoid fit | a magnetised phone is calibrated while it turns |
// | Allan deviation explained in words, able to fill Q | a rest gives the gyroscope's noise and fills Q |
// | any other estimator, and the angle to it | every estimator can be chosen |
// | hard iron, field quality and rest as they develop | hard iron, field and rest are shown |
// | display rate never slows the estimate | at five frames a second every innovation is drawn |
// | calculated against estimated error quaternion | the error quaternions turn by the errors |
// | results of each phone | each phone shows its own result |
// | a device that went | a removed phone is gone |
import assert from "node:assert/strict";
import { launch, suite, test, until } from "./browser.mjs";
import { numberIn, openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";

const HARD_IRON = [25, -14, 30];
/** The virtual phone's gyroscope: 0.005 rad/s a sample at 100 Hz. */
const NOISE_DENSITY = 5e-4;

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const { page } = view;
  const add = async (number, motion, magnetised = false) => {
    await view.step("Connect");
    await page.locator(".virtual select").first().selectOption(motion);
    await page.locator(".virtual input[type=checkbox]").setChecked(magnetised);
    await page.getByRole("button", { name: "Add a virtual phone" }).click();
    await page.locator("aside .pick", { hasText: `Virtual phone ${number}` }).waitFor();
  };
  const part = async (name) => {
    await view.step("Calibrate");
    await page.locator(".segments button", { hasText: name }).click();
  };
  const button = (name) => page.locator(".panel").getByRole("button", { name, exact: true });

  await add(1, "rest");
  await view.pick("Virtual phone 1");

  await test("a rest that is too short is refused in words, and goes on being offered", async () => {
    await part("Noise (Allan)");
    await page.locator(".panel input[type=range]").fill("2");
    await button("Record a rest").click();
    await until("a second of the two minutes", async () => (await page.locator(".panel progress").getAttribute("value")) > 0.01);
    await button("Stop and analyse").click();
    await page.locator(".panel .verdict.warn", { hasText: "too short" }).or(page.locator(".panel .verdict.warn", { hasText: "Too short" })).waitFor();
    assert.match(await page.locator(".panel .verdict.warn", { hasText: /short/ }).textContent(), /ten minutes/);
    // The rest for the analysis below, meanwhile; longer than all that comes between.
    await page.locator(".panel input[type=range]").fill("10");
    await button("Record a rest").click();
    await page.locator(".panel progress").waitFor();
  });
  const restBegan = performance.now();

  await add(2, "tumble", true);
  await view.pick("Virtual phone 2");

  await test("a magnetised phone is calibrated while it turns", async () => {
    await part("Magnetometer");
    await button("Start turning").click();
    await page.locator(".hint").waitFor();
    const share = async () => numberIn(await page.locator(".coverage output").textContent());
    // It rests for ten seconds, then turns.
    await until("half of the sphere", async () => (await share()) > 50, 60);
    assert.match(await page.locator(".hint").textContent(), /^Turn it so that its .* points? (down|up)\.$/);
    await view.picture("3b-magnetometer");
    await page.locator(".panel .verdict.good").waitFor();
    await button("Finish").click();
    await page.locator(".panel a", { hasText: "TOML" }).waitFor();
    const found = (await page.locator("tr[data-value=hard-iron] td").allTextContents()).map(numberIn);
    found.forEach((value, i) => assert.ok(Math.abs(value - HARD_IRON[i]) < 1, `hard iron ${found}`));
    const file = await fetch(new URL(await page.locator(".panel a", { hasText: "TOML" }).getAttribute("href"), lab.ready.lab));
    assert.match(await file.text(), /^hard_iron_ut = \[2[456]\./m);
    await button("Discard").click();
    await button("Start turning").waitFor();
    assert.equal((await lab.device("Virtual phone 2")).magnetometer, null);
  });

  await test("every estimator can be chosen, and the angle to it is shown", async () => {
    // At rest and not magnetised: they must agree.
    await view.pick("Virtual phone 1");
    await view.step("Q and R");
    const { estimators } = await lab.device("Virtual phone 1");
    assert.deepEqual(estimators, ["integration", "mekf"]);
    await page.locator("[data-estimator-choice=usque]").check();
    await page.locator("[data-estimator-choice=integration]").uncheck();
    await until("the choice", async () => (await lab.device("Virtual phone 1")).estimators.join() === "mekf,usque");
    await until("its ghost", async () => (await page.locator(".ghosts tr", { hasText: "USQUE" }).count()) === 1);
    await until("its angle", async () => (await view.angleTo("USQUE")) < 3);
    await until("the ghost of the other to go", async () => (await page.locator(".ghosts tr", { hasText: "Integration" }).count()) === 0);
    await view.pick("Virtual phone 2");
  });

  await test("hard iron, field and rest are shown as the bounded-velocity filter finds them", async () => {
    await view.pick("Virtual phone 1");
    const value = (name) => page.locator(`.surroundings tr[data-value=${name}] td`).textContent();
    await page.locator("[data-estimator-choice=bounded-velocity]").check();
    await until("a rest", async () => /^rests/.test(await value("motion")));
    assert.match(await value("iron"), /^not estimated/);
    assert.match(await value("field"), /^as expected, variance × 1\.\d$/);
    await page.locator("summary", { hasText: "All parameters" }).click();
    await page.locator(".fields label", { hasText: "bounded_initial_hard_iron_std_ut" }).locator("input").fill("5");
    await page.keyboard.press("Tab");
    await until("the hard iron", async () => /^[+−]\d+\.\d [+−]\d+\.\d [+−]\d+\.\d ±[0-5]\.\d µT$/.test(await value("iron")));
    await page.locator("summary", { hasText: "All parameters" }).click();
    await page.locator(".surroundings").scrollIntoViewIfNeeded();
    await view.picture("4b-surroundings");
    await view.pick("Virtual phone 2");
  });

  await test("at one frame in two hundred milliseconds every innovation is told", async () => {
    const told = await page.evaluate(
      () =>
        new Promise((done) => {
          const socket = new WebSocket(`ws://${location.host}/api/ws`);
          const stamps = [];
          let frames = 0;
          socket.onopen = () => socket.send(JSON.stringify({ type: "display_rate", hz: 5 }));
          socket.onmessage = ({ data }) => {
            const message = JSON.parse(data);
            if (message.type !== "frame" || message.device !== "virtual-2") return;
            frames++;
            for (const i of message.innovations) if (i.sensor === "magnetometer") stamps.push(i.t_s);
            if (frames < 16) return;
            socket.close();
            done({ frames, stamps });
          };
        }),
    );
    // 50 Hz: no stamp is missing between the first and the last, but for jitter.
    const gaps = told.stamps.slice(1).map((t, i) => t - told.stamps[i]);
    assert.ok(told.stamps.length > 100, `${told.stamps.length} innovations`);
    assert.ok(Math.max(...gaps) < 0.035, `a gap of ${Math.max(...gaps)} s`);
  });

  await test("text that is typed stays while data streams", async () => {
    const field = page.locator(".rename input");
    await field.click();
    await field.fill("");
    await field.pressSequentially("Left hand", { delay: 250 });
    assert.equal(await field.inputValue(), "Left hand");
    await field.press("Enter");
    await until("the name", async () => await lab.device("Left hand"));
  });

  await test("the error quaternions turn by the errors, and each phone shows its own result", async () => {
    await add(3, "rest");
    await view.pick("Virtual phone 3");
    await part("At rest");
    await view.calibrate();
    await view.experiment("Still", 10);
    await page.locator(".panel .final").waitFor({ timeout: 60_000 });
    for (const key of ["calculated", "estimated"]) {
      const cells = await page.locator(`td[data-quaternion=${key}]`).allTextContents();
      const [w, x, y, z, angle] = cells.map((text) => numberIn(text.replace("±", "")));
      const turned = (2 * Math.asin(Math.min(1, Math.hypot(x, y, z))) * 180) / Math.PI;
      assert.ok(Math.abs(Math.hypot(w, x, y, z) - 1) < 2e-4, cells.join());
      assert.ok(Math.abs(turned - angle) < 0.03, `${turned}, shown as ${angle}`);
    }
    assert.match(await page.locator(".result").textContent(), /the same numbers as live/);
    await view.picture("7b-quaternions");
    await view.pick("Left hand");
    await page.locator(".panel", { hasText: "No experiment has ended yet" }).waitFor();
    await view.pick("Virtual phone 3");
    await page.locator(".panel h3", { hasText: "Still" }).waitFor();
  });

  await test("a rest gives the gyroscope's noise and fills Q", async () => {
    await view.pick("Virtual phone 1");
    await part("Noise (Allan)");
    await until("70 seconds of rest", () => performance.now() - restBegan > 70_000, 90);
    await button("Stop and analyse").click();
    const row = page.locator("tr[data-value=noise]");
    await until("the noise", async () => Number(await row.getAttribute("data-number").catch(() => 0)) > 0);
    const found = Number(await row.getAttribute("data-number"));
    assert.ok(Math.abs(found / NOISE_DENSITY - 1) < 0.1, `${found} rad/s/sqrt(Hz)`);
    assert.match(await page.locator(".sentences.plain").last().textContent(), /White noise/);
    await page.locator(".plots.one canvas").first().waitFor();
    await view.picture("3c-allan");
    await button("Fill Q with this").click();
    await until("Q", async () => Math.abs((await lab.device("Virtual phone 1")).settings.gyroscope_noise_density / found - 1) < 1e-6);
  });

  await test("a removed phone is gone, its experiments stay", async () => {
    await view.pick("Virtual phone 3");
    await page.getByRole("button", { name: "Remove this device" }).click();
    await until("it to go", async () => !(await lab.device("Virtual phone 3")));
    await until("it to go from the page", async () => (await page.locator("aside .pick", { hasText: "Virtual phone 3" }).count()) === 0);
    assert.ok((await lab.status()).experiments.some((row) => row.name === "Still"));
  });

  await test("the page had nothing to complain about", () => assert.deepEqual(view.complaints, []));
}, 400);
