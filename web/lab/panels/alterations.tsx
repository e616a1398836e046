// What a what-if changes beside the numbers: sensors, estimators, and how good the samples are.

import type { Alterations, Change, ExperimentRow, SensorUse } from "../protocol";
import { aids, state, titleOf } from "../store";
import { type Key, t } from "../t";
import { nameOf, roleOf } from "../theme";
import { figures } from "../words";

/** What is asked beside the settings; what is left out is as it was. */
export type Trial = Omit<Change, "settings">;

/** How long a bump and a magnet last, s. */
const BUMP_S = 0.5, MAGNET_S = 5;

interface Steps {
  name: "rate_hz" | "gyroscope_step_deg_s" | "accelerometer_step_m_s2";
  label: Key;
  unit: string;
  steps: number[];
}
const STEPS: Steps[] = [
  { name: "rate_hz", label: "alter.rate", unit: "Hz", steps: [50, 25, 10, 5, 2, 1] },
  { name: "gyroscope_step_deg_s", label: "alter.gyroscopeStep", unit: "deg/s", steps: [0.1, 0.5, 1, 5] },
  { name: "accelerometer_step_m_s2", label: "alter.accelerometerStep", unit: "m/s²", steps: [0.1, 0.5, 1] },
];

export function Trials({ row, trial, change }: { row: ExperimentRow; trial: Trial; change: (trial: Trial) => void }) {
  return (
    <>
      <Sensors row={row} trial={trial} change={change} />
      <Estimators row={row} trial={trial} change={change} />
      <Samples row={row} trial={trial} change={change} />
    </>
  );
}

function Sensors({ row, trial, change }: { row: ExperimentRow; trial: Trial; change: (trial: Trial) => void }) {
  const use: SensorUse = { ...row.use, ...trial.use };
  const delivered = aids().filter((aid) => row.sensors.some((s) => s === aid.sensor));
  if (!delivered.length) return null;
  // A compass is used where there is no magnetometer, unless somebody says otherwise.
  const isOn = (key: keyof SensorUse): boolean => use[key] ?? !(row.sensors.some((s) => s === "magnetometer"));
  return (
    <fieldset class="toggles">
      <legend>{t("tune.sensors")}</legend>
      {delivered.map(({ sensor, switch: name }) => {
        const key = name as keyof SensorUse;
        return <label key={sensor}><input type="checkbox" data-what-if-sensor={sensor} checked={isOn(key)} onChange={() => change({ ...trial, use: { ...use, [key]: !isOn(key) } })} /> {titleOf(sensor)}</label>;
      })}
    </fieldset>
  );
}

function Estimators({ row, trial, change }: { row: ExperimentRow; trial: Trial; change: (trial: Trial) => void }) {
  const ran = Object.keys(row.results);
  const all = (state.hello?.estimators ?? []).map((e) => e.name).filter((name) => name !== "device" || ran.includes("device"));
  const running = all.filter((name) => (trial.estimators ?? ran).includes(name));
  const subject = trial.subject && running.includes(trial.subject) ? trial.subject : running.find((name) => name === row.subject) ?? running[0]!;
  const toggle = (name: string): void => {
    const next = all.filter((n) => (n === name ? !running.includes(n) : running.includes(n)));
    const stays = trial.subject && next.includes(trial.subject);
    const { subject: _, ...rest } = trial;
    change({ ...(stays ? trial : rest), estimators: next });
  };
  return (
    <>
      <label class="field">{t("subject")}
        <select data-what-if="subject" value={subject} onChange={(e) => change({ ...trial, subject: e.currentTarget.value as NonNullable<Trial["subject"]> })}>
          {running.filter((name) => name !== "device").map((name) => <option key={name} value={name}>{nameOf(name)}</option>)}
        </select>
      </label>
      <details>
        <summary>{t("plots.estimators")}</summary>
        <fieldset class="estimators">
          {all.map((name) => (
            <label key={name}>
              <input type="checkbox" data-what-if-estimator={name} checked={running.includes(name)} disabled={running.length === 1 && running.includes(name)} onChange={() => toggle(name)} />
              <span class="swatch" style={{ "--role": `var(--${roleOf(name)})` }} />
              <b>{nameOf(name)}</b>
            </label>
          ))}
        </fieldset>
      </details>
    </>
  );
}

/** Whether a change leaves the samples as they were measured. */
export const isAsMeasured = (alterations: Alterations | undefined): boolean => Object.values(alterations ?? {}).every((v) => v === undefined);

function Samples({ row, trial, change }: { row: ExperimentRow; trial: Trial; change: (trial: Trial) => void }) {
  const now = trial.alterations ?? {};
  const set = (changed: { [K in keyof Alterations]?: Alterations[K] | undefined }): void => {
    const all = Object.entries({ ...now, ...changed }).filter(([, v]) => v !== undefined);
    change({ ...trial, alterations: Object.fromEntries(all) });
  };
  const middle = row.duration_s / 2;
  const bump = now.bump, magnet = now.magnet;
  return (
    <fieldset class="virtual alterations">
      <legend>{t("alter.samples")}</legend>
      {STEPS.map(({ name, label, unit, steps }) => (
        <label key={name} class="field">{t(label)}
          <select data-alteration={name} value={String(now[name] ?? "")} onChange={(e) => set({ [name]: e.currentTarget.value ? Number(e.currentTarget.value) : undefined })}>
            <option value="">{t("alter.asMeasured")}</option>
            {steps.map((v) => <option key={v} value={String(v)}>{figures(v)} {unit}</option>)}
          </select>
        </label>
      ))}
      <Amount name="delay_s" label={t("alter.delay")} value={now.delay_s ?? 0} most={0.5} step={0.01} text={(v) => `${Math.round(v * 1000)} ms`} set={(v) => set({ delay_s: v || undefined })} />
      <Amount name="lost_share" label={t("alter.lost")} value={now.lost_share ?? 0} most={0.95} step={0.05} text={(v) => `${Math.round(v * 100)} %`} set={(v) => set({ lost_share: v || undefined })} />
      <Amount name="bump" label={t("alter.bump")} value={bump?.size ?? 0} most={20} step={0.5} text={(v) => `${figures(v)} m/s²`} set={(v) => set({ bump: v ? { at_s: bump?.at_s ?? middle, duration_s: BUMP_S, size: v } : undefined })} />
      {bump && <Amount name="bump-at" label={t("alter.at")} value={bump.at_s} most={row.duration_s} step={0.1} text={(v) => `${v.toFixed(1)} s`} set={(v) => set({ bump: { ...bump, at_s: v } })} />}
      <Amount name="magnet" label={t("alter.magnet")} value={magnet?.size ?? 0} most={100} step={1} text={(v) => `${figures(v)} µT`} set={(v) => set({ magnet: v ? { at_s: magnet?.at_s ?? middle, duration_s: MAGNET_S, size: v } : undefined })} />
      {magnet && <Amount name="magnet-at" label={t("alter.at")} value={magnet.at_s} most={row.duration_s} step={0.1} text={(v) => `${v.toFixed(1)} s`} set={(v) => set({ magnet: { ...magnet, at_s: v } })} />}
    </fieldset>
  );
}

function Amount({ name, label, value, most, step, text, set }: { name: string; label: string; value: number; most: number; step: number; text: (v: number) => string; set: (v: number) => void }) {
  return (
    <label class="row">{label}
      <input type="range" data-alteration={name} min="0" max={most} step={step} value={value} aria-valuetext={text(value)} onInput={(e) => set(Number(e.currentTarget.value))} />
      <output>{text(value)}</output>
    </label>
  );
}
