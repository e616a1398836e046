// The streams of one device over the whole session, for plots, for scrolling back and for the 3-D view of a moment before.
// They never pass through Preact; plots read them when they draw.

import type { Frame, Innovation, Quaternion } from "./protocol";
import { Table } from "./table";

/** Time going back by more than this is a new session: what was before cannot share its axis, s. */
const BACK_S = 0.5;
const XYZ = ["x", "y", "z"];

const put = (row: Record<string, number | null | undefined>, name: string, values: readonly number[] | null | undefined, scale = 1): void => {
  values?.forEach((v, i) => (row[`${name} ${i}`] = v * scale));
};

export class History {
  latest: Frame | null = null;
  /** Of each attitude NAME: `NAME q 0`..`3`, `NAME std 0`..`2`, `NAME bias 0`.., `NAME bias std 0`..; rates; NEES and error against the truth. */
  readonly frames = new Table();
  /** Raw samples of each sensor: x, y, z. Only while the page watches this device. */
  readonly samples: Record<string, Table> = {};
  /** Of each sensor: `residual 0`.., `std 0`.., `nis`, `refused` (the NIS of what was refused), `gain`. */
  readonly innovations: Record<string, Table> = {};
  readonly degreesOfFreedom: Record<string, number> = {};
  /** Every attitude that was ever seen, in the order in which it came. */
  readonly attitudes = new Set<string>();
  private subject: string | null = null;

  add(frame: Frame): void {
    const end = this.frames.extent()?.[1];
    if (end !== undefined && frame.t_s < end - BACK_S) this.clear();
    this.latest = frame;
    if (frame.subject !== this.subject) {
      // Innovations and errors are of another estimator; the attitudes of all go on.
      this.subject = frame.subject;
      for (const table of Object.values(this.innovations)) table.clear();
    }
    const row: Record<string, number | null | undefined> = {};
    for (const [name, estimate] of Object.entries(frame.estimates)) {
      this.attitudes.add(name);
      put(row, `${name} q`, estimate.q);
      put(row, `${name} std`, estimate.std_deg);
      put(row, `${name} bias`, estimate.bias_deg_s);
      put(row, `${name} bias std`, estimate.bias_std_deg_s);
    }
    if (frame.truth) {
      this.attitudes.add("truth");
      put(row, "truth q", frame.truth.q);
      row["nees"] = frame.truth.error?.nees;
      row["nees dof"] = frame.truth.error?.degrees_of_freedom;
    }
    put(row, "rate", frame.rate_rad_s, 180 / Math.PI);
    this.frames.push(frame.t_s, row);
    for (const innovation of frame.innovations ?? []) this.addInnovation(innovation);
    for (const [sensor, rows] of Object.entries(frame.samples ?? {})) {
      const table = (this.samples[sensor] ??= new Table()), scale = sensor === "gyroscope" ? 180 / Math.PI : 1;
      for (const [t, ...v] of rows) {
        const values: Record<string, number> = {};
        v.forEach((value, i) => (values[XYZ[i]!] = value * scale));
        table.push(t, values);
      }
    }
  }

  private clear(): void {
    this.frames.clear();
    this.attitudes.clear();
    for (const table of [...Object.values(this.samples), ...Object.values(this.innovations)]) table.clear();
  }

  private addInnovation(i: Innovation): void {
    if (i.outcome === "skipped") return;
    const table = (this.innovations[i.sensor] ??= new Table());
    const refused = i.outcome === "gated";
    // With one degree of freedom it is a heading: one angle, in rad, that degrees make readable.
    const heading = isHeading(i.dof), scale = heading ? 180 / Math.PI : 1;
    if (this.degreesOfFreedom[i.sensor] !== i.dof) table.clear();
    this.degreesOfFreedom[i.sensor] = i.dof;
    const row: Record<string, number | null | undefined> = { nis: refused ? null : i.nis, refused: refused ? i.nis : null, gain: refused ? 0 : i.gain };
    put(row, "residual", heading ? [i.residual[0]] : i.residual, scale);
    put(row, "std", heading ? [i.std[0]] : i.std, scale);
    table.push(i.t_s, row);
  }

  /** The attitude of a name at a row of the frames. */
  attitudeAt(name: string, row: number): Quaternion | null {
    const q = [0, 1, 2, 3].map((i) => this.frames.value(`${name} q ${i}`, row));
    return q.includes(null) ? null : (q as Quaternion);
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
