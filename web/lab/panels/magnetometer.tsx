// Magnetometer calibration: turn the phone all over, see which directions are missing, apply the fit.

import { useEffect, useRef, useState } from "preact/hooks";
import type { Device, MagnetometerFit } from "../protocol";
import type { View as ViewOf } from "../scene";
import type { Sphere } from "../sphere";
import { onChange, send, sensorOf, state } from "../store";
import { t } from "../t";
import { number, said } from "../words";

export function Magnetometer({ device }: { device: Device }) {
  const told = state.magnetometers[device.id];
  const running = told?.state === "running";
  const order = (action: "start" | "finish" | "cancel" | "discard"): void => send({ type: "calibrate_magnetometer", device: device.id, action });
  if (device.rates_hz["magnetometer"] === undefined) return <p>{t("mag.none")}</p>;
  return (
    <>
      <p>{t("mag.iron")}</p>
      {running ? (
        <>
          <Coverage fraction={told.coverage?.fraction ?? 0} />
          <p class="hint" aria-live="polite">{said(told.hint ?? "") || t("mag.turn")}</p>
          <div class="buttons">
            <button type="button" class={told.verdict?.tone === "good" ? "primary" : ""} onClick={() => order("finish")}>{t("mag.finish")}</button>
            <button type="button" onClick={() => order("cancel")}>{t("cancel")}</button>
          </div>
        </>
      ) : (
        <button type="button" class={device.magnetometer ? "" : "primary"} disabled={device.is_experimenting || !device.delivers || sensorOf(device, "magnetometer")?.delivery !== "delivers"} onClick={() => order("start")}>
          {device.magnetometer ? t("calibrate.again") : t("mag.start")}
        </button>
      )}
      {told?.verdict && (running || told.state === "done") && (
        <div class={`verdict ${told.verdict.tone}`}><b>{running ? t("mag.sofar") : t("calibrate.done")}</b><span>{said(told.verdict.text)}</span></div>
      )}
      {running && told.fit && <Numbers fit={told.fit} />}
      {!running && device.magnetometer && (
        <>
          <Numbers fit={device.magnetometer} />
          <div class="buttons downloads">
            <a href={`/api/devices/${encodeURIComponent(device.id)}/magnetometer.toml`} download="">{t("mag.save")}</a>
            <button type="button" disabled={device.is_experimenting} onClick={() => order("discard")}>{t("mag.discard")}</button>
          </div>
          <p class="small">{t("mag.inForce")}</p>
        </>
      )}
    </>
  );
}

function Coverage({ fraction }: { fraction: number }) {
  return (
    <div class="coverage">
      <progress max="1" value={fraction} aria-label={t("mag.share")} />
      <output>{t("mag.seen", { percent: (fraction * 100).toFixed(0) })}</output>
    </div>
  );
}

function Numbers({ fit }: { fit: MagnetometerFit }) {
  const length = Math.hypot(...fit.hard_iron_ut);
  const rows: [string, string, string][] = [
    [t("mag.strength"), "µT", number(fit.field_strength_ut, 1)],
    [t("mag.hardLength"), "µT", number(length, 1)],
    [t("mag.residual"), "µT", number(fit.residual_std_ut, 2)],
    [t("mag.before"), "µT", number(fit.uncalibrated_norm_std_ut, 2)],
  ];
  return (
    <table class="compact numbers">
      <thead><tr><th scope="col">{fit.model === "ellipsoid" ? t("mag.ellipsoid") : t("mag.sphere")}</th>{["x", "y", "z"].map((a) => <th key={a} scope="col" class="num">{a}</th>)}</tr></thead>
      <tbody>
        <tr data-value="hard-iron"><th scope="row">{t("mag.hard")} <small>µT</small></th>{fit.hard_iron_ut.map((v, i) => <td key={i} class="num">{number(v, 1)}</td>)}</tr>
        {fit.model === "ellipsoid" && fit.soft_iron.map((row, k) => (
          <tr key={k}><th scope="row">{k === 0 ? t("mag.soft") : ""}</th>{row.map((v, i) => <td key={i} class="num">{number(v, 3)}</td>)}</tr>
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
    let stop = (): void => undefined, gone = false;
    void Promise.all([import("../scene"), import("../sphere")]).then(([{ View }, { Sphere }]) => {
      if (gone) return;
      const view: ViewOf<Sphere> = new View(canvas.current!, new Sphere());
      let shown: unknown = null;
      const show = (): void => {
        const told = state.magnetometers[device];
        if (told && told !== shown) view.world!.show(told);
        shown = told;
        view.ask();
      };
      show();
      const follow = onChange(show);
      stop = () => {
        follow();
        view.close();
      };
    }).catch(() => setFailed(true));
    return () => {
      gone = true;
      stop();
    };
  }, [device]);
  const told = state.magnetometers[device];
  return (
    <div class="view3d">
      <canvas ref={canvas} role="img" aria-label={t("mag.canvas")} />
      {failed && <p class="empty">{t("mag.noWebgl")}</p>}
      <ul class="sphere-legend">
        <li><span class="swatch" style={{ "--role": "var(--good)" }} /> {t("mag.directions")}</li>
        <li><span class="swatch dot" style={{ "--role": "var(--ink)" }} /> {t("mag.samples")}</li>
        <li><span class="swatch ghost" style={{ "--role": "var(--accent)" }} /> {t("mag.surface")}</li>
        {told?.fit && <li><span class="swatch dashed" style={{ "--role": "var(--ink)" }} /> {t("mag.fromZero")}</li>}
      </ul>
      {!told?.coverage && <p class="empty">{t("mag.press")}</p>}
    </div>
  );
}
