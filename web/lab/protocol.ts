// The messages between lab page and program. Quaternions are w, x, y, z, body to reference; angles are yaw, pitch, roll.

export type Quaternion = [number, number, number, number];
export type Triple = [number, number, number];
export type Tone = "good" | "info" | "warn" | "bad";
export type SettingValue = number | string;
export type Settings = Record<string, SettingValue>;
export type Sensor = "gyroscope" | "accelerometer" | "magnetometer";

export interface Parameter {
  name: string;
  unit: string;
  meaning: string;
  default: Record<string, SettingValue>;
}

export interface Hello {
  type: "hello";
  version: string;
  phone_urls: string[];
  ingest_urls: string[];
  qr_svg: string;
  estimators: { name: string; summary: string }[];
  parameters: Parameter[];
  fingerprint: string;
  /** What this program can do beyond the path itself; older ones say nothing. */
  features?: string[];
  input_kinds?: { kind: string; title?: string; hint: string; example?: string }[];
  inputs?: Input[];
}

export interface Device {
  id: string;
  name: string;
  source: string;
  connected: boolean;
  health: { tone: Tone; text: string }[];
  rates_hz: Record<string, number>;
  resolution: Record<string, number>;
  received: number;
  lost: number;
  duplicated: number;
  duration_s: number;
  settings?: Settings;
  use?: Partial<Record<Sensor, boolean>>;
  estimators?: string[];
  is_calibrating?: boolean;
  is_experimenting?: boolean;
  is_turned?: boolean;
  is_calibrated?: boolean;
  magnetometer?: MagnetometerFit | null;
}

/** The calibrated field is `soft_iron (measured - hard_iron)`, as long as `field_strength`. */
export interface MagnetometerFit {
  model: "ellipsoid" | "sphere";
  hard_iron_ut: Triple;
  hard_iron_std_ut?: Triple;
  soft_iron: [Triple, Triple, Triple];
  field_strength_ut: number;
  radius_ut: number;
  residual_std_ut: number | null;
  uncalibrated_norm_std_ut?: number;
  coverage?: number;
  samples?: number;
}

export interface Magnetometer {
  type: "magnetometer";
  device: string;
  state: "running" | "done" | "idle";
  coverage?: { cells: boolean[]; slices: number; sectors: number; fraction: number };
  points?: Triple[];
  samples?: number;
  fit?: MagnetometerFit | null;
  verdict: { tone: Tone; text: string } | null;
  hint?: string;
}

export interface Coefficient {
  value: number;
  std: number;
}

export interface AllanReport {
  sensor: string;
  unit: string;
  duration_s: number;
  rate_hz: number;
  curve: { tau_s: number; deviation: number; lower: number; upper: number }[];
  coefficients: Partial<Record<"quantisation" | "noise_density" | "bias_instability" | "random_walk", Coefficient | null>>;
  trusted_tau_s: number;
  sentences: string[];
}

export interface Allan {
  type: "allan";
  request: unknown;
  id: string;
  sensor: string;
  state: "done" | "refused";
  text: string | null;
  report: AllanReport | null;
  fill: { settings: Settings; said: string[] } | null;
}

export interface Recording {
  type: "recording";
  state: "idle" | "on" | "off" | "failed";
  file: string | null;
  bytes: number;
  seconds: number;
  text: string;
}

export interface Input {
  id: string;
  kind: string;
  address: string;
  state: string;
  text: string;
}

export interface Estimate {
  q: Quaternion;
  std_deg: Triple | null;
  angles_deg: Triple;
  bias_deg_s: Triple | null;
  surroundings?: Surroundings;
}

/** What the bounded-velocity filter knows beside the attitude. */
export interface Surroundings {
  /** Null where it is not estimated. */
  hard_iron_ut: Triple | null;
  hard_iron_std_ut: Triple | null;
  /** 1 is the field that is expected; null without a magnetometer. */
  field_variance_factor: number | null;
  is_resting: boolean;
}

export interface Innovation {
  sensor: string;
  t_s: number;
  residual: Triple;
  std: Triple;
  nis: number;
  dof: number;
  outcome: "fused" | "inflated" | "gated" | "skipped";
}

export interface Lamp {
  sensor: string;
  tone: Tone;
  text: string;
  nis_mean: number | null;
  /** What it is when consistent. */
  nis_expected?: number;
}

export interface Frame {
  type: "frame";
  device: string;
  t_s: number;
  estimates: Record<string, Estimate>;
  truth: { q: Quaternion } | null;
  between_deg: Record<string, number>;
  rate_rad_s: Triple | null;
  /** Those of the frames that were not sent included. */
  innovations: Innovation[];
  lamp: Lamp[];
}

/** A thinned series of one sensor: time and three axes. */
export interface Series {
  t_s: number[];
  x: number[];
  y: number[];
  z: number[];
}

export interface RestCalibration {
  gyroscope_samples: number;
  gyroscope_bias_rad_s: Triple;
  gyroscope_bias_std_rad_s: Triple;
  gyroscope_std_rad_s: Triple;
  accelerometer_samples: number;
  specific_force_m_s2?: Triple;
  accelerometer_std_m_s2?: Triple;
  magnetometer_samples: number;
  magnetic_field_ut?: Triple;
  magnetometer_std_ut?: Triple;
}

export interface Calibration {
  type: "calibration";
  device: string;
  state: "running" | "done" | "refused";
  progress: number;
  remaining_s: number;
  verdict: { tone: Tone; text: string } | null;
  result: RestCalibration | null;
  samples: Partial<Record<Sensor, Series>> | null;
}

export interface FinalSummary {
  calculated_error_deg: number;
  calculated_error_wxyz: Quaternion;
  estimated_error_deg: number | null;
  estimated_error_wxyz: Quaternion | null;
  estimated_std_deg: Triple | null;
  normalised_square: number | null;
  verdict: "consistent" | "overconfident" | "conservative" | null;
  sentence: string;
}

export interface NisSummary {
  mean: number;
  median: number;
  degrees_of_freedom: number;
  samples: number;
  share_above_95: number;
  share_above_99: number;
}

export interface RunSummary {
  estimator: string;
  duration_s: number;
  samples: number;
  error_deg: Record<string, number> | null;
  nis_mean: Partial<Record<Sensor, number | null>>;
  final: FinalSummary | null;
  nis: Partial<Record<Sensor, NisSummary | null>>;
  verdicts: { sensor: string; verdict: string; variance_factor: number | null; sentences: string[] }[];
  issues: string[];
}

export interface Experiment {
  type: "experiment";
  device: string;
  id: string;
  state: "running" | "done";
  progress: number;
  remaining_s: number;
  result: {
    summary: Record<string, RunSummary>;
    final?: Record<string, FinalSummary | null>;
    settings: Settings;
    hash: string;
    /** Where the numbers come from, in words. */
    origin: string;
  } | null;
}

export interface ExperimentRow {
  id: string;
  /** What people called the device. */
  device: string;
  device_id: string;
  name: string;
  at: string;
  duration_s: number;
  settings: Settings;
  results: Record<string, {
    calculated_error_deg: number | null;
    estimated_error_deg: number | null;
    verdict: string | null;
    nis_acc?: number | null;
    nis_mag?: number | null;
    error_deg?: number | null;
  }>;
}

export interface WhatIf {
  type: "what_if";
  request: unknown;
  id: string;
  elapsed_ms: number;
  results: Record<string, RunSummary>;
  trace: { t_s: number[]; [column: string]: unknown } | null;
}

/** The curve of a what-if; it comes after the answer. */
export interface Curve {
  type: "curve";
  request: unknown;
  id: string;
  curve: { parameter: string; values: number[]; nis_acc: (number | null)[]; nis_mag: (number | null)[]; error_deg: (number | null)[] };
}

export type FromProgram =
  | Hello
  | { type: "devices"; devices: Device[] }
  | Frame
  | Calibration
  | Experiment
  | { type: "experiments"; rows: ExperimentRow[] }
  | WhatIf
  | Curve
  | Magnetometer
  | Allan
  | Recording
  | { type: "inputs"; inputs: Input[] }
  | { type: "error"; text: string; request?: unknown };

export type ToProgram =
  | { type: "virtual_phone"; action: "add" | "remove"; motion?: string; disturbance?: string; seed?: number; hard_iron_ut?: Triple; device?: string }
  | { type: "calibrate"; device: string; seconds: number }
  | { type: "experiment"; device: string; seconds: number; name: string }
  | { type: "stop"; device: string }
  | { type: "settings"; device: string; settings: Settings; profile?: string }
  | { type: "sensors"; device: string; use: Record<Sensor, boolean> }
  | { type: "estimators"; device: string; use: string[] }
  | { type: "calibrate_magnetometer"; device: string; action: "start" | "finish" | "cancel" | "discard" }
  | { type: "allan"; request: number; id: string; sensor: string }
  | { type: "remove"; device: string }
  | { type: "input"; action: "add" | "remove"; kind?: string; address?: string; id?: string }
  | { type: "display_rate"; hz: number }
  | { type: "what_if"; request: number; id: string; settings: Settings; curve: string | null }
  | { type: "rename"; device: string; name: string };
