// Orders to a whole class: calibrate, start, stop; and who refused, with the reason.

import { useState } from "preact/hooks";
import { receives, send, state, update } from "../store";
import { type Key, t } from "../t";
import { said } from "../words";

const ASKED: Record<string, Key> = { calibrate: "all.calibrated", experiment: "all.started", stop: "all.stopped" };

/** A number of seconds between two others. */
function Seconds({ label, value, least, most, change }: { label: string; value: number; least: number; most: number; change: (v: number) => void }) {
  return (
    <label>{label}
      <input type="number" min={least} max={most} step="1" value={value} onChange={(e) => change(Math.min(most, Math.max(least, Math.round(Number(e.currentTarget.value)) || least)))} /> s
    </label>
  );
}

export function Orders() {
  const [rest, setRest] = useState(10);
  const [seconds, setSeconds] = useState(60);
  const [name, setName] = useState("");
  const nobody = !state.devices.some(receives);
  const busy = state.devices.some((d) => d.is_calibrating || d.is_experimenting);
  const usual = t("all.name.usual", { number: state.rounds + 1 });
  const start = (): void => {
    send({ type: "experiment_all", seconds, name: name.trim() || usual });
    update((s) => void s.rounds++);
  };
  return (
    <div class="orders" role="group" aria-label={t("all")}>
      <form onSubmit={(e) => { e.preventDefault(); send({ type: "calibrate_all", seconds: rest }); }}>
        <button type="submit" disabled={nobody}>{t("all.calibrate")}</button>
        <Seconds label={t("all.for")} value={rest} least={2} most={120} change={setRest} />
      </form>
      <form onSubmit={(e) => { e.preventDefault(); start(); }}>
        <button type="submit" disabled={nobody}>{t("all.start")}</button>
        <Seconds label={t("all.for")} value={seconds} least={5} most={600} change={setSeconds} />
        <label>{t("all.name")} <input type="text" maxLength={60} value={name} placeholder={usual} onInput={(e) => setName(e.currentTarget.value)} /></label>
      </form>
      <button type="button" disabled={!busy} onClick={() => send({ type: "stop_all" })}>{t("all.stop")}</button>
      <Told />
    </div>
  );
}

/** What became of the last order: how many do it, and each that does not. */
function Told() {
  const told = state.everyone;
  return (
    <div class="told" role="status">
      {told && (
        <>
          <p><b>{t(ASKED[told.asked]!, { done: told.done })}</b> {told.refused.length > 0 && t("all.refused", { count: told.refused.length })}
            <button type="button" class="link" onClick={() => update((s) => (s.everyone = null))}>{t("close")}</button>
          </p>
          <ul>{told.refused.map((one) => <li key={one.device} data-refused={one.device}><b>{one.name}</b> {said(one.text)}</li>)}</ul>
        </>
      )}
    </div>
  );
}
