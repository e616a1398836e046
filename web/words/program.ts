// What the program says, in Spanish: lamps, health, calibrations, results, what a setting means. The program speaks English; `program.json` has
// its sentences with places for what changes. A sentence that is not there stays as it is.

import { filled, language, onLanguage, type Text } from "./language";

interface Rule {
  /** What stands before the first place, in small letters: most rules are out by it. */
  start: string;
  pattern: RegExp;
  text: string;
}

let rules: Rule[] = [];
let words = new Map<string, string>();
let known = new Map<string, string>();
/** Texts that are remembered: many are said again and again. */
const MOST_KNOWN = 2000;

const small = (text: string): string => text.charAt(0).toLowerCase() + text.slice(1);

function rule({ en, es }: Text): Rule {
  const pattern = en.replace(/\.$/, "").split(/(\{\w+\})/).map((part) => (/^\{\w+\}$/.test(part) ? `(?<${part.slice(1, -1)}>.+?)` : part.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"))).join("");
  return { start: small(en.split("{")[0]!.replace(/\.$/, "")), pattern: new RegExp(`^${pattern}\\.?$`, "i"), text: es };
}

function translated(sentence: string): string {
  for (const { start, pattern, text } of rules) {
    const found = small(sentence).startsWith(start) ? pattern.exec(sentence) : null;
    if (!found) continue;
    const values = Object.fromEntries(Object.entries(found.groups ?? {}).map(([name, value]) => [name, words.get(value) ?? value]));
    const said = filled(text, values);
    // As a whole sentence, or within one.
    const first = /^\p{Ll}/u.test(sentence) ? said.charAt(0).toLowerCase() : /^\p{Lu}/u.test(sentence) ? said.charAt(0).toUpperCase() : said.charAt(0);
    return first + said.slice(1);
  }
  return sentence;
}

/** A text of the program in the language of now. */
export function inLanguage(text: string): string {
  if (language() === "en" || !rules.length) return text;
  let said = known.get(text);
  if (said === undefined) {
    said = words.get(text) ?? text.split(/(?<=[.?!])\s+(?=\p{Lu})/u).map(translated).join(" ");
    if (known.size >= MOST_KNOWN) known = new Map();
    known.set(text, said);
  }
  return said;
}

/** Fetches the sentences once somebody reads Spanish, and calls when they are there. */
export function followLanguage(ready: () => void): void {
  const fetch = async (): Promise<void> => {
    if (language() === "en" || rules.length) return;
    const { default: catalogue } = await import("./program.json");
    rules = catalogue.sentences.map(rule);
    words = new Map(catalogue.words.map(({ en, es }) => [en, es]));
    ready();
  };
  onLanguage(() => void fetch());
  void fetch();
}
