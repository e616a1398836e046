// How numbers stand on axes and in readouts.

const RAISED: Record<string, string> = { "-": "⁻", "+": "", "0": "⁰", "1": "¹", "2": "²", "3": "³", "4": "⁴", "5": "⁵", "6": "⁶", "7": "⁷", "8": "⁸", "9": "⁹" };

/** A power of ten, raised: 10⁻⁴. Other numbers are rounded to one figure. */
export function power(v: number): string {
  const [head, exponent] = v.toExponential(0).split("e");
  return `${head === "1" ? "" : `${head}·`}10${[...exponent!].map((c) => RAISED[c] ?? c).join("")}`.replace("-", "−");
}

/** A number on an axis. */
export function short(v: number): string {
  const size = Math.abs(v);
  if (size !== 0 && (size < 0.001 || size >= 1e5)) return power(v);
  return String(+v.toPrecision(4)).replace("-", "−");
}

/** A value that somebody reads off a curve, to four figures. */
export function reading(v: number | null | undefined): string {
  if (v === null || v === undefined || !Number.isFinite(v)) return "–";
  const size = Math.abs(v);
  if (size === 0) return "0";
  if (size < 1e-4 || size >= 1e6) return v.toExponential(2).replaceAll("-", "−");
  const digits = Math.min(5, Math.max(0, 3 - Math.floor(Math.log10(size))));
  return v.toFixed(digits).replace("-", "−");
}

/** A time on the readout: milliseconds are as fine as sensors are. */
export const moment = (v: number): string => v.toFixed(Math.abs(v) < 1e4 ? 3 : 1).replace("-", "−");

/** A range with round ends, so that axes jump seldom and never tremble. */
export function roomy(low: number, high: number, least: number): [number, number] {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [-least / 2, least / 2];
  const span = Math.max(high - low, least);
  const step = 10 ** Math.floor(Math.log10(span)) / 2;
  const middle = (low + high) / 2;
  return [Math.floor((middle - span * 0.54) / step) * step, Math.ceil((middle + span * 0.54) / step) * step];
}

/** Whole decades about what is shown, so that no point sits on the frame. */
export function decades(low: number, high: number, least: [number, number]): [number, number] {
  const below = low > 0 ? 10 ** Math.floor(Math.log10(low * 0.999)) : least[0];
  const above = high > 0 ? 10 ** Math.ceil(Math.log10(high * 1.001)) : least[1];
  return [Math.min(below, least[0]), Math.max(above, least[1])];
}

export const isDecade = (v: number): boolean => Math.abs(Math.log10(v) - Math.round(Math.log10(v))) < 1e-6;

/** The numbers of a log axis: one in so many decades, all in digits, or all as powers of ten where some have many digits. */
export function powers(splits: (number | null)[], apart: number): string[] {
  const exponents = splits.map((v) => (v !== null && v > 0 && isDecade(v) ? Math.round(Math.log10(v)) : null));
  const raised = exponents.some((e) => e !== null && (e < -3 || e > 4));
  // Counted from 1, or from where one number more finds room.
  const those = (from: number): number[] => exponents.filter((e): e is number => e !== null && (e - from) % apart === 0);
  let shown = those(0);
  for (let from = 1; from < apart; from++) if (those(from).length > shown.length) shown = those(from);
  return exponents.map((e) => (e === null || !shown.includes(e) ? "" : raised ? power(10 ** e) : short(10 ** e)));
}
