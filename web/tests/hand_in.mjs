// Exercise cards in the lab: a student hands an experiment in, is told at once and why, and the teacher has the table. In a real browser.
//
// | of the issue | test |
// |---|---|
// | cards, questions and hand-in on the page | a right answer passes, and the file is there |
// | the reason | an answer of the opposite sign does not pass, with the reason |
// | other settings than those of the live run | a what-if is handed in with its sensors |
// | `northing grade` finds the same | the folder is graded with the judgement of the lab |
// | the teacher's table | the wall shows who has passed |
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { clean } from "./axe_in_page.mjs";
import { launch, suite, test, until, web } from "./browser.mjs";
import { openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";

const [program, ...before] = process.env.NORTHING ? [process.env.NORTHING] : ["cargo", "run", "-q", "-p", "northing", "--"];
const northing = (...args) => execFileSync(program, [...before, ...args], { encoding: "utf8", cwd: join(web, "..") });

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const { page } = view;
  const form = page.locator(".hand-in");
  const verdict = page.locator("[data-hand-in]");
  const answer = async (values) => {
    for (const [axis, value] of Object.entries(values)) await form.getByLabel(`Bias about ${axis}`).fill(value);
    await form.getByRole("button", { name: "Hand in" }).click();
  };

  await page.getByRole("button", { name: "Add a virtual phone" }).click();
  await page.locator("aside .pick").waitFor();
  await view.calibrate();
  await view.experiment("Mine", 10);
  const row = await view.ended("Mine");
  const device = (await lab.status()).devices[0];
  const deg = device.rest.gyroscope_bias_rad_s.map((v) => (v * 180) / Math.PI);
  const axes = (sign) => Object.fromEntries(["x", "y", "z"].map((axis, i) => [axis, (sign * deg[i]).toFixed(3).replace(".", ",")]));
  await view.step("Result");

  await test("a right answer passes, and the file is there", async () => {
    // By the keyboard alone.
    await form.locator("summary").focus();
    await page.keyboard.press("Enter");
    await form.getByLabel("Exercise").selectOption("bias");
    await form.getByText("Find the gyroscope's bias about each axis").waitFor();
    assert.equal(await form.getByLabel("Your name").inputValue(), device.name);
    await form.getByLabel("Your name").fill("Ana");
    await answer(axes(1));
    await page.locator("[data-hand-in=passed]").waitFor();
    assert.equal(await form.locator("[data-reason='reason.bias'].good").count(), 3);
    const [download] = await Promise.all([page.waitForEvent("download"), form.locator(".downloads a").click()]);
    assert.match(download.suggestedFilename(), new RegExp(`^bias-ana-${row.id}-[0-9a-f]{12}\\.zip$`));
    const kept = readFileSync(join(lab.folder, "hand-ins", download.suggestedFilename()));
    assert.deepEqual(readFileSync(await download.path()), kept);
    await view.picture("34-handed-in");
    await clean(page, "handed in");
  });

  await test("an answer of the opposite sign does not pass, with the reason", async () => {
    await form.getByLabel("Your name").fill("Ben");
    await answer(axes(-1));
    await page.locator("[data-hand-in=not-passed]").waitFor();
    assert.match(await form.locator("[data-reason='reason.biasSign']").textContent(), /opposite sign/);
    // What is typed stays when the page goes elsewhere and comes back.
    await view.step("Experiment");
    await view.step("Result");
    assert.equal(await form.getByLabel("Bias about x").inputValue(), axes(-1).x);
    await answer({ x: "much" });
    await page.locator("[data-hand-in=refused]").waitFor();
    assert.match(await verdict.textContent(), /x=much: expected a number in deg\/s/);
  });

  await test("a what-if is handed in with its sensors", async () => {
    await view.step("What if?");
    await form.getByLabel("Exercise").selectOption("no-magnetometer");
    await form.getByLabel("yaw", { exact: true }).check();
    await form.getByLabel(/Gravity looks the same/).check();
    await form.getByRole("button", { name: "Hand in" }).click();
    await page.locator("[data-reason='reason.magnetometerOff'].warn").waitFor();
    const sensor = (name) => page.locator(`[data-what-if-sensor=${name}]`);
    for (const name of ["magnetometer", "compass-heading"]) if (await sensor(name).count()) await sensor(name).uncheck();
    await form.getByRole("button", { name: "Hand in" }).click();
    await page.locator("[data-reason='reason.magnetometerOff'].good").waitFor();
    await page.locator("[data-reason='reason.accelerometerUsed'].good").waitFor();
  });

  await test("the reasons are in the page's language", async () => {
    await page.evaluate(() => localStorage.setItem("northing-language", "es"));
    await page.reload();
    await page.locator("aside .pick").first().click();
    await page.locator("nav li button").nth(6).click();
    await form.locator("summary", { hasText: "Entregar para un ejercicio" }).click();
    await form.getByLabel("Ejercicio").selectOption("bias");
    for (const [i, value] of Object.values(axes(-1)).entries()) await form.locator("input[inputmode=decimal]").nth(i).fill(value);
    await form.getByRole("button", { name: "Entregar" }).click();
    await page.locator("[data-hand-in=not-passed]").waitFor();
    assert.match(await form.locator("[data-reason='reason.biasSign']").textContent(), /signo/);
    await page.evaluate(() => localStorage.setItem("northing-language", "en"));
    await page.reload();
  });

  await test("the folder is graded with the judgement of the lab", async () => {
    const table = await (await fetch(new URL("/api/class", lab.ready.lab))).json();
    assert.equal(table.hand_ins.length, 5);
    const graded = JSON.parse(northing("grade", join(lab.folder, "hand-ins"), "--json")).hand_ins;
    const found = (all, reasons) => all.map((one) => ({ file: one.file.split("/").at(-1), student: one.student, card: one.card, reasons: reasons(one).map(({ key, holds, values }) => ({ key, holds, values })) }));
    assert.deepEqual(found(graded, (one) => one.reasons), found(table.hand_ins, (one) => one.judgement.reasons));
    assert.ok(graded.every((one) => one.judgement_in_file_is_the_same));
    const csv = join(lab.folder, "class.csv");
    northing("grade", join(lab.folder, "hand-ins"), "--out", csv);
    // The names of the files apart, which are paths there.
    const plain = readFileSync(csv, "utf8").replaceAll(join(lab.folder, "hand-ins") + "/", "");
    assert.equal(await (await fetch(new URL("/api/class.csv", lab.ready.lab))).text(), plain);
  });

  await test("the wall shows who has passed", async () => {
    await page.getByRole("button", { name: "Wall", exact: true }).click();
    const cell = (student) => page.locator(`.class-table tr[data-student="${student}"] td[data-card=bias]`);
    await cell("Ana").getByText("passed").waitFor();
    assert.equal((await cell("Ben").textContent()).trim(), "not yet");
    assert.match(await cell("Ben").getAttribute("title"), /opposite sign/);
    await view.picture("35-class");
    await clean(page, "the class");
    const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: /CSV/ }).click()]);
    await until("the table", async () => /^student,card,passes/.test(readFileSync(await download.path(), "utf8")));
  });

  await test("the page had nothing to complain about", () => {
    // The browser says itself that an answer was a refusal.
    assert.deepEqual(view.complaints.filter((text) => !/status of 422/.test(text)), []);
  });
}, 400);
