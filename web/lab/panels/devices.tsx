// The devices, with rates and health.

import type { Device } from "../protocol";
import { Draft } from "../draft";
import { goTo, isStudent, offers, select, send, state, update } from "../store";
import { t } from "../t";
import { said } from "../words";

/** The sensors in short: the compass where it stands in for the magnetometer. */
function shortOf(device: Device): [string, string][] {
  const compass = device.rates_hz["magnetometer"] === undefined && device.rates_hz["compass-heading"] !== undefined;
  return (["gyroscope", "accelerometer", compass ? "compass-heading" : "magnetometer"] as const).map((sensor) => [sensor, t(`short.${sensor}`)]);
}

export function Devices() {
  return (
    <aside class="devices" aria-label={t("devices")}>
      <h2>{t("devices")}</h2>
      {!state.devices.length && !isStudent() && <p class="small">{t("devices.none")}</p>}
      <ul>
        {state.devices.map((device) => <DeviceCard key={device.id} device={device} />)}
      </ul>
      {!isStudent() && <button type="button" onClick={() => goTo("connect")}>{t("devices.add")}</button>}
    </aside>
  );
}

function DeviceCard({ device }: { device: Device }) {
  const selected = device.id === state.selected;
  const worst = ["bad", "warn", "good"].map((tone) => device.health.find((h) => h.tone === tone)).find((h) => h) ?? device.health[0];
  const complaint = said(device.silence || (worst?.text ?? "")) || t("devices.noComplaint");
  const removable = !isStudent() && (device.source === "virtual" || (offers("remove") && !device.connected));
  return (
    <li class={`device ${device.delivers ? worst?.tone ?? "good" : "lost"}`} aria-current={selected} data-device={device.id}>
      <button type="button" class="pick" aria-pressed={selected} onClick={() => update((s) => select(s, device.id))}>
        <b>{device.name}</b>
        {!device.delivers && <span class="badge">{t(device.connected ? "devices.noSamples" : "devices.lost")}</span>}
      </button>
      <p class="rates">{shortOf(device).map(([sensor, text]) => <span key={sensor}>{text} <b>{device.rates_hz[sensor] === undefined ? "–" : device.rates_hz[sensor]!.toFixed(0)}</b></span>)}<span>Hz</span></p>
      <p class="health" title={complaint}>{complaint}</p>
      {selected && (
        <>
          {device.delivers && device.health.filter((h) => h !== worst).map((h) => <p key={h.text} class="health" title={said(h.text)}>{said(h.text)}</p>)}
          <p class="counts">{device.source}, {lost(device)}</p>
          <p class="counts">{t("devices.samples", { count: device.received })}</p>
          <p class="counts">{t(device.is_calibrated ? "devices.calibrated" : "devices.uncalibrated")}</p>
          {device.magnetometer && <p class="counts">{t("devices.magnetometer")}</p>}
          <Draft name="rename" label={t("name")} value={device.name} change={(name) => send({ type: "rename", device: device.id, name })} />
          {removable && <button type="button" class="link" onClick={() => send(device.source === "virtual" ? { type: "virtual_phone", action: "remove", device: device.id } : { type: "remove", device: device.id })}>{t("devices.remove")}</button>}
        </>
      )}
    </li>
  );
}

/** What got lost on the way, or came twice, in words. */
function lost(device: Device): string {
  const twice = device.duplicated ? t("devices.twice", { count: device.duplicated }) : "";
  return (device.lost ? t("devices.batchesLost", { count: device.lost }) : t("devices.noneLost")) + twice;
}
