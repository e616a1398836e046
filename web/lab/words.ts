// Numbers in words: one way to write them everywhere on the page.

import { power } from "../instrument/numbers";
import { inLanguage } from "../words/program";
import type { Key } from "./t";

/** A number with as many digits as it deserves. */
export function number(v: number | null | undefined, digits = 2): string {
  if (v === null || v === undefined || !Number.isFinite(v)) return "–";
  const text = v.toFixed(digits);
  // What rounds to zero has no sign.
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

/** A small or large number to three figures, without the exponent where it can be read. */
export function figures(v: number): string {
  if (v === 0) return "0";
  const size = Math.abs(v);
  return (size < 1e-3 || size >= 1e5 ? `${v.toExponential(1).split("e")[0]}·${power(10 ** Math.floor(Math.log10(size) + 1e-9))}` : String(+v.toPrecision(3))).replace("-", "−");
}

/** A sentence of the program with the signs that print knows. */
export function pretty(text: string): string {
  return text.replace(/\buT\b/g, "µT").replaceAll("m/s^2", "m/s²").replaceAll("+-", "±").replace(/sqrt\((Hz|s|h)\)/g, "√$1").replace(/(^|[\s(])-(?=\d)/g, "$1−");
}

/** A sentence of the program as the page says it. */
export const said = (text: string): string => pretty(inLanguage(text));

/** The sentence on a sensor's R without naming the sensor, for places where its name stands before. */
export function unnamed(sentence: string): string {
  return sentence.replace(/\b[Yy]our [\w-]+ R\b/g, "R").replaceAll("compass-heading sample", "sample");
}

export const degrees = (v: number | null | undefined): string => (v === null || v === undefined ? "–" : `${number(v)}°`);

export const VERDICTS: Record<string, { tone: "good" | "warn" | "bad"; text: Key }> = {
  consistent: { tone: "good", text: "verdict.consistent" },
  conservative: { tone: "warn", text: "verdict.conservative" },
  overconfident: { tone: "bad", text: "verdict.overconfident" },
};
