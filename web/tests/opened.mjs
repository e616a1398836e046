// Recordings of elsewhere are dropped on the lab page or chosen, run as experiments, played; experiments are archived. In a real browser.
//
// | of the issue | test |
// |---|---|
// | open any recording that the program reads by drag and drop | a file that is dropped is an experiment |
// | the same by a button, and as a device | a file that is chosen plays as a device |
// | refusals are the reader's sentence | what is no recording is refused in words |
// | archive and delete | an experiment is archived and brought back |
import assert from "node:assert/strict";
import { existsSync, readFileSync, statSync } from "node:fs";
import { join } from "node:path";
import { launch, suite, test, until } from "./browser.mjs";
import { openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";

/** Drops files on the page as a hand does. */
async function drop(page, files) {
  const data = await page.evaluateHandle((all) => {
    const data = new DataTransfer();
    for (const { name, text } of all) data.items.add(new File([text], name));
    return data;
  }, files);
  await page.dispatchEvent("main", "dragenter", { dataTransfer: data });
  await page.locator(".drop-zone").waitFor();
  await page.dispatchEvent("main", "drop", { dataTransfer: data });
}

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const { page } = view;
  const taken = (name) => page.locator(`.taken li[data-taken="${name}"]`);

  await page.getByRole("button", { name: "Add a virtual phone" }).click();
  await page.locator("aside .pick").waitFor();
  await view.experiment("Source", 10);
  const source = await view.ended("Source");
  // Without the name that the lab gave it, so that the file's counts.
  const csv = (await (await fetch(new URL(`/api/experiments/${source.id}/recording.csv`, lab.ready.lab))).text()).replace(/^# name:.*\n/m, "");

  await test("a file that is dropped is an experiment, with result, what-if and report", async () => {
    await drop(page, [{ name: "walk.csv", text: csv }]);
    await taken("walk.csv").and(page.locator(".good")).waitFor();
    assert.match(await taken("walk.csv").textContent(), /csv, \d+\.\d s: .*Gyroscope/i);
    const kept = join(lab.folder, "opened", "walk.csv");
    assert.equal(readFileSync(kept, "utf8"), csv);
    assert.equal(statSync(kept).mode & 0o777, 0o600);
    await view.picture("32-opened");
    await page.getByRole("button", { name: "Run walk.csv as an experiment" }).click();
    await page.locator(".panel h3", { hasText: "walk" }).waitFor();
    const row = (await lab.status()).experiments.find((r) => r.device_id === "file-walk.csv");
    assert.ok(row.results.mekf, JSON.stringify(row.results));
    assert.deepEqual([...row.sensors].sort(), [...source.sensors].sort());
    await page.locator(`.panel .results tr[data-estimator=mekf]`).waitFor();
    const report = await fetch(new URL(`/api/experiments/${row.id}/report.html`, lab.ready.lab));
    assert.equal(report.status, 200);
    await view.step("What if?");
    await page.locator(".panel tr[data-estimator=mekf] [data-value=nis]").waitFor();
    assert.equal(await page.locator(".panel .field select").first().inputValue(), row.id);
  });

  await test("a file that is chosen plays as a device", async () => {
    await page.getByRole("tab", { name: "Recordings" }).click();
    await page.locator(".file-button input").setInputFiles({ name: "walk.csv", mimeType: "text/csv", buffer: Buffer.from(csv) });
    // The first of this name stays.
    await page.locator("tr[data-opened='walk-2.csv']").waitFor();
    await page.getByRole("button", { name: "Play walk-2.csv as a device" }).click();
    await page.locator("aside .pick", { hasText: "walk-2" }).waitFor();
    await until("its samples", async () => (await lab.device("walk-2"))?.received > 100);
  });

  await test("what is no recording is refused in words and not kept", async () => {
    await drop(page, [{ name: "notes.txt", text: "hello\n" }, { name: "broken.csv", text: csv.split("\n").slice(0, 60).join("\n") + "\n0.5,not a number\n" }]);
    await taken("notes.txt").and(page.locator(".bad")).waitFor();
    await taken("broken.csv").and(page.locator(".bad")).waitFor();
    assert.match(await taken("notes.txt").textContent(), /^notes\.txt notes\.txt: /);
    assert.match(await taken("broken.csv").textContent(), /line 61/);
    for (const name of ["notes.txt", "broken.csv"]) assert.equal(existsSync(join(lab.folder, "opened", name)), false);
    await view.picture("33-refused");
  });

  await test("an opened file is deleted at the second press", async () => {
    const row = page.locator("tr[data-opened='walk-2.csv']");
    await row.getByRole("button", { name: "Delete walk-2.csv" }).click();
    await row.getByRole("button", { name: "Delete for good?" }).click();
    await row.waitFor({ state: "detached" });
    assert.equal(existsSync(join(lab.folder, "opened", "walk-2.csv")), false);
  });

  await test("an experiment is archived, stays on the disk, and is brought back", async () => {
    await page.getByRole("tab", { name: "Experiments" }).click();
    const row = page.locator(".experiments tbody tr", { hasText: "Source" });
    await row.getByRole("button", { name: "Archive Source" }).click();
    await row.waitFor({ state: "detached" });
    const folder = join(lab.folder, "lab/experiments", source.id);
    await until("its mark", () => existsSync(join(folder, "archived")));
    assert.ok(existsSync(join(folder, "samples.bin")) && existsSync(join(folder, "experiment.json")));
    await page.getByLabel("Show archived (1)").check();
    await row.waitFor();
    await row.getByRole("button", { name: "Bring Source back" }).click();
    await until("it to be back", async () => (await lab.status()).experiments.find((r) => r.id === source.id).is_archived === false);
    assert.equal(existsSync(join(folder, "archived")), false);
    await row.getByRole("button", { name: "Archive Source" }).waitFor();
  });

  await test("the page had nothing to complain about", () => {
    // The browser says itself that an answer was a refusal.
    assert.deepEqual(view.complaints.filter((text) => !/status of 422/.test(text)), []);
  });
}, 300);
