// The Allan deviation of a recording at rest: which noise rules at which averaging time, and Q from it.

import { useEffect, useMemo, useState } from "preact/hooks";
import { type Spec, Still, columns } from "../chart";
import type { Allan as Message, AllanReport, Device, Settings } from "../protocol";
import { changeHere, receives, rowsOf, send, state } from "../store";
import { inEveryLanguage, type Key, t } from "../t";
import { figures, number, pretty, said } from "../words";
import { Silence, Stillness } from "./stillness";

const SENSORS = ["gyroscope", "accelerometer", "magnetometer"];
/** What recordings at rest are called, to find them again. */
const isRest = (name: string): boolean => inEveryLanguage("allan.name").some((usual) => name.startsWith(usual));
let request = 0;

export function Allan({ device }: { device: Device }) {
  const [minutes, setMinutes] = useState(10);
  const [sensor, setSensor] = useState("gyroscope");
  const rows = rowsOf(device.id);
  const [chosen, setChosen] = useState<string | null>(null);
  const row = rows.find((r) => r.id === chosen) ?? [...rows].reverse().find((r) => isRest(r.name)) ?? rows.at(-1);
  const running = state.running[device.id];
  const analyse = (id: string, of: string): void => send({ type: "allan", request: ++request, id, sensor: of });
  useEffect(() => {
    if (row) analyse(row.id, sensor);
  }, [row?.id, sensor]);
  const told = state.allan;
  const answer = row && told?.id === row.id && told.sensor === sensor ? told : null;
  return (
    <>
      <p>{t("allan.what")}</p>
      {running ? (
        <>
          <progress max="1" value={running.progress} aria-label={t("allan.progress")} />
          <p class="big" role="timer">{t("left", { time: clock(running.remaining_s) })}</p>
          {!receives(device) && <Silence device={device} />}
          <p class="small">{t("allan.dont")}</p>
          <button type="button" onClick={() => send({ type: "stop", device: device.id })}>{t("allan.stop")}</button>
        </>
      ) : (
        <>
          <label class="row">{t("allan.restFor")}
            <input type="range" min="1" max="60" step="1" value={minutes} onInput={(e) => setMinutes(Number(e.currentTarget.value))} />
            <output>{minutes} min</output>
          </label>
          <p class="small">{t(minutes < 3 ? "allan.short" : minutes < 20 ? "allan.medium" : "allan.long")} {t("allan.usual")}</p>
          <Stillness device={device} />
          <button type="button" class={row ? "" : "primary"} disabled={!receives(device)} onClick={() => send({ type: "experiment", device: device.id, seconds: minutes * 60, name: `${t("allan.name")}, ${minutes} min` })}>{t("allan.record")}</button>
        </>
      )}
      {row && (
        <>
          <label class="field">{t("recordings.name")}
            <select value={row.id} onChange={(e) => setChosen(e.currentTarget.value)}>{rows.map((r) => <option key={r.id} value={r.id}>{r.name} ({clock(r.duration_s)})</option>)}</select>
          </label>
          <label class="field">{t("sensor")}
            <select value={sensor} onChange={(e) => setSensor(e.currentTarget.value)}>{SENSORS.map((s) => <option key={s} value={s}>{t(`sensor.${s}` as Key).toLowerCase()}</option>)}</select>
          </label>
        </>
      )}
      <div aria-live="polite" class="stack">{answer && <Answer answer={answer} device={device} />}</div>
    </>
  );
}

function clock(seconds: number): string {
  const whole = Math.ceil(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

function Answer({ answer, device }: { answer: Message; device: Device }) {
  if (!answer.report) return <div class="verdict warn"><b>{t("allan.notYet")}</b><span>{said(sentence(answer.text ?? ""))}</span></div>;
  const { report, fill } = answer;
  const settings = fill?.settings ?? {};
  const apply = (): void => {
    changeHere(device.id, (s) => (s.settings[device.id] = { ...s.settings[device.id], ...settings }));
    send({ type: "settings", device: device.id, settings });
  };
  return (
    <>
      <Coefficients report={report} />
      {report.sensor === "gyroscope" && Object.keys(settings).length > 0 && (
        <>
          <button type="button" class="primary" onClick={apply}>{t("allan.fill")}</button>
          <Filled settings={settings} />
        </>
      )}
      {report.sensor === "gyroscope" && fill && <ul class="sentences plain">{fill.said.filter((s) => s.includes("unchanged")).map((s) => <li key={s}>{said(s)}</li>)}</ul>}
      <ul class="sentences plain">{report.sentences.map((s) => <li key={s}>{said(s)}</li>)}</ul>
    </>
  );
}

const sentence = (text: string): string => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`.replace("..", ".");

function Coefficients({ report }: { report: AllanReport }) {
  const c = report.coefficients, unit = pretty(report.unit);
  const rows: [string, { value: number; std: number } | null | undefined, string, string][] = [
    [t("allan.white"), c.noise_density, `${unit}/√Hz`, "noise"],
    [t("allan.instability"), c.bias_instability, unit, "instability"],
    [t("allan.walk"), c.random_walk, `${unit}/√s`, "walk"],
  ];
  return (
    <table class="compact">
      <thead><tr><th scope="col">{t(`sensor.${report.sensor}` as Key)}</th><th scope="col" class="num">{t("value")}</th><th scope="col" class="num">±</th></tr></thead>
      <tbody>
        {rows.map(([name, value, u, key]) => (
          <tr key={key} data-value={key} {...(value ? { "data-number": String(value.value) } : {})}>
            <th scope="row">{name} <small>{u}</small></th>
            <td class="num">{value ? figures(value.value) : t("allan.notSeen")}</td>
            <td class="num">{value ? `${number((100 * value.std) / value.value, 0)} %` : ""}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Filled({ settings }: { settings: Settings }) {
  return <p class="small">{Object.entries(settings).map(([name, v]) => `${name} = ${figures(Number(v))}`).join("; ")}</p>;
}

const specOf = (): Spec => ({
  id: "allan", title: t("allan.title"), unit: "", across: t("allan.across"), logX: true, logY: true, leastRange: [1, 1],
  curves: [
    { label: "+95 %", key: t("measured"), role: "ink", edge: true }, { label: "−95 %", key: t("measured"), role: "ink", edge: true }, { label: t("measured"), role: "ink", width: 2.4 },
    { label: t("allan.white").toLowerCase(), role: "muted", dash: [2, 3] }, { label: t("allan.instability").toLowerCase(), role: "muted", dash: [7, 4] }, { label: t("allan.walk").toLowerCase(), role: "muted", dash: [12, 3, 2, 3] },
  ],
  bands: [{ high: 0, low: 1, role: "ink" }],
});

/** Each noise alone, where it is not far below the curve. */
function lines(report: AllanReport): (number | null)[][] {
  const c = report.coefficients;
  const lowest = Math.min(...report.curve.map((p) => p.deviation)) / 3;
  const of = (v: ((tau: number) => number) | null): (number | null)[] =>
    report.curve.map((p) => {
      const value = v ? v(p.tau_s) : null;
      return value !== null && value > lowest ? value : null;
    });
  const { noise_density: n, bias_instability: b, random_walk: k } = c;
  return [
    of(n ? (tau) => n.value / Math.sqrt(tau) : null),
    of(b ? () => b.value * Math.sqrt((2 * Math.LN2) / Math.PI) : null),
    of(k ? (tau) => k.value * Math.sqrt(tau / 3) : null),
  ];
}

/** The curve, in the lower half. */
export function AllanPlot() {
  const report = state.allan?.report ?? null;
  const spec = useMemo<Spec>(() => {
    const curve = report?.curve ?? [];
    const [low, high] = [Math.min(...curve.map((p) => Math.max(p.lower, p.deviation / 5))), Math.max(...curve.map((p) => p.upper))];
    return { ...specOf(), unit: `${pretty(report?.unit ?? "")}, 95 %`, ...(curve.length ? { leastRange: [low, high] as [number, number] } : {}), mark: () => report?.trusted_tau_s ?? null };
  }, [report, t("measured")]);
  const data = useMemo(() => {
    const curve = report?.curve ?? [];
    return columns([curve.map((p) => p.tau_s), curve.map((p) => p.upper), curve.map((p) => Math.max(p.lower, p.deviation / 5)), curve.map((p) => p.deviation), ...(report ? lines(report) : [[], [], []])]);
  }, [report]);
  if (!report) return <p class="empty">{t("allan.empty")}</p>;
  return <div class="plots one"><Still spec={spec} data={data} /></div>;
}
