// Step 4: Q and R by hand, sensors on and off; every change acts at once.

import { AllParameters, Sliders } from "../parameters";
import { LiveText } from "../live";
import type { Device, Settings, Surroundings, Use } from "../protocol";
import { aids, changeHere, goTo, offers, send, sensorOf, settingsOf, state, titleOf, useOf } from "../store";
import { t } from "../t";
import { nameOf, roleOf } from "../theme";
import { said } from "../words";

export function Tune({ device }: { device: Device }) {
  const settings = settingsOf(device.id);
  const use = useOf(device);
  const tuned = { subject: device.subject, missing: (sensor: string) => missingOf(device, sensor) };
  const apply = (changed: Settings, profile?: string): void => {
    changeHere(device.id, (s) => (s.settings[device.id] = { ...s.settings[device.id], ...changed }));
    send({ type: "settings", device: device.id, settings: changed, ...(profile ? { profile } : {}) });
  };
  const toggle = (key: keyof Use): void => {
    const on = !use[key];
    changeHere(device.id, (s) => (s.use[device.id] = { ...s.use[device.id], [key]: on }));
    // What was never touched stays as it is in force: a compass, where there is no magnetometer.
    send({ type: "sensors", device: device.id, use: { gyroscope: true, accelerometer: true, magnetometer: true, ...device.use, ...state.use[device.id], [key]: on } });
  };
  return (
    <>
      <p>{t("tune.what")}</p>
      <div class="buttons" role="group" aria-label={t("tune.from")}>
        <button type="button" onClick={() => apply({}, "lab")}>{t("tune.rest")}</button>
        <button type="button" onClick={() => apply({}, "hand-held")}>{t("tune.hand")}</button>
      </div>
      <Sliders settings={settings} tuned={tuned} change={(name, value) => apply({ [name]: value })} />
      <fieldset class="toggles">
        <legend>{t("tune.sensors")}</legend>
        <Switch sensor="gyroscope" title={t("sensor.gyroscope")} checked why={t("tune.needed")} />
        {aids().map(({ sensor, switch: key }) => {
          const why = missingOf(device, sensor);
          return <Switch key={sensor} sensor={sensor} title={titleOf(sensor)} checked={!why && use[key as keyof Use]} why={why} toggle={() => toggle(key as keyof Use)} />;
        })}
        {notes(device).map((text) => <p key={text} class="small">{said(text)}</p>)}
      </fieldset>
      {offers("estimators") && <Estimators device={device} />}
      {(state.estimators[device.id] ?? device.estimators ?? []).includes(BOUNDED) && <SurroundingsTable device={device.id} />}
      <AllParameters settings={settings} tuned={tuned} change={(name, value) => apply({ [name]: value })} />
      <button type="button" class="primary" onClick={() => goTo("experiment")}>{t("tune.next")}</button>
    </>
  );
}

/** Why nothing comes from a sensor; null when something does or did. */
function missingOf(device: Device, sensor: string): string | null {
  const known = sensorOf(device, sensor);
  return known && known.delivery === "missing" ? known.text : null;
}

/** What there is to say of the sensors that correct the attitude. */
const notes = (device: Device): string[] => aids().filter((aid) => aid.is_usual || missingOf(device, aid.sensor) === null).flatMap((aid) => sensorOf(device, aid.sensor)?.text || []);

/** One that does nothing is grey and says why. */
function Switch({ sensor, title, checked, why, toggle }: { sensor: string; title: string; checked: boolean; why: string | null; toggle?: () => void }) {
  return (
    <label class={why ? "off" : ""} title={why ? said(why) : undefined}>
      <input type="checkbox" data-sensor={sensor} checked={checked} disabled={why !== null} onChange={toggle} /> {title}
    </label>
  );
}

const BOUNDED = "bounded-velocity";

/** What the bounded-velocity filter finds out about magnetometer, field and motion while it runs. */
function SurroundingsTable({ device }: { device: string }) {
  const row = (name: string, key: string, text: (s: Surroundings) => string) => (
    <tr data-value={key}>
      <th scope="row">{name}</th>
      <td><LiveText device={device} text={(frame) => { const s = frame.estimates[BOUNDED]?.surroundings; return s ? text(s) : "–"; }} /></td>
    </tr>
  );
  return (
    <table class="compact surroundings">
      <caption><b>{nameOf(BOUNDED)}</b>: {t("tune.finds")}</caption>
      <tbody>
        {row(t("mag.hard"), "iron", ironInWords)}
        {row(t("tune.field"), "field", fieldInWords)}
        {row(t("virtual.motion"), "motion", (s) => t(s.is_resting ? "tune.rests" : "tune.moves"))}
      </tbody>
    </table>
  );
}

/** x, y, z and the worst standard deviation, microtesla. */
function ironInWords({ hard_iron_ut: iron, hard_iron_std_ut: std }: Surroundings): string {
  if (!iron || !std) return t("tune.asCalibrated");
  const signed = iron.map((v) => { const size = Math.abs(v).toFixed(1); return `${v < 0 && size !== "0.0" ? "−" : "+"}${size}`; }).join(" ");
  return `${signed} ±${Math.max(...std).toFixed(1)} µT`;
}

/** From this factor on the variance of the field a field is doubtful, and from that on disturbed. */
const DOUBTFUL = 2, DISTURBED = 5;

function fieldInWords({ field_variance_factor: factor }: Surroundings): string {
  if (factor === null) return t("tune.noMagnetometer");
  const word = t(factor < DOUBTFUL ? "tune.expected" : factor < DISTURBED ? "tune.doubtful" : "tune.disturbed");
  return t("tune.variance", { word, factor: factor.toFixed(1) });
}

/** Every estimator with its ghost; one that is off costs nothing. */
function Estimators({ device }: { device: Device }) {
  const running = new Set(state.estimators[device.id] ?? device.estimators ?? []);
  const all = (state.hello?.estimators ?? []).filter((e) => e.name !== "device");
  const toggle = (name: string): void => {
    const next = all.map((e) => e.name).filter((n) => (n === name ? !running.has(n) : running.has(n)));
    changeHere(device.id, (s) => (s.estimators[device.id] = next));
    send({ type: "estimators", device: device.id, use: next });
  };
  return (
    <fieldset class="estimators">
      <legend>{t("plots.estimators")}</legend>
      {all.map((e) => (
        <label key={e.name}>
          <input type="checkbox" data-estimator-choice={e.name} checked={running.has(e.name)} disabled={running.size === 1 && running.has(e.name)} onChange={() => toggle(e.name)} />
          <span class={`swatch ${e.name === device.subject ? "" : "ghost"}`} style={{ "--role": `var(--${roleOf(e.name)})` }} />
          <b>{nameOf(e.name)}{e.name === device.subject ? ` (${t("subject").toLowerCase()})` : ""}</b>
          <small>{said(e.summary)}</small>
        </label>
      ))}
    </fieldset>
  );
}
