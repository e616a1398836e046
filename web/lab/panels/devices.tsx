// The devices, with rates and health.

import type { Device, Remark } from "../protocol";
import { Draft } from "../draft";
import { goTo, isStudent, offers, select, send, state, update } from "../store";
import { type Key, t } from "../t";
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
  const health = facts(device.health);
  const worst = ["bad", "warn", "good"].map((tone) => health.find((h) => h.tone === tone)).find((h) => h) ?? health[0];
  const complaint = said(device.silence || (worst?.text ?? "")) || t("devices.noComplaint");
  const removable = !isStudent() && (device.source === "virtual" || (offers("remove") && !device.connected));
  return (
    <li class={`device ${device.delivers ? worst?.tone ?? "good" : "lost"}`} aria-current={selected} data-device={device.id}>
      <button type="button" class="pick" aria-pressed={selected} onClick={() => update((s) => select(s, device.id))}>
        <b>{device.name}</b>
        {!device.delivers && <span class="badge">{t(device.connected ? "devices.noSamples" : "devices.lost")}</span>}
      </button>
      <p class="rates">{shortOf(device).map(([sensor, text]) => <span key={sensor}>{text} <b>{device.rates_hz[sensor] === undefined ? "–" : device.rates_hz[sensor]!.toFixed(0)}</b></span>)}<span>Hz</span></p>
      <p class="health">{complaint}</p>
      {selected && (
        <>
          {device.delivers && health.filter((h) => h !== worst).map((h) => <p key={h.text} class="health">{said(h.text)}</p>)}
          <p class="counts">{sourceOf(device)}: {lost(device)}</p>
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

/** What a remark is about, where two say the same: the phone's page tells rate and rounding of its sensors, and the program what it sees of them.
 * One of the rates says it for all sensors: the rates stand above. */
const SAME: [RegExp, (sensor: string) => string][] = [
  [/^The (\w+) comes only [\d.]+ times a second/, () => "rate"],
  [/^Only [\d.]+ (\w+) samples a second/, () => "rate"],
  [/^The browser rounds the (\w+) to /, (sensor) => `steps of ${sensor}`],
  [/^Coarse values: the (\w+) comes in steps/, (sensor) => `steps of ${sensor}`],
];

/** The remarks, each fact once. */
function facts(health: Remark[]): Remark[] {
  const told = new Set<string>();
  return health.filter(({ text }) => {
    const about = SAME.flatMap(([pattern, of]) => { const found = pattern.exec(text); return found ? [of(found[1]!)] : []; })[0] ?? text;
    return !told.has(about) && told.add(about);
  });
}

const SOURCES: Record<string, Key> = { page: "source.page", virtual: "source.virtual", replay: "source.replay", "sensor-logger": "source.sensorLogger" };

/** What sends for a device, in words; an input by its title. */
function sourceOf({ source }: Device): string {
  const key = SOURCES[source];
  return key ? t(key) : state.hello?.input_kinds?.find((one) => one.kind === source)?.title ?? source;
}

/** What got lost on the way, or came twice, in words. */
function lost(device: Device): string {
  const twice = device.duplicated ? t("devices.twice", { count: device.duplicated }) : "";
  return (device.lost ? t("devices.batchesLost", { count: device.lost }) : t("devices.noneLost")) + twice;
}
