// Step 4: Q and R by hand, sensors on and off; every change acts at once.

import { AllParameters, Sliders } from "../parameters";
import { LiveText } from "../live";
import type { Device, Sensor, Settings, Surroundings } from "../protocol";
import { changeHere, goTo, offers, send, settingsOf, state, useOf } from "../store";
import { nameOf, roleOf } from "../theme";

const SENSORS: Sensor[] = ["gyroscope", "accelerometer", "magnetometer"];

export function Tune({ device }: { device: Device }) {
  const settings = settingsOf(device.id);
  const use = useOf(device.id);
  const apply = (changed: Settings, profile?: string): void => {
    changeHere(device.id, (s) => (s.settings[device.id] = { ...s.settings[device.id], ...changed }));
    send({ type: "settings", device: device.id, settings: changed, ...(profile ? { profile } : {}) });
  };
  const toggle = (sensor: Sensor): void => {
    const next = { ...use, [sensor]: !use[sensor] };
    changeHere(device.id, (s) => (s.use[device.id] = next));
    send({ type: "sensors", device: device.id, use: next });
  };
  return (
    <>
      <p>Q says how fast the estimate may be wrong by itself, R how far each sensor may be wrong. Watch the lamps: they say when a number is not consistent.</p>
      <div class="buttons" role="group" aria-label="Start from">
        <button type="button" onClick={() => apply({}, "lab")}>As at rest</button>
        <button type="button" onClick={() => apply({}, "hand-held")}>Hand-held</button>
      </div>
      <Sliders settings={settings} change={(name, value) => apply({ [name]: value })} />
      <fieldset class="toggles">
        <legend>Sensors used</legend>
        {SENSORS.map((sensor) => (
          <label key={sensor}><input type="checkbox" checked={use[sensor]} disabled={sensor === "gyroscope"} title={sensor === "gyroscope" ? "Every estimator needs it" : undefined} onChange={() => toggle(sensor)} /> {sensor}</label>
        ))}
      </fieldset>
      {offers("estimators") && <Estimators device={device} />}
      {(state.estimators[device.id] ?? device.estimators ?? []).includes(BOUNDED) && <SurroundingsTable device={device.id} />}
      <AllParameters settings={settings} change={(name, value) => apply({ [name]: value })} />
      <button type="button" class="primary" onClick={() => goTo("experiment")}>Next: experiment</button>
    </>
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
      <caption><b>{nameOf(BOUNDED)}</b>: what it finds out</caption>
      <tbody>
        {row("Hard iron", "iron", ironInWords)}
        {row("Field", "field", fieldInWords)}
        {row("Motion", "motion", (s) => (s.is_resting ? "rests: the rate is the bias" : "moves"))}
      </tbody>
    </table>
  );
}

/** x, y, z and the worst standard deviation, microtesla. */
function ironInWords({ hard_iron_ut: iron, hard_iron_std_ut: std }: Surroundings): string {
  if (!iron || !std) return "not estimated: taken as calibrated";
  const signed = iron.map((v) => { const size = Math.abs(v).toFixed(1); return `${v < 0 && size !== "0.0" ? "−" : "+"}${size}`; }).join(" ");
  return `${signed} ±${Math.max(...std).toFixed(1)} µT`;
}

/** From this factor on the variance of the field a field is doubtful, and from that on disturbed. */
const DOUBTFUL = 2, DISTURBED = 5;

function fieldInWords({ field_variance_factor: factor }: Surroundings): string {
  if (factor === null) return "no magnetometer";
  const word = factor < DOUBTFUL ? "as expected" : factor < DISTURBED ? "doubtful" : "disturbed";
  return `${word}, variance × ${factor.toFixed(1)}`;
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
      <legend>Estimators</legend>
      {all.map((e) => (
        <label key={e.name}>
          <input type="checkbox" data-estimator-choice={e.name} checked={running.has(e.name)} disabled={running.size === 1 && running.has(e.name)} onChange={() => toggle(e.name)} />
          <span class={`swatch ${e.name === "mekf" ? "" : "ghost"}`} style={{ "--role": `var(--${roleOf(e.name)})` }} />
          <b>{nameOf(e.name)}</b>
          <small>{e.summary}</small>
        </label>
      ))}
    </fieldset>
  );
}
