// Steps 2 and 3: the device lies still, and tells its bias and noise; beside it magnetometer and Allan deviation.

import { useMemo, useState } from "preact/hooks";
import type uPlot from "uplot";
import { Chart, type ChartSpec } from "../chart";
import type { Calibration, Device, RestCalibration, Sensor, Triple } from "../protocol";
import { type Calibrating, calibrateWhat, goTo, offers, receives, send, state } from "../store";
import { number, pretty } from "../words";
import { Allan } from "./allan";
import { Magnetometer } from "./magnetometer";
import { Silence, Stillness } from "./stillness";

export function Place({ device }: { device: Device }) {
  return (
    <>
      <p>Lay the phone flat on the table, screen up, away from iron, magnets and loudspeakers. Mark its outline: it comes back to the same place at the end.</p>
      <p>This pose is the reference: gravity and the magnetic field as measured here.</p>
      <Stillness device={device} />
      <button type="button" class="primary" disabled={!receives(device)} onClick={() => goTo("calibrate")}>Next: calibrate</button>
    </>
  );
}

const PARTS: [Calibrating, string][] = [["rest", "At rest"], ["magnetometer", "Magnetometer"], ["allan", "Noise (Allan)"]];

export function Calibrate({ device }: { device: Device }) {
  const parts = PARTS.filter(([key]) => key === "rest" || offers(key));
  const shown = parts.some(([key]) => key === state.calibrating) ? state.calibrating : "rest";
  return (
    <>
      {parts.length > 1 && (
        <div class="segments" role="group" aria-label="What to calibrate">
          {parts.map(([key, text]) => <button key={key} type="button" aria-pressed={key === shown} onClick={() => calibrateWhat(key)}>{text}</button>)}
        </div>
      )}
      {shown === "rest" ? <AtRest device={device} /> : shown === "magnetometer" ? <Magnetometer device={device} /> : <Allan device={device} />}
    </>
  );
}

function AtRest({ device }: { device: Device }) {
  const [seconds, setSeconds] = useState(10);
  const calibration = state.calibrations[device.id];
  const running = calibration?.state === "running";
  const receiving = receives(device);
  const busy = running || !!state.running[device.id] || !receiving;
  return (
    <>
      <p>While it rests, the mean is the gyroscope's bias and the direction of gravity and field; the scatter is each sensor's noise.</p>
      <label class="row">Duration
        <input type="range" min="5" max="60" step="1" value={seconds} disabled={running} onInput={(e) => setSeconds(Number(e.currentTarget.value))} />
        <output>{seconds} s</output>
      </label>
      <button type="button" class={calibration?.state === "done" ? "" : "primary"} disabled={busy} onClick={() => send({ type: "calibrate", device: device.id, seconds })}>
        {running ? `Hold still: ${Math.ceil(calibration.remaining_s)} s` : calibration ? "Calibrate again" : "Calibrate"}
      </button>
      {running && <button type="button" onClick={() => send({ type: "stop", device: device.id })}>Cancel</button>}
      {!receiving && <Silence device={device} />}
      <progress max="1" value={calibration?.progress ?? 0} aria-label="Progress of the calibration" />
      {state.running[device.id] && <p class="small">An experiment is under way; stop it first.</p>}
      {calibration?.verdict && (
        <div class={`verdict ${calibration.verdict.tone}`} role="status">
          <b>{calibration.state === "refused" ? "Refused" : running ? "Measuring" : "Calibrated"}</b>
          <span>{pretty(calibration.verdict.text)}</span>
        </div>
      )}
      {calibration?.result && <Numbers result={calibration.result} />}
      {calibration?.samples && <Plots samples={calibration.samples} />}
      {calibration?.state === "done" && <button type="button" class="primary" onClick={() => goTo("tune")}>Next: set Q and R</button>}
    </>
  );
}

function Numbers({ result }: { result: RestCalibration }) {
  const deg = (v: Triple): Triple => v.map((x) => (x * 180) / Math.PI) as Triple;
  const rows: [string, string, Triple | null][] = [
    ["Gyroscope bias", "deg/s", deg(result.gyroscope_bias_rad_s)],
    ["Gyroscope noise", "deg/s", deg(result.gyroscope_std_rad_s)],
    ["Specific force", "m/s²", result.specific_force_m_s2],
    ["Accelerometer noise", "m/s²", result.accelerometer_std_m_s2],
    ["Magnetic field", "µT", result.magnetic_field_ut],
    ["Magnetometer noise", "µT", result.magnetometer_std_ut],
  ];
  return (
    <table class="compact">
      <thead><tr><th scope="col">At rest</th>{["x", "y", "z"].map((a) => <th key={a} scope="col" class="num">{a}</th>)}</tr></thead>
      <tbody>
        {rows.filter((r) => r[2]).map(([name, unit, v]) => (
          <tr key={name}><th scope="row">{name} <small>{unit}</small></th>{v!.map((x, i) => <td key={i} class="num">{number(x, 3)}</td>)}</tr>
        ))}
      </tbody>
    </table>
  );
}

const XYZ = [{ text: "x", role: "s1" }, { text: "y", role: "s2" }, { text: "z", role: "s0" }];
const spec = (title: string, unit: string, leastSpan: number): ChartSpec => ({ title, unit, leastSpan, legend: XYZ, lines: XYZ.map((l) => ({ role: l.role, width: 1.2 })) });
const SPECS: Record<Sensor, ChartSpec> = {
  gyroscope: spec("Gyroscope", "deg/s from mean", 0.2),
  accelerometer: spec("Accelerometer", "m/s² from mean", 0.02),
  magnetometer: spec("Magnetometer", "µT from mean", 0.2),
};

function Plots({ samples }: { samples: NonNullable<Calibration["samples"]> }) {
  const sensors = (Object.keys(SPECS) as Sensor[]).filter((s) => (samples[s]?.t_s.length ?? 0) > 1);
  return <div class="small-plots">{sensors.map((s) => <Plot key={s} sensor={s} samples={samples} />)}</div>;
}

function Plot({ sensor, samples }: { sensor: Sensor; samples: NonNullable<Calibration["samples"]> }) {
  const data = useMemo(() => {
    const s = samples[sensor]!;
    const scale = sensor === "gyroscope" ? 180 / Math.PI : 1;
    const centred = (v: number[]): number[] => {
      const mean = v.reduce((a, b) => a + b, 0) / v.length;
      return v.map((x) => (x - mean) * scale);
    };
    const columns = [s.t_s.map((t) => t - s.t_s[0]!), centred(s.x), centred(s.y), centred(s.z)] as uPlot.AlignedData;
    return () => columns;
  }, [samples, sensor]);
  return <Chart spec={SPECS[sensor]} data={data} />;
}
