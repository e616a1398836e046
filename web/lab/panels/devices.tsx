// The devices, with rates and health.

import type { Device } from "../protocol";
import { Draft } from "../draft";
import { goTo, isStudent, offers, select, send, state, update } from "../store";

/** The sensors in short: the compass where it stands in for the magnetometer. */
function shortOf(device: Device): [string, string][] {
  const compass = device.rates_hz["magnetometer"] === undefined && device.rates_hz["compass-heading"] !== undefined;
  return [["gyroscope", "gyr"], ["accelerometer", "acc"], compass ? ["compass-heading", "com"] : ["magnetometer", "mag"]];
}

export function Devices() {
  return (
    <aside class="devices" aria-label="Devices">
      <h2>Devices</h2>
      {!state.devices.length && !isStudent() && <p class="small">None yet. Scan the QR code with a phone, or add a virtual phone.</p>}
      <ul>
        {state.devices.map((device) => <DeviceCard key={device.id} device={device} />)}
      </ul>
      {!isStudent() && <button type="button" onClick={() => goTo("connect")}>Add a device</button>}
    </aside>
  );
}

function DeviceCard({ device }: { device: Device }) {
  const selected = device.id === state.selected;
  const worst = ["bad", "warn", "good"].map((tone) => device.health.find((h) => h.tone === tone)).find((h) => h) ?? device.health[0];
  const removable = !isStudent() && (device.source === "virtual" || (offers("remove") && !device.connected));
  return (
    <li class={`device ${device.delivers ? worst?.tone ?? "good" : "lost"}`} aria-current={selected} data-device={device.id}>
      <button type="button" class="pick" aria-pressed={selected} onClick={() => update((s) => select(s, device.id))}>
        <b>{device.name}</b>
        {!device.delivers && <span class="badge">{device.connected ? "no samples" : "lost"}</span>}
      </button>
      <p class="rates">{shortOf(device).map(([sensor, text]) => <span key={sensor}>{text} <b>{device.rates_hz[sensor] === undefined ? "–" : device.rates_hz[sensor]!.toFixed(0)}</b></span>)}<span>Hz</span></p>
      <p class="health" title={device.silence || worst?.text}>{device.silence || (worst?.text ?? "No complaint.")}</p>
      {selected && (
        <>
          {device.delivers && device.health.filter((h) => h !== worst).map((h) => <p key={h.text} class="health" title={h.text}>{h.text}</p>)}
          <p class="counts">{device.source}, {lost(device)}</p>
          <p class="counts">{device.received} samples</p>
          <p class="counts">{device.is_calibrated ? "Calibrated at rest" : "Not yet calibrated at rest"}</p>
          {device.magnetometer && <p class="counts">Magnetometer calibrated</p>}
          <Draft name="rename" label="Name" value={device.name} change={(name) => send({ type: "rename", device: device.id, name })} />
          {removable && <button type="button" class="link" onClick={() => send(device.source === "virtual" ? { type: "virtual_phone", action: "remove", device: device.id } : { type: "remove", device: device.id })}>Remove this device</button>}
        </>
      )}
    </li>
  );
}

/** What got lost on the way, or came twice, in words. */
function lost(device: Device): string {
  const twice = device.duplicated ? `, ${device.duplicated} stamps twice` : "";
  return (device.lost ? `${device.lost} batches lost` : "none lost") + twice;
}
