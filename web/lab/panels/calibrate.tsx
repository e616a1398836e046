// Steps 2 and 3: the device lies still, and tells its bias and noise; beside it magnetometer and Allan deviation.

import { useMemo, useState } from "preact/hooks";
import { type Spec, Still, columns } from "../chart";
import type { Calibration, Device, RestCalibration, Sensor, Triple } from "../protocol";
import { type Calibrating, calibrateWhat, goTo, offers, receives, send, state } from "../store";
import { type Key, t } from "../t";
import { number, said } from "../words";
import { Allan } from "./allan";
import { Magnetometer } from "./magnetometer";
import { Silence, Stillness } from "./stillness";

export function Place({ device }: { device: Device }) {
  return (
    <>
      <p>{t("place.lay")}</p>
      <p>{t("place.reference")}</p>
      <Stillness device={device} />
      <button type="button" class="primary" disabled={!receives(device)} onClick={() => goTo("calibrate")}>{t("place.next")}</button>
    </>
  );
}

const PARTS: [Calibrating, Key][] = [["rest", "still.rest"], ["magnetometer", "sensor.magnetometer"], ["allan", "calibrate.allan"]];

export function Calibrate({ device }: { device: Device }) {
  const parts = PARTS.filter(([key]) => key === "rest" || offers(key));
  const shown = parts.some(([key]) => key === state.calibrating) ? state.calibrating : "rest";
  return (
    <>
      {parts.length > 1 && (
        <div class="segments" role="group" aria-label={t("calibrate.what")}>
          {parts.map(([key, text]) => <button key={key} type="button" aria-pressed={key === shown} onClick={() => calibrateWhat(key)}>{t(text)}</button>)}
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
      <p>{t("calibrate.mean")}</p>
      <label class="row">{t("duration")}
        <input type="range" min="5" max="60" step="1" value={seconds} disabled={running} onInput={(e) => setSeconds(Number(e.currentTarget.value))} />
        <output>{seconds} s</output>
      </label>
      <button type="button" class={calibration?.state === "done" ? "" : "primary"} disabled={busy} onClick={() => send({ type: "calibrate", device: device.id, seconds })}>
        {running ? t("calibrate.hold", { seconds: Math.ceil(calibration.remaining_s) }) : calibration ? t("calibrate.again") : t("calibrate.start")}
      </button>
      {running && <button type="button" onClick={() => send({ type: "stop", device: device.id })}>{t("cancel")}</button>}
      {!receiving && <Silence device={device} />}
      <progress max="1" value={calibration?.progress ?? 0} aria-label={t("calibrate.progress")} />
      {state.running[device.id] && <p class="small">{t("calibrate.busy")}</p>}
      {calibration?.verdict && (
        <div class={`verdict ${calibration.verdict.tone}`} role="status">
          <b>{calibration.state === "refused" ? t("calibrate.refused") : running ? t("calibrate.measuring") : t("calibrate.done")}</b>
          <span>{said(calibration.verdict.text)}</span>
        </div>
      )}
      {!calibration && device.rest && <p class="small">{t("rest.inForce", { time: device.calibrated.rest ?? "–" })}</p>}
      {(calibration?.result ?? (calibration ? null : device.rest)) && <Numbers result={(calibration?.result ?? device.rest)!} />}
      {calibration?.samples && <Plots samples={calibration.samples} />}
      {calibration?.state === "done" && <button type="button" class="primary" onClick={() => goTo("tune")}>{t("calibrate.next")}</button>}
    </>
  );
}

function Numbers({ result }: { result: RestCalibration }) {
  const deg = (v: Triple): Triple => v.map((x) => (x * 180) / Math.PI) as Triple;
  const rows: [string, string, Triple | null][] = [
    [t("rest.bias"), "deg/s", deg(result.gyroscope_bias_rad_s)],
    [t("rest.gyroscopeNoise"), "deg/s", deg(result.gyroscope_std_rad_s)],
    [t("rest.force"), "m/s²", result.specific_force_m_s2],
    [t("rest.accelerometerNoise"), "m/s²", result.accelerometer_std_m_s2],
    [t("rest.field"), "µT", result.magnetic_field_ut],
    [t("rest.magnetometerNoise"), "µT", result.magnetometer_std_ut],
  ];
  return (
    <table class="compact">
      <thead><tr><th scope="col">{t("still.rest")}</th>{["x", "y", "z"].map((a) => <th key={a} scope="col" class="num">{a}</th>)}</tr></thead>
      <tbody>
        {rows.filter((r) => r[2]).map(([name, unit, v]) => (
          <tr key={name}><th scope="row">{name} <small>{unit}</small></th>{v!.map((x, i) => <td key={i} class="num">{number(x, 3)}</td>)}</tr>
        ))}
      </tbody>
    </table>
  );
}

const spec = (title: string, unit: string, leastSpan: number): Spec => ({ id: `rest ${title}`, title, unit, across: t("across.time"), leastSpan, curves: ["x", "y", "z"].map((label) => ({ label, role: label, width: 1.2 })) });
const LEAST: Record<Sensor, [string, number]> = { gyroscope: ["deg/s", 0.2], accelerometer: ["m/s²", 0.02], magnetometer: ["µT", 0.2] };
const specOf = (sensor: Sensor): Spec => spec(t(`sensor.${sensor}`), t("rest.fromMean", { unit: LEAST[sensor][0] }), LEAST[sensor][1]);

function Plots({ samples }: { samples: NonNullable<Calibration["samples"]> }) {
  const sensors = (Object.keys(LEAST) as Sensor[]).filter((s) => (samples[s]?.t_s.length ?? 0) > 1);
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
    return columns([s.t_s.map((time) => time - s.t_s[0]!), centred(s.x), centred(s.y), centred(s.z)]);
  }, [samples, sensor]);
  const shown = useMemo(() => specOf(sensor), [sensor, t("still.rest")]);
  return <Still spec={shown} data={data} />;
}
