// Phones against the program itself, over TLS with its self-made certificate, in a real browser.
//
// | of the issue | test |
// |---|---|
// | scripted sensors (rest, motion, return), calibration, experiment, result, numbers against the script | a phone is calibrated, ...; its experiment ... |
// | two phones, each with its own experiment | two experiments at once |
// | lost connection and return without a lost sample | a network that goes away; a lab that stands still |
// | iOS path (WebSocket refused, opposite sign, seconds, tap, compass) | an iPhone |
// | two devices with one id | a second tab |
// | a sensor that stops in the middle | sensors that stop |
// | wrong token | a wrong token |
// | wrong Host, wrong Origin | a foreign name, a foreign page |
// | TLS 1.2 and 1.3, addresses in the certificate | the certificate |
import assert from "node:assert/strict";
import { readFileSync, statSync } from "node:fs";
import { request as httpRequest } from "node:http";
import { request as httpsRequest } from "node:https";
import { join } from "node:path";
import { X509Certificate } from "node:crypto";
import { connect } from "node:tls";
import { launch, picture, suite, test, until } from "./browser.mjs";
import { openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";
import { asInSafari, Hand, phone } from "./scripted_phone.mjs";

/** One request; the answer's status and text. */
const ask = (make, options, body = "") => new Promise((done, fail) => {
  const request = make(options, (response) => {
    let text = "";
    response.on("data", (part) => (text += part));
    response.on("end", () => done({ status: response.statusCode, text }));
  });
  request.on("error", fail).end(body);
});

/** Waits until the lab has every sample that the page's sensors gave, and none twice. */
async function allArrived(lab, name, device) {
  await device.still();
  const taken = await until("no more readings", async () => {
    const before = await device.taken();
    await device.page.waitForTimeout(300);
    return before === (await device.taken()) && before;
  });
  await until("the last batch", async () => (await device.fact("Waiting")) === "0");
  const row = await until(`${taken} samples of ${name}`, async () => {
    const row = await lab.device(name);
    return row.received === taken && row;
  }, 15).catch(async (error) => { throw new Error(`${error.message}: there are ${(await lab.device(name)).received}`); });
  assert.deepEqual([row.lost, row.refused, row.late], [0, 0, 0], "lost, refused, late");
}

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const { page } = view;
  // The gyroscope's own error, a multiple of the browser's rounding.
  const anna = await phone(browser, lab.phoneUrl(), new Hand([0, 0, (0.5 * Math.PI) / 180]));
  const ben = await phone(browser, lab.phoneUrl(), new Hand());

  await test("a phone is calibrated: the bias and gravity of its script", async () => {
    await anna.start("Anna");
    await ben.start("Ben");
    await until("Sending", async () => (await anna.state()).startsWith("Sending") && (await ben.state()).startsWith("Sending"));
    await until("both in the list", async () => (await page.locator("aside .pick").count()) === 2);
    await view.picture("2-devices");
    await view.pick("Anna");
    const said = until("the request to hold still", async () => /do not touch the phone/.test(await anna.said()));
    await view.calibrate();
    await said;
    const bias = await view.atRest("Gyroscope bias");
    [0, 0, 0.5].forEach((truth, i) => assert.ok(Math.abs(bias[i] - truth) < 0.08, `bias ${bias}`));
    const force = await view.atRest("Specific force");
    [0, 0, 9.81].forEach((truth, i) => assert.ok(Math.abs(force[i] - truth) < 0.08, `force ${force}`));
    const field = await view.atRest("Magnetic field");
    [0, 22, -42].forEach((truth, i) => assert.ok(Math.abs(field[i] - truth) < 0.3, `field ${field}`));
    assert.match(await anna.page.locator("#foot").textContent(), /Coarse mode/);
    await picture(anna.page, "phone-coarse");
    await view.pick("Ben");
    await view.calibrate();
  });

  await test("two experiments at once: one phone turns and comes back, the other rests undisturbed", async () => {
    await view.pick("Ben");
    await view.experiment("Ben rests", 25);
    await view.pick("Anna");
    // Long enough for a busy computer; it is ended by hand.
    await view.experiment("Anna turns", 180);
    const rested_s = async () => 180 - ((await lab.device("Anna")).under_way?.remaining_s ?? 180);
    assert.match(await until("what to do", async () => { const said = await anna.said(); return /Experiment/.test(said) && said; }), /move the phone/);
    await picture(anna.page, "phone-experiment");
    await until("three seconds of rest", async () => (await rested_s()) > 3);
    anna.hand.turn(60, 3);
    await until("the turn", () => anna.hand.rests);
    // What the page shows is what the hand did.
    await until("60 degrees on the page", async () => Math.abs((await view.tilt()) - anna.hand.degrees) < 2, 10);
    const [, pitch, roll] = await view.angles();
    assert.ok(Math.abs(pitch - 60) < 2 && Math.abs(roll) < 2, `pitch ${pitch}, roll ${roll}`);
    await view.picture("5-phone-turned");
    anna.hand.turn(0, 3);
    await until("the return", () => anna.hand.rests);
    const back = await rested_s();
    await until("five seconds of rest", async () => (await rested_s()) > back + 5);
    await page.getByRole("button", { name: "Stop now" }).click();
    const turned = await view.ended("Anna turns");
    const rested = await view.ended("Ben rests");
    assert.ok(turned.results.mekf.calculated_error_deg < 1.5, `back at the start: ${turned.results.mekf.calculated_error_deg}`);
    assert.ok(rested.results.mekf.calculated_error_deg < 0.5, `never moved: ${rested.results.mekf.calculated_error_deg}`);
    await view.step("Result");
    await page.locator(".panel .final").waitFor();
    assert.equal(await view.shown("mekf", "calculated"), Number(turned.results.mekf.calculated_error_deg.toFixed(2)));
    assert.equal(await view.shown("mekf", "estimated"), Number(turned.results.mekf.estimated_error_deg.toFixed(2)));
    await page.getByRole("tab", { name: "Experiments" }).click();
    for (const name of ["Anna turns", "Ben rests"]) await page.locator(".experiments th", { hasText: name }).waitFor();
    await view.picture("7-two-experiments");
  });

  await test("what-if on the phone's recording: the same numbers, and others", async () => {
    await view.step("What if?");
    const row = await view.ended("Anna turns");
    await page.locator(".panel tr[data-estimator=mekf] [data-value=calculated]").waitFor();
    assert.equal(await view.shown("mekf", "calculated"), Number(row.results.mekf.calculated_error_deg.toFixed(2)));
    const nis = () => page.locator(".panel tr[data-estimator=mekf] td").last().textContent();
    const before = await nis();
    await page.locator("input[data-parameter=accelerometer_std]").fill("0");
    await until("another NIS", async () => (await nis()) !== before);
  });

  await test("a network that goes away and comes back loses no sample", async () => {
    const before = (await lab.device("Anna")).received;
    await anna.page.context().setOffline(true);
    const taken = await anna.taken();
    await until("four seconds of readings", async () => (await anna.taken()) > taken + 300);
    await anna.page.context().setOffline(false);
    await until("the state", async () => (await anna.state()).startsWith("Sending"));
    await until("the backlog", async () => (await lab.device("Anna")).received > before + 300);
    assert.equal((await lab.device("Anna")).lost, 0);
  });

  await test("a lab that stands still for seconds gets every sample when it goes on", async () => {
    const taken = await anna.taken();
    lab.freeze();
    await until("the page to notice", async () => !(await anna.state()).startsWith("Sending"));
    await picture(anna.page, "phone-lost-connection");
    await until("some more readings", async () => (await anna.taken()) > taken + 300);
    lab.thaw();
    await until("the state", async () => (await anna.state()).startsWith("Sending"));
    await allArrived(lab, "Anna", anna);
    await allArrived(lab, "Ben", ben);
  });

  await test("sensors that stop in the middle show as such on the phone", async () => {
    // Both stand still now: their pages live, their sensors give nothing.
    for (const device of [anna, ben]) await until("the phone's own words", async () => /Gyroscope0 Hz/.test(await device.page.locator("#sensors").textContent()));
    await anna.close();
    await ben.close();
  });

  await test("an iPhone: tap, opposite sign, no WebSocket, compass", async () => {
    const cleo = await phone(browser, lab.phoneUrl(), new Hand(), { init: asInSafari });
    await cleo.start("Cleo");
    await until("Sending", async () => (await cleo.state()).startsWith("Sending"));
    assert.deepEqual(await cleo.page.evaluate(() => window.northingAsked), ["DeviceMotionEvent", "DeviceOrientationEvent"]);
    await until("samples", async () => (await lab.device("Cleo"))?.received > 200);
    assert.match(await cleo.page.locator("#link").textContent(), /POST/);
    assert.match(await cleo.page.locator("#sensors").textContent(), /motion events/);
    assert.match(await cleo.page.locator("#sensors").textContent(), /compass 0°/);
    await picture(cleo.page, "phone-iphone");
    await view.pick("Cleo");
    await view.calibrate();
    const force = await view.atRest("Specific force");
    assert.ok(Math.abs(force[2] - 9.81) < 0.08, `up is up: ${force}`);
    cleo.hand.turn(60, 3);
    await until("60 degrees on the page", async () => Math.abs((await view.tilt()) - 60) < 2.5);
    const row = await lab.device("Cleo");
    assert.deepEqual([row.lost, row.refused], [0, 0]);
    await cleo.close();
  });

  await test("a second tab is a device of its own, and its person is told", async () => {
    const dora = await phone(browser, lab.phoneUrl());
    await dora.start("Dora");
    await until("Dora", async () => (await lab.device("Dora"))?.received > 50);
    const id = await dora.page.evaluate(() => localStorage.getItem("northing-device"));
    const copy = await phone(browser, lab.phoneUrl(), new Hand(), { init: `localStorage.setItem("northing-device", ${JSON.stringify(id)})` });
    await copy.start("Dora's copy");
    await until("what the copy is told", async () => /device of its own/.test(await copy.said()));
    await until("both", async () => (await lab.device("Dora"))?.received > 200 && (await lab.device("Dora's copy"))?.received > 100);
    await dora.close();
    await copy.close();
  });

  await test("a wrong token gets nothing in, and the phone says what to do", async () => {
    const { devices } = await lab.status();
    const stranger = await phone(browser, lab.phoneUrl("wrong"));
    await stranger.start();
    await until("the refusal", async () => /does not know this code/.test(await stranger.detail()));
    await picture(stranger.page, "phone-wrong-token");
    assert.equal((await lab.status()).devices.length, devices.length);
    await stranger.close();
  });

  await test("a foreign name, a foreign page: refused in words on every listener", async () => {
    const listeners = [[httpRequest, lab.port, "/api/status", "GET"], [httpsRequest, lab.port + 1, "/in", "POST"], [httpRequest, lab.port + 2, `/in/${lab.token}`, "POST"]];
    for (const [make, port, path, method] of listeners) {
      const options = { host: "127.0.0.1", port, path, method, rejectUnauthorized: false };
      for (const host of ["evil.example", `evil.example:${port}`, `127.0.0.1:${port}.evil.example`]) {
        const { status, text } = await ask(make, { ...options, headers: { host } });
        assert.equal(status, 403, `${port} ${host}`);
        assert.match(text, /not one of the lab's/);
      }
      // Apps send whatever origin they like; pages may not.
      if (path.startsWith("/in/")) continue;
      for (const origin of ["https://evil.example", "null", `http://127.0.0.1:${port + 5}`]) {
        const { status, text } = await ask(make, { ...options, headers: { origin } });
        assert.equal(status, 403, `${port} ${origin}`);
        assert.match(text, /another page may not/);
      }
    }
    // A page of another origin in a real browser can neither read nor change anything.
    const context = await browser.newContext();
    const evil = await context.newPage();
    await evil.route("http://evil.example/", (route) => route.fulfill({ contentType: "text/html", body: "<title>evil</title>" }));
    await evil.goto("http://evil.example/");
    const tried = await evil.evaluate(async (base) => {
      const read = await fetch(`${base}api/status`).then(() => "read", () => "refused");
      const socket = await new Promise((done) => {
        const ws = new WebSocket(`${base.replace("http", "ws")}api/ws`);
        ws.onopen = () => done("open");
        ws.onerror = () => done("refused");
      });
      return [read, socket];
    }, lab.ready.lab);
    assert.deepEqual(tried, ["refused", "refused"]);
    await context.close();
  });

  await test("the certificate: short enough, names the addresses, for servers, TLS 1.2 and 1.3, key for the user alone", async () => {
    for (const version of ["TLSv1.2", "TLSv1.3"]) {
      const [protocol, der] = await new Promise((done, fail) => {
        const socket = connect({ host: "127.0.0.1", port: lab.port + 1, rejectUnauthorized: false, minVersion: version, maxVersion: version }, () => {
          done([socket.getProtocol(), socket.getPeerCertificate(true).raw]);
          socket.destroy();
        });
        socket.on("error", fail);
      });
      assert.equal(protocol, version);
      const certificate = new X509Certificate(der);
      const days = (Date.parse(certificate.validTo) - Date.parse(certificate.validFrom)) / 86_400_000;
      assert.ok(days <= 397, `${days} days`);
      const names = certificate.subjectAltName;
      assert.ok(names.includes("DNS:localhost") && names.includes("IP Address:127.0.0.1"), names);
      for (const url of lab.ready.phones) assert.ok(names.includes(`IP Address:${new URL(url).hostname}`), `${names} without ${url}`);
      // extendedKeyUsage, in older versions of Node the only name for it.
      assert.deepEqual(certificate.keyUsage, ["1.3.6.1.5.5.7.3.1"]);
      assert.equal(certificate.fingerprint256, lab.ready.fingerprint);
    }
    assert.equal(statSync(join(lab.folder, "key.pem")).mode & 0o777, 0o600);
    assert.match(readFileSync(join(lab.folder, "certificate.pem"), "utf8"), /BEGIN CERTIFICATE/);
  });

  await test("the lab page had nothing to complain about", () => assert.deepEqual(view.complaints, []));
}, 600);
