// Sliders for Q and R on a logarithmic scale, shared by tuning and what-if.

import { DraftInput } from "./draft";
import type { Settings } from "./protocol";
import { aids, state, titleOf } from "./store";
import { nameOf } from "./theme";
import { type Key, t } from "./t";
import { figures, said } from "./words";

interface Slider {
  name: string;
  matrix: "Q" | "R";
  label: string;
  /** Why it does nothing; null when it does. */
  idle: string | null;
}

/** What is tuned: whose parameters, and which sensors there are. */
export interface Tuned {
  subject: string | null;
  /** Why nothing comes from a sensor; null when something does. */
  missing: (sensor: string) => string | null;
}

/** Process noise, by its names in the estimators. */
const PROCESS: { names: string[]; label: Key }[] = [
  { names: ["gyroscope_noise_density", "bounded_gyroscope_noise_density"], label: "rest.gyroscopeNoise" },
  { names: ["gyroscope_bias_random_walk", "bounded_gyroscope_bias_random_walk"], label: "tune.walk" },
];

/** What is tuned by hand in the lab; everything else is under "All parameters". Units and values come from the tables of the estimators. */
function slidersOf({ subject, missing }: Tuned): Slider[] {
  const reads = new Set(state.hello?.estimators.find((e) => e.name === subject)?.reads ?? []);
  const unread = subject ? t("tune.unread", { name: nameOf(subject) }) : t("tune.noEstimator");
  const slider = (matrix: "Q" | "R", names: readonly string[], label: string, gone: string | null): Slider => {
    const read = names.find((name) => reads.has(name));
    return { name: read ?? names[0]!, matrix, label, idle: gone ?? (read ? null : unread) };
  };
  return [
    ...PROCESS.map(({ names, label }) => slider("Q", names, t(label), null)),
    ...shown(missing).map((aid) => slider("R", aid.noise, titleOf(aid.sensor), missing(aid.sensor))),
  ];
}

/** The parameters that sliders stand for and that do something: Q and R. */
export const tunable = (tuned: Tuned): string[] => slidersOf(tuned).filter((slider) => slider.idle === null).map((slider) => slider.name);

/** The usual sensors, and those of the others that deliver. */
const shown = (missing: Tuned["missing"]) => aids().filter((aid) => aid.is_usual || missing(aid.sensor) === null);

interface Gate {
  name: string;
  label: string;
  steps: [number, string][];
}

function gatesOf({ subject, missing }: Tuned, settings: Settings): Gate[] {
  const reads = state.hello?.estimators.find((e) => e.name === subject)?.reads ?? [];
  return shown(missing)
    .filter((aid) => missing(aid.sensor) === null && reads.includes(aid.gate))
    .map((aid) => ({ name: aid.gate, label: t("tune.gate", { sensor: titleOf(aid.sensor) }), steps: GATE_STEPS[degreesOf(aid.sensor, settings)] }));
}
/** Quantiles of chi-square for one and for three degrees of freedom. */
const GATE_STEPS: Record<1 | 3, [number, string][]> = {
  1: [[0, ""], [3.84, "95 %"], [6.63, "99 %"], [10.83, "99.9 %"]],
  3: [[0, ""], [7.81, "95 %"], [11.34, "99 %"], [16.27, "99.9 %"]],
};

/** Degrees of freedom of a sensor's innovation with these settings: a heading is one angle. */
export function degreesOf(sensor: string, settings: Settings): 1 | 3 {
  const angle = aids().find((aid) => aid.sensor === sensor)?.unit === "rad";
  return angle || (sensor === "magnetometer" && settings["magnetometer_use"] === "heading") ? 1 : 3;
}

/** The sliders' parameters, for curves. */
export const curveChoices = (tuned: Tuned): { name: string; text: string }[] =>
  slidersOf(tuned).filter((s) => s.idle === null).map((s) => ({ name: s.name, text: `${s.matrix}: ${s.label}` }));

export function Sliders({ settings, change, tuned }: { settings: Settings; change: (name: string, value: number) => void; tuned: Tuned }) {
  return (
    <div class="sliders">
      {slidersOf(tuned).map((slider) => <LogSlider key={slider.name} slider={slider} value={Number(settings[slider.name])} change={change} />)}
      {gatesOf(tuned, settings).map((gate) => <GateChoice key={gate.name} {...gate} value={Number(settings[gate.name])} change={change} />)}
    </div>
  );
}

const parameter = (name: string) => state.hello?.parameters.find((p) => p.name === name);

/** A unit of the tables as a page prints it. */
const printed = (unit: string): string =>
  unit.replace(/sqrt\((\w+)\)/g, "√$1").replace("microtesla", "µT").replaceAll("^2", "²");

/** The decades of a slider: two on either side of the defaults of all profiles, and as far as its value. */
function decades(name: string, value: number): [number, number] {
  const defaults = Object.values(parameter(name)?.default ?? {}).map(Number).filter((d) => d > 0);
  const powers = (defaults.length ? defaults : [value > 0 ? value : 1]).map(Math.log10);
  const now = value > 0 ? Math.log10(value) : powers[0]!;
  return [Math.floor(Math.min(Math.min(...powers) - 2, now)), Math.ceil(Math.max(Math.max(...powers) + 2, now))];
}

function LogSlider({ slider, value, change }: { slider: Slider; value: number; change: (name: string, value: number) => void }) {
  const { unit, meaning } = parameter(slider.name) ?? { unit: "", meaning: slider.label };
  const [low, high] = decades(slider.name, value);
  return (
    <label class={`slider ${slider.idle ? "off" : ""}`} title={said(slider.idle ?? meaning)}>
      <span class="matrix">{slider.matrix}</span>
      <span class="label">{slider.label}</span>
      <span class="value">{slider.idle ? "–" : figures(value)} <small>{printed(unit)}</small></span>
      <input
        type="range" data-parameter={slider.name} disabled={slider.idle !== null} min={low} max={high} step={0.02} value={value > 0 ? Math.log10(value) : low}
        aria-valuetext={`${figures(value)} ${printed(unit)}`}
        onInput={(e) => change(slider.name, Number((10 ** Number(e.currentTarget.value)).toPrecision(3)))}
      />
      {slider.idle && <small>{said(slider.idle)}</small>}
    </label>
  );
}

function GateChoice({ name, label, steps, value, change }: Gate & { value: number; change: (name: string, value: number) => void }) {
  const known = steps.find(([nis]) => Math.abs(nis - value) < 0.02);
  return (
    <label class="gate">
      <span class="label">{label}</span>
      <select data-parameter={name} value={String(known?.[0] ?? value)} onChange={(e) => change(name, Number(e.currentTarget.value))}>
        {!known && <option value={String(value)}>NIS {figures(value)}</option>}
        {steps.map(([nis, text]) => <option key={text} value={String(nis)}>{text || t("off")}</option>)}
      </select>
    </label>
  );
}

/** Every other parameter as a field, with its unit and meaning. */
export function AllParameters({ settings, change, tuned }: { settings: Settings; change: (name: string, value: number | string) => void; tuned: Tuned }) {
  const shown = new Set([...slidersOf(tuned).filter((s) => s.idle === null), ...gatesOf(tuned, settings)].map((s) => s.name));
  return (
    <details>
      <summary>{t("tune.all")}</summary>
      <div class="fields">
        {(state.hello?.parameters ?? []).filter((p) => !shown.has(p.name)).map((p) => {
          const words = p.unit.includes("|") ? p.unit.split("|").map((w) => w.trim()) : null;
          return (
            <label key={p.name} title={said(p.meaning)}>
              <code>{p.name}</code>
              {words ? (
                <select data-parameter={p.name} value={String(settings[p.name])} onChange={(e) => change(p.name, e.currentTarget.value)}>
                  {words.map((w) => <option key={w}>{w}</option>)}
                </select>
              ) : (
                <DraftInput decimal value={String(settings[p.name])} change={(v) => v.trim() && Number.isFinite(Number(v)) && change(p.name, Number(v))} />
              )}
              <small>{words ? said(p.meaning) : `${p.unit === "-" ? "" : printed(p.unit) + " · "}${said(p.meaning)}`}</small>
            </label>
          );
        })}
      </div>
    </details>
  );
}
