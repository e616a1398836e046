// What the 3-D view and the large numbers show: the newest frame, or the moment that the charts' cursor is on.

import { Span } from "../instrument/span";
import { yawPitchRoll } from "./attitude";
import type { History } from "./history";
import type { Frame, Quaternion, Triple } from "./protocol";
import { historyOf, onFrame } from "./store";

/** How much of a stream is shown at first, s. */
export const WINDOW_S = 20;

const spans = new Map<string, Span>();

/** The span that all live charts of a device share; it stays while one looks elsewhere. */
export function spanOf(device: string): Span {
  let span = spans.get(device);
  if (!span) spans.set(device, (span = new Span(() => historyOf(device).frames.extent(), WINDOW_S)));
  return span;
}

/** The frame of a moment before, as far as it was kept. */
export function frameAt(history: History, time: number): Frame | null {
  const { frames, latest } = history, row = frames.at(time);
  if (row === null || !latest) return null;
  const estimates: Frame["estimates"] = {};
  const triple = (name: string): Triple | null => {
    const v = [0, 1, 2].map((i) => frames.value(`${name} ${i}`, row));
    return v.includes(null) ? null : (v as Triple);
  };
  let truth: Quaternion | null = null;
  for (const name of history.attitudes) {
    const q = history.attitudeAt(name, row);
    if (!q) continue;
    if (name === "truth") truth = q;
    else estimates[name] = { q, angles_deg: yawPitchRoll(q), std_deg: triple(`${name} std`), bias_deg_s: triple(`${name} bias`), bias_std_deg_s: triple(`${name} bias std`), covariance_deg2: null };
  }
  const rate = triple("rate");
  return { ...latest, t_s: frames.time(row), estimates, truth: truth && { q: truth, error: null }, between_deg: {}, rate_rad_s: (rate ?? [0, 0, 0]).map((v) => (v * Math.PI) / 180) as Triple, innovations: [] };
}

/** Calls with the frame to show whenever it is another one; `isPast` when the charts hold a moment before. */
export function followShown(device: string, show: (frame: Frame, isPast: boolean) => void): () => void {
  const span = spanOf(device), history = historyOf(device);
  const shown = (): void => {
    const moment = span.moment;
    const frame = moment === null ? history.latest : frameAt(history, moment);
    if (frame) show(frame, moment !== null);
  };
  shown();
  const stop = [onFrame((frame) => frame.device === device && span.moment === null && show(frame, false)), span.onChange(shown)];
  return () => stop.forEach((end) => end());
}
