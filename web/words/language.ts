// The language of a page: English or Spanish. It is the browser's unless somebody chose.

export type Language = "en" | "es";
export const LANGUAGES: Record<Language, string> = { en: "English", es: "Español" };
/** A text in every language; placeholders are names in braces. */
export type Text = Record<Language, string>;

const KEY = "northing-language";
const listeners = new Set<() => void>();
let chosen: Language = remembered() ?? (navigator.language.toLowerCase().startsWith("es") ? "es" : "en");

function remembered(): Language | null {
  try {
    const value = localStorage.getItem(KEY);
    return value === "en" || value === "es" ? value : null;
  } catch {
    return null;
  }
}

export const language = (): Language => chosen;

export function setLanguage(to: Language): void {
  chosen = to;
  document.documentElement.lang = to;
  try {
    localStorage.setItem(KEY, to);
  } catch {
    // It is then the browser's again next time.
  }
  for (const listener of listeners) listener();
}

export function onLanguage(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

/** Fills the places of a text. */
export function filled(text: string, values: Record<string, string | number> = {}): string {
  return text.replace(/\{(\w+)\}/g, (whole, name: string) => (name in values ? String(values[name]) : whole));
}

/** Looks texts of a catalogue up in the language of now. */
export function translator<K extends string>(catalogue: Record<K, Text>): (key: K, values?: Record<string, string | number>) => string {
  return (key, values) => filled(catalogue[key][chosen], values);
}

document.documentElement.lang = chosen;
