// The lab page's texts, in the language of now.

import catalogue from "../words/lab.json";
import { translator } from "../words/language";

export type Key = keyof typeof catalogue;
export const t = translator<Key>(catalogue);
