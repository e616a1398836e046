// Things that follow the frames without passing through the page's state: numbers, the 3-D view, plots.

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { Chart, type ChartSpec } from "./chart";
import { angleBetween, isHeading, mainEstimate, mainName } from "./history";
import type { Device, EstimatorKind, Frame, Lamp, TruthError } from "./protocol";
import { type Body, View, World } from "./scene";
import { aids, historyOf, isOld, onFrame, send, state, titleOf, update } from "./store";
import { nameOf, roleOf } from "./theme";
import { pretty, unnamed } from "./words";
import type uPlot from "uplot";

export const WINDOW_S = 20;

/** Text made of the latest frame of a device, at most five times a second: faster cannot be read. */
export function LiveText({ device, text, className }: { device: string; text: (frame: Frame) => string; className?: string }) {
  const element = useRef<HTMLSpanElement>(null);
  const make = useRef(text);
  make.current = text;
  useEffect(() => {
    let last = 0;
    const show = (frame: Frame): void => {
      if (frame.device !== device || performance.now() - last < 200 || !element.current || document.visibilityState === "hidden") return;
      last = performance.now();
      element.current.textContent = make.current(frame);
    };
    const latest = historyOf(device).latest;
    if (latest) show(latest);
    return onFrame(show);
  }, [device]);
  return <span class={className} ref={element}>–</span>;
}

/** The state of a frame as something to draw again for, at most `hz` times a second. */
export function useFrame<T>(device: string, read: (frame: Frame) => T, hz: number, start: T): T {
  const [value, set] = useState<T>(start);
  const reader = useRef(read);
  reader.current = read;
  useEffect(() => {
    let last = 0;
    const take = (frame: Frame): void => {
      if (document.visibilityState === "hidden" || frame.device !== device || performance.now() - last < 1000 / hz) return;
      last = performance.now();
      set(reader.current(frame));
    };
    const latest = historyOf(device).latest;
    if (latest) take(latest);
    return onFrame(take);
  }, [device]);
  return value;
}

/** Every attitude of a frame, the subject's first. */
export function attitudes(frame: Frame): Body[] {
  const main = mainName(frame);
  const names = Object.keys(frame.estimates).sort((a, b) => Number(b === main) - Number(a === main));
  const bodies: Body[] = names.map((name) => ({ name, solid: name === main, q: frame.estimates[name]!.q }));
  if (frame.truth) bodies.push({ name: "truth", solid: false, q: frame.truth.q });
  return bodies;
}

/** The 3-D view with its legend: switch ghosts, read the angle to each. */
export function Device3d({ device }: { device: string | null }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [failed, setFailed] = useState(false);
  useEffect(() => {
    let view: View;
    try {
      view = new View(canvas.current!, new World());
    } catch {
      setFailed(true);
      return;
    }
    const show = (frame: Frame): void => {
      if (frame.device !== device || document.visibilityState === "hidden") return;
      view.world!.set(attitudes(frame).filter((b) => !state.hidden.has(b.name)));
      view.ask();
    };
    const latest = device ? historyOf(device).latest : null;
    if (latest) show(latest);
    else view.ask();
    const stop = onFrame(show);
    return () => {
      stop();
      view.close();
    };
  }, [device]);
  return (
    <div class="view3d">
      <canvas ref={canvas} role="img" aria-label="The device as estimated, over a compass: drag to look from elsewhere" />
      {failed && <p class="empty">This browser shows no 3-D graphics (WebGL is off). All numbers and plots work.</p>}
      {device && <Legend device={device} />}
    </div>
  );
}

/** Chooses the estimator that lamps, innovations, NIS, result and report are about. */
function Subject({ device }: { device: Device }) {
  return (
    <label class="subject" title="The estimator that lamps, innovations, NIS, result and report are about">Subject
      <select value={device.subject ?? ""} onChange={(e) => send({ type: "subject", device: device.id, estimator: e.currentTarget.value as EstimatorKind })}>
        {device.subject === null && <option value="">none</option>}
        {device.estimators.map((name) => <option key={name} value={name}>{nameOf(name)}</option>)}
      </select>
    </label>
  );
}

function Legend({ device }: { device: string }) {
  const names = useFrame(device, (frame) => attitudes(frame).map((b) => b.name).join(" "), 1, "");
  const list = names ? names.split(" ") : [];
  const row = state.devices.find((d) => d.id === device);
  const subject = row?.subject;
  const toggle = (name: string): void => update((s) => void (s.hidden.has(name) ? s.hidden.delete(name) : s.hidden.add(name)));
  return (
    <div class="ghosts">
      {row && <Subject device={row} />}
      <table>
        <thead><tr><th scope="col">Attitude</th><th scope="col" class="num">{subject ? `to ${nameOf(subject)}` : ""}</th></tr></thead>
        <tbody>
          {list.map((name) => (
            <tr key={name}>
              <th scope="row">
                <label>
                  <input type="checkbox" checked={!state.hidden.has(name)} onChange={() => toggle(name)} />
                  <span class={`swatch ${name === subject ? "" : "ghost"}`} style={{ "--role": `var(--${roleOf(name)})` }} />
                  {nameOf(name)}
                </label>
              </th>
              <td class="num">{name === subject ? "" : <LiveText device={device} text={(frame) => angleTo(frame, name)} />}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

/** Angle from the main estimate to another attitude, as text. */
function angleTo(frame: Frame, name: string): string {
  const main = mainName(frame);
  const known = frame.between_deg[`${main}|${name}`] ?? frame.between_deg[`${name}|${main}`];
  const other = name === "truth" ? frame.truth?.q : frame.estimates[name]?.q;
  const own = mainEstimate(frame)?.q;
  const angle = known ?? (other && own ? angleBetween(own, other) : undefined);
  return angle === undefined ? "–" : `${angle.toFixed(2)}°`;
}

/** Yaw, pitch and roll with their 3 sigma, in large type. */
export function Angles({ device }: { device: string }) {
  return (
    <dl class="angles">
      {["Yaw", "Pitch", "Roll"].map((name, i) => (
        <div key={name} style={{ "--role": `var(--s${i})` }}>
          <dt>{name}</dt>
          <dd>
            <LiveText device={device} text={(f) => signed(mainEstimate(f)?.angles_deg[i])} />
            <LiveText device={device} className="sigma" text={(f) => threeSigma(mainEstimate(f)?.std_deg?.[i])} />
          </dd>
        </div>
      ))}
    </dl>
  );
}

const signed = (v: number | undefined): string => {
  if (v === undefined) return "–";
  const size = Math.abs(v).toFixed(1);
  return `${v < 0 && size !== "0.0" ? "−" : "\u2007"}${size}°`;
};
const threeSigma = (v: number | undefined): string => (v === undefined ? "" : `±${(3 * v).toFixed(3 * v < 10 ? 2 : 0)}°`);

interface Shown {
  key: string;
  title: string;
  tone: string;
  text: string;
  number: string;
  hint: string;
}

const nis = (value: number | null): string => (value === null ? "–" : value.toFixed(value < 0.95 ? 2 : value < 99.5 ? 1 : 0));

function ofSensor(lamp: Lamp): Shown {
  return {
    key: lamp.sensor, title: titleOf(lamp.sensor), tone: lamp.tone, text: unnamed(lamp.text), number: `NIS ${nis(lamp.nis_mean)}`,
    hint: lamp.nis_expected === null ? "Nothing to judge" : `Mean NIS of the last seconds: ${lamp.nis_expected} when consistent`,
  };
}

function ofTruth(error: TruthError): Shown {
  return {
    key: "truth", title: "Truth", tone: error.tone, text: error.sigmas === null ? `${error.text} No covariance: nothing to judge.` : error.text, number: `NEES ${nis(error.nees)}`,
    hint: `Normalised estimation error squared: ${error.degrees_of_freedom} on average when consistent`,
  };
}

const NOTHING: Shown[] = [{ key: "none", title: "Nothing received", tone: "idle", text: "Nothing to judge.", number: "NIS –", hint: "Nothing to judge" }];

/** One lamp a sensor, and one for the truth where it is known: is what the subject states consistent? In words. */
export function Lamps({ device }: { device: string }) {
  const frame = useFrame<Frame | null>(device, (frame) => frame, 2, null);
  const told: Shown[] = [...(frame?.lamp.map(ofSensor) ?? []), ...(frame?.truth?.error ? [ofTruth(frame.truth.error)] : [])];
  const row = state.devices.find((d) => d.id === device);
  const grey = isOld() ? "Connection lost: what you see is old." : row && !row.delivers ? "Nothing is received: nothing to judge." : null;
  const shown = told.length ? told : NOTHING;
  return (
    <div class={`lamps ${shown.length > 2 ? "many" : ""}`} role="group" aria-label="Consistency of each sensor" style={{ "--lamps": String(shown.length) }}>
      {shown.map((lamp) => ({ ...lamp, ...(grey ? { tone: "idle", text: grey } : {}) })).map((lamp) => (
        <div key={lamp.key} class={`lamp ${lamp.tone}`} data-lamp={lamp.key}>
          <span class="light" aria-hidden="true" />
          <p title={lamp.text}><b>{lamp.title}</b> {pretty(lamp.text)}</p>
          <span class="spoken" aria-live="polite">{`${lamp.title}: ${TONES[lamp.tone] ?? "nothing to judge"}`}</span>
          <span class="nis" title={lamp.hint}>{lamp.number}</span>
        </div>
      ))}
    </div>
  );
}

/** Read aloud when a lamp changes its colour; its number changes all the time. */
const TONES: Record<string, string> = { good: "consistent", warn: "worth a look", bad: "not consistent" };

const time: Pick<ChartSpec, "x"> = { x: [-WINDOW_S, 0] };
const XYZ = [{ text: "x", role: "s1" }, { text: "y", role: "s2" }, { text: "z", role: "s0" }];

const ANGLE_SPEC: ChartSpec = {
  ...time, title: "Angles ±3σ", unit: "°", leastSpan: 4,
  legend: [{ text: "yaw", role: "s0" }, { text: "pitch", role: "s1" }, { text: "roll", role: "s2" }, { text: "truth", role: "reference", dash: true }],
  lines: [
    ...[0, 1, 2].flatMap((i) => [{ role: `s${i}`, edge: true }, { role: `s${i}`, edge: true }]),
    ...[0, 1, 2].map((i) => ({ role: `s${i}` })),
    ...[0, 1, 2].map(() => ({ role: "reference", dash: true, width: 1.1 })),
  ],
  bands: [0, 1, 2].map((i) => ({ high: 1 + 2 * i, low: 2 + 2 * i, role: `s${i}` })),
};
const RATE_SPEC: ChartSpec = { ...time, title: "Angular rate", unit: "deg/s", leastSpan: 4, legend: XYZ, lines: XYZ.map((l) => ({ role: l.role })) };

/** Where the subject states no covariance, its innovations have no bounds and no NIS. */
const NO_COVARIANCE = "no covariance: nothing to judge";

const residualSpec = (sensor: string, heading: boolean, judged: boolean): ChartSpec => ({
  ...time, title: heading ? "Innovation of the heading ±3σ" : "Innovation ±3σ",
  unit: !judged ? NO_COVARIANCE : heading ? "deg" : pretty(aids().find((a) => a.sensor === sensor)?.unit.replace("microtesla", "uT") ?? ""), leastSpan: heading || sensor !== "accelerometer" ? 2 : 0.2,
  legend: heading ? [{ text: "heading", role: "s1" }] : XYZ,
  lines: [{ role: "muted", edge: true }, { role: "muted", edge: true }, ...XYZ.map((l) => ({ role: l.role, width: 1.4 }))],
  bands: [{ high: 1, low: 2, role: "muted" }],
});
/** 95 % and 99 % of chi-square for 1 and 3 degrees of freedom. */
const BOUNDS: Record<number, [number, number]> = { 1: [3.841, 6.635], 2: [5.991, 9.21], 3: [7.815, 11.345] };
const nisSpec = (dof: () => number, judged: boolean): ChartSpec => ({
  ...time, title: "NIS", unit: judged ? "log scale" : NO_COVARIANCE, logY: true, y: [0.001, 1000],
  legend: [{ text: "fused", role: "estimate", dot: true }, { text: "refused", role: "gated", dot: true }],
  lines: [{ role: "estimate", points: true }, { role: "gated", points: true }],
  rules: () => { const [a, b] = BOUNDS[dof()] ?? BOUNDS[3]!; return [{ value: b, text: "99 %" }, { value: a, text: "95 %", below: true }]; },
});

const aligned = (columns: (number | null)[][]): uPlot.AlignedData => columns as unknown as uPlot.AlignedData;

/** The four live plots of a device. */
export function LivePlots({ device }: { device: string }) {
  const [wanted, setSensor] = useState("accelerometer");
  const lit = useFrame(device, (frame) => frame.lamp.map((l) => l.sensor).join(" "), 1, "accelerometer magnetometer");
  const choices = lit.split(" ").filter((s) => s);
  const sensor = choices.includes(wanted) ? wanted : choices[0] ?? "accelerometer";
  const judged = useFrame(device, (frame) => !mainEstimate(frame) || mainEstimate(frame)!.std_deg !== null, 1, true);
  const history = historyOf(device);
  const end = (): number => history.latest?.t_s ?? 0;
  const dof = useFrame(device, () => history.degreesOfFreedom[sensor] ?? 3, 2, 3);
  const heading = isHeading(dof);
  const residual = useMemo(() => residualSpec(sensor, heading, judged), [sensor, heading, judged]);
  const nis = useMemo(() => nisSpec(() => history.degreesOfFreedom[sensor] ?? 3, judged), [sensor, device, judged]);

  const angles = (): uPlot.AlignedData => {
    const [t, y, p, r, sy, sp, sr, ty, tp, tr] = history.angles.window(WINDOW_S, end()) as (number | null)[][];
    const lines = [y!, p!, r!].map(unwrapped);
    const edges = lines.flatMap((line, k) => [1, -1].map((s) => line.map((v, i) => (v === null || [sy!, sp!, sr!][k]![i] === null ? null : v + s * 3 * [sy!, sp!, sr!][k]![i]!))));
    return aligned([t!, ...edges, ...lines, ...[ty!, tp!, tr!].map(unwrapped)]);
  };
  const innovations = (): (number | null)[][] => history.innovations[sensor]?.window(WINDOW_S, end()) ?? Array.from({ length: 9 }, () => []);
  const residuals = (): uPlot.AlignedData => {
    const [t, x, y, z, sx, sy, sz] = innovations();
    const widest = sx!.map((s, i) => 3 * Math.max(s ?? 0, sy![i] ?? 0, sz![i] ?? 0));
    return aligned([t!, widest, widest.map((s) => -s), x!, y!, z!]);
  };
  const nisData = (): uPlot.AlignedData => { const c = innovations(); return aligned([c[0]!, c[7]!, c[8]!]); };
  return (
    <div class="plots">
      <Chart spec={ANGLE_SPEC} data={angles} live />
      <Chart spec={residual} data={residuals} live />
      <Chart spec={RATE_SPEC} data={() => aligned(history.rates.window(WINDOW_S, end()))} live />
      <Chart spec={nis} data={nisData} live />
      <div class="choice" role="group" aria-label="Sensor of the innovation plots">
        {choices.map((s) => (
          <button key={s} type="button" aria-pressed={s === sensor} onClick={() => setSensor(s)}>{titleOf(s).toLowerCase()}</button>
        ))}
      </div>
    </div>
  );
}

/** Breaks a line where an angle jumps over ±180°. */
function unwrapped(values: (number | null)[]): (number | null)[] {
  return values.map((v, i) => (i && v !== null && values[i - 1] !== null && Math.abs(v - values[i - 1]!) > 180 ? null : v));
}

