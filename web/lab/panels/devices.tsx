// The devices, with rates and health; and the wall that shows them all.

import { useEffect, useRef } from "preact/hooks";
import { LiveText } from "../live";
import { attitudes } from "../stage";
import { mainEstimate } from "../history";
import type { Device } from "../protocol";
import type { View as ViewOf, World } from "../scene";
import { Draft } from "../draft";
import { goTo, historyOf, isStudent, offers, onFrame, send, state, update } from "../store";

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
      <button type="button" class="pick" aria-pressed={selected} onClick={() => update((s) => (s.selected = device.id))}>
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

/** All devices as boxes, for a class. */
export function Wall() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const grid = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const worlds = new Map<string, World>();
    let stop = (): void => undefined, gone = false;
    void import("../scene").then(({ View, World }) => {
      if (gone) return;
      const worldOf = (id: string): World => {
        let world = worlds.get(id);
        if (!world) worlds.set(id, (world = new World()));
        return world;
      };
      const cells = (): { world: World; box: DOMRect }[] => {
        const elements = [...grid.current!.querySelectorAll<HTMLElement>("[data-cell]")];
        for (const [id, world] of worlds) {
          if (elements.some((element) => element.dataset["cell"] === id)) continue;
          world.dispose();
          worlds.delete(id);
        }
        return elements.map((element) => ({ world: worldOf(element.dataset["cell"]!), box: element.getBoundingClientRect() }));
      };
      const view: ViewOf<World> = new View<World>(canvas.current!, null, cells);
      const follow = onFrame((frame) => {
        if (document.visibilityState === "hidden" || !worlds.has(frame.device)) return view.ask();
        worldOf(frame.device).set(attitudes(frame).filter((b) => b.solid));
        view.ask();
      });
      for (const device of state.devices) {
        const latest = historyOf(device.id).latest;
        if (latest) worldOf(device.id).set(attitudes(latest).filter((b) => b.solid));
      }
      const scrolled = (): void => view.ask();
      grid.current!.parentElement!.addEventListener("scroll", scrolled);
      view.ask();
      stop = () => {
        follow();
        view.close();
      };
    }).catch(() => undefined);
    return () => {
      gone = true;
      stop();
      for (const world of worlds.values()) world.dispose();
    };
  }, []);
  // About as many columns as make cells that are a little wider than high.
  const columns = Math.max(2, Math.ceil(Math.sqrt(state.devices.length * 1.35)));
  return (
    <section class="wall" aria-label="All devices">
      <canvas ref={canvas} aria-hidden="true" />
      <div class="grid" ref={grid} style={{ "--columns": String(columns) }}>
        {state.devices.map((device) => (
          <button key={device.id} type="button" class={`cell ${device.delivers ? "" : "bad"}`} onClick={() => update((s) => { s.selected = device.id; s.view = "lab"; })}>
            <b>{device.name}</b>
            <span data-cell={device.id} class="box" />
            <LiveText device={device.id} text={(f) => { const a = mainEstimate(f)?.angles_deg; return a ? a.map((v) => `${v.toFixed(0)}°`.replace("-", "−")).join("   ") : "–"; }} />
          </button>
        ))}
      </div>
      {!state.devices.length && <p class="empty">No device yet.</p>}
    </section>
  );
}
