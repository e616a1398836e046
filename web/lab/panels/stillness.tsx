// Whether a device rests now, in words: read before a calibration, an experiment, a recording at rest.

import { useFrame } from "../live";
import type { Device, Frame, RestCalibration } from "../protocol";
import { historyOf, receives, silenceOf } from "../store";
import type { Table } from "../table";
import { type Key, t } from "../t";
import { said } from "../words";

/** Slower than this a device rests. */
const STILL_DEG_S = 3;
/** What is constant is looked for in so many seconds, and not told from less than most of them. */
const WINDOW_S = 1.5;
const LEAST_S = 1;
/** A rate and a specific force that stay within so much of their middle are constant: noise, and no turn by hand. */
const CONSTANT_DEG_S = 1.5;
const CONSTANT_M_S2 = 0.35;

/** `constant`: the rate is not small and does not change, and its bias is not calibrated, so that a bias looks the same as a turn. */
export interface Motion {
  is: "waiting" | "rest" | "constant" | "moving";
  /** The rate, deg/s, without the bias where one is calibrated. */
  rate: number;
  isCalibrated: boolean;
  /** Whether the accelerometer's samples of the same time are known. */
  hasForce: boolean;
}

/** What the gyroscope, and the accelerometer where it is known, say of a device at a moment. */
export function motionOf(frame: Frame, rest: RestCalibration | null): Motion | null {
  if (!frame.rate_rad_s) return null;
  const bias = rest?.gyroscope_bias_rad_s;
  const rate = (Math.hypot(...frame.rate_rad_s.map((v, i) => v - (bias?.[i] ?? 0))) * 180) / Math.PI;
  const now = { rate, isCalibrated: !!bias, hasForce: false };
  if (rate < STILL_DEG_S) return { ...now, is: "rest" };
  if (bias) return { ...now, is: "moving" };
  const history = historyOf(frame.device);
  const turns = half(history.frames, ["rate 0", "rate 1", "rate 2"], frame.t_s), force = half(history.samples["accelerometer"], ["x", "y", "z"], frame.t_s);
  const hasForce = force !== null;
  if ((turns !== null && turns > CONSTANT_DEG_S) || (force !== null && force > CONSTANT_M_S2)) return { ...now, hasForce, is: "moving" };
  return { ...now, hasForce, is: turns === null ? "waiting" : "constant" };
}

/** Half of the range of what changes most during the window before a time; null where too little of it is there. */
function half(table: Table | undefined, names: string[], time: number): number | null {
  const rows = table?.pick(time - WINDOW_S, time) ?? [];
  if (!table || rows.length < 3 || table.time(rows.at(-1)!) < time - LEAST_S || table.time(rows.at(-1)!) - table.time(rows[0]!) < LEAST_S) return null;
  return Math.max(...names.map((name) => {
    const values = table.column(name, rows).filter((v) => v !== null);
    return (Math.max(...values) - Math.min(...values)) / 2;
  }));
}

const SHOWN: Record<Motion["is"], { tone: string; word: Key }> = {
  waiting: { tone: "idle", word: "still.waiting" },
  rest: { tone: "good", word: "still.rest" },
  constant: { tone: "info", word: "still.constant" },
  moving: { tone: "warn", word: "still.moving" },
};

function hint(motion: Motion | null): string {
  if (!motion) return t("still.none");
  const rate = { rate: motion.rate.toFixed(1) };
  if (motion.is === "constant") return t(motion.hasForce ? "still.constant.force" : "still.constant.rate", rate);
  return t(motion.isCalibrated ? "still.rate" : "still.measured", rate);
}

/** Without samples there is no rest: then why there are none, and what to do. */
export function Stillness({ device }: { device: Device }) {
  const motion = useFrame<Motion | null>(device.id, (frame) => motionOf(frame, device.rest), 4, null);
  if (!receives(device)) return <Silence device={device} />;
  const is = motion?.is ?? "waiting";
  return (
    <div class={`verdict ${SHOWN[is].tone}`} data-stillness={is}>
      {/* Only the word is read aloud, when it changes; the number changes all the time. */}
      <b aria-live="polite">{t(SHOWN[is].word)}</b>
      <span>{hint(motion)}</span>
    </div>
  );
}

/** That nothing is received, why, and what to do. */
export function Silence({ device }: { device: Device }) {
  return (
    <div class="verdict bad" data-stillness="nothing">
      <b aria-live="polite">{t("nothingReceived")}</b>
      <span>{said(silenceOf(device))}</span>
    </div>
  );
}
