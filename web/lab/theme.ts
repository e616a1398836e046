// Colours by role, read from the style sheet, so that plots and the 3-D view follow light and dark. One role has one meaning.

import type { Theme } from "../instrument/spec";
import { type Key, t } from "./t";

let cache = new Map<string, string>();
const listeners = new Set<() => void>();

/** The colour of a role, such as `mekf` or `x`. */
export function colour(role: string): string {
  let value = cache.get(role);
  if (value === undefined) {
    value = getComputedStyle(document.documentElement).getPropertyValue(`--${role}`).trim() || "#888888";
    cache.set(role, value);
  }
  return value;
}

/** Calls when light changes to dark or back. */
export function onTheme(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  cache = new Map();
  for (const listener of listeners) listener();
});

export const theme: Theme = { colour, onChange: onTheme };

/** How each attitude is drawn beside its colour: thirteen colours alone are too many for some eyes. */
const ATTITUDES: Record<string, { dash?: number[] }> = {
  mekf: {},
  mekf3: { dash: [9, 3] },
  integration: { dash: [2, 3] },
  device: { dash: [12, 3, 2, 3] },
  truth: { dash: [6, 4] },
  "bounded-velocity": { dash: [14, 4] },
  usque: { dash: [5, 2] },
  "quaternion-ekf": { dash: [8, 2, 2, 2] },
  complementary: { dash: [4, 4] },
  "complementary-passive": { dash: [3, 2] },
  "complementary-direct": { dash: [10, 2, 3, 2] },
  cascade: { dash: [6, 2] },
  "cascade-ekf": { dash: [2, 2] },
};

/** Everything that has an attitude, the estimators and the truth. */
export const ALL_ATTITUDES = Object.keys(ATTITUDES);

/** The role of an attitude's colour, everywhere. */
export const roleOf = (attitude: string): string => (ATTITUDES[attitude] ? attitude : "muted");

export const dashOf = (attitude: string): number[] | undefined => ATTITUDES[attitude]?.dash;

/** What an attitude is called on the page. */
export const nameOf = (attitude: string): string => (ATTITUDES[attitude] ? t(`estimator.${attitude}` as Key) : attitude);
