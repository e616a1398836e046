// The live plots of a device, four at a time: motion, estimators, sensors, filter. All share one span of time.

import { useMemo, useState } from "preact/hooks";
import { Chart, SpanBar, type Source, type Spec, columns } from "./chart";
import { type Notation, angleBetween, written } from "./attitude";
import { type History, isHeading, mainEstimate } from "./history";
import { useFrame } from "./live";
import { spanOf } from "./moments";
import type { Quaternion } from "./protocol";
import { partsOf } from "./stage";
import { aids, historyOf, state, titleOf, update } from "./store";
import { type Key, t } from "./t";
import { dashOf, nameOf, roleOf } from "./theme";
import { pretty } from "./words";
import type { Span } from "../instrument/span";

/** More rows than a screen has columns show nothing more. */
const MOST = 1600;
/** The angle to another attitude costs an arc tangent each. */
const MOST_ANGLES = 900;

export type LivePage = "motion" | "estimators" | "sensors" | "filter";
const PAGES: LivePage[] = ["motion", "estimators", "sensors", "filter"];
const XYZ = ["x", "y", "z"];

interface Part {
  device: string;
  history: History;
  span: Span;
}

/** The live plots of a device, and the bar that moves them. */
export function LivePlots({ device }: { device: string }) {
  const part: Part = { device, history: historyOf(device), span: spanOf(device) };
  return (
    <div class="live">
      <div class="live-bar">
        <div class="segments" role="group" aria-label={t("plots.which")}>
          {PAGES.map((page) => <button key={page} type="button" aria-pressed={state.livePage === page} onClick={() => update((s) => (s.livePage = page))}>{t(`plots.${page}`)}</button>)}
        </div>
        <SpanBar span={part.span} widths={[10, 20, 60, 300]} />
      </div>
      {state.livePage === "motion" ? <Motion {...part} /> : state.livePage === "estimators" ? <Estimators {...part} /> : state.livePage === "sensors" ? <Sensors {...part} /> : <Filter {...part} />}
    </div>
  );
}

// ---- Motion: angles, innovations, rate, NIS.

function Motion(part: Part) {
  const { sensor, choice } = useSensor(part.device);
  return (
    <div class="plots">
      <AnglesChart {...part} />
      <Innovations {...part} sensor={sensor} />
      <RateChart {...part} />
      <NisChart {...part} sensor={sensor} />
      {choice}
    </div>
  );
}

/** Which sensor's innovations are shown, among those with a lamp. */
function useSensor(device: string) {
  const [wanted, setSensor] = useState("accelerometer");
  const lit = useFrame(device, (frame) => frame.lamp.map((l) => l.sensor).join(" "), 1, "accelerometer magnetometer");
  const choices = lit.split(" ").filter((s) => s);
  const sensor = choices.includes(wanted) ? wanted : choices[0] ?? "accelerometer";
  const choice = (
    <div class="choice" role="group" aria-label={t("plots.sensor")}>
      {choices.map((s) => <button key={s} type="button" data-choice={s} aria-pressed={s === sensor} onClick={() => setSensor(s)}>{titleOf(s).toLowerCase()}</button>)}
    </div>
  );
  return { sensor, choice };
}

const degreesText = (notation: Notation): string => (notation === "quaternion" ? "" : "deg");

function anglesSpec(notation: Notation): Spec {
  const parts = partsOf(notation), truth = t("truth").toLowerCase();
  const banded = notation === "yaw-pitch-roll";
  const edges = banded ? parts.flatMap(({ name, role }) => [{ label: `${name} +3σ`, key: name, role, edge: true }, { label: `${name} −3σ`, key: name, role, edge: true }]) : [];
  return {
    id: `angles ${notation}`, title: banded ? t("plots.angles3") : t(`notation.${notation}`), unit: degreesText(notation), across: t("across.time"), leastSpan: notation === "quaternion" ? 0.1 : 4,
    curves: [
      ...edges,
      ...parts.map(({ name, role }) => ({ label: name, role })),
      ...parts.map(({ name }) => ({ label: `${name}, ${truth}`, key: truth, role: "truth", dash: true, width: 1.1 })),
    ],
    bands: banded ? parts.map(({ role }, i) => ({ high: 2 * i, low: 2 * i + 1, role })) : [],
  };
}

function AnglesChart({ history, span }: Part) {
  const notation = state.notation;
  const spec = useMemo(() => anglesSpec(notation), [notation, t("truth")]);
  const source: Source = (from, to) => {
    const { frames } = history, rows = frames.pick(from, to, MOST), subject = history.latest?.subject ?? "";
    const of = (name: string): (number | null)[][] => {
      const values = rows.map((k) => { const q = history.attitudeAt(name, k); return q && written(q, notation); });
      return partsOf(notation).map((_, i) => unwrapped(values.map((v) => v?.[i] ?? null)));
    };
    const lines = of(subject), truth = of("truth");
    const edges = notation !== "yaw-pitch-roll" ? [] : lines.flatMap((line, i) => {
      const std = frames.column(`${subject} std ${i}`, rows);
      return [1, -1].map((s) => line.map((v, k) => (v === null || std[k] === null ? null : v + s * 3 * std[k]!)));
    });
    return columns([frames.times(rows), ...edges, ...lines, ...truth]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

/** Breaks a line where an angle jumps over ±180°. */
function unwrapped(values: (number | null)[]): (number | null)[] {
  return values.map((v, i) => (i && v !== null && values[i - 1] !== null && Math.abs(v - values[i - 1]!) > 180 ? null : v));
}

const xyz = (id: string, title: string, unit: string, leastSpan: number): Spec => ({ id, title, unit, across: t("across.time"), leastSpan, curves: XYZ.map((label) => ({ label, role: label, width: 1.4 })) });

function RateChart({ history, span }: Part) {
  const spec = useMemo(() => xyz("rate", t("sensor.gyroscope"), "deg/s", 4), [t("sensor.gyroscope")]);
  const source: Source = (from, to) => {
    const rows = history.frames.pick(from, to, MOST);
    return columns([history.frames.times(rows), ...[0, 1, 2].map((i) => history.frames.column(`rate ${i}`, rows))]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

/** Whether the subject states a covariance: without one, innovations have no bounds and no NIS. */
const useJudged = (device: string): boolean => useFrame(device, (frame) => !mainEstimate(frame) || mainEstimate(frame)!.std_deg !== null, 1, true);
const useDof = (device: string, sensor: string): number => useFrame(device, () => historyOf(device).degreesOfFreedom[sensor] ?? 3, 2, 3);

function innovationSpec(sensor: string, heading: boolean, judged: boolean): Spec {
  const unit = heading ? "deg" : pretty(aids().find((a) => a.sensor === sensor)?.unit.replace("microtesla", "uT") ?? "");
  const lines = heading ? [{ label: t("heading"), role: "z", width: 1.4 }] : XYZ.map((label) => ({ label, role: label, width: 1.4 }));
  return {
    id: `innovation ${heading}`, title: t(heading ? "plots.innovationHeading" : "plots.innovation"), unit: judged ? unit : t("noCovariance"), across: t("across.time"), leastSpan: heading || sensor !== "accelerometer" ? 2 : 0.2,
    curves: [{ label: "+3σ", role: "muted", edge: true }, { label: "−3σ", role: "muted", edge: true }, ...lines],
    bands: [{ high: 0, low: 1, role: "muted" }],
  };
}

function Innovations({ device, history, span, sensor }: Part & { sensor: string }) {
  const judged = useJudged(device), heading = isHeading(useDof(device, sensor));
  const spec = useMemo(() => innovationSpec(sensor, heading, judged), [sensor, heading, judged, t("heading")]);
  const axes = heading ? [0] : [0, 1, 2];
  const source: Source = (from, to) => {
    const table = history.innovations[sensor];
    if (!table) return columns([[], [], [], ...axes.map(() => [])]);
    const rows = table.pick(from, to, MOST);
    const std = axes.map((i) => table.column(`std ${i}`, rows));
    const widest = rows.map((_, k) => 3 * Math.max(...std.map((s) => s[k] ?? 0)));
    return columns([table.times(rows), widest, widest.map((s) => -s), ...axes.map((i) => table.column(`residual ${i}`, rows))]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

/** 95 % and 99 % of chi-square for 1, 2 and 3 degrees of freedom. */
const BOUNDS: Record<number, [number, number]> = { 1: [3.841, 6.635], 2: [5.991, 9.21], 3: [7.815, 11.345] };
const bounds = (dof: number) => { const [a, b] = BOUNDS[dof] ?? BOUNDS[3]!; return [{ value: b, text: "99 %" }, { value: a, text: "95 %", below: true }]; };

function NisChart({ device, history, span, sensor }: Part & { sensor: string }) {
  const judged = useJudged(device), dof = useDof(device, sensor);
  const spec = useMemo<Spec>(() => ({
    id: "nis", title: "NIS", unit: judged ? `${titleOf(sensor).toLowerCase()}, ${t("logScale")}` : t("noCovariance"), across: t("across.time"), logY: true, leastRange: [0.05, 50],
    curves: [{ label: t("fused"), role: "fused", points: "dot" }, { label: t("refused"), role: "refused", points: "cross" }],
    rules: () => bounds(dof),
  }), [judged, dof, sensor, t("fused")]);
  const source: Source = (from, to) => {
    const table = history.innovations[sensor];
    if (!table) return columns([[], [], []]);
    const rows = table.pick(from, to, 2 * MOST);
    return columns([table.times(rows), table.column("nis", rows), table.column("refused", rows)]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

// ---- Estimators: each one against the subject, the bias, and how sure each is.

function Estimators(part: Part) {
  return (
    <div class="plots">
      <AgainstSubject {...part} />
      <Bias {...part} />
      <Certainty {...part} />
      <Tilt {...part} />
    </div>
  );
}

const useAttitudes = ({ device, history }: Part): string[] => useFrame(device, () => [...history.attitudes].join(" "), 1, [...history.attitudes].join(" ")).split(" ").filter((n) => n);
const curveOf = (name: string) => ({ label: nameOf(name), role: roleOf(name), ...(dashOf(name) ? { dash: dashOf(name)! } : {}) });

/** A value of each attitude over time that is made of it and the subject's. */
function ofEach({ history }: Part, names: string[], value: (subject: Quaternion, other: Quaternion) => number): Source {
  return (from, to) => {
    const rows = history.frames.pick(from, to, MOST_ANGLES), subject = history.latest?.subject ?? "";
    const main = rows.map((k) => history.attitudeAt(subject, k));
    return columns([history.frames.times(rows), ...names.map((name) => rows.map((k, i) => {
      const q = history.attitudeAt(name, k);
      return main[i] && q ? value(main[i]!, q) : null;
    }))]);
  };
}

function AgainstSubject(part: Part) {
  const subject = part.history.latest?.subject ?? "";
  const names = useAttitudes(part).filter((n) => n !== subject);
  const spec = useMemo<Spec>(() => ({ id: "against", title: t("plots.against", { name: nameOf(subject) }), unit: "deg", across: t("across.time"), leastSpan: 1, curves: names.map(curveOf) }), [names.join(), subject, t("none")]);
  return <Chart spec={spec} source={ofEach(part, names, angleBetween)} span={part.span} live />;
}

/** The part of it that is tilt: what a compass has no say in. */
function Tilt(part: Part) {
  const subject = part.history.latest?.subject ?? "";
  const names = useAttitudes(part).filter((n) => n !== subject);
  const spec = useMemo<Spec>(() => ({ id: "tilt", title: t("plots.tilt", { name: nameOf(subject) }), unit: "deg", across: t("across.time"), leastSpan: 1, curves: names.map(curveOf) }), [names.join(), subject, t("none")]);
  return <Chart spec={spec} source={ofEach(part, names, tiltBetween)} span={part.span} live />;
}

/** Angle between the verticals of two attitudes, degrees. */
function tiltBetween(a: Quaternion, b: Quaternion): number {
  const up = ([w, x, y, z]: Quaternion) => [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
  const [p, q] = [up(a), up(b)];
  const dot = p[0]! * q[0]! + p[1]! * q[1]! + p[2]! * q[2]!;
  const cross = Math.hypot(p[1]! * q[2]! - p[2]! * q[1]!, p[2]! * q[0]! - p[0]! * q[2]!, p[0]! * q[1]! - p[1]! * q[0]!);
  return (Math.atan2(cross, dot) * 180) / Math.PI;
}

function Bias({ history, span, device }: Part) {
  const subject = useFrame(device, (f) => f.subject ?? "", 1, "");
  const has = useFrame(device, (f) => !!mainEstimate(f)?.bias_deg_s, 1, true);
  const spec = useMemo<Spec>(() => ({
    id: "bias", title: t("plots.bias"), unit: has ? "deg/s" : t("plots.noBias", { name: nameOf(subject) }), across: t("across.time"), leastSpan: 0.05,
    curves: [...XYZ.flatMap((a) => [{ label: `${a} +3σ`, key: a, role: a, edge: true }, { label: `${a} −3σ`, key: a, role: a, edge: true }]), ...XYZ.map((label) => ({ label, role: label }))],
    bands: XYZ.map((role, i) => ({ high: 2 * i, low: 2 * i + 1, role })),
  }), [has, subject, t("none")]);
  const source: Source = (from, to) => {
    const { frames } = history, rows = frames.pick(from, to, MOST), of = history.latest?.subject ?? "";
    const bias = [0, 1, 2].map((i) => frames.column(`${of} bias ${i}`, rows)), std = [0, 1, 2].map((i) => frames.column(`${of} bias std ${i}`, rows));
    const edges = bias.flatMap((line, i) => [1, -1].map((s) => line.map((v, k) => (v === null || std[i]![k] === null ? null : v + s * 3 * std[i]![k]!))));
    return columns([frames.times(rows), ...edges, ...bias]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

/** One standard deviation of the whole attitude error, of every estimator that states one. */
function Certainty(part: Part) {
  const { history, span } = part;
  const names = useAttitudes(part).filter((n) => history.frames.has(`${n} std 0`));
  const spec = useMemo<Spec>(() => ({ id: "certainty", title: t("plots.certainty"), unit: "deg, 1σ", across: t("across.time"), leastSpan: 0.2, curves: names.map(curveOf) }), [names.join(), t("none")]);
  const source: Source = (from, to) => {
    const rows = history.frames.pick(from, to, MOST);
    return columns([history.frames.times(rows), ...names.map((name) => {
      const std = [0, 1, 2].map((i) => history.frames.column(`${name} std ${i}`, rows));
      return rows.map((_, k) => (std[0]![k] === null ? null : Math.hypot(std[0]![k]!, std[1]![k]!, std[2]![k]!)));
    })]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

// ---- Sensors: the samples as they were measured.

const SENSORS: [string, Key, string, number][] = [["gyroscope", "sensor.gyroscope", "deg/s", 1], ["accelerometer", "sensor.accelerometer", "m/s²", 0.5], ["magnetometer", "sensor.magnetometer", "µT", 2]];

function Sensors(part: Part) {
  const there = useFrame(part.device, () => SENSORS.map(([s]) => s).filter((s) => part.history.samples[s]).join(" "), 1, "");
  const shown = SENSORS.filter(([s]) => there.split(" ").includes(s) || s !== "magnetometer");
  return <div class="plots three">{shown.map(([sensor, title, unit, least]) => <RawChart key={sensor} {...part} sensor={sensor} title={t(title)} unit={unit} least={least} />)}</div>;
}

function RawChart({ history, span, sensor, title, unit, least }: Part & { sensor: string; title: string; unit: string; least: number }) {
  const spec = useMemo<Spec>(() => {
    const base = xyz(`raw ${sensor}`, t("plots.raw", { sensor: title }), unit, least);
    // The length is what a magnet or a shake changes, whichever way the device lies.
    return sensor === "gyroscope" ? base : { ...base, curves: [...base.curves, { label: t("length"), role: "ink", dash: [2, 2], width: 1.2 }] };
  }, [sensor, title]);
  const source: Source = (from, to) => {
    const table = history.samples[sensor];
    if (!table) return columns([[], ...spec.curves.map(() => [])]);
    const rows = table.pick(from, to, 2 * MOST), [x, y, z] = XYZ.map((a) => table.column(a, rows)) as [(number | null)[], (number | null)[], (number | null)[]];
    const length = rows.map((_, k) => (x[k] === null ? null : Math.hypot(x[k]!, y[k]!, z[k]!)));
    return columns([table.times(rows), x, y, z, ...(spec.curves.length > 3 ? [length] : [])]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

// ---- Filter: P, gain, NIS, NEES.

function Filter(part: Part) {
  const { sensor, choice } = useSensor(part.device);
  const truth = useFrame(part.device, (f) => !!f.truth, 1, false);
  return (
    <div class="plots">
      <StdChart {...part} />
      <GainChart {...part} sensor={sensor} />
      {truth ? <NeesChart {...part} /> : <Covariance {...part} />}
      <NisChart {...part} sensor={sensor} />
      {choice}
    </div>
  );
}

function StdChart({ history, span, device }: Part) {
  const judged = useJudged(device);
  const spec = useMemo<Spec>(() => ({ id: "std", title: t("plots.std"), unit: judged ? "deg, 1σ" : t("noCovariance"), across: t("across.time"), leastSpan: 0.2, curves: partsOf("yaw-pitch-roll").map(({ name, role }) => ({ label: name, role })) }), [judged, t("none")]);
  const source: Source = (from, to) => {
    const rows = history.frames.pick(from, to, MOST), subject = history.latest?.subject ?? "";
    return columns([history.frames.times(rows), ...[0, 1, 2].map((i) => history.frames.column(`${subject} std ${i}`, rows))]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

function GainChart({ history, span, sensor, device }: Part & { sensor: string }) {
  const subject = useFrame(device, (f) => f.subject ?? "", 1, "");
  const heading = isHeading(useDof(device, sensor));
  const stated = ["mekf", "mekf3"].includes(subject) && !heading;
  const spec = useMemo<Spec>(() => ({
    id: "gain", title: t("plots.gain"), unit: stated ? t("plots.gainUnit", { sensor: titleOf(sensor).toLowerCase() }) : t("plots.noGain"), across: t("across.time"), logY: true, leastRange: [1e-3, 1],
    curves: [{ label: t("plots.gainCurve"), role: "fused", points: "dot" }],
  }), [stated, sensor, t("none")]);
  const source: Source = (from, to) => {
    const table = history.innovations[sensor];
    if (!table) return columns([[], []]);
    const rows = table.pick(from, to, 2 * MOST);
    return columns([table.times(rows), table.column("gain", rows).map((g) => (g !== null && g > 0 ? g : null))]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

function NeesChart({ history, span, device }: Part) {
  const dof = useFrame(device, (f) => f.truth?.error?.degrees_of_freedom ?? 3, 2, 3);
  const spec = useMemo<Spec>(() => ({ id: "nees", title: "NEES", unit: t("plots.nees", { dof }), across: t("across.time"), logY: true, leastRange: [0.05, 50], curves: [{ label: "NEES", role: "ink", width: 1.4 }], rules: () => bounds(dof) }), [dof, t("none")]);
  const source: Source = (from, to) => {
    const rows = history.frames.pick(from, to, MOST);
    return columns([history.frames.times(rows), history.frames.column("nees", rows).map((v) => (v !== null && v > 0 ? v : null))]);
  };
  return <Chart spec={spec} source={source} span={span} live />;
}

/** The attitude part of P as a matrix, and how its errors hang together. */
function Covariance({ device }: Part) {
  const p = useFrame(device, (f) => mainEstimate(f)?.covariance_deg2 ?? null, 3, null);
  if (!p) return <p class="empty">{t("noCovariance")}</p>;
  const std = [0, 1, 2].map((i) => Math.sqrt(Math.max(p[i]![i]!, 0)));
  return (
    <figure class="matrix">
      <figcaption><b>P</b> <span class="unit">{t("plots.p")}</span></figcaption>
      <table>
        <thead><tr><td />{XYZ.map((a) => <th key={a} scope="col" style={{ color: `var(--${a})` }}>{a}</th>)}</tr></thead>
        <tbody>
          {XYZ.map((a, i) => (
            <tr key={a}>
              <th scope="row" style={{ color: `var(--${a})` }}>{a}</th>
              {XYZ.map((b, j) => <td key={b} class="num">{i === j ? <b>{std[i]!.toPrecision(3)}°</b> : (p[i]![j]! / (std[i]! * std[j]! || 1)).toFixed(2).replace("-", "−")}</td>)}
            </tr>
          ))}
        </tbody>
      </table>
    </figure>
  );
}
