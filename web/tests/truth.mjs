// What the lab page says is so: of the estimator that runs, of the sensors that deliver, of a program that is there.
//
// | of the issue | test |
// |---|---|
// | lamps, innovations, NIS, result and table of the estimator that is the subject; no green beyond 5 sigma | only the paper's filter runs |
// | changing the subject resets the lamps; no covariance, nothing to judge | another subject begins anew |
// | no samples, no rest; nothing is begun without them | a phone that sends nothing |
// | time-outs with a reason, and Cancel | a calibration is cancelled; one whose samples stay away ends |
// | a compass has lamp, innovations, slider and switch | a phone without magnetometer |
// | a program that is gone or stands still greys everything out, and is back by itself | a program that is gone |
import assert from "node:assert/strict";
import { request } from "node:https";
import { atTheEnd, launch, suite, test, until } from "./browser.mjs";
import { numberIn, openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";
import { asInSafari, Hand, phone } from "./scripted_phone.mjs";

/** A batch of the phone page without a reading. */
const emptyBatch = (lab, seq) => new Promise((done, fail) => {
  const headers = { "content-type": "application/json", "x-northing-token": lab.token };
  const post = request({ host: "127.0.0.1", port: lab.port + 1, path: "/in", method: "POST", rejectUnauthorized: false, headers }, (response) => response.resume().on("end", () => done(response.statusCode)));
  const body = { v: 1, device: "locked-phone", name: "Locked", session: "s", seq, ua: "", platform: "", sent_ms: seq * 500, dm: [], gs: { a: [], g: [], m: [], q: [] }, do: [], events: [] };
  post.on("error", fail).end(JSON.stringify(body));
});

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const { page } = view;
  const lamps = () => page.locator(".lamps .lamp").evaluateAll((all) => all.map((one) => ({ sensor: one.dataset.lamp, tone: one.className.replace("lamp", "").trim(), text: one.querySelector("p").textContent, nis: one.querySelector(".nis").textContent })));
  const lampOf = async (sensor) => (await lamps()).find((one) => one.sensor === sensor);
  const choose = async (wanted) => {
    // The one that stays first: none at all cannot be.
    for (const name of wanted) await page.locator(`[data-estimator-choice=${name}]`).check();
    const boxes = page.locator("[data-estimator-choice]");
    for (let i = 0; i < (await boxes.count()); i++) {
      const name = await boxes.nth(i).getAttribute("data-estimator-choice");
      if (!wanted.includes(name)) await boxes.nth(i).uncheck();
    }
  };
  const send = (message) => page.evaluate((text) => new Promise((done) => {
    const socket = new WebSocket(`ws://${location.host}/api/ws`);
    socket.onopen = () => socket.send(text);
    socket.onmessage = ({ data }) => {
      const answer = JSON.parse(data);
      if (answer.type !== "error") return;
      socket.close();
      done(answer.text);
    };
  }), JSON.stringify(message));

  await test("only the paper's filter runs: lamps, NIS, innovations, result and table are about it", async () => {
    await page.getByRole("button", { name: "Add a virtual phone" }).click();
    await view.pick("Virtual phone 1");
    await view.step("Q and R");
    await choose(["mekf3"]);
    await until("the subject", async () => (await lab.device("Virtual phone 1")).subject === "mekf3");
    const first = await until("a NIS", async () => { const lamp = await lampOf("accelerometer"); return /\d/.test(lamp?.nis ?? "") && lamp; });
    await until("another NIS", async () => (await lampOf("accelerometer")).nis !== first.nis, 30);
    // Every innovation that the page is told is this filter's.
    const told = await page.evaluate(() => new Promise((done) => {
      const socket = new WebSocket(`ws://${location.host}/api/ws`);
      let innovations = 0, frames = 0;
      socket.onmessage = ({ data }) => {
        const message = JSON.parse(data);
        if (message.type !== "frame") return;
        innovations += message.innovations.length;
        if (++frames < 30) return;
        socket.close();
        done({ innovations, subject: message.subject, between: Object.keys(message.between_deg) });
      };
    }));
    assert.equal(told.subject, "mekf3");
    assert.ok(told.innovations > 30, `${told.innovations} innovations`);
    assert.ok(told.between.every((pair) => pair.startsWith("mekf3|") || !pair.includes("mekf3")), told.between.join());
    // Without magnetometer it turns away from the truth, and says so.
    await page.locator("[data-sensor=magnetometer]").uncheck();
    await until("its lamp to be grey", async () => (await lampOf("magnetometer")).tone === "idle");
    const far = await until("the truth outside 5 sigma", async () => { const truth = await lampOf("truth"); const sigma = numberIn(/, ([\d.]+) sigma/.exec(truth?.text ?? "")?.[1] ?? "0"); return sigma > 6 && truth; }, 120);
    assert.match(far.text, /deg from the truth, [\d.]+ sigma/);
    const now = await lamps();
    assert.deepEqual(now.filter((lamp) => lamp.tone === "good"), [], "no lamp is green");
    await view.picture("10-subject-far");
    await view.experiment("Paper", 10);
    const row = await view.ended("Paper");
    assert.equal(row.subject, "mekf3");
    await view.step("Result");
    await page.locator(".panel [data-subject=mekf3]").waitFor();
    await page.getByRole("tab", { name: "Experiments" }).click();
    assert.match(await page.locator(".experiments tbody tr", { hasText: "Paper" }).textContent(), /MEKF, no bias/);
    const first_row = await page.locator(".panel .results tbody tr").first().getAttribute("data-estimator");
    assert.equal(first_row, "mekf3");
    await view.picture("11-subject-result");
  }, 240);

  await test("another subject begins anew, and without a covariance there is nothing to judge", async () => {
    await view.step("Q and R");
    await page.getByRole("tab", { name: "Live" }).click();
    await page.locator("[data-sensor=magnetometer]").check();
    await choose(["integration", "mekf", "mekf3"]);
    await page.locator(".subject select").selectOption("integration");
    await until("the choice", async () => (await lab.device("Virtual phone 1")).subject === "integration");
    await until("nothing to judge", async () => (await lamps()).every((lamp) => lamp.tone === "idle" && /No covariance: nothing to judge/.test(lamp.text)));
    await view.picture("12-no-covariance");
    await page.locator(".subject select").selectOption("mekf");
    await until("lamps of another one", async () => /\d/.test((await lampOf("accelerometer")).nis));
    assert.match(await page.locator(".ghosts thead").textContent(), /to MEKF/);
  });

  await test("a phone that sends nothing neither rests, nor is calibrated, nor begins an experiment", async () => {
    let seq = 0;
    assert.equal(await emptyBatch(lab, seq++), 200);
    const sending = setInterval(() => emptyBatch(lab, seq++).catch(() => undefined), 500);
    atTheEnd(() => clearInterval(sending));
    await view.pick("Locked");
    await view.step("Place");
    await page.locator("[data-stillness=nothing]").waitFor();
    assert.match(await page.locator("[data-stillness=nothing]").textContent(), /Nothing received.*sensors give no readings.*Unlock the phone/);
    assert.equal(await page.locator(".panel .verdict.good").count(), 0);
    assert.ok(await page.locator(".panel button", { hasText: "Next: calibrate" }).isDisabled());
    await view.picture("13-nothing-received");
    await view.step("Calibrate");
    assert.ok(await page.locator(".panel button", { hasText: /^Calibrate$/ }).isDisabled());
    await view.step("Experiment");
    assert.ok(await page.locator(".panel button", { hasText: "Start the experiment" }).isDisabled());
    // Whoever asks the program itself is refused, too.
    for (const message of [{ type: "calibrate", device: "locked-phone", seconds: 5 }, { type: "experiment", device: "locked-phone", seconds: 5, name: "" }]) {
      assert.match(await send(message), /^Nothing received: no gyroscope sample/);
    }
    assert.deepEqual((await lamps()).filter((lamp) => lamp.tone !== "idle"), []);
    clearInterval(sending);
  });

  await test("a calibration is cancelled; one whose samples stay away ends with the reason", async () => {
    const finn = await phone(browser, lab.phoneUrl(), new Hand());
    await finn.start("Finn");
    await until("samples", async () => (await lab.device("Finn"))?.received > 200);
    await view.pick("Finn");
    await view.step("Calibrate");
    const begin = page.locator(".panel button", { hasText: /^Calibrate( again)?$/ });
    await page.locator(".panel input[type=range]").first().fill("60");
    await begin.click();
    await until("it", async () => (await lab.device("Finn")).is_calibrating);
    await page.locator(".panel button", { hasText: "Cancel" }).click();
    await until("its end", async () => !(await lab.device("Finn")).is_calibrating);
    await begin.waitFor();
    await begin.click();
    await until("a second of it", async () => (await page.locator(".panel progress").getAttribute("value")) > 0.01);
    await finn.still();
    await page.locator("[data-stillness=nothing]").waitFor();
    assert.match(await page.locator("[data-stillness=nothing]").textContent(), /its sensors have stopped/);
    await page.locator(".lamps .lamp.idle").first().waitFor();
    assert.deepEqual((await lamps()).filter((lamp) => lamp.tone !== "idle"), [], "nothing is green without samples");
    await view.picture("14-samples-stopped");
    const verdict = page.locator(".panel .verdict[role=status]", { hasText: "Refused" });
    await verdict.waitFor({ timeout: 30_000 });
    assert.match(await verdict.textContent(), /No gyroscope sample came for 1\d s/);
    assert.equal((await lab.device("Finn")).is_calibrating, false);
    await finn.close();
  });

  await test("a phone without magnetometer: its compass has lamp, innovations, slider and switch", async () => {
    const cleo = await phone(browser, lab.phoneUrl(), new Hand(), { init: asInSafari });
    await cleo.start("Cleo");
    await until("samples", async () => (await lab.device("Cleo"))?.received > 300);
    await view.pick("Cleo");
    await view.step("Q and R");
    // Its system tells an orientation that changes.
    let to = 0;
    const turning = setInterval(() => cleo.hand.turn((to = 25 - to), 1.5), 2000);
    atTheEnd(() => clearInterval(turning));
    await until("its lamp", async () => /\d/.test((await lampOf("compass-heading"))?.nis ?? ""));
    assert.equal(await lampOf("magnetometer"), undefined);
    assert.doesNotMatch((await lampOf("compass-heading")).text, /your|compass-heading/i);
    assert.ok(await page.locator("input[data-parameter=compass_std]").isEnabled());
    assert.ok(await page.locator("input[data-parameter=magnetometer_std_ut]").isDisabled());
    const box = (sensor) => page.locator(`input[data-sensor=${sensor}]`);
    assert.ok(await box("magnetometer").isDisabled());
    assert.match(await page.locator(".toggles").textContent(), /Magnetometer: this browser gives none/);
    assert.ok(await box("compass-heading").isChecked());
    await page.locator(".choice button", { hasText: "compass" }).click();
    await page.locator(".chart figcaption", { hasText: "Innovation of the heading" }).waitFor();
    await view.picture("15-compass");
    const std = await page.locator("input[data-parameter=compass_std]").inputValue();
    await page.locator("input[data-parameter=compass_std]").fill(String(Number(std) - 0.5));
    await until("another R", async () => (await lab.device("Cleo")).settings.compass_std < 0.9 * 10 ** Number(std));
    await box("compass-heading").uncheck();
    await until("it to be off", async () => (await lab.device("Cleo")).use.compass === false);
    await until("its lamp to be grey", async () => { const lamp = await lampOf("compass-heading"); return lamp.tone === "idle" && /Switched off/.test(lamp.text); });
    await box("compass-heading").check();
    await until("it to be on", async () => (await lab.device("Cleo")).use.compass === true);
    clearInterval(turning);
    await cleo.close();
  });

  await test("a program that stands still or is gone greys everything out, and is back by itself", async () => {
    await view.pick("Virtual phone 1");
    const old = page.locator("main.old");
    const notice = page.locator(".notice", { hasText: /^Connection lost since \d+ s; what you see is old/ });
    const grey = async () => {
      await old.waitFor();
      await notice.waitFor();
      assert.deepEqual((await lamps()).filter((lamp) => lamp.tone !== "idle"), []);
      assert.match(await page.locator(".recording").getAttribute("class"), /idle/);
      const seconds = async () => Number(/since (\d+) s/.exec(await notice.textContent())[1]);
      const first = await seconds();
      await until("the seconds to go on", async () => (await seconds()) > first);
    };
    lab.freeze();
    await grey();
    await view.picture("16-connection-lost");
    lab.thaw();
    await until("it to be back", async () => (await old.count()) === 0 && (await page.locator(".notice").count()) === 0);
    await until("lamps that live", async () => (await lamps()).some((lamp) => lamp.tone !== "idle"));
    await lab.kill();
    await grey();
    const again = await startLab({ port: lab.port });
    await until("it to be back", async () => (await old.count()) === 0, 30);
    await page.getByRole("button", { name: "Add a virtual phone" }).or(page.getByRole("button", { name: "connect a phone" })).first().waitFor();
    assert.deepEqual((await again.status()).devices, []);
  });
}, 700);
