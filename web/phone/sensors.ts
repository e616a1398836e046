// The phone's sensors, as the browser gives them: Generic Sensor API where it works, else motion events.
// Numbers are passed on untouched; rates and steps are only looked at for display.

import { type Key as Words, t } from "./t";

export type Row = (number | null)[];
export type Channel = "a" | "g" | "m" | "q" | "dm" | "do";

/** What is known about one line of the display. */
export interface Meter {
  unit: string;
  tone: "good" | "warn" | "bad" | "idle";
  /** In the language of now. */
  text: () => string;
  count: number;
  /** Readings a second; negative while it is not known yet. */
  rateHz: number;
  step: number;
}

interface GenericSensor extends EventTarget {
  start(): void;
  stop(): void;
  readonly timestamp: number | null;
  readonly x?: number | null;
  readonly y?: number | null;
  readonly z?: number | null;
  readonly quaternion?: number[] | null;
}
type SensorClass = new (options: { frequency: number; referenceFrame?: string }) => GenericSensor;
type Permission = { requestPermission?: () => Promise<string> };

const meter = (unit: string): Meter => ({ unit, tone: "idle", text: () => t("notStarted"), count: 0, rateHz: -1, step: 0 });

/** One line for each kind of sensor. */
export const meters = {
  a: meter("m/s²"),
  g: meter("deg/s"),
  m: meter("µT"),
  q: meter("°"),
};
type Key = keyof typeof meters;

/** A sensor that has given nothing for so long is taken to be missing. */
const FIRST_READING_MS = 3000;
const lastValue: Partial<Record<Key, number[]>> = {};
const GENERIC: [Key, string, number][] = [["a", "Accelerometer", 60], ["g", "Gyroscope", 60], ["m", "Magnetometer", 50], ["q", "AbsoluteOrientationSensor", 60]];
const running: Partial<Record<Key, GenericSensor>> = {};
const win = window as unknown as Record<string, unknown>;

/** Counts a reading and remembers the smallest change seen, which is the step of the values. */
function count(key: Key, values: (number | null | undefined)[], words: Words, compass?: number): void {
  const m = meters[key];
  m.count++;
  m.tone = "good";
  m.text = () => t(words) + (compass === undefined ? "" : `, ${t("compass", { heading: compass.toFixed(0) })}`);
  const now = values.map((v) => v ?? 0);
  const before = lastValue[key];
  if (before) {
    now.forEach((v, i) => {
      const change = Math.abs(v - before[i]!);
      if (change > 1e-9 && (m.step === 0 || change < m.step)) m.step = change;
    });
  }
  lastValue[key] = now;
}

function say(key: Key, tone: Meter["tone"], words: Words | (() => string)): void {
  meters[key].tone = tone;
  meters[key].text = typeof words === "string" ? () => t(words) : words;
}

/** Asks for the sensors. Must be called directly in a tap; resolves to what was refused, in words. */
export async function askPermission(): Promise<string[]> {
  // Both calls before the first await: the tap allows them only now.
  const asked = ["DeviceMotionEvent", "DeviceOrientationEvent"].map((name) => {
    const ask = (win[name] as Permission | undefined)?.requestPermission;
    return ask ? ask.call(win[name]).catch((e: Error) => `failed: ${e.message}`) : Promise.resolve("granted");
  });
  const answers = await Promise.all(asked);
  return answers.flatMap((answer, i) => (answer === "granted" ? [] : [`${i === 0 ? "motion" : "orientation"} sensors: ${answer}`]));
}

/** Starts everything that this browser has. */
export function startSensors(push: (channel: Channel, row: Row) => void, note: (text: string) => void): void {
  for (const [key, name, frequency] of GENERIC) startGeneric(key, name, frequency, push, note);
  const motion = !!win["Accelerometer"] && !!win["Gyroscope"], orientation = !!win["AbsoluteOrientationSensor"];
  if (!motion) useMotionEvents(push, note);
  if (!orientation) useOrientationEvents(push, note);
  // A class that exists can still have no sensor behind it: after a while use events instead.
  window.setTimeout(() => {
    if (motion && (!meters.a.count || !meters.g.count)) useMotionEvents(push, note);
    if (orientation && !meters.q.count) useOrientationEvents(push, note);
    if (!meters.m.count) {
      stop("m");
      say("m", "warn", win["Magnetometer"] ? "noneToGive" : "noneOffered");
    }
  }, FIRST_READING_MS);
  // Frozen sensors show as a rate of zero.
  let last = performance.now();
  let counts = Object.values(meters).map((m) => m.count);
  window.setInterval(() => {
    const now = performance.now();
    const all = Object.values(meters);
    all.forEach((m, i) => (m.rateHz = ((m.count - counts[i]!) * 1000) / (now - last)));
    counts = all.map((m) => m.count);
    last = now;
  }, 1000);
}

function startGeneric(key: Key, name: string, frequency: number, push: (channel: Channel, row: Row) => void, note: (text: string) => void): void {
  const make = win[name] as SensorClass | undefined;
  if (!make) return say(key, "idle", "noSensor");
  try {
    const sensor = new make({ frequency, referenceFrame: "device" });
    sensor.addEventListener("reading", () => {
      if (!running[key]) return;
      const t = sensor.timestamp ?? performance.now();
      if (key === "q") {
        const q = sensor.quaternion ?? [];
        push("q", [t, q[0] ?? null, q[1] ?? null, q[2] ?? null, q[3] ?? null]);
        count("q", [], "grantedSensor");
        return;
      }
      push(key, [t, sensor.x ?? null, sensor.y ?? null, sensor.z ?? null]);
      const scale = key === "g" ? 180 / Math.PI : 1;
      count(key, [sensor.x, sensor.y, sensor.z].map((v) => (v ?? 0) * scale), "grantedSensor");
    });
    sensor.addEventListener("error", (e) => {
      const error = (e as Event & { error?: DOMException }).error;
      note(`${name}: ${error?.name ?? "error"} ${error?.message ?? ""}`);
      say(key, "bad", error?.name === "NotAllowedError" ? "denied" : "unavailable");
    });
    running[key] = sensor;
    sensor.start();
  } catch (e) {
    const { message } = e as Error;
    say(key, "bad", () => message);
  }
}

function stop(key: Key): void {
  running[key]?.stop();
  delete running[key];
}

function useMotionEvents(push: (channel: Channel, row: Row) => void, note: (text: string) => void): void {
  stop("a");
  stop("g");
  if (!win["DeviceMotionEvent"]) {
    for (const key of ["a", "g"] as const) say(key, "bad", window.isSecureContext ? "noMotion" : "insecure");
    return;
  }
  note("motion events are used");
  say("a", "warn", "first");
  say("g", "warn", "first");
  window.addEventListener("devicemotion", (e) => {
    const a = e.acceleration, f = e.accelerationIncludingGravity, r = e.rotationRate;
    push("dm", [e.timeStamp, a?.x ?? null, a?.y ?? null, a?.z ?? null, f?.x ?? null, f?.y ?? null, f?.z ?? null, r?.alpha ?? null, r?.beta ?? null, r?.gamma ?? null]);
    if (f && f.x !== null) count("a", [f.x, f.y, f.z], "grantedMotion");
    if (r && r.alpha !== null) count("g", [r.alpha, r.beta, r.gamma], "grantedMotion");
  });
}

function useOrientationEvents(push: (channel: Channel, row: Row) => void, note: (text: string) => void): void {
  stop("q");
  if (!win["DeviceOrientationEvent"]) return say("q", "bad", "unavailable");
  const name = "ondeviceorientationabsolute" in window ? "deviceorientationabsolute" : "deviceorientation";
  note(`${name} events are used`);
  say("q", "warn", "first");
  window.addEventListener(name, (event) => {
    const e = event as DeviceOrientationEvent & { webkitCompassHeading?: number; webkitCompassAccuracy?: number };
    push("do", [e.timeStamp, e.alpha, e.beta, e.gamma, e.absolute ? 1 : 0, e.webkitCompassHeading ?? null, e.webkitCompassAccuracy ?? null]);
    if (e.alpha !== null) count("q", [e.beta, e.gamma], "grantedOrientation", e.webkitCompassHeading);
  });
}
