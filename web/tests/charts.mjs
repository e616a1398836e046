// Charts as instruments, in the lab and in reports, in a real browser.
//
// | of the issue | test |
// |---|---|
// | hover with values and time, links between plots, legend that switches curves | a chart is read, zoomed, switched |
// | pause, pan, scroll back over the whole session, and the 3-D view turns with it | scrubbing the time turns the phone |
// | PNG and CSV of what is shown, full screen, keyboard | what is shown is saved; the keyboard does all of it |
// | every estimator against the subject, bias with its bound, raw sensors, gain, P, NEES | every page of plots shows its curves |
// | Euler with its order, quaternion, axis and angle, gimbal lock | notations, and gimbal lock is said |
// | thirteen estimators: colours told apart, legend and lamps do not overlap | all estimators on |
// | reports carry the same component, in one file, with the picture for print; text legible at 390 px | a report is read on a phone |
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { picture, launch, suite, test, until, atTheEnd } from "./browser.mjs";
import { openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";

/** The chart of this id. */
const chart = (page, id) => page.locator(`[data-chart="${id}"]`);
const plot = (one) => one.locator(".u-over");
/** Numbers on the x axis of what a chart shows, read from uPlot's own scale through its CSV. */
async function csv(page, one) {
  const [download] = await Promise.all([page.waitForEvent("download"), one.locator("[data-tool=table]").click()]);
  const [head, ...lines] = readFileSync(await download.path(), "utf8").trim().split("\n");
  return { name: download.suggestedFilename(), head: head.match(/"[^"]*"|[^,]+/g).map((h) => h.replaceAll('"', "")), rows: lines.map((line) => line.split(",").map((v) => (v === "" ? null : Number(v)))) };
}

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const { page } = view;
  const sub = (name) => page.locator(".live-bar .segments button", { hasText: name }).click();

  await test("a chart is read under the pointer, with those linked to it", async () => {
    // One that tumbles all the while, for gimbal lock, and one that is looked at.
    await page.locator(".virtual select").first().selectOption("tumble");
    await page.getByRole("button", { name: "Add a virtual phone" }).click();
    await page.locator("aside .pick", { hasText: "Virtual phone 1" }).waitFor();
    await page.locator(".virtual select").first().selectOption("gentle");
    await page.getByRole("button", { name: "Add a virtual phone" }).click();
    await view.pick("Virtual phone 2");
    await view.step("Q and R");
    await until("some samples", async () => (await lab.device("Virtual phone 2")).duration_s > 14);
    await page.locator(".span-bar .hold").click();
    const angles = chart(page, "angles yaw-pitch-roll"), rate = chart(page, "rate");
    await plot(angles).hover({ position: { x: 120, y: 30 } });
    const read = angles.locator(".readout");
    await read.waitFor();
    const text = await read.innerText();
    assert.match(text, /^\d+\.\d{3} s/, text);
    assert.match(text, /yaw[\s\S]*−?\d[\d.]* ±\d/, text);
    assert.match(await rate.locator(".readout").innerText(), /^\d+\.\d{3} s[\s\S]*x[\s\S]*y[\s\S]*z/);
    // Both read the same time, and the axis says what it is.
    const at = async (one) => (await one.locator(".readout .at").textContent()).trim();
    assert.equal(await at(rate), await at(angles));
    await view.picture("20-chart-readout");
  });

  await test("zoom, pan and legend: all linked charts move, curves go and come", async () => {
    const angles = chart(page, "angles yaw-pitch-roll"), rate = chart(page, "rate");
    const span = async (one) => { const { rows } = await csv(page, one); return [rows[0][0], rows.at(-1)[0]]; };
    const before = await span(rate);
    const box = await plot(angles).boundingBox();
    await page.mouse.move(box.x + box.width * 0.3, box.y + 20);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width * 0.6, box.y + 20, { steps: 6 });
    await page.mouse.up();
    const zoomed = await span(rate);
    // Three tenths of the window, which the session of 14 s or more does not fill yet.
    assert.ok(zoomed[1] - zoomed[0] < 0.5 * (before[1] - before[0]), `${before} to ${zoomed}`);
    await page.keyboard.down("Shift");
    await page.mouse.move(box.x + box.width * 0.5, box.y + 20);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width * 0.9, box.y + 20, { steps: 6 });
    await page.mouse.up();
    await page.keyboard.up("Shift");
    const panned = await span(rate);
    assert.ok(panned[0] < zoomed[0] && Math.abs(panned[1] - panned[0] - (zoomed[1] - zoomed[0])) < 0.3, `${zoomed} to ${panned}`);
    const yaw = angles.locator(".key", { hasText: "yaw" });
    await yaw.click();
    assert.equal(await yaw.getAttribute("aria-pressed"), "false");
    assert.ok(!(await csv(page, angles)).head.some((h) => h.startsWith("yaw (") || h.startsWith("yaw +")));
    await yaw.click();
    assert.ok((await csv(page, angles)).head.some((h) => h.startsWith("yaw (deg)")));
    await plot(angles).dblclick({ position: { x: 40, y: 20 } });
    assert.equal(await page.locator(".span-bar .hold").getAttribute("aria-pressed"), "false", "a double click follows again");
  });

  await test("scrubbing the time turns the phone, and the way back is one click", async () => {
    await page.locator(".span-bar .hold").click();
    const shown = () => page.locator(".angles dd span:first-child").allTextContents();
    const slider = page.locator(".span-bar input[type=range]");
    const end = Number(await slider.getAttribute("max"));
    const poses = new Set();
    for (const share of [0.2, 0.5, 0.75, 0.95]) {
      const wanted = share * end;
      await slider.evaluate((input, v) => { input.value = v; input.dispatchEvent(new Event("input", { bubbles: true })); }, String(wanted));
      const past = page.locator(".past");
      await past.waitFor();
      assert.ok(Math.abs(Number.parseFloat(await past.locator("b").textContent()) - wanted) < 0.6, `${await past.textContent()} for ${wanted}`);
      poses.add((await shown()).join());
    }
    assert.ok(poses.size >= 3, `${[...poses].join(" | ")}`);
    await view.picture("21-scrubbed");
    await page.locator(".past button").click();
    await page.locator(".past").waitFor({ state: "detached" });
    const moving = await shown();
    await until("numbers that move", async () => (await shown()).join() !== moving.join());
  });

  await test("the keyboard does all of it; what is shown is saved as picture and table", async () => {
    const angles = chart(page, "angles yaw-pitch-roll"), box = angles.locator(".canvas");
    await box.focus();
    await page.keyboard.press("Space");
    assert.equal(await page.locator(".span-bar .hold").getAttribute("aria-pressed"), "true");
    await page.keyboard.press("ArrowLeft");
    await page.keyboard.press("ArrowLeft");
    assert.match(await angles.locator(".spoken").textContent(), /\d+\.\d{3} s.*yaw/);
    const wide = (await csv(page, angles)).rows.length;
    await box.focus();
    await page.keyboard.press("+");
    await page.keyboard.press("+");
    const narrow = await csv(page, angles);
    assert.ok(narrow.rows.length < wide && narrow.rows.length > 5, `${narrow.rows.length} of ${wide}`);
    assert.equal(narrow.name, "angles-3-.csv".replace("3-", "3"));
    const [png] = await Promise.all([page.waitForEvent("download"), angles.locator("[data-tool=picture]").click()]);
    const bytes = readFileSync(await png.path());
    assert.equal(bytes.subarray(1, 4).toString(), "PNG");
    assert.ok(bytes.length > 8000, `${bytes.length} bytes`);
    await box.focus();
    await page.keyboard.press("f");
    const full = await until("the full screen", async () => { const b = await angles.boundingBox(); return b.width > 1200 && b.height > 650 && b; });
    assert.ok(full.x <= 1 && full.y <= 1);
    await view.picture("22-chart-full");
    await page.keyboard.press("Escape");
    await until("the page", async () => (await angles.boundingBox()).width < 900);
    await page.keyboard.press("0");
    assert.equal(await page.locator(".span-bar .hold").getAttribute("aria-pressed"), "false");
  });

  await test("every page of plots shows its curves: estimators, bias, raw sensors, gain, P, NEES", async () => {
    const has = async (id, columns, from = 3) => {
      const one = chart(page, id);
      await one.waitFor();
      const { head, rows } = await until(`values of ${id}`, async () => { const got = await csv(page, one); return got.rows.length > from && got; });
      for (const column of columns) {
        const at = head.findIndex((h) => h.startsWith(column));
        assert.ok(at > 0, `${id}: ${column} in ${head}`);
        assert.ok(rows.some((row) => Number.isFinite(row[at])), `${id}: values of ${column} in ${head}`);
      }
      return { head, rows };
    };
    await sub("Estimators");
    const against = await has("against", ["Integration (deg)", "Truth (deg)", "Device's own (deg)"]);
    assert.ok(against.rows.every((row) => row.slice(1).every((v) => v === null || (v >= 0 && v <= 180))));
    const bias = await has("bias", ["x +3σ", "x −3σ", "x (deg/s)", "z (deg/s)"]);
    assert.ok(bias.rows.every(([, high, low]) => high === null || high > low));
    await has("certainty", ["MEKF"]);
    await view.picture("23-estimators");
    await sub("Sensors");
    await has("raw gyroscope", ["x (deg/s)"]);
    const force = await has("raw accelerometer", ["x (m/s²)", "length"], 100);
    const length = force.rows.map((r) => r.at(-1)).filter((v) => v !== null);
    assert.ok(Math.abs(length.reduce((a, b) => a + b, 0) / length.length - 9.81) < 0.3);
    await has("raw magnetometer", ["x (µT)"]);
    await view.picture("24-sensors");
    await sub("Filter");
    await has("std", ["yaw", "pitch", "roll"]);
    const gain = await has("gain", ["gain"]);
    assert.ok(gain.rows.every(([, g]) => g === null || (g > 0 && g <= 1)), "a gain is between 0 and 1");
    await has("nees", ["NEES"]);
    await view.picture("25-filter");
    await sub("Motion");
  });

  await test("notations of an attitude, and gimbal lock is said where it is", async () => {
    // Frames are late: a chart of twelve curves must not be asked for the eight of the next notation.
    await page.evaluate(() => { window.frameInTime = window.requestAnimationFrame; window.requestAnimationFrame = (draw) => window.setTimeout(() => draw(performance.now()), 250); });
    for (const [notation, names] of [["quaternion", ["w", "x", "y", "z"]], ["rotation-vector", ["x", "y", "z"]], ["alpha-beta-gamma", ["alpha", "beta", "gamma"]], ["yaw-pitch-roll", ["yaw", "pitch", "roll"]]]) {
      await page.locator(".notation").selectOption(notation);
      assert.deepEqual(await page.locator(".angles dt").allTextContents(), names);
      await chart(page, `angles ${notation}`).waitFor();
    }
    await page.evaluate(() => { window.requestAnimationFrame = window.frameInTime; });
    assert.deepEqual(view.complaints, []);
    // A tumbling phone comes near the pole of one order sooner or later.
    await view.pick("Virtual phone 1");
    const lock = await until("gimbal lock", async () => { const text = await page.locator(".lock").textContent(); return /Gimbal lock/.test(text) && text; }, 90);
    assert.match(lock, /pitch is −?8[5-9]\.\d°|pitch is −?90\.0°/);
    await view.picture("26-gimbal-lock");
    // Two phones in one scene, with the angle between them.
    await page.locator(".beside select").selectOption({ label: "Virtual phone 2" });
    await until("the angle between them", async () => /\d° apart: tilt \d/.test(await page.locator(".beside").textContent()));
    await view.picture("27-two-phones");
    await page.locator(".beside select").selectOption("");
    await view.pick("Virtual phone 2");
  });

  await test("all estimators on: thirteen colours, and nothing lies over anything", async () => {
    await view.step("Q and R");
    const boxes = page.locator("[data-estimator-choice]");
    for (let i = 0; i < (await boxes.count()); i++) await boxes.nth(i).check();
    await until("all of them", async () => (await page.locator(".ghosts tbody tr").count()) >= 13, 30);
    const colours = await page.locator(".ghosts .swatch").evaluateAll((all) => all.map((s) => getComputedStyle(s).borderTopColor));
    assert.equal(new Set(colours).size, colours.length, colours.join());
    const [legend, lamps, angles] = await Promise.all([".ghosts", ".lamps", ".angles"].map((s) => page.locator(s).boundingBox()));
    assert.ok(legend.y + legend.height <= lamps.y + 1, "the legend ends above the lamps");
    assert.ok(legend.x + legend.width <= angles.x + angles.width);
    // Axes have the colours of their letters, and no estimator has an axis's.
    const roles = await page.evaluate(() => Object.fromEntries(["x", "y", "z", "good", "warn", "bad"].map((r) => [r, getComputedStyle(document.documentElement).getPropertyValue(`--${r}`).trim()])));
    assert.equal(new Set(Object.values(roles)).size, 6);
    await sub("Estimators");
    await until("their curves", async () => (await chart(page, "against").locator(".key").count()) >= 12);
    await view.picture("28-all-estimators");
    for (let i = 0; i < (await boxes.count()); i++) {
      const name = await boxes.nth(i).getAttribute("data-estimator-choice");
      if (!["mekf", "integration"].includes(name)) await boxes.nth(i).uncheck();
    }
    await sub("Motion");
  });

  await test("a report is read on a phone: the same charts in one file, text of a size one can read, pictures for print", async () => {
    await view.experiment("Short", 10);
    const row = await view.ended("Short");
    const context = await browser.newContext({ viewport: { width: 390, height: 844 }, deviceScaleFactor: 2 });
    atTheEnd(() => context.close());
    const report = await context.newPage();
    const asked = [], complaints = [];
    report.on("request", (request) => asked.push(request.url()));
    report.on("pageerror", (error) => complaints.push(error.message));
    report.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
    await report.goto(new URL(`/api/experiments/${row.id}/report.html`, lab.ready.lab).href);
    await report.locator(".instruments .chart").first().waitFor();
    assert.deepEqual(asked.filter((url) => !url.startsWith("data:") && !url.endsWith("report.html") && !url.endsWith("favicon.ico")), []);
    assert.ok((await report.locator(".instruments .chart").count()) >= 6);
    assert.equal(await report.locator(".alive > .picture:visible").count(), 0);
    assert.ok(await report.evaluate(() => document.documentElement.scrollWidth <= innerWidth), "nothing is wider than the phone");
    const first = report.locator(".instruments .chart").first();
    await first.scrollIntoViewIfNeeded();
    const box = await first.locator(".u-over").boundingBox();
    await report.mouse.move(box.x + 0.4 * box.width, box.y + 30);
    await first.locator(".readout").waitFor();
    assert.match(await first.locator(".readout").innerText(), /^\d+\.\d{3} s/);
    await report.mouse.down();
    await report.mouse.move(box.x + 0.7 * box.width, box.y + 30, { steps: 5 });
    await report.mouse.up();
    await report.locator(".shown").waitFor();
    await picture(report, "report-phone");
    await report.getByRole("button", { name: "Show all" }).click();
    await report.locator(".shown").waitFor({ state: "hidden" });
    // All letters are at least as large as small print.
    const sizes = await report.evaluate(() => [...document.querySelectorAll("main *, header *, footer *")].filter((e) => e.childElementCount === 0 && e.textContent.trim() && e.getClientRects().length && !e.closest("svg, script, .spoken")).map((e) => Number.parseFloat(getComputedStyle(e).fontSize)));
    assert.ok(Math.min(...sizes) >= 12, `${Math.min(...sizes)} px`);
    await report.emulateMedia({ media: "print" });
    assert.equal(await report.locator(".instruments:visible").count(), 0);
    assert.ok((await report.locator(".alive > .picture:visible").count()) >= 3);
    await report.emulateMedia({ media: "screen" });
    await report.setViewportSize({ width: 1440, height: 900 });
    await picture(report, "report-laptop");
    assert.deepEqual(complaints, []);
  });

  await test("the lab page had nothing to complain about", () => assert.deepEqual(view.complaints, []));
}, 500);
