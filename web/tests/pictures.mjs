// Makes the pictures of README: a lab with virtual phones, its experiment and what-if, and the phone page.
import { mkdirSync } from "node:fs";
import { dirname, join } from "node:path";
import { launch, suite, test, until, web } from "./browser.mjs";
import { openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";
import { Hand, phone } from "./scripted_phone.mjs";

const folder = join(dirname(web), "docs/pictures");
mkdirSync(folder, { recursive: true });

await suite(async () => {
  const lab = await startLab();
  const browser = await launch();
  const view = await openLab(browser, lab);
  const save = (page, name) => page.screenshot({ path: join(folder, `${name}.png`), scale: "css" });

  await test("the lab page in an experiment, and in what-if", async () => {
    await view.page.getByRole("button", { name: "Add a virtual phone" }).click();
    await view.page.locator("aside .pick").waitFor();
    await view.calibrate();
    const phase = async () => (await lab.device("Virtual phone 1")).duration_s % 75;
    await until("the next rest", async () => (await phase()) > 71 || (await phase()) < 6, 90);
    await view.experiment("First", 75);
    await until("motion", async () => (await phase()) > 40 && (await phase()) < 60, 90);
    await save(view.page, "lab");
    await view.ended("First");
    await view.step("What if?");
    await view.page.locator(".what-if-plots .chart").nth(2).waitFor();
    await save(view.page, "what-if");
  }, 300);

  await test("the phone page, sending", async () => {
    const device = await phone(browser, lab.phoneUrl(), new Hand());
    await device.start("Anna");
    await until("steps of the browser's rounding", async () => /Coarse mode/.test(await device.page.locator("#foot").textContent()));
    await save(device.page, "phone");
  });
}, 400);
