// Magnetometer calibration: turn the phone all over, see which directions are missing, apply the fit.

import { useEffect, useRef, useState } from "preact/hooks";
import type { Device, MagnetometerFit } from "../protocol";
import { View } from "../scene";
import { Sphere } from "../sphere";
import { onChange, send, sensorOf, state } from "../store";
import { number, pretty } from "../words";

export function Magnetometer({ device }: { device: Device }) {
  const told = state.magnetometers[device.id];
  const running = told?.state === "running";
  const order = (action: "start" | "finish" | "cancel" | "discard"): void => send({ type: "calibrate_magnetometer", device: device.id, action });
  if (device.rates_hz["magnetometer"] === undefined) return <p>This device sends no magnetometer samples: there is nothing to calibrate.</p>;
  return (
    <>
      <p>Iron in the phone shifts the field it measures (hard iron) and bends it (soft iron). Turned all over on one spot, the samples lie on an ellipsoid: its centre and shape take both away.</p>
      {running ? (
        <>
          <Coverage fraction={told.coverage?.fraction ?? 0} />
          <p class="hint" aria-live="polite">{told.hint ?? "Turn it slowly about all of its axes, on the spot."}</p>
          <div class="buttons">
            <button type="button" class={told.verdict?.tone === "good" ? "primary" : ""} onClick={() => order("finish")}>Finish</button>
            <button type="button" onClick={() => order("cancel")}>Cancel</button>
          </div>
        </>
      ) : (
        <button type="button" class={device.magnetometer ? "" : "primary"} disabled={device.is_experimenting || !device.delivers || sensorOf(device, "magnetometer")?.delivery !== "delivers"} onClick={() => order("start")}>
          {device.magnetometer ? "Calibrate again" : "Start turning"}
        </button>
      )}
      {told?.verdict && (running || told.state === "done") && (
        <div class={`verdict ${told.verdict.tone}`}><b>{running ? "So far" : "Calibrated"}</b><span>{pretty(told.verdict.text)}</span></div>
      )}
      {running && told.fit && <Numbers fit={told.fit} />}
      {!running && device.magnetometer && (
        <>
          <Numbers fit={device.magnetometer} />
          <div class="buttons downloads">
            <a href={`/api/devices/${encodeURIComponent(device.id)}/magnetometer.toml`} download="">Save as TOML</a>
            <button type="button" disabled={device.is_experimenting} onClick={() => order("discard")}>Discard</button>
          </div>
          <p class="small">In force for every sample since. Phones that calibrate themselves while you turn them do it again: compare before and after.</p>
        </>
      )}
    </>
  );
}

function Coverage({ fraction }: { fraction: number }) {
  return (
    <div class="coverage">
      <progress max="1" value={fraction} aria-label="Share of the sphere seen" />
      <output>{(fraction * 100).toFixed(0)} % seen</output>
    </div>
  );
}

function Numbers({ fit }: { fit: MagnetometerFit }) {
  const length = Math.hypot(...fit.hard_iron_ut);
  const rows: [string, string, string][] = [
    ["Strength of the field", "µT", number(fit.field_strength_ut, 1)],
    ["Hard iron, length", "µT", number(length, 1)],
    ["Residual", "µT", number(fit.residual_std_ut, 2)],
    ["Scatter before", "µT", number(fit.uncalibrated_norm_std_ut, 2)],
  ];
  return (
    <table class="compact numbers">
      <thead><tr><th scope="col">{fit.model === "ellipsoid" ? "Ellipsoid" : "Sphere"}</th>{["x", "y", "z"].map((a) => <th key={a} scope="col" class="num">{a}</th>)}</tr></thead>
      <tbody>
        <tr data-value="hard-iron"><th scope="row">Hard iron <small>µT</small></th>{fit.hard_iron_ut.map((v, i) => <td key={i} class="num">{number(v, 1)}</td>)}</tr>
        {fit.model === "ellipsoid" && fit.soft_iron.map((row, k) => (
          <tr key={k}><th scope="row">{k === 0 ? "Soft iron" : ""}</th>{row.map((v, i) => <td key={i} class="num">{number(v, 3)}</td>)}</tr>
        ))}
        {rows.map(([name, unit, value]) => <tr key={name}><th scope="row">{name} <small>{unit}</small></th><td colSpan={3} class="num">{value}</td></tr>)}
      </tbody>
    </table>
  );
}

/** The sphere itself, where the 3-D view is. */
export function CoverageSphere({ device }: { device: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [failed, setFailed] = useState(false);
  useEffect(() => {
    let view: View<Sphere>;
    try {
      view = new View(canvas.current!, new Sphere());
    } catch {
      setFailed(true);
      return;
    }
    let shown: unknown = null;
    const show = (): void => {
      const told = state.magnetometers[device];
      if (told && told !== shown) view.world!.show(told);
      shown = told;
      view.ask();
    };
    show();
    const stop = onChange(show);
    return () => {
      stop();
      view.close();
    };
  }, [device]);
  const told = state.magnetometers[device];
  return (
    <div class="view3d">
      <canvas ref={canvas} role="img" aria-label="The sphere of directions about the device: filled where the field has been seen from. Drag to look from elsewhere." />
      {failed && <p class="empty">This browser shows no 3-D graphics (WebGL is off). The words and numbers on the right are enough.</p>}
      <ul class="sphere-legend">
        <li><span class="swatch" style={{ "--role": "var(--good)" }} /> directions seen</li>
        <li><span class="swatch dot" style={{ "--role": "var(--s1)" }} /> samples; the large one is now</li>
        <li><span class="swatch ghost" style={{ "--role": "var(--estimate)" }} /> fitted surface</li>
        {told?.fit && <li><span class="swatch dashed" style={{ "--role": "var(--ink)" }} /> hard iron, from zero field</li>}
      </ul>
      {!told?.coverage && <p class="empty">Press Start turning: each direction the field comes from fills a cell.</p>}
    </div>
  );
}
