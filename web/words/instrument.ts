// What charts and their bar are called, in the language of now.

import type { BarWords } from "../instrument/bar";
import type { Words } from "../instrument/spec";
import catalogue from "./instrument.json";
import { language } from "./language";

export function instrumentWords(): Words & BarWords {
  const spoken = language();
  return Object.fromEntries(Object.entries(catalogue).map(([key, text]) => [key, text[spoken]])) as unknown as Words & BarWords;
}
