// What the page knows and what it shows: one state, changed here only, drawn again when it changes.

import type { Notation } from "./attitude";
import { History } from "./history";
import type { AidLine, Allan, Calibration, Curve, Device, Everyone, Experiment, ExperimentRow, Frame, FromProgram, Hello, Input, Magnetometer, Recording, SensorStatus, Settings, Standing, ToProgram, Tuned, Use, WhatIf } from "./protocol";

import { type Key, t } from "./t";

const CONFIRMED_MS = 1500;
export const STEPS = ["connect", "place", "calibrate", "tune", "experiment", "return", "result", "what-if"] as const;
export type Step = (typeof STEPS)[number];
export type Lower = "live" | "experiments" | "what-if" | "allan" | "recordings";
/** What the step "Calibrate" is about. */
export type Calibrating = "rest" | "magnetometer" | "allan";

export interface State {
  connection: "connecting" | "open" | "lost";
  /** When the connection was lost, by `performance.now()`. */
  lostMs: number;
  hello: Hello | null;
  devices: Device[];
  selected: string | null;
  step: Step;
  lower: Lower;
  calibrating: Calibrating;
  view: "lab" | "wall";
  displayHz: number;
  /** How attitudes are written in numbers. */
  notation: Notation;
  /** The device shown beside the selected one. */
  beside: string | null;
  livePage: "motion" | "estimators" | "sensors" | "filter";
  hidden: Set<string>;
  calibrations: Record<string, Calibration>;
  magnetometers: Record<string, Magnetometer>;
  running: Record<string, Experiment>;
  finished: Record<string, Experiment>;
  /** The experiment whose result is shown, of each device. */
  shownResults: Record<string, string>;
  /** The experiment that is shown although its device is not there: an earlier one, or a file. */
  shownAlone: string | null;
  rows: ExperimentRow[];
  /** The newest experiment of each device, the most consistent first. */
  board: Standing[];
  /** What became of the last order to every device. */
  everyone: Everyone | null;
  /** Experiments that were started with every device, for their names. */
  rounds: number;
  whatIf: WhatIf | null;
  curve: Curve | null;
  allan: Allan | null;
  /** The fit of Q and R that is under way, or came out last. */
  tuned: Tuned | null;
  recording: Recording | null;
  inputs: Input[];
  settings: Record<string, Settings>;
  use: Record<string, Partial<Use>>;
  estimators: Record<string, string[]>;
  error: string | null;
  /** The request that the last error answered. */
  failed: unknown;
  /** How often the connection has ended: what was asked before is not answered any more. */
  closed: number;
}

export const state: State = {
  connection: "connecting",
  lostMs: 0,
  hello: null,
  devices: [],
  selected: null,
  step: "connect",
  lower: "live",
  calibrating: "rest",
  view: "lab",
  displayHz: 30,
  notation: "yaw-pitch-roll",
  beside: null,
  livePage: "motion",
  hidden: new Set(),
  calibrations: {},
  magnetometers: {},
  running: {},
  finished: {},
  shownResults: {},
  shownAlone: null,
  rows: [],
  board: [],
  everyone: null,
  rounds: 0,
  whatIf: null,
  curve: null,
  allan: null,
  tuned: null,
  recording: null,
  inputs: [],
  settings: {},
  use: {},
  estimators: {},
  error: null,
  failed: null,
  closed: 0,
};

const SENSOR_KEYS = { "sensor.gyroscope": 1, "sensor.accelerometer": 1, "sensor.magnetometer": 1, "sensor.compass-heading": 1 };

export const histories = new Map<string, History>();
const changeListeners = new Set<() => void>();
const frameListeners = new Set<(frame: Frame) => void>();
let sender: (message: ToProgram) => void = () => undefined;
let scheduled = false;

export function onChange(listener: () => void): () => void {
  changeListeners.add(listener);
  return () => changeListeners.delete(listener);
}

export function onFrame(listener: (frame: Frame) => void): () => void {
  frameListeners.add(listener);
  return () => frameListeners.delete(listener);
}

/** Changes the state and draws once, however many changes a moment brings. */
export function update(change: (s: State) => void): void {
  change(state);
  if (scheduled) return;
  scheduled = true;
  queueMicrotask(() => {
    scheduled = false;
    sayWatched();
    for (const listener of changeListeners) listener();
  });
}

/** The device that the program sends everything of: what the page shows in full. */
let watched: string | null | undefined;

function sayWatched(): void {
  const wanted = state.view === "wall" ? null : state.selected;
  if (state.connection !== "open" || wanted === watched) return;
  watched = wanted;
  send({ type: "watch", device: wanted });
}

/** A new connection knows nothing of what is watched. */
export function watchAgain(): void {
  watched = undefined;
  sayWatched();
}

export function setSender(send: (message: ToProgram) => void): void {
  sender = send;
}

export function send(message: ToProgram): void {
  sender(message);
}

export function historyOf(device: string): History {
  let history = histories.get(device);
  if (!history) histories.set(device, (history = new History()));
  return history;
}

export function selectedDevice(): Device | undefined {
  return state.devices.find((d) => d.id === state.selected);
}

/** Selects a device: what is shown is about it. */
export function select(s: State, id: string | null): void {
  s.selected = id;
  s.shownAlone = null;
}

const collator = new Intl.Collator(undefined, { numeric: true, sensitivity: "base" });
/** The order of people's names, in which 2 comes before 10. */
export const byName = (a: string, b: string): number => collator.compare(a, b);

/** The experiment that is shown: of the selected device, or the one that was chosen without its device. */
export function shownExperiment(): string | undefined {
  if (state.shownAlone) return state.shownAlone;
  return state.selected ? state.shownResults[state.selected] ?? rowsOf(state.selected).filter((row) => !row.is_archived).at(-1)?.id : undefined;
}

/** Shows the result of an experiment. */
export function showExperiment(row: { id: string; device_id: string }): void {
  goTo("result");
  update((s) => {
    s.shownResults[row.device_id] = row.id;
    if (s.devices.some((d) => d.id === row.device_id)) select(s, row.device_id);
    else s.shownAlone = row.id;
  });
}

/** Results that were asked for. */
const fetched = new Set<string>();

/** Fetches what came out of an experiment that ended before this page was opened; where it cannot be had, the table's numbers stay. */
export function fetchResult(id: string): void {
  if (fetched.has(id)) return;
  fetched.add(id);
  const got = async (): Promise<void> => {
    const answer = await fetch(`/api/experiments/${encodeURIComponent(id)}/result.json`);
    if (!answer.ok) return;
    const message = (await answer.json()) as Experiment;
    if (message.id === id && message.result) update((s) => void (s.finished[id] ??= message));
  };
  // Without an answer it is asked for again when it is shown again.
  got().catch(() => fetched.delete(id));
}

/** The settings in force for a device as far as the page knows: what the program said, what was set, or the profile. */
export function settingsOf(device: string): Settings {
  return { ...profileSettings("hand-held"), ...state.devices.find((d) => d.id === device)?.settings, ...state.settings[device] };
}

function profileSettings(profile: string): Settings {
  return Object.fromEntries((state.hello?.parameters ?? []).map((p) => [p.name, p.default[profile]!]));
}

/** The sensors that correct the attitude: each has a lamp, a slider and a switch. */
export const aids = (): AidLine[] => state.hello?.aids ?? [];

/** What a sensor is called on the page. */
export const titleOf = (sensor: string): string => (`sensor.${sensor}` in SENSOR_KEYS ? t(`sensor.${sensor}` as Key) : sensor);

export const sensorOf = (device: Device, sensor: string): SensorStatus | undefined => device.sensors?.find((s) => s.sensor === sensor);

/** Whether samples come, the gyroscope's among them: without these nothing can be measured. */
export const receives = (device: Device): boolean => device.delivers && sensorOf(device, "gyroscope")?.delivery === "delivers";

/** Why no samples come, and what to do. */
export const silenceOf = (device: Device): string => device.silence || sensorOf(device, "gyroscope")?.text || "";

/** Whether what is shown is old: the program does not answer. */
export const isOld = (): boolean => state.connection === "lost";

/** The sensors in use as far as the page knows. */
export function useOf(device: Device): Use {
  const use = { gyroscope: true } as Use;
  for (const { sensor, switch: key } of aids()) use[key as keyof Use] = sensorOf(device, sensor)?.is_used ?? true;
  return Object.assign(use, state.use[device.id]);
}

/** Whether the program offers something. */
export const offers = (feature: string): boolean => state.hello?.features?.includes(feature) ?? false;

/** Whether this page is a student's: it has one phone, and what concerns all is the teacher's. */
export const isStudent = (): boolean => state.hello?.role === "student";

/** The steps of this page's path: a student's phone is connected by its own page. */
export const steps = (): readonly Step[] => (isStudent() ? STEPS.slice(1) : STEPS);

/** The experiments of a device, the oldest first. */
export const rowsOf = (device: string): ExperimentRow[] => state.rows.filter((row) => row.device_id === device);

function lowerOf(s: State, step: Step): Lower {
  if (step === "calibrate") return s.calibrating === "allan" ? "allan" : "live";
  return step === "result" ? "experiments" : step === "what-if" ? "what-if" : "live";
}

export function goTo(step: Step): void {
  update((s) => {
    s.step = step;
    s.view = "lab";
    s.lower = lowerOf(s, step);
  });
}

export function calibrateWhat(what: Calibrating): void {
  update((s) => {
    s.calibrating = what;
    s.lower = lowerOf(s, "calibrate");
  });
}

/** Takes one message of the program. */
export function receive(message: FromProgram): void {
  if (message.type === "frame") {
    historyOf(message.device).add(message);
    for (const listener of frameListeners) listener(message);
    return;
  }
  update((s) => take(s, message));
}

function take(s: State, message: Exclude<FromProgram, Frame>): void {
  switch (message.type) {
    case "hello":
      s.hello = message;
      if (message.role === "student" && s.step === "connect") s.step = "place";
      s.inputs = message.inputs ?? [];
      // A program that was started anew knows of nothing that was under way.
      s.running = {};
      s.magnetometers = {};
      s.calibrations = Object.fromEntries(Object.entries(s.calibrations).filter(([, c]) => c.state !== "running"));
      break;
    case "devices":
      takeDevices(s, message.devices);
      break;
    case "calibration":
      s.calibrations[message.device] = message;
      break;
    case "experiment":
      takeExperiment(s, message);
      break;
    case "experiments":
      s.rows = message.rows;
      s.board = message.board;
      if (!s.rows.some((row) => row.id === s.shownAlone)) s.shownAlone = null;
      break;
    case "everyone":
      s.everyone = message;
      break;
    case "what_if":
      s.whatIf = message;
      break;
    case "curve":
      s.curve = message;
      break;
    case "tuned":
      s.tuned = message;
      break;
    case "magnetometer":
      takeMagnetometer(s, message);
      break;
    case "allan":
      s.allan = message;
      break;
    case "recording":
      s.recording = message;
      break;
    case "inputs":
      s.inputs = message.inputs;
      break;
    case "error":
      s.error = message.text;
      s.failed = message.request ?? null;
      break;
  }
}

/** When settings of a device were last changed on this page. */
const changedHere = new Map<string, number>();

/** Shows a change at once, before the program has confirmed it. */
export function changeHere(device: string, change: (s: State) => void): void {
  changedHere.set(device, performance.now());
  update(change);
}

function takeDevices(s: State, devices: Device[]): void {
  for (const { id } of devices) {
    // What the program says counts again once a change has had the time to come back.
    if (performance.now() - (changedHere.get(id) ?? 0) < CONFIRMED_MS) continue;
    delete s.settings[id];
    delete s.use[id];
    delete s.estimators[id];
  }
  for (const device of devices) forgetEnded(s, device);
  const before = new Set(s.devices.map((d) => d.id));
  s.devices = [...devices].sort((a, b) => byName(a.name, b.name) || byName(a.id, b.id));
  for (const id of histories.keys()) if (!devices.some((d) => d.id === id)) histories.delete(id);
  const fresh = devices.find((d) => !before.has(d.id));
  const gone = !devices.some((d) => d.id === s.selected);
  if (gone) s.selected = s.devices[0]?.id ?? null;
  else if (fresh && s.step === "connect") select(s, fresh.id);
}

/** What the program no longer does is not shown as running, whatever became of the message that ended it. */
function forgetEnded(s: State, device: Device): void {
  if (device.is_experimenting === false) delete s.running[device.id];
  if (device.is_calibrating === false && s.calibrations[device.id]?.state === "running") delete s.calibrations[device.id];
  if (device.is_turned === false && s.magnetometers[device.id]?.state === "running") delete s.magnetometers[device.id];
}

function takeMagnetometer(s: State, message: Magnetometer): void {
  // What was last seen of the sphere stays while a verdict is read.
  s.magnetometers[message.device] = { ...s.magnetometers[message.device], ...message };
}

function takeExperiment(s: State, message: Experiment): void {
  if (message.state === "running") {
    s.running[message.device] = message;
    if (message.device === s.selected && s.step === "experiment" && message.remaining_s < 6) s.step = "return";
    return;
  }
  delete s.running[message.device];
  s.finished[message.id] = message;
  s.shownResults[message.device] = message.id;
  if (message.device !== s.selected) return;
  if (s.step === "experiment" || s.step === "return") {
    s.step = "result";
    s.lower = "experiments";
  }
}
