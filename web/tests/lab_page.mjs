// The lab page as a test sees it: steps by name, devices by name, numbers as they are shown.
import assert from "node:assert/strict";
import { picture, until } from "./browser.mjs";

/** The number in a text such as `−1.25°`. */
export const numberIn = (text) => Number(text.replace("−", "-").replace(/[^\d.-]/g, ""));

/** Opens the lab page and gathers what it complains about. */
export async function openLab(browser, lab) {
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(error.stack ?? error.message));
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  // A click may wait long on a busy computer.
  page.setDefaultTimeout(90_000);
  await page.goto(lab.ready.lab);
  // Drawing without a graphics card costs what the other tests need; the estimate does not depend on it.
  await page.locator("label.rate select").selectOption("5");
  const self = {
    page, complaints,
    picture: (name) => picture(page, `lab-${name}`),
    /** Goes to a step of the path by its name in the list. */
    step: (name) => page.locator("nav li button", { hasText: name }).first().click(),
    pick: async (name) => {
      await page.locator("aside .pick", { hasText: name }).click();
      await page.locator("aside .pick[aria-pressed=true]", { hasText: name }).waitFor();
    },
    /** Calibrates the picked device: a few seconds, and longer where a busy computer gives few samples. */
    calibrate: async () => {
      await self.step("Calibrate");
      const verdict = page.locator(".panel .verdict[role=status]").last();
      for (const seconds of [5, 20, 60]) {
        await page.locator(".panel input[type=range]").first().fill(String(seconds));
        await page.locator(".panel button", { hasText: /^Calibrate( again)?$/ }).click();
        await page.locator(".panel button", { hasText: "Hold still" }).waitFor();
        await until("the verdict", async () => /^(Calibrated|Refused)/.test(await verdict.textContent()), 2 * seconds + 20);
        if (!/too short/.test(await verdict.textContent())) break;
      }
      assert.match(await verdict.textContent(), /^Calibrated/);
    },
    /** A row of the table of the calibration: x, y, z. */
    atRest: async (row) => (await page.locator(".compact tr", { hasText: row }).locator("td").allTextContents()).map(numberIn),
    /** Starts an experiment with the picked device. */
    experiment: async (name, seconds) => {
      await self.step("Experiment");
      await page.locator(".panel input[type=text]").fill(name);
      await page.locator(".panel input[type=range]").first().fill(String(seconds));
      await page.getByRole("button", { name: "Start the experiment" }).click();
      await page.locator(".panel progress").waitFor();
    },
    /** Yaw, pitch and roll as the page shows them. */
    angles: async () => (await page.locator(".angles dd span:first-child").allTextContents()).map(numberIn),
    /** The angle between the phone's z axis and up, of the angles shown: it does not depend on their order. */
    tilt: async () => {
      const [, pitch, roll] = (await self.angles()).map((a) => (a * Math.PI) / 180);
      return (Math.acos(Math.cos(pitch) * Math.cos(roll)) * 180) / Math.PI;
    },
    /** The angle from the MEKF to another attitude, as the page shows it. */
    angleTo: async (name) => numberIn(await page.locator(".ghosts tr", { hasText: name }).locator("td").textContent()),
    /** A number of the results on the right. */
    shown: async (estimator, value) => numberIn(await page.locator(`.panel tr[data-estimator="${estimator}"] [data-value="${value}"]`).textContent()),
    /** The row of an experiment, once it has ended. */
    ended: (name, seconds = 120) => until(`the end of ${name}`, async () => (await lab.status()).experiments.find((row) => row.name === name), seconds),
  };
  return self;
}

/** What part of the time the page's main thread runs scripts, and is busy at all, over some seconds. */
export async function mainThread(page, seconds) {
  const cdp = await page.context().newCDPSession(page);
  await cdp.send("Performance.enable");
  const now = async () => Object.fromEntries((await cdp.send("Performance.getMetrics")).metrics.map(({ name, value }) => [name, value]));
  const before = await now();
  await page.waitForTimeout(1000 * seconds);
  const after = await now(), share = (name) => (after[name] - before[name]) / (after.Timestamp - before.Timestamp);
  return { script: share("ScriptDuration"), tasks: share("TaskDuration") };
}
