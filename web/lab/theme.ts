// Colours by role, read from the style sheet, so that plots and the 3-D view follow light and dark.

let cache = new Map<string, string>();
const listeners = new Set<() => void>();

/** The colour of a role, such as `estimate` or `s1`. */
export function colour(role: string): string {
  let value = cache.get(role);
  if (value === undefined) {
    value = getComputedStyle(document.documentElement).getPropertyValue(`--${role}`).trim() || "#888";
    cache.set(role, value);
  }
  return value;
}

/** The colour with an opacity of 0 to 1. */
export function faded(role: string, opacity: number): string {
  return colour(role) + Math.round(opacity * 255).toString(16).padStart(2, "0");
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

/** Which colour an attitude is drawn in, everywhere. */
export function roleOf(estimator: string): string {
  const roles: Record<string, string> = { mekf: "estimate", integration: "s1", device: "device", truth: "reference", usque: "s2", "quaternion-ekf": "s4", mekf3: "s5", complementary: "s5", "complementary-passive": "s5", "complementary-direct": "s5", cascade: "s5", "cascade-ekf": "s4" };
  return roles[estimator] ?? "s5";
}

/** What an attitude is called on the page. */
export function nameOf(estimator: string): string {
  const names: Record<string, string> = { mekf: "MEKF", "bounded-velocity": "Bounded velocity", integration: "Integration", device: "Device's own", truth: "Truth", usque: "USQUE", "quaternion-ekf": "Quaternion EKF", mekf3: "MEKF, no bias", complementary: "Complementary", "complementary-passive": "Passive", "complementary-direct": "Direct", cascade: "Cascade", "cascade-ekf": "Cascade, EKF" };
  return names[estimator] ?? estimator;
}
