// The words of the pages: every text in one catalogue, English and Spanish, and none beside it; the lab page in Spanish, in a real browser.
//
// | of the issue | test |
// |---|---|
// | all strings in one catalogue | no page has words of its own |
// | checked for completeness | every text is there in both languages |
// | the phone's page, too | a phone's page in Spanish says in Spanish why a calibration was refused |
// | English and Spanish | in Spanish nothing English is left on the lab page: no text of the catalogue, no sentence of the program |
import assert from "node:assert/strict";
import { readdir, readFile } from "node:fs/promises";
import { join, relative } from "node:path";
import { API } from "typescript/unstable/sync";
import { SyntaxKind } from "typescript/unstable/ast";
import { launch, suite, test, until, web } from "./browser.mjs";
import { openLab } from "./lab_page.mjs";
import { startLab } from "./program.mjs";
import { Hand, phone } from "./scripted_phone.mjs";

const CATALOGUES = ["phone", "join", "lab", "instrument", "course"];
const catalogueOf = async (name) => JSON.parse(await readFile(join(web, `words/${name}.json`), "utf8"));

/** What is the same in every language: names, units, keys of a keyboard, classes of browsers, and what a phone is called until somebody names it. */
const NAMES = new Set(["Northing", "lab", "Hz", "NIS", "MHz", "µT", "min", "ms", "Enter", "Escape", "Files", "Parquet", "English", "Español",
  "Accelerometer", "Gyroscope", "Magnetometer", "Phone", "Android phone"]);
/** Attributes that people see or hear. */
const SEEN = new Set(["title", "placeholder", "aria-label", "alt", "label", "aria-valuetext"]);
const { JsxText, JsxAttribute, ImportDeclaration, LiteralType, StringLiteral, NoSubstitutionTemplateLiteral, TemplateHead, TemplateMiddle, TemplateTail } = SyntaxKind;
const STRINGS = new Set([StringLiteral, NoSubstitutionTemplateLiteral, TemplateHead, TemplateMiddle, TemplateTail]);

/** Whether a string is meant for people, as far as its shape and place say. */
function isForPeople(node) {
  const words = /\p{L}{2,}/u.test(node.text);
  if (node.kind === JsxText) return words;
  if (!STRINGS.has(node.kind) || node.parent?.kind === ImportDeclaration || node.parent?.kind === LiteralType) return false;
  for (let above = node.parent; above; above = above.parent) {
    if (above.kind === JsxAttribute) return words && SEEN.has(above.name.text) && node.parent === above;
    if (![SyntaxKind.TemplateSpan, SyntaxKind.TemplateExpression, SyntaxKind.JsxExpression].includes(above.kind)) break;
  }
  // A word with a capital, or a sentence.
  return /^\p{Lu}\p{Ll}+$|^\p{Lu}\p{Ll}*['’]?\p{Ll}*,? .*\p{L}{2,}/u.test(node.text.trim());
}

/** The strings for people in the sources of a page, each with its place. */
function wordsIn(folders) {
  const api = new API({ cwd: web });
  try {
    const { program, rootFiles } = api.updateSnapshot({ openProjects: [join(web, "tsconfig.json")] }).getProjects()[0];
    const found = [];
    for (const file of rootFiles.filter((file) => folders.some((folder) => relative(web, file).startsWith(`${folder}/`)))) {
      const source = program.getSourceFile(file);
      const look = (node) => {
        const text = node.text?.trim?.();
        if (isForPeople(node) && !NAMES.has(text)) found.push(`${relative(web, file)}:${source.text.slice(0, node.getStart(source)).split("\n").length} ${JSON.stringify(text)}`);
        node.forEachChild(look);
      };
      look(source);
    }
    return found;
  } finally {
    api.close();
  }
}

/** Words that English sentences hardly do without, and Spanish ones do. */
const ENGLISH = /\b(the|of|is|are|and|with|its?|for|from|was|were|that|which|no samples?)\b/i;

/** Everything that a page says, to eyes and to ears; values of settings are called as the program's `--set` calls them. */
const saidBy = (page) => page.evaluate(() => {
  const all = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) if (!walk.currentNode.parentElement.closest("[data-parameter], noscript, code")) all.push(walk.currentNode.textContent);
  for (const element of document.querySelectorAll("[title], [aria-label], [placeholder]")) all.push(element.title, element.getAttribute("aria-label"), element.getAttribute("placeholder"));
  return [...new Set(all.filter((text) => text?.trim()).map((text) => text.trim()))];
});

await suite(async () => {
  await test("every text is there in both languages, with the same places to fill", async () => {
    for (const file of CATALOGUES) {
      const catalogue = await catalogueOf(file);
      assert.ok(Object.keys(catalogue).length > 5);
      for (const [key, text] of Object.entries(catalogue)) {
        const places = (words) => (words.match(/\{\w+\}/g) ?? []).sort().join();
        assert.deepEqual(Object.keys(text).sort(), ["en", "es"], `${file} ${key}`);
        assert.ok(text.en.trim() && text.es.trim(), `${file} ${key}`);
        assert.equal(places(text.en), places(text.es), `${file} ${key}`);
      }
    }
    const { sentences, words } = await catalogueOf("program");
    for (const { en, es } of sentences) {
      const places = [...en.matchAll(/\{\w+\}/g)].map(([place]) => place);
      assert.equal(new Set(places).size, places.length, en);
      for (const [place] of es.matchAll(/\{\w+\}/g)) assert.ok(places.includes(place), `${place} of ${es}`);
    }
    for (const list of [sentences, words]) assert.equal(new Set(list.map((one) => one.en)).size, list.length);
  });

  await test("no page has words of its own beside the catalogue", async () => assert.deepEqual(wordsIn(["lab", "phone", "join", "instrument"]), []));

  await test("no page's script has what Safari of 2022 cannot read: one such expression, and nothing runs", async () => {
    for (const page of ["lab", "join", "phone", "report"]) {
      for (const file of (await readdir(join(web, "dist", page))).filter((file) => file.endsWith(".js"))) {
        const script = await readFile(join(web, "dist", page, file), "utf8");
        assert.ok(!/\(\?<[=!]/.test(script), `a look-behind in ${page}/${file}`);
      }
    }
  });

  const lab = await startLab();
  const browser = await launch();

  await test("in Spanish nothing English is left on the lab page, and the button brings English back", async () => {
    const context = await browser.newContext({ locale: "es-ES" });
    const view = await openLab(context, lab);
    const { page } = view;
    const texts = Object.values({ ...(await catalogueOf("lab")), ...(await catalogueOf("instrument")) });
    const spanish = new Set(texts.map((text) => text.es));
    const english = new Set(texts.map((text) => text.en).filter((text) => !spanish.has(text)));
    const seen = new Set();
    const look = async (where) => {
      const said = await saidBy(page);
      assert.deepEqual(said.filter((text) => english.has(text) || ENGLISH.test(text)), [], where);
      assert.deepEqual(said.filter((text) => /(^|\s)\p{Ll}\p{Lu}\p{Lu}/u.test(text)), [], `acronyms keep their capitals: ${where}`);
      for (const text of said) if (spanish.has(text)) seen.add(text);
    };
    assert.equal(await page.evaluate(() => document.documentElement.lang), "es");
    await look("empty");
    // What a setting and an estimator mean, and how an input is set up: the program names them all at once.
    const hello = await page.evaluate(() => new Promise((done) => {
      const socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/api/ws`);
      socket.onmessage = ({ data }) => { const message = JSON.parse(data); if (message.type === "hello") { socket.close(); done(message); } };
    }));
    const translated = new Set((await catalogueOf("program")).sentences.map((one) => one.en));
    const meant = [...hello.estimators.map((one) => one.summary), ...hello.parameters.map((one) => one.meaning), ...hello.input_kinds.flatMap((one) => one.hint.split(/(?<=\.)\s+(?=[A-Z])/))];
    assert.deepEqual(meant.filter((text) => !translated.has(text)), []);
    await page.getByRole("button", { name: "Añadir un teléfono virtual" }).click();
    await page.locator("aside .pick").waitFor();
    const calibrate = async (verdict) => {
      await view.step("Calibrar");
      await page.locator(".panel input[type=range]").first().fill("5");
      await page.locator(".panel button", { hasText: /^Calibrar( de nuevo)?$/ }).click();
      await page.locator(".panel .verdict[role=status]", { hasText: verdict }).last().waitFor();
      await look(`calibration: ${verdict}`);
    };
    await calibrate("Calibrado");
    await view.step("Q y R");
    for (const box of await page.locator("[data-estimator-choice]").all()) await box.check();
    await page.locator(".ghosts tr", { hasText: "Velocidad acotada" }).waitFor();
    await look("all estimators");
    for (const part of ["Magnetómetro", "Ruido (Allan)"]) {
      await view.step("Calibrar");
      await page.locator(".panel").getByRole("button", { name: part, exact: true }).click();
      await look(part);
    }
    await page.locator(".panel").getByRole("button", { name: "En reposo", exact: true }).click();
    await view.step("Dejar");
    await page.locator("[data-stillness=moving]").waitFor();
    await calibrate("Rechazada");
    for (const step of ["Dejar", "Calibrar", "Q y R", "Experimento", "Volver", "Resultado", "¿Y si…?"]) {
      await view.step(step);
      await look(step);
    }
    await view.step("Experimento");
    await page.locator(".panel input[type=range]").first().fill("10");
    await page.getByRole("button", { name: "Iniciar el experimento" }).click();
    await until("the end of the experiment", async () => (await lab.status()).experiments.length === 1, 60);
    await view.step("Resultado");
    await page.locator(".result table").first().waitFor();
    await look("the result");
    await view.picture("40-spanish-result");
    await view.step("¿Y si…?");
    await page.locator("table.what-if").waitFor();
    await look("an answer of what-if");
    for (const tab of await page.getByRole("tab").all()) {
      await tab.click();
      await look(await tab.textContent());
    }
    await page.getByRole("button", { name: "Panel", exact: true }).click();
    await page.locator(".cell-state").waitFor();
    await look("the wall");
    await view.picture("41-spanish-wall");
    // A third of the catalogue was there to be read: the check has something to find.
    assert.ok(seen.size > texts.length / 3, `${seen.size} of ${texts.length} texts seen`);

    await page.getByRole("button", { name: "EN, English", exact: true }).click();
    await page.getByRole("heading", { name: "Results", exact: true }).waitFor();
    const left = (await saidBy(page)).filter((text) => spanish.has(text) && !texts.some((one) => one.en === text));
    assert.deepEqual(left, []);
    assert.deepEqual(view.complaints, []);
    await context.close();
  }, 200);

  await test("a phone's page in Spanish says in Spanish why a calibration was refused", async () => {
    const hand = new Hand();
    const device = await phone(browser, lab.phoneUrl(), hand, { locale: "es-ES" });
    await device.start("Ana");
    const { page } = device;
    await until("the calibration to be offered", async () => (await page.locator("#mine").isVisible()) && (await page.locator("#calibrate").isEnabled()), 60);
    await page.click("#calibrate");
    const swings = setInterval(() => hand.rests && hand.turn(hand.degrees > 30 ? 0 : 60, 1), 100);
    const said = () => page.locator("#rest-said").textContent();
    await until("the refusal", async () => /^No aceptada/.test(await said()), 60);
    clearInterval(swings);
    const words = await said();
    assert.match(words, /el dispositivo (se movió|no estaba en reposo)/);
    assert.ok(!ENGLISH.test(words), words);
    await device.close();
  });
}, 360);
