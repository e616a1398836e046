// Step 4: Q and R by hand, sensors on and off; every change acts at once.

import { AllParameters, Sliders } from "../parameters";
import type { Device, Sensor, Settings } from "../protocol";
import { changeHere, goTo, send, settingsOf, useOf } from "../store";

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
      <p>Q says how fast the estimate may be wrong by itself, R how far each sensor may be wrong. Watch the lamps: they say when a number is not honest.</p>
      <div class="buttons" role="group" aria-label="Start from">
        <button type="button" onClick={() => apply({}, "lab")}>As at rest</button>
        <button type="button" onClick={() => apply({}, "hand-held")}>Hand-held</button>
      </div>
      <Sliders settings={settings} change={(name, value) => apply({ [name]: value })} />
      <fieldset class="toggles">
        <legend>Sensors used</legend>
        {SENSORS.map((sensor) => (
          <label key={sensor}><input type="checkbox" checked={use[sensor]} onChange={() => toggle(sensor)} /> {sensor}</label>
        ))}
      </fieldset>
      <AllParameters settings={settings} change={(name, value) => apply({ [name]: value })} />
      <button type="button" class="primary" onClick={() => goTo("experiment")}>Next: experiment</button>
    </>
  );
}
