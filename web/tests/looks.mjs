// Every state of the lab page and of the phone page, at four widths, in light and dark: nothing is wider than the screen, nothing covers
// what is to be read, and axe-core finds nothing to complain about. Pictures of each land in the folder of screenshots.
//
// | of the issue | test |
// |---|---|
// | responsive from 390 to 1920 px, one column when narrow | each test, in every state |
// | legends do not cover lamps with all estimators on | all estimators on |
// | axe-core clean in every state | each test, in light and dark |
// | the phone page | the phone page |
import assert from "node:assert/strict";
import { join } from "node:path";
import { clean } from "./axe_in_page.mjs";
import { launch, screenshots, suite, test, until } from "./browser.mjs";
import { openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";
import { phone } from "./scripted_phone.mjs";

const SIZES = [[390, 844], [820, 1180], [1440, 900], [1920, 1080]];

/** What reaches beyond the screen's edge and is not in a box that scrolls by itself. */
const beyond = () => {
  const bad = [];
  for (const element of document.querySelectorAll("body *")) {
    const box = element.getBoundingClientRect();
    if (box.width === 0 || (box.right <= innerWidth + 1 && box.left >= -1)) continue;
    let parent = element.parentElement;
    while (parent && !/auto|scroll|hidden|clip/.test(getComputedStyle(parent).overflowX)) parent = parent.parentElement;
    if (!parent) bad.push(`${element.tagName}.${element.className} ${Math.round(box.left)} to ${Math.round(box.right)}`);
  }
  return bad.slice(0, 5);
};

/** Looks at a state at every width, in light and dark. */
async function look(page, name, more = async () => undefined) {
  for (const [width, height] of SIZES) {
    await page.setViewportSize({ width, height });
    await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    const wide = await page.evaluate(() => document.documentElement.scrollWidth), outside = await page.evaluate(beyond);
    assert.ok(wide <= width, `${name} is ${wide} px wide on a screen of ${width}`);
    assert.deepEqual(outside, [], `${name} at ${width}`);
    await more(width);
    for (const colorScheme of ["dark", "light"]) {
      await page.emulateMedia({ colorScheme });
      if (width === 390 || width === 1440) await clean(page, `${name}, ${width} px, ${colorScheme}`);
      await page.screenshot({ path: join(screenshots, `look-${name}-${width}${colorScheme === "dark" ? "-dark" : ""}.png`), fullPage: width < 900 });
    }
  }
  await page.setViewportSize({ width: 1280, height: 720 });
}

/** Below 900 px all parts have the same left edge, and none stands beside another. */
const inOneColumn = (page, parts) => async (width) => {
  const boxes = await page.evaluate((parts) => parts.map((part) => { const { left, right, top, bottom } = document.querySelector(part).getBoundingClientRect(); return { part, left, right, top, bottom }; }), parts);
  if (width >= 900) return;
  for (const box of boxes) assert.ok(box.left < 1 && box.right > width - 1, `${box.part} from ${box.left} to ${box.right} of ${width}`);
  const sorted = [...boxes].sort((a, b) => a.top - b.top);
  for (let i = 1; i < sorted.length; i++) assert.ok(sorted[i].top >= sorted[i - 1].bottom - 1, `${sorted[i].part} begins within ${sorted[i - 1].part}`);
};

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const { page } = view;
  const column = inOneColumn(page, [".devices", ".stage", ".lamps", ".panel", ".lower"]);

  await test("empty", async () => look(page, "empty"), 240);

  await test("one phone", async () => {
    await page.getByRole("button", { name: "Add a virtual phone" }).click();
    await view.pick("Virtual phone 1");
    await view.step("Q and R");
    await until("the plots", async () => (await page.locator(".lower canvas").count()) >= 2);
    await look(page, "phone", column);
  }, 240);

  await test("all estimators on: the legend covers no lamp", async () => {
    const boxes = page.locator("[data-estimator-choice]");
    const count = await boxes.count();
    for (let i = 0; i < count; i++) await boxes.nth(i).check();
    await until("all of them", async () => (await lab.device("Virtual phone 1")).estimators.length === count);
    await until("the legend", async () => (await page.locator(".ghosts tbody tr").count()) >= count);
    await look(page, "all-estimators", async (width) => {
      const covered = await page.evaluate(() => {
        const box = (one) => one.getBoundingClientRect();
        const legend = box(document.querySelector(".ghosts"));
        const over = (a, b) => a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1;
        return [...document.querySelectorAll(".lamps .lamp, .angles dd, .angles select")].filter((one) => over(legend, box(one))).map((one) => one.className || one.tagName);
      });
      assert.deepEqual(covered, [], `the legend covers them at ${width}`);
    });
    for (let i = 0; i < count; i++) {
      const name = await boxes.nth(i).getAttribute("data-estimator-choice");
      if (name !== "mekf" && name !== "integration") await boxes.nth(i).uncheck();
    }
  }, 300);

  await test("calibrating, and calibrated", async () => {
    await view.step("Calibrate");
    await page.locator(".panel input[type=range]").first().fill("60");
    await page.locator(".panel button", { hasText: /^Calibrate( again)?$/ }).click();
    await page.locator(".panel button", { hasText: "Hold still" }).waitFor();
    await look(page, "calibrating", column);
    if ((await lab.device("Virtual phone 1")).is_calibrating) await page.locator(".panel button", { hasText: "Cancel" }).click();
    await look(page, "calibrate");
  }, 240);

  await test("experiment, result, table and what-if", async () => {
    await view.experiment("Look", 300);
    await look(page, "experiment", column);
    if ((await lab.device("Virtual phone 1")).is_experimenting) await page.getByRole("button", { name: "Stop now" }).click();
    await view.ended("Look");
    await view.step("Result");
    await page.locator(".panel h3", { hasText: "Look" }).waitFor();
    await look(page, "result", column);
    await view.step("What if?");
    await page.locator(".panel tr[data-estimator=mekf] [data-value=nis]").waitFor();
    await page.locator(".what-if-plots .chart").nth(2).waitFor();
    await look(page, "what-if", column);
  }, 400);

  await test("recordings and the wall", async () => {
    await page.getByRole("tab", { name: "Recordings" }).click();
    await page.locator(".opened").waitFor();
    await look(page, "recordings");
    await page.evaluate(() => new Promise((done) => {
      const socket = new WebSocket(`ws://${location.host}/api/ws`);
      socket.onopen = () => { for (let seed = 2; seed < 7; seed++) socket.send(JSON.stringify({ type: "virtual_phone", action: "add", seed })); socket.close(); done(); };
    }));
    await page.getByRole("button", { name: "Wall" }).click();
    await until("six boxes", async () => (await page.locator(".cell .lamp").count()) >= 12);
    await look(page, "wall");
  }, 300);

  await test("the phone page, before and while it sends", async () => {
    const device = await phone(browser, lab.phoneUrl());
    const both = async (name) => {
      for (const colorScheme of ["dark", "light"]) {
        await device.page.emulateMedia({ colorScheme });
        await clean(device.page, `${name}, ${colorScheme}`);
      }
      assert.ok(await device.page.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
    };
    await both("the phone page");
    await device.start("Anna");
    await until("Sending", async () => (await device.state()).startsWith("Sending"));
    await both("the phone page, sending");
  });

  await test("the page had nothing to complain about", () => assert.deepEqual(view.complaints, []));
}, 900);
