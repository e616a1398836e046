// axe-core in a page: its rules of WCAG 2.2 A and AA and its best practices, on what is shown now.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const source = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

/** Fails with every violation: rule, element, and what is wrong. */
export async function clean(page, what) {
  // Evaluated by the browser's debugger: the page's own policy does not let it in as a script.
  if (!(await page.evaluate(() => "axe" in window))) await page.evaluate(source);
  const { violations, passes } = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations", "passes"] }));
  const told = violations.flatMap(({ id, nodes }) => nodes.map((node) => `${id}: ${node.target.join(" ")}: ${node.failureSummary.replaceAll("\n", " ")}`));
  assert.deepEqual(told, [], what);
  assert.ok(passes.length > 15, `${what}: only ${passes.length} rules found anything to look at`);
}
