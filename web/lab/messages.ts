// Made from the program's types by a test of `crates/live/src/protocol.rs`; not to be edited.
import type { Settings, SettingValue } from "./protocol";

export type Action = "add" | "remove";

export type AidLine = {
  sensor: SensorKind,
  title: string,
  switch: string,
  noise: Array<string>,
  gate: string,
  unit: string,
  is_usual: boolean, };

export type Allan = {
  request: unknown,
  id: string,
  sensor: SensorKind,
  state: AllanState,
  text: string | null,
  report: AllanReport | null,
  fill: Fill | null, };

export type AllanPoint = {
  tau_s: number,
  cluster_samples: number,
  deviation: number,
  lower: number,
  upper: number,
  axis_deviations: [number, number, number],
  degrees_of_freedom: number,
  kind: NoiseKind, };

export type AllanReport = {
  sensor: SensorKind,
  unit: string,
  duration_s: number,
  rate_hz: number,
  samples: number,
  filled_samples: number,
  ignored_samples: number,
  curve: Array<AllanPoint>,
  coefficients: NoiseCoefficients,
  axis_coefficients: [NoiseCoefficients, NoiseCoefficients, NoiseCoefficients],
  floor: Floor,
  trusted_tau_s: number,
  worst_misfit: number,
  sentences: Array<string>, };

export type AllanState = "done" | "refused";

export type Alterations = {
  rate_hz?: number,
  gyroscope_step_deg_s?: number,
  accelerometer_step_m_s2?: number,
  delay_s?: number,
  lost_share?: number,
  bump?: Pulse,
  magnet?: Pulse, };

export type Asked = "calibrate" | "experiment" | "stop";

export type Calibration = {
  device: string,
  state: CalibrationState,
  progress: number,
  remaining_s: number,
  verdict: Remark | null,
  result: RestNumbers | null,
  samples: { [key in string]: Series } | null, };

export type CalibrationState = "running" | "done" | "refused";

export type CalibrationTimes = {
  rest: string | null,
  magnetometer: string | null, };

export type Card = "experiment" | "bias" | "consistent" | "no-magnetometer" | "rate" | "scale" | "magnet";

export type CardLine = {
  card: Card,
  minutes: number,
  questions: Array<Question>, };

export type Cause = "unit" | "stuck" | "hole" | "saturation" | "bursts" | "jitter" | "bias-change" | "misalignment" | "scale" | "hard-iron" | "magnetic-disturbance" | "rounding" | "noise" | "acceleration" | "lasting-errors";

export type Change = {
  settings: Settings,
  use?: SensorUse,
  estimators?: Array<EstimatorKind>,
  subject?: EstimatorKind,
  alterations?: Alterations, };

export type ClassTable = {
  cards: Array<Card>,
  students: Array<StudentLine>,
  hand_ins: Array<HandInLine>,
  shared: Array<Array<string>>,
  not_judged: Array<[string, string]>, };

export type Coefficient = {
  value: number,
  std: number, };

export type Contents = {
  name: string,
  format: string,
  duration_s: number | null,
  sensors: Array<SensorKind>,
  recordings: number, };

export type Coverage = {
  cells: Array<boolean>,
  slices: number,
  sectors: number,
  fraction: number, };

export type Curve = {
  request: unknown,
  id: string,
  curve: CurveColumns, };

export type CurveColumns = {
  parameter: string,
  values: Array<number>,
  nis: { [key in string]: Array<number | null> },
  error_deg: Array<number | null>, };

export type Delivery = "delivers" | "stopped" | "missing";

export type DeviceStatus = {
  id: string,
  name: string,
  source: string,
  connected: boolean,
  delivers: boolean,
  silence: string,
  silent_s: number | null,
  under_way: UnderWay | null,
  lost: number,
  duplicated_batches: number,
  settings: Settings | null,
  use: SensorUse | null,
  rest: RestNumbers | null,
  calibrated: CalibrationTimes,
  estimates: { [key in string]: Estimate },
  health: Array<Remark>,
  rates_hz: { [key in string]: number },
  resolution: { [key in string]: number },
  received: number,
  duplicated: number,
  refused: number,
  late: number,
  duration_s: number,
  estimators: Array<EstimatorKind>,
  subject: EstimatorKind | null,
  sensors: Array<SensorStatus>,
  is_calibrating: boolean,
  is_experimenting: boolean,
  is_turned: boolean,
  is_calibrated: boolean,
  magnetometer: MagnetometerFit | null, };

export type Disturbance = "none" | "acceleration" | "magnetic" | "both";

export type ErrorSummary = {
  total_rmse: number,
  heading_rmse: number,
  inclination_rmse: number,
  heading_offset: number,
  heading_offset_removed: boolean,
  heading_aligned_rmse: number,
  heading_drift_rmse: number,
  heading_drift_end: number,
  scored_samples: number,
  not_finite_samples?: number, };

export type Estimate = {
  q: [number, number, number, number],
  std_deg: [number, number, number] | null,
  angles_deg: [number, number, number],
  bias_deg_s: [number, number, number] | null,
  bias_std_deg_s: [number, number, number] | null,
  covariance_deg2: [[number, number, number], [number, number, number], [number, number, number]] | null,
  surroundings?: Surroundings, };

export type EstimatorKind = "integration" | "mekf3" | "mekf" | "bounded-velocity" | "usque" | "quaternion-ekf" | "complementary" | "complementary-passive" | "complementary-direct" | "cascade" | "cascade-ekf" | "device";

export type EstimatorLine = {
  name: EstimatorKind,
  summary: string,
  reads: Array<string>, };

export type Everyone = {
  asked: Asked,
  done: number,
  refused: Array<Refusal>,
  request: unknown, };

export type Experiment = {
  device: string,
  id: string,
  state: ExperimentState,
  progress: number,
  remaining_s: number,
  result: ExperimentResult | null, };

export type ExperimentResult = {
  subject: EstimatorKind,
  summary: { [key in string]: RunSummary },
  final: { [key in string]: FinalSummary | null },
  settings: Settings,
  hash: string,
  origin: string, };

export type ExperimentRow = {
  id: string,
  device: string,
  device_id: string,
  name: string,
  at: string,
  duration_s: number,
  asked_s: number,
  settings: Settings,
  subject: EstimatorKind,
  sensors: Array<SensorKind>,
  use: SensorUse,
  results: { [key in string]: ResultCell },
  is_earlier: boolean,
  has_samples: boolean,
  is_archived: boolean, };

export type ExperimentState = "running" | "done";

export type FaultRecord = {
  sensor: string,
  kind: string,
  from_s: number,
  found_s: number,
  until_s: number | null,
  size: number, };

export type Fill = {
  settings: Settings,
  said: Array<string>, };

export type FinalSummary = {
  calculated_error_deg: number,
  calculated_error_wxyz: [number, number, number, number],
  calculated_tilt_deg: number,
  calculated_heading_deg: number,
  estimated_error_deg: number | null,
  estimated_error_wxyz: [number, number, number, number] | null,
  estimated_std_deg: [number, number, number] | null,
  estimated_tilt_deg: number | null,
  degrees_of_freedom: number,
  normalised_square: number | null,
  verdict: FinalVerdict | null,
  sentence: string, };

export type FinalVerdict = "consistent" | "overconfident" | "conservative";

export type Finding = {
  cause: Cause,
  sensor: SensorKind,
  confidence: number,
  sentence: string, };

export type Fitted = {
  estimator: string,
  parameters: Array<FittedParameter>,
  without_effect: Array<string>,
  gain_fitted: number,
  gain_held_out: number,
  over_fits: boolean,
  error_deg: [number, number] | null, };

export type FittedParameter = {
  name: string,
  before: number,
  after: number,
  ran_off: boolean, };

export type Floor = {
  tau_s: number,
  deviation: number,
  is_reached: boolean, };

export type Frame = {
  device: string,
  t_s: number,
  subject: EstimatorKind | null,
  estimates: { [key in string]: Estimate },
  truth: TruthPose | null,
  between_deg: { [key in string]: number },
  rate_rad_s: [number, number, number],
  samples?: { [key in string]: Array<[number, number, number, number]> },
  innovations: Array<InnovationPoint>,
  lamp: Array<Lamp>, };

export type Gaps = {
  count: number,
  limit_s: number,
  longest_s: number,
  longest_start_s: number, };

export type HandInLine = {
  file: string,
  student: string,
  card: Card,
  at: string,
  judgement: Judgement, };

export type HandInRequest = {
  card: Card,
  student: string,
  answers: { [key in string]: string },
  settings: Settings,
  use?: SensorUse,
  estimators?: Array<EstimatorKind>,
  subject?: EstimatorKind,
  alterations?: Alterations, };

export type HandedIn = {
  url: string,
  file: string,
  judgement: Judgement,
  kept: boolean,
  problem: string | null, };

export type HeadingReference = "measured" | "initial" | "arbitrary" | "device";

export type Hello = {
  version: string,
  phone_urls: Array<string>,
  named_url: string | null,
  ingest_urls: Array<string>,
  qr_svg: string,
  estimators: Array<EstimatorLine>,
  parameters: Array<Parameter>,
  aids: Array<AidLine>,
  fingerprint: string,
  features: Array<string>,
  name: string,
  role: RoleName,
  input_kinds: Array<InputKindLine>,
  inputs: Array<InputStatus>, };

export type InnovationPoint = {
  sensor: SensorKind,
  t_s: number,
  residual: [number, number, number],
  std: [number, number, number],
  nis: number,
  dof: number,
  outcome: "fused" | "inflated" | "gated" | "skipped",
  gain: number | null, };

export type InputKind = "sensorserver" | "linkoping" | "phyphox" | "razor" | "northing" | "hyperimu" | "sensorstreamer";

export type InputKindLine = {
  kind: InputKind,
  title: string,
  hint: string,
  example: string, };

export type InputState = "connecting" | "connected" | "waiting" | "failed";

export type InputStatus = {
  id: string,
  kind: InputKind,
  address: string,
  state: InputState,
  text: string, };

export type Judgement = {
  passed: boolean,
  reasons: Array<Reason>, };

export type Lamp = {
  sensor: SensorKind,
  tone: Tone,
  text: string,
  nis_mean: number | null,
  nis_expected: number | null, };

export type Listed = {
  name: string,
  bytes: number,
  start: string | null,
  devices: Array<string>,
  finished: boolean, };

export type Made = {
  experiments: Array<string>,
  refused: Array<string>, };

export type Magnetometer = {
  device: string,
  state: MagnetometerState,
  verdict: Remark | null,
  fit: MagnetometerFit | null,
  coverage?: Coverage,
  points?: Array<[number, number, number]>,
  samples?: number,
  hint?: string, };

export type MagnetometerAction = "start" | "finish" | "cancel" | "discard";

export type MagnetometerFit = {
  model: "ellipsoid" | "sphere",
  hard_iron_ut: [number, number, number],
  soft_iron: [[number, number, number], [number, number, number], [number, number, number]],
  field_strength_ut: number,
  radius_ut: number,
  residual_std_ut: number | null,
  uncalibrated_norm_std_ut: number | null, };

export type MagnetometerSource = "device" | "uncalibrated";

export type MagnetometerState = "running" | "done" | "idle";

export type Motion = "gentle" | "brisk" | "tumble" | "rest";

export type NeesSummary = {
  mean: number,
  degrees_of_freedom: number,
  tilt_mean: number, };

export type NisColumns = {
  t_s: Array<number>,
  mean: Array<number>, };

export type NisOf<V> = {
  accelerometer: V | null,
  magnetometer: V | null,
  compass: V | null, };

export type NisSummary = {
  mean: number,
  median: number,
  degrees_of_freedom: number,
  samples: number,
  share_above_95: number,
  share_above_99: number,
  lag1_autocorrelation: number,
  effective_samples: number, };

export type NoiseCoefficients = {
  quantisation: Coefficient | null,
  noise_density: Coefficient | null,
  bias_instability: Coefficient | null,
  random_walk: Coefficient | null, };

export type NoiseKind = "quantisation" | "white" | "bias-instability" | "random-walk";

export type NoiseVerdict = "consistent" | "too-small" | "too-large" | "outliers" | "undetermined" | "too-few";

export type OpenedFile = {
  name: string,
  bytes: number,
  at: string | null, };

export type Origin = "default" | "profile" | "file" | "set" | "setup" | "setup-default" | "recording" | "calibration" | "learnt";

export type Parameter = {
  name: string,
  unit: string,
  range: string,
  meaning: string,
  default: Record<string, SettingValue>, };

export type PerSensor<V> = {
  gyroscope: V,
  accelerometer: V,
  magnetometer: V,
  compass: V, };

export type PositionRms = {
  horizontal: number,
  vertical: number, };

export type PositionSummary = {
  updates: UpdateCounts,
  innovation_rms_m: PositionRms | null,
  accelerometer_bias_m_s2: [number, number, number], };

export type Profile = "hand-held" | "lab";

export type Pulse = {
  at_s: number,
  duration_s: number,
  size: number, };

export type Question = {
  name: string,
  kind: QuestionKind,
  unit: string,
  choices: Array<string>, };

export type QuestionKind = "number" | "choice";

export type Reason = {
  key: string,
  values: { [key in string]: string },
  holds: boolean, };

export type RecordingState = "off" | "idle" | "on" | "failed";

export type RecordingStatus = {
  state: RecordingState,
  file: string | null,
  bytes: number,
  seconds: number,
  text: string, };

export type ReferenceAlignment = {
  clock_offset_s: number,
  clock_offset_std_s: number,
  misalignment_deg: [number, number, number],
  misalignment_std_deg: [number, number, number],
  correlation: number,
  rate_rms_deg_s: number,
  windows: number, };

export type ReferenceSummary = {
  samples: number,
  scored: number,
  in_gaps: number,
  alignment: ReferenceAlignment | null,
  found: ReferenceAlignment | null, };

export type Refusal = {
  device: string,
  name: string,
  text: string, };

export type Remark = {
  tone: Tone,
  text: string, };

export type Request = { "type": "virtual_phone",
  action: Action,
  motion?: Motion,
  disturbance?: Disturbance,
  seed?: number | null,
  hard_iron_ut?: [number, number, number],
  device?: string | null, } | { "type": "calibrate",
  device: string,
  seconds: number, } | { "type": "experiment",
  device: string,
  seconds: number,
  name: string, } | { "type": "stop",
  device: string, } | { "type": "calibrate_all",
  seconds: number, } | { "type": "experiment_all",
  seconds: number,
  name: string, } | { "type": "stop_all" } | { "type": "settings",
  device: string,
  settings: Settings,
  profile?: string | null, } | { "type": "sensors",
  device: string,
  use: SensorUse, } | { "type": "estimators",
  device: string,
  use: Array<EstimatorKind>, } | { "type": "subject",
  device: string,
  estimator: EstimatorKind, } | { "type": "display_rate",
  hz: number, } | { "type": "watch",
  device?: string | null, } | { "type": "what_if",
  id: string,
  curve?: string | null,
  settings: Settings,
  use?: SensorUse,
  estimators?: Array<EstimatorKind>,
  subject?: EstimatorKind,
  alterations?: Alterations, } | { "type": "tune",
  id: string,
  parameters?: Array<string>,
  settings: Settings,
  use?: SensorUse,
  estimators?: Array<EstimatorKind>,
  subject?: EstimatorKind,
  alterations?: Alterations, } | { "type": "calibrate_magnetometer",
  device: string,
  action: MagnetometerAction, } | { "type": "allan",
  id: string,
  sensor: string, } | { "type": "delete_experiment",
  id: string, } | { "type": "archive_experiment",
  id: string,
  archived: boolean, } | { "type": "remove",
  device: string, } | { "type": "input",
  action: Action,
  kind?: InputKind | null,
  address?: string,
  id?: string | null, } | { "type": "rename",
  device: string,
  name: string, };

export type RestNumbers = {
  gyroscope_samples: number,
  gyroscope_bias_rad_s: [number, number, number],
  gyroscope_bias_std_rad_s: [number, number, number],
  gyroscope_std_rad_s: [number, number, number],
  accelerometer_samples: number,
  specific_force_m_s2: [number, number, number] | null,
  accelerometer_std_m_s2: [number, number, number] | null,
  magnetometer_samples: number,
  magnetic_field_ut: [number, number, number] | null,
  magnetometer_std_ut: [number, number, number] | null, };

export type ResultCell = {
  calculated_error_deg: number | null,
  estimated_error_deg: number | null,
  degrees_of_freedom: number | null,
  calculated_tilt_deg: number | null,
  estimated_tilt_deg: number | null,
  verdict: FinalVerdict | null,
  nis_acc: number | null,
  nis_mag: number | null,
  nis_compass: number | null,
  error_deg: number | null, };

export type RoleName = "teacher" | "student";

export type RunSummary = {
  estimator: EstimatorKind,
  recording: string,
  duration_s: number,
  samples: number,
  updates: PerSensor<UpdateCounts>,
  heading: HeadingReference,
  error_deg: ErrorSummary | null,
  reference?: ReferenceSummary,
  nees_mean: number | null,
  nees: NeesSummary | null,
  nis_mean: NisOf<number>,
  final: FinalSummary | null,
  nis: NisOf<NisSummary>,
  verdicts: Array<SensorVerdict>,
  faults: Array<FaultRecord>,
  findings: Array<Finding>,
  unobservable: Array<string>,
  profile: Profile | null,
  magnetometer?: MagnetometerSource,
  hard_iron_prior_ut?: number,
  calibration: string | null,
  magnetometer_calibration?: string,
  smoothed: boolean,
  estimates: number,
  first_estimate_s: number | null,
  gaps: Gaps,
  position?: PositionSummary,
  samples_per_sensor: { [key in SensorKind]?: number },
  issues: Array<string>,
  parameters: Array<UsedParameter>,
  calibrations: unknown,
  version: string, };

export type SensorKind = "gyroscope" | "accelerometer" | "magnetometer" | "magnetometer-uncalibrated" | "device-gyroscope-bias" | "device-orientation" | "reference" | "position" | "velocity" | "pressure" | "compass-heading" | "gnss-position" | "gnss-velocity" | "forward-speed" | "water-velocity" | "true-heading" | "device-navigation" | "reference-position" | "reference-velocity";

export type SensorStatus = {
  sensor: SensorKind,
  delivery: Delivery,
  is_used: boolean,
  text: string, };

export type SensorUse = {
  gyroscope: boolean,
  accelerometer: boolean,
  magnetometer: boolean,
  compass?: boolean, };

export type SensorVerdict = {
  sensor: SensorKind,
  verdict: NoiseVerdict,
  variance_factor: number | null,
  confidence: number,
  mean_nis_band: [number, number],
  sentences: Array<string>, };

export type Series = {
  t_s: Array<number>, x: Array<number>, y: Array<number>, z: Array<number>, };

export type Standing = {
  place: number,
  experiment: string,
  device_id: string,
  verdict: FinalVerdict | null,
  nis_factor: number | null,
  is_nis_large: boolean, };

export type StudentLine = {
  student: string,
  passed: { [key in Card]?: boolean }, };

export type Surroundings = {
  hard_iron_ut: [number, number, number] | null,
  hard_iron_std_ut: [number, number, number] | null,
  field_variance_factor: number | null,
  is_resting: boolean, };

export type ToPage = { "type": "hello" } & Hello | { "type": "devices",
  devices: Array<DeviceStatus>, } | { "type": "frame" } & Frame | { "type": "calibration" } & Calibration | { "type": "experiment" } & Experiment | { "type": "experiments",
  rows: Array<ExperimentRow>,
  board: Array<Standing>, } | { "type": "everyone" } & Everyone | { "type": "what_if" } & WhatIf | { "type": "curve" } & Curve | { "type": "tuned" } & Tuned | { "type": "magnetometer" } & Magnetometer | { "type": "allan" } & Allan | { "type": "recording" } & RecordingStatus | { "type": "inputs",
  inputs: Array<InputStatus>, } | { "type": "error",
  text: string,
  request: unknown, };

export type Tone = "good" | "info" | "warn" | "bad" | "idle";

export type TraceColumns = {
  t_s: Array<number>,
  angles_deg: Array<[number, number, number]>,
  std_deg: Array<[number, number, number]> | null,
  error_deg: Array<number> | null,
  nis: { [key in string]: NisColumns }, };

export type TruthError = {
  angle_deg: number,
  sigmas: number | null,
  nees: number | null,
  degrees_of_freedom: number,
  tone: Tone,
  text: string, };

export type TruthPose = {
  q: [number, number, number, number],
  error: TruthError | null, };

export type Tuned = {
  request: unknown,
  id: string,
  runs: number,
  fit: Fitted | null, };

export type UnderWay = { "what": "calibration",
  remaining_s: number, } | { "what": "experiment",
  remaining_s: number, };

export type UpdateCounts = {
  fused: number,
  gated: number,
  skipped: number,
  inflated: number,
  skipped_because: { [key in string]: number }, };

export type UsedParameter = {
  name: string,
  unit: string,
  value: unknown,
  origin: Origin, };

export type WhatIf = {
  request: unknown,
  id: string,
  subject: EstimatorKind,
  elapsed_ms: number,
  results: { [key in string]: RunSummary },
  trace: TraceColumns,
  original: TraceColumns, };
