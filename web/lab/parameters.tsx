// Sliders for Q and R on a logarithmic scale, shared by tuning and what-if.

import { DraftInput } from "./draft";
import type { Settings } from "./protocol";
import { state } from "./store";
import { figures } from "./words";

interface Slider {
  name: string;
  matrix: "Q" | "R";
  label: string;
  unit: string;
  decades: [number, number];
}

/** What is tuned by hand in the lab; everything else is under "All parameters". */
export const SLIDERS: Slider[] = [
  { name: "gyroscope_noise_density", matrix: "Q", label: "Gyroscope noise", unit: "rad/s/√Hz", decades: [-5, -1] },
  { name: "gyroscope_bias_random_walk", matrix: "Q", label: "Bias walk", unit: "rad/s/√s", decades: [-6, -2] },
  { name: "accelerometer_std", matrix: "R", label: "Accelerometer", unit: "m/s²", decades: [-3, 1] },
  { name: "magnetometer_std_ut", matrix: "R", label: "Magnetometer", unit: "µT", decades: [-2, 2] },
];
const GATES: { name: string; label: string }[] = [
  { name: "accelerometer_gate_nis", label: "Accelerometer gate" },
  { name: "magnetometer_gate_nis", label: "Magnetometer gate" },
];
/** Quantiles of chi-square for one and for three degrees of freedom. */
const GATE_STEPS: Record<1 | 3, [number, string][]> = {
  1: [[0, "off"], [3.84, "95 %"], [6.63, "99 %"], [10.83, "99.9 %"]],
  3: [[0, "off"], [7.81, "95 %"], [11.34, "99 %"], [16.27, "99.9 %"]],
};

/** Degrees of freedom of a sensor's innovation with these settings: a compass gives one angle. */
export const degreesOf = (sensor: string, settings: Settings): 1 | 3 => (sensor === "magnetometer" && settings["magnetometer_use"] === "heading" ? 1 : 3);

/** The names of the sliders' parameters, for curves. */
export const curveChoices = (): { name: string; text: string }[] => SLIDERS.map((s) => ({ name: s.name, text: `${s.matrix}: ${s.label}` }));

export function Sliders({ settings, change }: { settings: Settings; change: (name: string, value: number) => void }) {
  return (
    <div class="sliders">
      {SLIDERS.map((slider) => <LogSlider key={slider.name} slider={slider} value={Number(settings[slider.name])} change={change} />)}
      {GATES.map((gate) => <GateChoice key={gate.name} {...gate} steps={GATE_STEPS[degreesOf(gate.name.split("_")[0]!, settings)]} value={Number(settings[gate.name])} change={change} />)}
    </div>
  );
}

function LogSlider({ slider, value, change }: { slider: Slider; value: number; change: (name: string, value: number) => void }) {
  const meaning = state.hello?.parameters.find((p) => p.name === slider.name)?.meaning ?? slider.label;
  const position = value > 0 ? Math.log10(value) : slider.decades[0];
  return (
    <label class="slider" title={meaning}>
      <span class="matrix">{slider.matrix}</span>
      <span class="label">{slider.label}</span>
      <span class="value">{figures(value)} <small>{slider.unit}</small></span>
      <input
        type="range" data-parameter={slider.name} min={slider.decades[0]} max={slider.decades[1]} step={0.02} value={position}
        aria-valuetext={`${figures(value)} ${slider.unit}`}
        onInput={(e) => change(slider.name, Number((10 ** Number(e.currentTarget.value)).toPrecision(3)))}
      />
    </label>
  );
}

function GateChoice({ name, label, steps, value, change }: { name: string; label: string; steps: [number, string][]; value: number; change: (name: string, value: number) => void }) {
  const known = steps.find(([nis]) => Math.abs(nis - value) < 0.02);
  return (
    <label class="gate">
      <span class="label">{label}</span>
      <select data-parameter={name} value={String(known?.[0] ?? value)} onChange={(e) => change(name, Number(e.currentTarget.value))}>
        {!known && <option value={String(value)}>NIS {figures(value)}</option>}
        {steps.map(([nis, text]) => <option key={text} value={String(nis)}>{text}</option>)}
      </select>
    </label>
  );
}

/** Every other parameter as a field, with its unit and meaning. */
export function AllParameters({ settings, change }: { settings: Settings; change: (name: string, value: number | string) => void }) {
  const shown = new Set([...SLIDERS, ...GATES].map((s) => s.name));
  return (
    <details>
      <summary>All parameters</summary>
      <div class="fields">
        {(state.hello?.parameters ?? []).filter((p) => !shown.has(p.name)).map((p) => {
          const words = p.unit.includes("|") ? p.unit.split("|").map((w) => w.trim()) : null;
          return (
            <label key={p.name} title={p.meaning}>
              <code>{p.name}</code>
              {words ? (
                <select value={String(settings[p.name])} onChange={(e) => change(p.name, e.currentTarget.value)}>
                  {words.map((w) => <option key={w}>{w}</option>)}
                </select>
              ) : (
                <DraftInput decimal value={String(settings[p.name])} change={(v) => v.trim() && Number.isFinite(Number(v)) && change(p.name, Number(v))} />
              )}
              <small>{words ? p.meaning : `${p.unit === "-" ? "" : p.unit + " · "}${p.meaning}`}</small>
            </label>
          );
        })}
      </div>
    </details>
  );
}
