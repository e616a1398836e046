// The phone page's texts, in the language of now; fixed ones stand in the page under their keys.

import catalogue from "../words/phone.json";
import { translator } from "../words/language";

export type Key = keyof typeof catalogue;
export const t = translator<Key>(catalogue);
export const has = (key: string): key is Key => key in catalogue;

export const byId = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;

export function element(tag: string, text: string, className = ""): HTMLElement {
  const made = document.createElement(tag);
  made.textContent = text;
  made.className = className;
  return made;
}

/** Changes a text only where it is another one: what is read aloud is not read again. */
export function say(where: HTMLElement, text: string): void {
  if (where.textContent !== text) where.textContent = text;
}

/** Writes every fixed text. */
export function writeFixed(): void {
  for (const e of Array.from(document.querySelectorAll<HTMLElement>("[data-t]"))) e.textContent = t(e.dataset["t"] as Key);
  for (const e of Array.from(document.querySelectorAll<HTMLElement>("[data-label]"))) e.setAttribute("aria-label", t(e.dataset["label"] as Key));
}
