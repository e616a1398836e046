// Steps 5 to 7: move, come back, and compare the calculated with the estimated error.

import { useEffect, useRef, useState } from "preact/hooks";
import { angleBetween } from "../attitude";
import { mainEstimate, mainName } from "../history";
import { endedEarly, type Judged, judged, TiltMark } from "../judged";
import { LiveText } from "../live";
import type { Device, Experiment as Message, FinalSummary, FinalVerdict, Frame, RunSummary, SettingValue } from "../protocol";
import { aids, fetchResult, goTo, historyOf, isStudent, offers, receives, send, showExperiment, shownExperiment, state, titleOf } from "../store";
import { type Key, t } from "../t";
import { nameOf, roleOf } from "../theme";
import { degrees, figures, number, said, unnamed, VERDICTS } from "../words";
import { HandIn } from "./hand_in";
import { Silence, Stillness } from "./stillness";

/** Where each device was when its experiment began: by the page's own clock, for the live angle only. */
const starts = new Map<string, number[]>();

export function Experiment({ device }: { device: Device }) {
  // A virtual phone comes back after 75 s.
  const [seconds, setSeconds] = useState(device.source === "virtual" ? 75 : 30);
  const [name, setName] = useState("");
  const running = state.running[device.id];
  const start = (): void => {
    const now = historyOf(device.id).latest;
    const estimate = now && mainEstimate(now);
    if (estimate) starts.set(device.id, estimate.q);
    send({ type: "experiment", device: device.id, seconds, name: name.trim() || t("experiment.usual", { number: state.rows.length + 1 }) });
  };
  return (
    <>
      <p>{t("experiment.what")}</p>
      <label class="field">{t("name")}
        <input type="text" maxLength={60} value={name} placeholder={t("experiment.usual", { number: state.rows.length + 1 })} onInput={(e) => setName(e.currentTarget.value)} />
      </label>
      <label class="row">{t("experiment.duration")}
        <input type="range" min="10" max="300" step="5" value={seconds} disabled={!!running} onInput={(e) => setSeconds(Number(e.currentTarget.value))} />
        <output>{seconds} s</output>
      </label>
      {!running && <Stillness device={device} />}
      {running ? <Running device={device} running={running} /> : <button type="button" class="primary" disabled={!receives(device)} onClick={start}>{t("experiment.start")}</button>}
    </>
  );
}

function Running({ device, running }: { device: Device; running: Message }) {
  return (
    <>
      <progress max="1" value={running.progress} aria-label={t("experiment.progress")} />
      <p class="big" role="timer">{t("left", { time: `${Math.ceil(running.remaining_s)} s` })}</p>
      {!receives(device) && <Silence device={device} />}
      <button type="button" onClick={() => send({ type: "stop", device: device.id })}>{t("experiment.stop")}</button>
    </>
  );
}

export function Return({ device }: { device: Device }) {
  const running = state.running[device.id];
  const fromStart = (frame: Frame): string => {
    const start = starts.get(device.id), now = mainEstimate(frame)?.q;
    return start && now ? `${angleBetween(start, now).toFixed(1)}°` : "–";
  };
  const others = (frame: Frame): string => {
    const angle = frame.between_deg[`${mainName(frame)}|integration`];
    return angle === undefined ? "–" : `${angle.toFixed(1)}°`;
  };
  return (
    <>
      <p>{t("return.lay")}</p>
      <dl class="facts">
        <div><dt>{t("return.fromStart")}</dt><dd><LiveText device={device.id} text={fromStart} /></dd></div>
        <div><dt>{t("return.integration")}</dt><dd><LiveText device={device.id} text={others} /></dd></div>
      </dl>
      {running ? <Running device={device} running={running} /> : (
        <>
          <p class="small">{t("return.none")}</p>
          <button type="button" class="primary" onClick={() => goTo("experiment")}>{t("return.back")}</button>
        </>
      )}
    </>
  );
}

export function Result() {
  const heading = useRef<HTMLDivElement>(null);
  const id = shownExperiment();
  const finished = id ? state.finished[id] : undefined;
  useEffect(() => heading.current?.focus({ preventScroll: true }), [id]);
  // What ended before this page was opened was told to other pages.
  const canFetch = offers("results") && state.connection === "open";
  useEffect(() => {
    if (id && !finished && canFetch) fetchResult(id);
  }, [id, !finished, canFetch]);
  if (!id) return <p>{t("result.none")} <button type="button" class="link" onClick={() => goTo("experiment")}>{t("startOne")}</button></p>;
  const row = state.rows.find((r) => r.id === id), early = endedEarly(row);
  return (
    <div class="result" tabIndex={-1} ref={heading}>
      <h3>{row?.name ?? id} <small>{row?.at}</small></h3>
      {early && <p class="verdict warn" data-early><span>{early}</span></p>}
      {finished?.result ? <Summary summary={finished.result.summary} subject={finished.result.subject} /> : row && <RowSummary row={row} />}
      {finished?.result && <p class="small">{said(finished.result.origin)}</p>}
      {row && !row.has_samples ? <p class="small">{t("experiments.noSamples.hint")}</p> : (
        <>
          <Downloads id={id} hash={finished?.result?.hash} />
          <button type="button" class="primary" onClick={() => goTo("what-if")}>{t("result.next")}</button>
          <HandIn id={id} />
        </>
      )}
    </div>
  );
}

/** Verdicts that are no warning. */
const TONES: Record<string, string> = { consistent: "good", undetermined: "info", "too-few": "idle" };

/** Calculated against estimated error of every estimator, then what the sensors' noise looked like. */
export function Summary({ summary, subject }: { summary: Record<string, RunSummary>; subject: string }) {
  const names = Object.keys(summary).sort((a, b) => Number(b === subject) - Number(a === subject));
  const main = summary[subject] ?? summary[names[0]!]!;
  // What is left to the noise stands with the sensors below.
  const causes = (main.findings ?? []).filter((f) => f.cause !== "noise" && f.cause !== "lasting-errors");
  return (
    <>
      <p class="small" data-subject={main.estimator}>{t("result.of")} <b>{nameOf(main.estimator)}</b></p>
      {main.final ? <><Final of={judged(main.final)} verdict={main.final.verdict} /><Quaternions final={main.final} /></> : <NotAtRest />}
      <table class="compact results">
        <thead><tr><th scope="col">{t("board.error")}</th><th scope="col" class="num">{t("result.calculated")}</th><th scope="col" class="num">{t("result.estimated")}</th>{main.error_deg && <th scope="col" class="num" title={t("result.rms.hint")}>{t("result.rms")}</th>}</tr></thead>
        <tbody>
          {names.map((name) => {
            const s = summary[name]!, of = judged(s.final);
            return (
              <tr key={name} data-estimator={name}>
                <th scope="row"><span class="swatch" style={{ "--role": `var(--${roleOf(name)})` }} /> {nameOf(name)}</th>
                <td class="num" data-value="calculated">{degrees(of.calculated)}<TiltMark of={of} /></td>
                <td class="num" data-value="estimated">{degrees(of.estimated)}</td>
                {main.error_deg && <td class="num" data-value="rms">{degrees(rms(s))}</td>}
              </tr>
            );
          })}
        </tbody>
      </table>
      {main.final && <p class="small">{said(main.final.sentence)}</p>}
      {causes.length > 0 && (
        <ol class="sentences findings" aria-label={t("result.mend")}>
          {causes.map((f) => <li key={f.sentence} class="warn" data-cause={f.cause}>{unnamed(said(f.sentence))}</li>)}
        </ol>
      )}
      <ul class="sentences">
        {main.verdicts.map((v) => <li key={v.sensor} class={TONES[v.verdict] ?? "warn"}><b>{titleOf(v.sensor)}</b> {unnamed(said(v.sentences[0] ?? ""))}</li>)}
      </ul>
    </>
  );
}

/** RMS of the total error, where the truth is known. */
export function rms(summary: RunSummary): number | null {
  const error = summary.error_deg;
  if (!error) return null;
  return error["total_rmse"] ?? null;
}

/** The two numbers that the verdict compares, and the verdict. */
function Final({ of, verdict: given }: { of: Judged; verdict: FinalVerdict | null }) {
  const verdict = (given && VERDICTS[given]) || { tone: "warn", text: "verdict.noCovariance" as Key };
  const what = of.isTilt ? `, ${t("tilt")}` : "";
  return (
    <div class={`final ${verdict.tone}`} data-judged={of.isTilt ? "tilt" : "attitude"}>
      <div><span>{t("result.calculated.small")}{what}</span><b>{degrees(of.calculated)}</b></div>
      <div><span>{t("result.estimated.small")}{what}</span><b>{degrees(of.estimated)}</b></div>
      <p data-verdict={given ?? "none"} aria-live="polite">{t(verdict.text)}</p>
    </div>
  );
}

const NotAtRest = () => <div class="verdict warn"><b>{t("result.noVerdict")}</b><span>{t("result.notAtRest")}</span></div>;

/** The paper's last step: both error quaternions side by side. */
function Quaternions({ final }: { final: FinalSummary }) {
  const [calculated, estimated] = [final.calculated_error_wxyz, final.estimated_error_wxyz];
  return (
    <table class="compact quaternions">
      <thead><tr><th scope="col">{t("result.quaternion")}</th><th scope="col" class="num">{t("result.calculated.small")}</th><th scope="col" class="num">{t("result.estimated.small")}</th></tr></thead>
      <tbody>
        {["w", "x", "y", "z"].map((axis, i) => (
          <tr key={axis}>
            <th scope="row">{axis}</th>
            <td class="num" data-quaternion="calculated">{number(calculated[i], 5)}</td>
            <td class="num" data-quaternion="estimated">{estimated ? `${i ? "±" : ""}${number(estimated[i], 5)}` : "–"}</td>
          </tr>
        ))}
        <tr>
          <th scope="row">{t("angle")}</th>
          <td class="num" data-quaternion="calculated">{degrees(final.calculated_error_deg)}</td>
          <td class="num" data-quaternion="estimated">{degrees(final.estimated_error_deg)}</td>
        </tr>
        {judged(final).isTilt && (
          <tr>
            <th scope="row">{t("tilt")}</th>
            <td class="num">{degrees(final.calculated_tilt_deg)}</td>
            <td class="num">{degrees(final.estimated_tilt_deg)}</td>
          </tr>
        )}
      </tbody>
    </table>
  );
}

/** What the table of experiments has of a result: the numbers and verdicts, without sentences, causes and quaternions. */
function RowSummary({ row }: { row: (typeof state.rows)[number] }) {
  const main = row.results[row.subject], of = judged(main);
  return (
    <>
      <p class="small" data-subject={row.subject}>{t("result.of")} <b>{nameOf(row.subject)}</b></p>
      {main && (of.calculated === null ? <NotAtRest /> : <Final of={of} verdict={main.verdict} />)}
      <table class="compact">
        <thead><tr><th scope="col">{t("estimator")}</th><th scope="col" class="num">{t("result.calculated")}</th><th scope="col" class="num">{t("result.estimated")}</th></tr></thead>
        <tbody>
          {Object.entries(row.results).sort(([a], [b]) => Number(b === row.subject) - Number(a === row.subject)).map(([name, r]) => {
            const each = judged(r);
            return <tr key={name}><th scope="row">{nameOf(name)}</th><td class="num">{degrees(each.calculated)}<TiltMark of={each} /></td><td class="num">{degrees(each.estimated)}</td></tr>;
          })}
        </tbody>
      </table>
    </>
  );
}

function Downloads({ id, hash }: { id: string; hash: string | undefined }) {
  const files: [string, string][] = [["report.html", t("report")], ["recording.csv", "CSV"], ["recording.parquet", "Parquet"], ["estimates.tum", "TUM"], ...(state.recording ? [["recording.mcap", "MCAP"] as [string, string]] : [])];
  return (
    <>
      <div class="buttons downloads">
        {files.map(([file, text]) => <a key={file} href={`/api/experiments/${encodeURIComponent(id)}/${file}`} {...(file === "report.html" ? { target: "_blank", rel: "noopener" } : { download: "" })}>{text}</a>)}
      </div>
      {hash && <p class="small">{t("recordings.name")} <code title={hash}>{hash.slice(0, 16)}</code></p>}
    </>
  );
}

const setting = (v: SettingValue | undefined): string => (typeof v === "number" ? figures(v) : "–");

/** Deletes an experiment at the second press. */
function Delete({ id, name }: { id: string; name: string }) {
  const [sure, setSure] = useState(false);
  const press = (): void => (sure ? send({ type: "delete_experiment", id }) : setSure(true));
  return <button type="button" class="link" aria-label={sure ? t("experiments.delete.sure") : t("experiments.delete.of", { name })} onBlur={() => setSure(false)} onClick={press}>{t(sure ? "experiments.delete.sure" : "experiments.delete")}</button>;
}

/** Hides an experiment, or brings it back; its files stay. */
function Archive({ row }: { row: (typeof state.rows)[number] }) {
  const hide = !row.is_archived;
  const name = { name: row.name };
  return <button type="button" class="link" title={t("experiments.archive.hint")} aria-label={t(hide ? "experiments.archive.of" : "experiments.restore.of", name)} onClick={() => send({ type: "archive_experiment", id: row.id, archived: hide })}>{t(hide ? "experiments.archive" : "experiments.restore")}</button>;
}

/** All experiments so far, in the lower half. */
export function ExperimentTable() {
  const [all, setAll] = useState(false);
  if (!state.rows.length) return <p class="empty">{t("experiments.none")}</p>;
  const archived = state.rows.filter((row) => row.is_archived).length;
  const rows = state.rows.filter((row) => all || !row.is_archived);
  const shown = shownExperiment();
  const sensors = aids().filter((aid) => rows.some((row) => row.sensors.some((s) => s === aid.sensor)));
  const reads = (row: (typeof state.rows)[number], names: readonly string[]): string | undefined =>
    names.find((name) => state.hello?.estimators.find((e) => e.name === row.subject)?.reads.includes(name));
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={t("experiments")}>
      <p class="row-of-links">
        {!isStudent() && <a href="/api/session.zip" download="">{t("experiments.session")}</a>}
        {archived > 0 && <label class="tick"><input type="checkbox" checked={all} onChange={() => setAll(!all)} /> {t("experiments.archived.show", { count: archived })}</label>}
      </p>
      <table class="experiments">
        <thead>
          <tr>
            <th scope="col">{t("experiment")}</th><th scope="col">{t("subject")}</th><th scope="col">{t("board.verdict")}</th><th scope="col" class="num">{t("result.calculated")}</th><th scope="col" class="num">{t("result.estimated")}</th>
            <th scope="col" class="num">{nameOf("integration")}</th>{sensors.map((aid) => <th key={aid.sensor} scope="col" class="num" title={t("experiments.r", { sensor: titleOf(aid.sensor).toLowerCase() })}>R {t(`short.${aid.sensor}` as Key)}</th>)}<th scope="col" class="num">s</th><th scope="col">{t("device")}</th><td />
          </tr>
        </thead>
        <tbody>
          {[...rows].reverse().map((row) => {
            const main = row.results[row.subject], of = judged(main), integration = judged(row.results["integration"]), early = endedEarly(row);
            const verdict = main?.verdict ? VERDICTS[main.verdict] : undefined;
            return (
              <tr key={row.id} aria-current={row.id === shown}>
                <th scope="row"><button type="button" class="link" onClick={() => showExperiment(row)}>{row.name}</button>
                  {row.is_archived && <small class="mark"> {t("experiments.archived")}</small>}
                  {row.is_earlier && <small class="mark" title={t("experiments.earlier.hint")}> {t("experiments.earlier")}</small>}
                  {!row.has_samples && <small class="mark" title={t("experiments.noSamples.hint")}> {t("experiments.noSamples")}</small>}
                  {early && <small class="mark"> {early}</small>}
                </th>
                <td>{nameOf(row.subject)}</td>
                <td><span class={`tag ${verdict?.tone ?? ""}`}>{verdict ? t(verdict.text) : "–"}</span></td>
                <td class="num">{degrees(of.calculated)}<TiltMark of={of} /></td>
                <td class="num">{degrees(of.estimated)}</td>
                <td class="num">{degrees(integration.calculated)}<TiltMark of={integration} /></td>
                {sensors.map((aid) => <td key={aid.sensor} class="num">{row.sensors.some((s) => s === aid.sensor) ? setting(row.settings[reads(row, aid.noise) ?? ""]) : "–"}</td>)}
                <td class="num">{number(row.duration_s, 0)}</td>
                <td>{state.devices.find((d) => d.id === row.device_id)?.name ?? row.device}</td>
                <td class="acts">{!isStudent() && <><Archive row={row} /> <Delete id={row.id} name={row.name} /></>}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </div>
  );
}
