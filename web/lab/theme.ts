// Colours by role, read from the style sheet, so that plots and the 3-D view follow light and dark. One role has one meaning.

import type { Theme } from "../instrument/spec";

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

/** What each attitude is called, and how it is drawn beside its colour: thirteen colours alone are too many for some eyes. */
const ATTITUDES: Record<string, { name: string; dash?: number[] }> = {
  mekf: { name: "MEKF" },
  mekf3: { name: "MEKF, no bias", dash: [9, 3] },
  integration: { name: "Integration", dash: [2, 3] },
  device: { name: "Device's own", dash: [12, 3, 2, 3] },
  truth: { name: "Truth", dash: [6, 4] },
  "bounded-velocity": { name: "Bounded velocity", dash: [14, 4] },
  usque: { name: "USQUE", dash: [5, 2] },
  "quaternion-ekf": { name: "Quaternion EKF", dash: [8, 2, 2, 2] },
  complementary: { name: "Complementary", dash: [4, 4] },
  "complementary-passive": { name: "Passive", dash: [3, 2] },
  "complementary-direct": { name: "Direct", dash: [10, 2, 3, 2] },
  cascade: { name: "Cascade", dash: [6, 2] },
  "cascade-ekf": { name: "Cascade, EKF", dash: [2, 2] },
};

/** Everything that has an attitude, the estimators and the truth. */
export const ALL_ATTITUDES = Object.keys(ATTITUDES);

/** The role of an attitude's colour, everywhere. */
export const roleOf = (attitude: string): string => (ATTITUDES[attitude] ? attitude : "muted");

export const dashOf = (attitude: string): number[] | undefined => ATTITUDES[attitude]?.dash;

/** What an attitude is called on the page. */
export const nameOf = (attitude: string): string => ATTITUDES[attitude]?.name ?? attitude;
