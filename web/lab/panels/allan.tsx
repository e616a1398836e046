// The Allan deviation of a recording at rest: which noise rules at which averaging time, and Q from it.

import { useEffect, useMemo, useState } from "preact/hooks";
import type uPlot from "uplot";
import { Chart, type ChartSpec } from "../chart";
import type { Allan as Message, AllanReport, Device, Settings } from "../protocol";
import { changeHere, receives, rowsOf, send, state } from "../store";
import { figures, number, pretty } from "../words";
import { Silence, Stillness } from "./stillness";

const SENSORS = ["gyroscope", "accelerometer", "magnetometer"];
/** What recordings at rest are called, to find them again. */
const NAME = "Rest";
let request = 0;

export function Allan({ device }: { device: Device }) {
  const [minutes, setMinutes] = useState(10);
  const [sensor, setSensor] = useState("gyroscope");
  const rows = rowsOf(device.id);
  const [chosen, setChosen] = useState<string | null>(null);
  const row = rows.find((r) => r.id === chosen) ?? [...rows].reverse().find((r) => r.name.startsWith(NAME)) ?? rows.at(-1);
  const running = state.running[device.id];
  const analyse = (id: string, of: string): void => send({ type: "allan", request: ++request, id, sensor: of });
  useEffect(() => {
    if (row) analyse(row.id, sensor);
  }, [row?.id, sensor]);
  const told = state.allan;
  const answer = row && told?.id === row.id && told.sensor === sensor ? told : null;
  return (
    <>
      <p>Left at rest for long, a sensor shows how its noise averages out, and when its bias begins to drift. That is Q, measured.</p>
      {running ? (
        <>
          <progress max="1" value={running.progress} aria-label="Progress of the recording at rest" />
          <p class="big" role="timer">{clock(running.remaining_s)} left</p>
          {!receives(device) && <Silence device={device} />}
          <p class="small">Do not touch the table. What you have is analysed when you stop.</p>
          <button type="button" onClick={() => send({ type: "stop", device: device.id })}>Stop and analyse</button>
        </>
      ) : (
        <>
          <label class="row">Rest for
            <input type="range" min="1" max="60" step="1" value={minutes} onInput={(e) => setMinutes(Number(e.currentTarget.value))} />
            <output>{minutes} min</output>
          </label>
          <p class="small">{minutes < 3 ? "White noise only." : minutes < 20 ? "White noise well, the floor roughly." : "White noise, the floor, and how the bias walks."} Ten minutes are usual, an hour shows the bias.</p>
          <Stillness device={device} />
          <button type="button" class={row ? "" : "primary"} disabled={!receives(device)} onClick={() => send({ type: "experiment", device: device.id, seconds: minutes * 60, name: `${NAME}, ${minutes} min` })}>Record a rest</button>
        </>
      )}
      {row && (
        <>
          <label class="field">Recording
            <select value={row.id} onChange={(e) => setChosen(e.currentTarget.value)}>{rows.map((r) => <option key={r.id} value={r.id}>{r.name} ({clock(r.duration_s)})</option>)}</select>
          </label>
          <label class="field">Sensor
            <select value={sensor} onChange={(e) => setSensor(e.currentTarget.value)}>{SENSORS.map((s) => <option key={s}>{s}</option>)}</select>
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
  if (!answer.report) return <div class="verdict warn"><b>Not yet</b><span>{pretty(sentence(answer.text ?? ""))}</span></div>;
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
          <button type="button" class="primary" onClick={apply}>Fill Q with this</button>
          <Filled settings={settings} />
        </>
      )}
      {report.sensor === "gyroscope" && fill && <ul class="sentences plain">{fill.said.filter((s) => s.includes("unchanged")).map((s) => <li key={s}>{pretty(s)}</li>)}</ul>}
      <ul class="sentences plain">{report.sentences.map((s) => <li key={s}>{pretty(s)}</li>)}</ul>
    </>
  );
}

const sentence = (text: string): string => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`.replace("..", ".");

function Coefficients({ report }: { report: AllanReport }) {
  const c = report.coefficients, unit = pretty(report.unit);
  const rows: [string, { value: number; std: number } | null | undefined, string, string][] = [
    ["White noise", c.noise_density, `${unit}/√Hz`, "noise"],
    ["Bias instability", c.bias_instability, unit, "instability"],
    ["Random walk", c.random_walk, `${unit}/√s`, "walk"],
  ];
  return (
    <table class="compact">
      <thead><tr><th scope="col">{report.sensor}</th><th scope="col" class="num">value</th><th scope="col" class="num">±</th></tr></thead>
      <tbody>
        {rows.map(([name, value, u, key]) => (
          <tr key={key} data-value={key} {...(value ? { "data-number": String(value.value) } : {})}>
            <th scope="row">{name} <small>{u}</small></th>
            <td class="num">{value ? figures(value.value) : "not seen"}</td>
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

const SPEC: ChartSpec = {
  title: "Allan deviation", unit: "over averaging time, s", logX: true, logY: true,
  legend: [
    { text: "measured", role: "estimate" }, { text: "white noise", role: "s1", dash: true },
    { text: "instability", role: "s2", dash: true }, { text: "random walk", role: "s3", dash: true },
  ],
  lines: [
    { role: "estimate", edge: true }, { role: "estimate", edge: true }, { role: "estimate", width: 2.4 },
    { role: "s1", dash: true }, { role: "s2", dash: true }, { role: "s3", dash: true },
  ],
  bands: [{ high: 1, low: 2, role: "estimate" }],
};

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
  const spec = useMemo<ChartSpec>(() => ({ ...SPEC, unit: `${pretty(report?.unit ?? "")} over s, 95 %`, mark: () => report?.trusted_tau_s ?? null }), [report]);
  const data = useMemo(() => {
    const curve = report?.curve ?? [];
    const columns = [curve.map((p) => p.tau_s), curve.map((p) => p.upper), curve.map((p) => Math.max(p.lower, 1e-12)), curve.map((p) => p.deviation), ...(report ? lines(report) : [[], [], []])];
    return () => columns as unknown as uPlot.AlignedData;
  }, [report]);
  if (!report) return <p class="empty">The curve appears here once a rest of a minute or more is recorded.</p>;
  return <div class="plots one"><Chart spec={spec} data={data} /></div>;
}
