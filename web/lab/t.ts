// The lab page's texts, in the language of now.

import catalogue from "../words/lab.json";
import { translator } from "../words/language";

export type Key = keyof typeof catalogue;
export const t = translator<Key>(catalogue);
/** A text as every language has it: names that were given in another one are found, too. */
export const inEveryLanguage = (key: Key): string[] => Object.values(catalogue[key]);
