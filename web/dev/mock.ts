// A stand-in for the program's WebSocket: one or more synthetic devices, good enough to look at every screen.

import type { Calibration, Device, EstimatorKind, Frame, FromProgram, Innovation, Quaternion, RunSummary, Sensor, ToProgram, Triple } from "../lab/protocol";

/** As much of a message as the screens need. */
type Sketch<T> = T extends string | number | boolean | null | Triple | Quaternion ? T : T extends (infer U)[] ? Sketch<U>[] : T extends object ? { [K in keyof T]?: Sketch<T[K]> } : T;

const noise = (): number => Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());
const noise3 = (s: number): Triple => [noise() * s, noise() * s, noise() * s];
const norm = (q: number[]): Quaternion => q.map((v) => v / Math.hypot(...q)) as Quaternion;
const mul = ([a, b, c, d]: Quaternion, [e, f, g, h]: Quaternion): Quaternion =>
  norm([a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g, a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e]);
const exp = (v: number[]): Quaternion => norm([1, ...v.map((x) => x / 2)]);
const angles = ([w, x, y, z]: Quaternion): Triple => [Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)), Math.asin(2 * (w * y - z * x)), Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))].map((v) => (v * 180) / Math.PI) as Triple;
const truthAt = (t: number, k: number): Quaternion => mul(mul(exp([0, 0, 0.9 * Math.sin(0.31 * t + k)]), exp([0.7 * Math.sin(0.53 * t + k), 0, 0])), exp([0, 0.6 * Math.sin(0.4 * t), 0]));

const parameters: [string, string, number][] = [
  ["gyroscope_noise_density", "rad/s/sqrt(Hz)", 5e-4], ["gyroscope_bias_random_walk", "rad/s/sqrt(s)", 2e-4], ["accelerometer_std", "m/s^2", 0.05], ["magnetometer_std_ut", "microtesla", 0.5],
  ["accelerometer_gate_nis", "-", 11.34], ["magnetometer_gate_nis", "-", 11.34], ["gate_timeout_s", "s", 3], ["initial_tilt_std", "rad", 0.1],
];

function summary(name: EstimatorKind, error: number, estimated: number | null): Sketch<RunSummary> {
  return {
    estimator: name, duration_s: 30, samples: 9000, error_deg: { total_rmse: error * 0.8 }, nis_mean: { accelerometer: 3.1, magnetometer: 2.9 }, nis: {}, issues: [],
    final: { calculated_error_deg: error, calculated_error_wxyz: exp([0.004, -0.003, 0.005]), estimated_error_deg: estimated, estimated_error_wxyz: estimated ? exp([0.004, 0.004, 0.007]) : null, estimated_std_deg: null, normalised_square: 2.2, verdict: estimated ? "consistent" : null, sentence: `Back in the first pose the estimate is ${error.toFixed(2)} deg away from it, as the filter's 0.54 deg allow: consistent. A hand puts a device back only to 0.5 to 1 deg: a calculated error of that size says nothing against the filter.` },
    verdicts: [{ sensor: "accelerometer", verdict: "consistent", variance_factor: 1.03, sentences: ["NIS is 3.1 on average, 3 when consistent: the stated noise fits."] }, { sensor: "magnetometer", verdict: "too-small", variance_factor: 2.4, sentences: ["R is about 2.4 times too small."] }],
  };
}

const ESTIMATORS: EstimatorKind[] = ["integration", "mekf3", "mekf", "usque", "quaternion-ekf", "device"];

class Mock extends EventTarget {
  static readonly OPEN = 1;
  readonly readyState = 1;
  onopen: (() => void) | null = null;
  onmessage: ((e: { data: string }) => void) | null = null;
  onclose: (() => void) | null = null;
  private devices: (Sketch<Device> & Pick<Device, "id" | "name" | "received">)[] = [];
  private rows: Sketch<Extract<FromProgram, { type: "experiments" }>["rows"]> = [];
  private t = 0;

  constructor() {
    super();
    setTimeout(() => {
      this.onopen?.();
      this.say({
        type: "hello", version: "0.0.0", phone_urls: ["https://192.0.2.7:7771/p#t=J7p3vX0mQk2b9sT4uY6wZg"], ingest_urls: ["http://192.0.2.7:7772/in/J7p3vX0mQk2b9sT4uY6wZg"], qr_svg: "qr.svg",
        estimators: ESTIMATORS.map((name) => ({ name, summary: "what it does, in a few words", reads: parameters.map(([p]) => p) })), aids: [
          { sensor: "accelerometer", title: "Accelerometer", switch: "accelerometer", noise: ["accelerometer_std"], gate: "accelerometer_gate_nis", unit: "m/s^2", is_usual: true },
          { sensor: "magnetometer", title: "Magnetometer", switch: "magnetometer", noise: ["magnetometer_std_ut"], gate: "magnetometer_gate_nis", unit: "microtesla", is_usual: true },
        ], features: ["estimators", "magnetometer", "allan", "remove"], parameters: parameters.map(([name, unit, v]) => ({ name, unit, meaning: name.replaceAll("_", " "), default: { lab: v, "hand-held": v * 4 } })), fingerprint: "A1:B2:C3:D4:E5:F6:07:18:29:3A:4B:5C",
      });
      this.say({ type: "devices", devices: [] });
    });
    setInterval(() => this.tick(), 33);
    setInterval(() => this.say({ type: "devices", devices: structuredClone(this.devices) }), 500);
  }

  private say(message: Sketch<FromProgram>): void {
    this.onmessage?.({ data: JSON.stringify(message) });
  }

  private tick(): void {
    this.t += 0.033;
    this.devices.forEach((device, k) => {
      device.received += 10;
      const q = truthAt(this.t, k), mekf = mul(q, exp(noise3(0.003)));
      const estimates: Frame["estimates"] = {};
      const drift = 0.004 * this.t;
      for (const [name, other, std] of [["mekf", mekf, true], ["integration", mul(exp([drift, drift * 0.5, drift * 2]), q), false], ["device", mul(exp([0, 0, 0.06]), q), false]] as [string, Quaternion, boolean][]) {
        estimates[name] = { q: other, angles_deg: angles(other), std_deg: std ? [0.7, 0.25, 0.25] : null, bias_deg_s: null, bias_std_deg_s: null, covariance_deg2: null };
      }
      const innovations = (["accelerometer", "magnetometer"] as const).map((sensor): Innovation => {
        const s = sensor === "accelerometer" ? 0.05 : 0.5, residual = noise3(sensor === "accelerometer" ? s : s * 1.5);
        const nis = residual.reduce((sum, r) => sum + (r / s) ** 2, 0);
        return { sensor, t_s: this.t, residual, std: [s, s, s], nis, dof: 3, gain: 0.02, outcome: nis > 11.34 ? "gated" : "fused" };
      });
      this.say({
        type: "frame", device: device.id, t_s: this.t, subject: "mekf", estimates, truth: { q, error: { angle_deg: 0.3, sigmas: 0.8, nees: 0.64, degrees_of_freedom: 3, tone: "good", text: "0.3 deg from the truth, 0.8 sigma." } }, between_deg: {}, rate_rad_s: noise3(0.02).map((n, i) => n + 0.4 * Math.cos(0.4 * this.t + i)) as Triple, innovations,
        lamp: [{ sensor: "accelerometer", tone: "good", text: "The residuals are as large as stated.", nis_mean: 3.1, nis_expected: 3 }, { sensor: "magnetometer", tone: "warn", text: "R is about 2.3 times too small: raise it or look for iron near by.", nis_mean: 6.8, nis_expected: 3 }],
      });
    });
  }

  send(text: string): void {
    const m = JSON.parse(text) as ToProgram;
    if (m.type === "virtual_phone" && m.action === "add") {
      const n = this.devices.length + 1;
      this.devices.push({ id: `v${n}`, name: `Virtual phone ${n}`, source: "virtual", connected: true, delivers: true, silence: "", subject: "mekf", estimators: ["integration", "mekf"], sensors: (["gyroscope", "accelerometer", "magnetometer"] as const).map((sensor) => ({ sensor, delivery: "delivers" as const, is_used: true, text: "" })), health: [{ tone: n % 3 === 2 ? "warn" : "good", text: n % 3 === 2 ? "The accelerometer is rounded to 0.1 m/s²." : "All sensors deliver." }], rates_hz: { gyroscope: 100, accelerometer: 100, magnetometer: 50 }, resolution: {}, received: 0, lost: 0, duplicated: 0, duration_s: 0 });
    }
    if (m.type === "calibrate") this.calibrate(m.device, m.seconds);
    if (m.type === "calibrate_all") this.devices.forEach((d) => this.calibrate(d.id, m.seconds));
    if (m.type === "experiment_all") this.devices.forEach((d) => this.experiment(d.id, m.seconds, m.name ?? ""));
    if (m.type === "experiment") this.experiment(m.device, m.seconds, m.name);
    if (m.type === "what_if") this.whatIf(m);
    if (m.type === "calibrate_magnetometer") this.turn(m.device, m.action);
    if (m.type === "allan") this.allan(m);
    if (m.type === "estimators") this.devices.find((d) => d.id === m.device)!.estimators = m.use;
    if (m.type === "rename") this.devices.find((d) => d.id === m.device)!.name = m.name;
  }

  private turning = new Set<string>();

  private turn(device: string, action: string): void {
    const hard_iron_ut: Triple = [25, -14, 30];
    const fit = { model: "ellipsoid" as const, hard_iron_ut, soft_iron: [[1.05, 0.02, 0], [0.02, 0.97, 0.01], [0, 0.01, 1]] as [Triple, Triple, Triple], field_strength_ut: 43, radius_ut: 43, residual_std_ut: 0.52, uncalibrated_norm_std_ut: 21.3, coverage: 0.7 };
    if (action === "start") this.turning.add(device);
    else this.turning.delete(device);
    const own = this.devices.find((d) => d.id === device)!;
    if (action === "finish") own.magnetometer = fit;
    if (action === "discard") own.magnetometer = null;
    const points: Triple[] = [];
    const tell = (): void => {
      if (!this.turning.has(device)) return;
      for (let i = 0; i < 4; i++) points.unshift(norm([0, noise(), noise(), noise()]).slice(1).map((v, k) => v * 43 + hard_iron_ut[k]! + noise() * 0.5) as Triple);
      const cells = Array.from({ length: 72 }, (_, i) => i < points.length / 3);
      this.say({ type: "magnetometer", device, state: "running", coverage: { cells, slices: 6, sectors: 12, fraction: cells.filter(Boolean).length / 72 }, points: points.slice(0, 300), fit, verdict: { tone: "good", text: "Good: 70 % of the sphere seen, hard and soft iron found, residual 0.52 uT." }, hint: "Turn it so that its left edge and its screen point down." });
      setTimeout(tell, 200);
    };
    if (action === "start") tell();
    else this.say({ type: "magnetometer", device, state: action === "finish" ? "done" : "idle", fit, verdict: { tone: "good", text: "Applied from now on: hard iron 25.0, -14.0, 30.0 uT taken away; the field's length now scatters by 0.52 uT, before by 21.34 uT." } });
  }

  private allan(m: Extract<ToProgram, { type: "allan" }>): void {
    const curve = Array.from({ length: 40 }, (_, i) => {
      const tau_s = 10 ** (-2 + i / 10), deviation = Math.hypot(5e-4 / Math.sqrt(tau_s), 2e-5) * (1 + 0.03 * noise());
      return { tau_s, deviation, lower: deviation * (1 - 0.012 * i), upper: deviation * (1 + 0.015 * i) };
    });
    this.say({
      type: "allan", request: m.request, id: m.id, sensor: m.sensor as Sensor, state: "done", text: null, fill: { settings: { gyroscope_noise_density: 5e-4, gyroscope_bias_random_walk: 2e-6 }, said: [] },
      report: { sensor: m.sensor as Sensor, unit: "rad/s", duration_s: 600, rate_hz: 100, curve, coefficients: { noise_density: { value: 5e-4, std: 4e-6 }, bias_instability: { value: 3e-5, std: 4e-6 }, random_walk: null }, trusted_tau_s: 60, sentences: ["White noise: 0.0005 rad/s/sqrt(Hz) (1.72 deg/sqrt(h)) +- 1 %, where the falling line of slope -1/2 passes tau = 1 s; averaging four times as long halves it.", "Beyond tau = 60 s the record of 10 minutes is too short to say anything: a point there is the mean of a few differences only."] },
    });
  }

  private calibrate(device: string, seconds: number): void {
    const series = (s: number): { t_s: number[]; x: number[]; y: number[]; z: number[] } => {
      const t_s = Array.from({ length: 200 }, (_, i) => (i * seconds) / 200);
      const column = (): number[] => t_s.map(() => noise() * s);
      return { t_s, x: column(), y: column(), z: column() };
    };
    const done: Sketch<Calibration> & { type: "calibration" } = {
      type: "calibration", device, state: "done", progress: 1, remaining_s: 0, verdict: { tone: "good", text: "At rest for the whole time; the bias is known to 0.003 deg/s." }, samples: { gyroscope: series(0.005), accelerometer: series(0.05), magnetometer: series(0.5) },
      result: { gyroscope_samples: 1000, gyroscope_bias_rad_s: [0.011, -0.004, 0.002], gyroscope_bias_std_rad_s: [1e-4, 1e-4, 1e-4], gyroscope_std_rad_s: [0.005, 0.005, 0.005], accelerometer_samples: 1000, specific_force_m_s2: [0.02, 0.1, 9.79], accelerometer_std_m_s2: [0.05, 0.05, 0.05], magnetometer_samples: 500, magnetic_field_ut: [0.3, 22.1, -41.8], magnetometer_std_ut: [0.5, 0.5, 0.5] },
    };
    this.progress(1200, (p) => this.say(p < 1 ? { ...done, state: "running", progress: p, remaining_s: (1 - p) * seconds, result: null, samples: null, verdict: null } : done));
  }

  private experiment(device: string, seconds: number, name: string): void {
    const id = `e${this.rows.length + 1}`;
    this.progress(2500, (p) => {
      if (p < 1) return this.say({ type: "experiment", device, id, state: "running", progress: p, remaining_s: (1 - p) * seconds, result: null });
      const results = { mekf: summary("mekf", 0.41, 0.54), integration: summary("integration", 12.3, null), device: summary("device", 1.1, null) };
      this.rows.push({ id, device: this.devices.find((d) => d.id === device)!.name, device_id: device, name, at: "", duration_s: seconds, subject: "mekf", sensors: ["gyroscope", "accelerometer", "magnetometer"], settings: Object.fromEntries(parameters.map(([n, , v]) => [n, v])), results: Object.fromEntries(Object.entries(results).map(([n, s]) => [n, { calculated_error_deg: s.final!.calculated_error_deg, estimated_error_deg: s.final!.estimated_error_deg, verdict: s.final!.verdict }])) });
      const board = [...new Map(this.rows.map((row) => [row.device_id, row])).values()].map((row, i) => ({ place: i + 1, experiment: row.id!, device_id: row.device_id!, verdict: "consistent" as const, nis_factor: 1 + 0.3 * i, is_nis_large: i % 2 > 0 }));
      this.say({ type: "experiments", rows: this.rows, board });
      this.say({ type: "experiment", device, id, state: "done", progress: 1, remaining_s: 0, result: { subject: "mekf", summary: results, settings: {}, hash: "9f2c4e8d1a7b6053f4e1", origin: "The recording was run again from the state the estimate had when it began: the same numbers as live." } });
    });
  }

  private whatIf(m: Extract<ToProgram, { type: "what_if" }>): void {
    const std = Number(m.settings["accelerometer_std"]);
    const t_s = Array.from({ length: 300 }, (_, i) => i / 10);
    const values = Array.from({ length: 25 }, (_, i) => 10 ** (-3 + i / 6));
    setTimeout(() => this.say({
      type: "what_if", request: m.request, id: m.id, subject: "mekf", elapsed_ms: 38, results: { mekf: summary("mekf", 0.41 + Math.abs(Math.log10(std / 0.05)), 0.54) },
      trace: { t_s, angles_deg: t_s.map((t) => angles(truthAt(t, 0))), error_deg: t_s.map(() => 0.4 + 0.1 * Math.abs(noise()) * (std / 0.05)) },
    }), 40);
    const parameter = m.curve;
    if (parameter) setTimeout(() => this.say({ type: "curve", request: m.request, id: m.id, curve: { parameter, values, nis: { accelerometer: values.map((v) => 3 * (0.05 / v) ** 2), magnetometer: values.map(() => 3) }, error_deg: values.map((v) => 0.3 + 0.2 * Math.log10(v / 0.05) ** 2) } }), 90);
  }

  private progress(ms: number, tell: (p: number) => void): void {
    const start = performance.now();
    const timer = setInterval(() => {
      const p = Math.min(1, (performance.now() - start) / ms);
      tell(p);
      if (p >= 1) clearInterval(timer);
    }, 100);
  }
}

(window as unknown as { WebSocket: unknown }).WebSocket = Mock;
