// The lab page on a virtual phone, whose truth is known, in a real browser.
//
// | of the issue | test |
// |---|---|
// | works with no phone at hand, one click away | a virtual phone is calibrated at rest |
// | no layout shift while data streams, small laptop | nothing moves on the page |
// | keyboard reachable | every control can be reached |
// | numbers on the page against the script's truth | an experiment ends with numbers that fit the truth |
// | files of an experiment | the same |
// | what-if at once, and back | what-if runs the recording again |
// | what-if with worse samples, sensors on or off | what-if with worse samples |
// | wall | the wall shows every device |
// | nothing fetched from elsewhere | the page asks nobody else |
import assert from "node:assert/strict";
import { launch, picture, suite, test, until } from "./browser.mjs";
import { numberIn, openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const { page } = view;
  const foreign = [];
  page.on("request", (request) => new URL(request.url()).host === new URL(lab.ready.lab).host || request.url().startsWith("data:") || foreign.push(request.url()));

  await test("the page opens with QR code and addresses", async () => {
    await page.locator(".qr img").waitFor();
    await until("the QR code", () => page.locator(".qr img").evaluate((img) => img.complete && img.naturalWidth > 0));
    assert.match(await page.locator("code.url").first().textContent(), /^https:.*#t=/);
    await view.picture("1-empty");
  });

  await test("a virtual phone is calibrated at rest", async () => {
    await page.getByRole("button", { name: "Add a virtual phone" }).click();
    await page.locator("aside .pick", { hasText: "Virtual phone 1" }).waitFor();
    await view.calibrate();
    const force = await view.atRest("Specific force");
    const length = Math.hypot(...force);
    assert.ok(Math.abs(length - 9.81) < 0.15, `gravity ${length}`);
    await view.picture("3-calibration");
  });

  await test("nothing moves on the page while data streams, and nothing overflows", async () => {
    await view.step("Q and R");
    await until("the plots", async () => (await page.locator(".lower canvas").count()) >= 2);
    const drawn = async () => (await lab.device("Virtual phone 1")).received;
    const enough = (await drawn()) + 900;
    await page.evaluate(() => {
      window.shifted = 0;
      new PerformanceObserver((list) => { for (const entry of list.getEntries()) window.shifted += entry.value; }).observe({ type: "layout-shift" });
    });
    await until("three seconds of samples", async () => (await drawn()) > enough);
    const shifted = await page.evaluate(() => window.shifted);
    assert.ok(shifted < 0.002, `layout shift ${shifted}`);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth && document.documentElement.scrollHeight <= innerHeight));
    await view.picture("4-q-and-r");
  });

  await test("every control can be reached with the keyboard", async () => {
    await page.keyboard.press("1");
    await page.locator(".panel h2", { hasText: "Connect" }).waitFor();
    const count = await page.locator("button:not([disabled]):visible, input:visible, select:visible, summary:visible").count();
    const seen = new Set();
    for (let i = 0; i < count + 8; i++) {
      await page.keyboard.press("Tab");
      seen.add(await page.evaluate(() => [...document.querySelectorAll("*")].indexOf(document.activeElement)));
    }
    assert.ok(seen.size >= count, `${seen.size} of ${count}`);
  });

  await test("an experiment ends with numbers that fit the truth", async () => {
    await view.pick("Virtual phone 1");
    // The script of 75 s: it rests from 70 s until 10 s into the next round. From there a whole
    // round comes back to where it began.
    await until("the next rest", async () => {
      const phase = (await lab.device("Virtual phone 1")).duration_s % 75;
      return phase > 71 || phase < 6;
    }, 90);
    await view.experiment("First", 75);
    const { received } = await lab.device("Virtual phone 1");
    await until("motion", async () => (await lab.device("Virtual phone 1")).received > received + 6000, 90);
    const angle = await view.angleTo("Truth");
    assert.ok(angle < 3, `${angle} degrees from the truth`);
    await view.picture("5-experiment");
    const row = await view.ended("First");
    await view.step("Result");
    await page.locator(".panel .final").waitFor();
    await view.picture("7-result");
    assert.equal(await view.shown("mekf", "calculated"), Number(row.results.mekf.calculated_error_deg.toFixed(2)));
    assert.equal(await view.shown("mekf", "estimated"), Number(row.results.mekf.estimated_error_deg.toFixed(2)));
    assert.ok((await view.shown("mekf", "rms")) < 2, "RMS error against the truth");
    assert.ok((await view.shown("mekf", "calculated")) < 2, "the script ends where it began");
    assert.notEqual(await page.locator(".final [data-verdict]").getAttribute("data-verdict"), "none");
    for (const [file, start] of [["report.html", "<!doctype html>"], ["recording.csv", ""], ["estimates.tum", ""]]) {
      const response = await fetch(new URL(`/api/experiments/${row.id}/${file}`, lab.ready.lab));
      assert.equal(response.status, 200, file);
      const text = await response.text();
      assert.ok(text.length > 1000 && text.toLowerCase().startsWith(start), file);
    }
  }, 230);

  await test("what-if runs the recording again at once, and back again", async () => {
    await view.step("What if?");
    const row = (await lab.status()).experiments.find((r) => r.name === "First");
    await page.locator(".panel tr[data-estimator=mekf] [data-value=calculated]").waitFor();
    assert.equal(await view.shown("mekf", "calculated"), Number(row.results.mekf.calculated_error_deg.toFixed(2)), "the same numbers give the same result");
    const nis = page.locator(".panel tr[data-estimator=mekf] td").last();
    const before = await nis.textContent();
    // Calibrated, R is the simulated sensor's own noise and the NIS about 3; with 1 m/s^2 it is far too small.
    assert.ok(numberIn(before) > 1 && numberIn(before) < 10, before);
    await page.locator("input[data-parameter=accelerometer_std]").fill("0");
    await until("a NIS far too small", async () => numberIn(await nis.textContent()) < 0.5);
    await page.locator(".what-if-plots .chart").nth(2).waitFor();
    await view.picture("8-what-if");
    await page.getByRole("button", { name: "Back to the numbers" }).click();
    await until("the NIS of before", async () => (await nis.textContent()) === before);
  });

  await test("Q and R are fitted to the recording: an R that was far off comes back", async () => {
    const slider = page.locator(".panel input[data-parameter=accelerometer_std]"), nis = page.locator(".panel tr[data-estimator=mekf] td").last();
    await slider.fill("0");
    await until("a NIS far too small", async () => numberIn(await nis.textContent()) < 0.5);
    await page.getByRole("button", { name: "Fit Q and R to this recording" }).click();
    await page.locator("[data-fit=running]").waitFor();
    await page.locator("[data-fit=done]").waitFor();
    const [before, after] = (await page.locator("[data-fitted=accelerometer_std] td").allTextContents()).map(numberIn);
    assert.ok(before === 1 && after > 0.01 && after < 0.3, `from ${before} to ${after} m/s^2`);
    await until("the slider to follow", async () => Math.abs(Number(await slider.inputValue()) - Math.log10(after)) < 0.03);
    await until("a NIS that fits", async () => numberIn(await nis.textContent()) > 1);
    await view.picture("8b-fitted");
    // A slider that is moved meanwhile ends the fit, and nothing is left of it.
    await page.getByRole("button", { name: "Fit Q and R to this recording" }).click();
    await slider.fill("0");
    await until("a NIS far too small", async () => numberIn(await nis.textContent()) < 0.5);
    assert.equal(await page.locator("[data-fit=running]").count(), 0);
    await page.getByRole("button", { name: "Back to the numbers" }).click();
    await until("the NIS of before", async () => numberIn(await nis.textContent()) > 1);
  });

  await test("what-if with worse samples and without a sensor: the effect stands beside the experiment as it was", async () => {
    const nis = page.locator(".panel tr[data-estimator=mekf] [data-value=nis]");
    const before = await nis.textContent();
    await page.locator("input[data-alteration=bump]").fill("15");
    await until("the bump in the NIS", async () => numberIn(await nis.textContent()) > 1.5 * numberIn(before));
    await page.locator(".panel caption", { hasText: "samples altered" }).waitFor();
    const chart = page.locator(".what-if-plots .chart", { hasText: "NIS of MEKF over time" });
    await chart.waitFor();
    assert.match(await chart.textContent(), /Accelerometer, as it was/);
    await view.picture("8b-what-if-worse-samples");
    await page.locator("input[data-what-if-sensor=accelerometer]").uncheck();
    await until("no NIS of the accelerometer", async () => (await nis.textContent()) === "–");
    await page.getByRole("button", { name: "Back to the numbers" }).click();
    await until("the NIS of before", async () => (await nis.textContent()) === before);
  });

  await test("the report opens in a browser, in light and dark, without asking anybody", async () => {
    const row = (await lab.status()).experiments.find((r) => r.name === "First");
    const context = await browser.newContext({ viewport: { width: 1280, height: 720 } });
    const report = await context.newPage();
    const asked = [];
    report.on("request", (request) => asked.push(request.url()));
    await report.goto(new URL(`/api/experiments/${row.id}/report.html`, lab.ready.lab).href);
    assert.match(await report.locator("body").textContent(), /First/);
    await picture(report, "report");
    assert.equal(asked.filter((url) => !url.startsWith("data:") && !url.includes("favicon")).length, 1, asked.join(" "));
    await context.close();
  });

  await test("the wall shows every device", async () => {
    await page.getByRole("button", { name: "Wall" }).click();
    assert.equal(await page.locator(".cell").count(), (await lab.status()).devices.length);
    await view.picture("9-wall");
  });

  await test("the page asks nobody else and had nothing to complain about", () => {
    assert.deepEqual(foreign, []);
    assert.deepEqual(view.complaints, []);
  });
}, 600);
