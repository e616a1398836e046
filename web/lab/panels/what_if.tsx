// Step 8: the same recording with other numbers, sensors, estimators or worse samples, at once, beside how it was; and the curve that shows
// where tuning is consistent.

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { type Rule, type Spec, Still, columns } from "../chart";
import { AllParameters, curveChoices, degreesOf, Sliders, type Tuned } from "../parameters";
import type { ExperimentRow, Settings, TraceColumns, WhatIf as Message } from "../protocol";
import { judged, TiltMark } from "../judged";
import { language } from "../../words/language";
import { aids, goTo, send, shownExperiment, state, titleOf, update } from "../store";
import { type Key, t } from "../t";
import { nameOf, roleOf } from "../theme";
import { degrees, number } from "../words";
import { isAsMeasured, type Trial, Trials } from "./alterations";
import { rms } from "./experiment";
import { endFit, FitButton } from "./fit";
import { HandIn } from "./hand_in";

let request = 0;
/** What was asked last and is not answered: only one is under way, so that a drag cannot pile up work. */
let underWay: number | null = null;
let next: (() => void) | null = null;
/** Settings of the last question, marked in the curve. */
let asked: Settings = {};
/** Settings under trial; kept here so that leaving the step does not lose them. */
let tried: { id: string; settings: Settings; trial: Trial } | null = null;

/** Without an answer for so long the question is lost: the program was started anew, or the page was away. */
const PATIENCE_MS = 5000;
let askedMs = 0;

/** Sliders are those of the experiment's subject and sensors. */
const tunedOf = (row: ExperimentRow, trial: Trial = {}): Tuned => ({
  subject: trial.subject ?? row.subject,
  missing: (sensor) => (row.sensors.some((s) => s === sensor) ? null : t("whatIf.notHere", { sensor: titleOf(sensor) })),
});

function isUnderWay(): boolean {
  const open = underWay !== null && state.whatIf?.request !== underWay && state.failed !== underWay;
  return open && state.connection === "open" && performance.now() - askedMs < PATIENCE_MS;
}

function ask(row: ExperimentRow, settings: Settings, trial: Trial, curve: string | null): void {
  asked = settings;
  endFit();
  const go = (): void => {
    underWay = ++request;
    askedMs = performance.now();
    send({ type: "what_if", request, id: row.id, settings, curve, ...trial });
  };
  if (isUnderWay()) next = go;
  else go();
}

export function WhatIf() {
  const own = shownExperiment();
  const rows = state.rows.filter((r) => r.has_samples && (!r.is_archived || r.id === own));
  const [id, setId] = useState(own ?? rows.at(-1)?.id ?? "");
  const row = rows.find((r) => r.id === id) ?? rows.at(-1);
  const [settings, setSettings] = useState<Settings>(tried && tried.id === row?.id ? tried.settings : { ...row?.settings });
  const [trial, setTrial] = useState<Trial>(tried && tried.id === row?.id ? tried.trial : {});
  const [chosen, setCurve] = useState("accelerometer_std");
  const tuned = row && tunedOf(row, trial);
  const choices = tuned ? curveChoices(tuned) : [];
  const curve = choices.some((c) => c.name === chosen) ? chosen : choices[0]?.name ?? null;
  const begun = useRef(false);
  useEffect(() => {
    // The first answer: the recording as it was run.
    if (row && !begun.current) ask(row, settings, trial, curve);
    begun.current = true;
  });
  useEffect(() => {
    if (isUnderWay() || !next) return;
    const go = next;
    next = null;
    go();
  }, [state.whatIf, state.failed]);
  if (!row || !tuned) return <p>{t("whatIf.needs")} <button type="button" class="link" onClick={() => goTo("experiment")}>{t("startOne")}</button></p>;
  const run = (changed: Settings, { as = trial, parameter = curve, of = row }: { as?: Trial; parameter?: string | null; of?: ExperimentRow } = {}): void => {
    setSettings(changed);
    setTrial(as);
    tried = { id: of.id, settings: changed, trial: as };
    update((s) => (s.lower = "what-if"));
    ask(of, changed, as, parameter);
  };
  const set = (name: string, value: number | string): void => run({ ...settings, [name]: value });
  return (
    <>
      <p>{t("whatIf.move")}</p>
      <label class="field">{t("recordings.name")}
        <select value={row.id} onChange={(e) => { const other = rows.find((r) => r.id === e.currentTarget.value)!; setId(other.id); run({ ...other.settings }, { as: {}, of: other }); }}>
          {rows.map((r) => <option key={r.id} value={r.id}>{r.name}</option>)}
        </select>
      </label>
      <Sliders settings={settings} tuned={tuned} change={set} />
      <FitButton row={row} settings={settings} trial={trial} tuned={tuned} take={(fitted) => run(fitted)} />
      <Trials row={row} trial={trial} change={(as) => run(settings, { as })} />
      <label class="field">{t("whatIf.over")}
        <select value={curve ?? ""} onChange={(e) => { setCurve(e.currentTarget.value); run(settings, { parameter: e.currentTarget.value }); }}>
          {choices.map((c) => <option key={c.name} value={c.name}>{c.text}</option>)}
        </select>
      </label>
      <button type="button" onClick={() => run({ ...row.settings }, { as: {} })}>{t("whatIf.back")}</button>
      <Answer message={state.whatIf} row={row} />
      <HandIn id={row.id} change={{ settings, ...trial }} />
      <AllParameters settings={settings} tuned={tuned} change={set} />
    </>
  );
}

function Answer({ message, row }: { message: Message | null; row: ExperimentRow }) {
  if (!message || message.id !== row.id) return null;
  const names = Object.keys(message.results).sort((a, b) => Number(b === message.subject) - Number(a === message.subject));
  const truth = names.some((name) => rms(message.results[name]!) !== null);
  return (
    <table class="compact results what-if">
      <caption>{t("whatIf.took")} <b>{number(message.elapsed_ms, 0)} ms</b>{!isAsMeasured(tried?.trial.alterations) && <>; {t("whatIf.altered")}</>}</caption>
      <thead><tr><th scope="col">{t("estimator")}</th><th scope="col" class="num">{t("whatIf.then")}</th><th scope="col" class="num">{t("whatIf.now")}</th>{truth && <th scope="col" class="num" title={t("whatIf.rms")}>{t("result.rms")}</th>}<th scope="col" class="num" title={t("nis.mean")}>NIS</th></tr></thead>
      <tbody>
        {names.map((name) => {
          const now = judged(message.results[name]!.final), before = judged(state.finished[row.id]?.result?.summary[name]?.final ?? row.results[name]);
          return (
            <tr key={name} data-estimator={name}>
              <th scope="row"><span class="swatch" style={{ "--role": `var(--${roleOf(name)})` }} /> {nameOf(name)}</th>
              <td class="num">{degrees(before.calculated)}<TiltMark of={before} /></td>
              <td class="num" data-value="calculated">{degrees(now.calculated)}<TiltMark of={now} /></td>
              {truth && <td class="num" data-value="rms">{degrees(rms(message.results[name]!))}</td>}
              <td class="num" data-value="nis">{number(message.results[name]!.nis_mean.accelerometer, 2)}</td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}

/** As it was measured: thinner, and dashed. */
const BEFORE = { dash: [3, 3], width: 1 };

const traceSpec = (subject: string): Spec => ({
  id: "what-if angles", title: t("whatIf.again", { name: nameOf(subject) }), unit: "deg", across: t("across.time"), leastSpan: 4,
  curves: ANGLES.flatMap(({ key, role }) => [{ label: t(key), role }, { label: t("whatIf.before", { what: t(key) }), role, ...BEFORE }]),
});
const ANGLES: { key: Key; role: string }[] = [{ key: "angle.yaw", role: "z" }, { key: "angle.pitch", role: "y" }, { key: "angle.roll", role: "x" }];

/** NIS over time of each sensor, beside how it was. */
const nisSpec = (sensors: string[], subject: string): Spec => ({
  id: "what-if nis", title: t("whatIf.nis", { name: nameOf(subject) }), unit: "", across: t("across.time"), logY: true, leastRange: [0.3, 10],
  curves: sensors.flatMap((s, i) => [{ label: titleOf(s), role: NIS_ROLES[i % NIS_ROLES.length]! }, { label: t("whatIf.before", { what: titleOf(s) }), role: NIS_ROLES[i % NIS_ROLES.length]!, ...BEFORE }]),
  rules: () => consistent(sensors),
});
const NIS_ROLES = ["ink", "refused", "muted"];

/** Columns over all times of both: each value stands until the next. */
function beside(now: { t_s: number[]; of: (number | null)[][] }, before: { t_s: number[]; of: (number | null)[][] }) {
  const times = [...new Set([...now.t_s, ...before.t_s])].sort((a, b) => a - b);
  const held = ({ t_s, of }: typeof now): (number | null)[][] => {
    let at = -1;
    const places = times.map((time) => {
      while (at + 1 < t_s.length && t_s[at + 1]! <= time) at++;
      return time > t_s.at(-1)! ? -1 : at;
    });
    return of.map((column) => places.map((place) => (place < 0 ? null : column[place] ?? null)));
  };
  const [a, b] = [held(now), held(before)];
  return columns([times, ...a.flatMap((column, i) => [column, b[i]!])]);
}

const errorSpec = (truth: boolean): Spec => ({
  id: "what-if error", title: t(truth ? "whatIf.error.title" : "whatIf.sigma.title"), unit: "deg", across: t("across.time"), leastSpan: 0.5,
  curves: [{ label: t(truth ? "whatIf.error" : "whatIf.sigma"), role: "ink" }, { label: t("whatIf.before", { what: t(truth ? "whatIf.error" : "whatIf.sigma") }), role: "ink", ...BEFORE }],
});
/** The line of a sensor: its place in the table of sensors is its dash. */
const DASHES = [undefined, [7, 3], [2, 3]];
const dashOfSensor = (sensor: string): number[] | undefined => DASHES[aids().findIndex((aid) => aid.sensor === sensor)];

const curveSpec = (text: string, sensors: string[], value: () => number | null, rules: () => Rule[]): Spec => ({
  id: "what-if curve", title: t("whatIf.curve"), unit: "", across: text, logX: true, logY: true, leastRange: [0.3, 10],
  curves: [...sensors.map((s) => ({ label: titleOf(s).toLowerCase(), role: "ink", ...(dashOfSensor(s) ? { dash: dashOfSensor(s)! } : {}), width: 2 })), { label: t("whatIf.curve.error"), role: "refused", width: 2 }],
  rules,
  mark: value,
});

/** The NIS of a consistent R: its degrees of freedom, which are fewer for a heading. */
function consistent(sensors: string[]): Rule[] {
  const degrees = [...new Set(sensors.map((s) => degreesOf(s, asked)))].sort((a, b) => b - a);
  if (degrees.length < 2) return degrees.map((value) => ({ value, text: t("whatIf.consistent", { value }) }));
  const whose = (value: number): string => sensors.filter((s) => degreesOf(s, asked) === value).map((s) => titleOf(s).toLowerCase().slice(0, 3)).join(", ");
  return degrees.map((value, i) => ({ value, text: t("whatIf.consistent.of", { whose: whose(value), value }), below: i > 0 }));
}

const positive = (v: number | null): number | null => (v !== null && v > 0 ? v : null);

/** The NIS of each sensor, now and then, each sensor over its own times. */
function nisBeside(sensors: string[], now: TraceColumns | null, before: TraceColumns | null) {
  const empty = { t_s: [], mean: [] };
  const pairs = sensors.map((s) => [now?.nis[s] ?? empty, before?.nis[s] ?? empty] as const);
  const times = [...new Set(pairs.flat().flatMap((one) => one.t_s))].sort((a, b) => a - b);
  const column = ({ t_s, mean }: { t_s: number[]; mean: number[] }): (number | null)[] => {
    const known = new Map(t_s.map((time, i) => [time, mean[i]!]));
    let last: number | null = null;
    return times.map((time) => (last = positive(known.get(time) ?? (time <= (t_s.at(-1) ?? -1) ? last : null))));
  };
  return columns([times, ...pairs.flatMap(([a, b]) => [column(a), column(b)])]);
}

/** The lower half: trace and curve of the last answer. */
export function WhatIfPlots() {
  const message = state.whatIf;
  const trace = message?.trace ?? null;
  // It comes after the answer; until then the one before stays.
  const curve = state.curve && state.curve.id === message?.id ? state.curve.curve : null;
  const before = message?.original ?? null;
  const spoken = language();
  const both = (of: (trace: TraceColumns) => (number | null)[][]) => {
    const one = (trace: TraceColumns | null) => ({ t_s: trace?.t_s ?? [], of: trace ? of(trace) : [] });
    return beside(one(trace), one(before));
  };
  const angles = useMemo(() => both((one) => [0, 1, 2].map((i) => one.angles_deg.map((r) => r[i]!))), [trace]);
  const truth = !!trace?.error_deg;
  const errors = useMemo(() => both((one) => [(truth ? one.error_deg : one.std_deg?.map((s) => Math.hypot(...s))) ?? []]), [trace]);
  const errorOf = useMemo(() => errorSpec(truth), [truth, spoken]);
  const traceOf = useMemo(() => traceSpec(message?.subject ?? ""), [message?.subject, spoken]);
  const withNis = aids().map((aid) => aid.sensor as string).filter((s) => trace?.nis[s] || before?.nis[s]);
  const nisOf = useMemo(() => nisSpec(withNis, message?.subject ?? ""), [withNis.join(), message?.subject, spoken]);
  const nis = useMemo(() => nisBeside(withNis, trace, before), [trace, withNis.join()]);
  const sensors = aids().map((aid) => aid.sensor as string).filter((s) => curve?.nis[s]);
  const row = state.rows.find((r) => r.id === message?.id);
  const over = (row && curveChoices(tunedOf(row)).find((c) => c.name === curve?.parameter)?.text) ?? curve?.parameter ?? "";
  const spec = useMemo(() => curveSpec(over, sensors, () => Number(asked[curve?.parameter ?? ""]) || null, () => consistent(sensors)), [over, curve?.parameter, sensors.join(), spoken]);
  const curveData = useMemo(() => columns([curve?.values ?? [], ...sensors.map((s) => curve!.nis[s]!.map(positive)), curve?.error_deg.map(positive) ?? []]), [curve]);
  if (!message) return <p class="empty">{t(state.rows.length ? "whatIf.empty.move" : "whatIf.empty")}</p>;
  return (
    <div class="plots what-if-plots">
      <Still spec={traceOf} data={angles} />
      <Still spec={nisOf} data={nis} />
      {curve && <Still spec={spec} data={curveData} />}
      <Still spec={errorOf} data={errors} />
    </div>
  );
}
