// What the program says, in Spanish: lamps, health, calibrations, results, what a setting means. The program speaks English; `program.json` has
// its sentences with places for what changes. A sentence that is not there stays as it is.

import { filled, language, onLanguage, type Text } from "./language";

/** Sentences with places, and words that may stand in the places. */
export interface Catalogue {
  sentences: Text[];
  words: Text[];
}

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

/** Whether a text begins with a word and not with an acronym or a symbol, whose capitals stay: `EKF`, `R`. */
const isWord = (text: string): boolean => /^(\p{L}\p{Ll}|[AEOUY]\s)/u.test(text);
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
    const first = /^\p{Ll}/u.test(sentence) ? (isWord(said) ? said.charAt(0).toLowerCase() : said.charAt(0)) : /^\p{Lu}/u.test(sentence) ? said.charAt(0).toUpperCase() : said.charAt(0);
    return first + said.slice(1);
  }
  return sentence;
}

/** The sentences of a text: a point, and a capital behind it. */
const sentences = (text: string): string[] => text.match(/\S.*?[.?!](?=\s+\p{Lu}|\s*$)|\S.*$/gu) ?? [text];

/** A text of the program in the language of now. */
export function inLanguage(text: string): string {
  if (language() === "en" || !rules.length) return text;
  let said = known.get(text);
  if (said === undefined) {
    said = words.get(text) ?? sentences(text).map(translated).join(" ");
    if (known.size >= MOST_KNOWN) known = new Map();
    known.set(text, said);
  }
  return said;
}

/** Fetches the sentences once somebody reads Spanish, and calls when they are there; until then, and where they cannot be had, English stays. */
export function followLanguage(catalogue: () => Promise<Catalogue>, ready: () => void): void {
  const get = async (): Promise<void> => {
    if (language() === "en" || rules.length) return;
    const found = await catalogue();
    rules = found.sentences.map(rule);
    words = new Map(found.words.map(({ en, es }) => [en, es] as [string, string]));
    ready();
  };
  const follow = (): void => void get().catch(() => undefined);
  onLanguage(follow);
  follow();
}
