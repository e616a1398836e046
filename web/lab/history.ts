// The streams of one device, kept for the plots: somewhat more of frames and innovations than plots show.
// They never pass through Preact; plots read them when they draw.

import type { Frame, Innovation } from "./protocol";

const KEEP_S = 25;
const TRIM_AT = 20_000;

/** Rows of numbers with a time column first, the oldest dropped. */
export class Rows {
  readonly columns: (number | null)[][];
  constructor(width: number) {
    this.columns = Array.from({ length: width }, () => []);
  }

  push(row: (number | null)[]): void {
    const time = this.columns[0]!;
    // Time going back is a new session: what was before cannot share its axis.
    if (time.length && row[0]! < time[time.length - 1]! - 0.5) this.clear();
    this.columns.forEach((column, i) => column.push(row[i] ?? null));
    if (time.length > TRIM_AT || (time.length % 256 === 0 && time[0]! < row[0]! - 2 * KEEP_S)) this.trim(row[0]! - KEEP_S);
  }

  clear(): void {
    for (const column of this.columns) column.length = 0;
  }

  private trim(before: number): void {
    const first = Math.max(this.firstAfter(before), this.columns[0]!.length - TRIM_AT / 2);
    for (const column of this.columns) column.splice(0, first);
  }

  private firstAfter(time: number): number {
    const column = this.columns[0]!;
    let low = 0, high = column.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (column[middle]! < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The last `seconds` before `end`, time as seconds relative to `end`. */
  window(seconds: number, end: number): (number | null)[][] {
    const first = this.firstAfter(end - seconds);
    return this.columns.map((column, i) => {
      const part = column.slice(first);
      return i === 0 ? part.map((t) => t! - end) : part;
    });
  }
}

/** yaw, pitch, roll, their standard deviations, and the truth's angles. */
const ANGLES = 10;

export class History {
  latest: Frame | null = null;
  readonly angles = new Rows(ANGLES);
  readonly rates = new Rows(4);
  /** t, residual x y z, expected std x y z, NIS when used, NIS when refused. */
  readonly innovations: Record<string, Rows> = {};
  readonly degreesOfFreedom: Record<string, number> = {};
  private lastInnovation: Record<string, number> = {};
  private subject: string | null = null;

  add(frame: Frame): void {
    this.latest = frame;
    if (frame.subject !== this.subject) {
      // What was drawn is of another estimator.
      this.subject = frame.subject;
      this.angles.clear();
      for (const rows of Object.values(this.innovations)) rows.clear();
    }
    const main = mainEstimate(frame);
    const truth = frame.truth ? anglesOf(frame.truth.q) : [null, null, null];
    if (main) this.angles.push([frame.t_s, ...main.angles_deg, ...(main.std_deg ?? [null, null, null]), ...truth]);
    if (frame.rate_rad_s) this.rates.push([frame.t_s, ...frame.rate_rad_s.map((r) => (r * 180) / Math.PI)]);
    for (const innovation of frame.innovations) this.addInnovation(innovation);
  }

  private addInnovation(i: Innovation): void {
    if (i.outcome === "skipped" || i.t_s === this.lastInnovation[i.sensor]) return;
    this.lastInnovation[i.sensor] = i.t_s;
    const rows = (this.innovations[i.sensor] ??= new Rows(9));
    const nis = Math.max(i.nis, 1.2e-3);
    const refused = i.outcome === "gated";
    // With one degree of freedom it is a heading: one angle, in rad, that degrees make readable.
    const scale = isHeading(i.dof) ? 180 / Math.PI : 1;
    const of = (v: readonly number[]): (number | null)[] => v.map((x, k) => (scale === 1 || k < 1 ? x * scale : null));
    if (this.degreesOfFreedom[i.sensor] !== i.dof) rows.clear();
    this.degreesOfFreedom[i.sensor] = i.dof;
    rows.push([i.t_s, ...of(i.residual), ...of(i.std), refused ? null : nis, refused ? nis : null]);
  }
}

/** Whether an innovation is one angle: a compass, or a magnetometer that is used as one. */
export const isHeading = (dof: number | undefined): boolean => dof === 1;

/** The estimate that plots and numbers show: the subject's, once there is one. */
export function mainName(frame: Frame): string | undefined {
  return frame.subject && frame.estimates[frame.subject] ? frame.subject : undefined;
}

export function mainEstimate(frame: Frame): Frame["estimates"][string] | undefined {
  const name = mainName(frame);
  return name === undefined ? undefined : frame.estimates[name];
}

const DEG = 180 / Math.PI;

/** Yaw, pitch, roll in degrees (Z-Y'-X''), as the program's. */
export function anglesOf([w, x, y, z]: [number, number, number, number]): [number, number, number] {
  const sinPitch = Math.max(-1, Math.min(1, 2 * (w * y - z * x)));
  return [
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) * DEG,
    Math.asin(sinPitch) * DEG,
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) * DEG,
  ];
}

/** Angle between two attitudes, degrees. */
export function angleBetween(a: readonly number[], b: readonly number[]): number {
  const dot = Math.abs(a[0]! * b[0]! + a[1]! * b[1]! + a[2]! * b[2]! + a[3]! * b[3]!);
  return 2 * Math.acos(Math.min(1, dot)) * DEG;
}
