// Step 1: phones come in by QR code; a virtual phone is one click away.

import { useState } from "preact/hooks";
import type { Disturbance, Motion, Triple } from "../protocol";
import { goTo, send, state } from "../store";
import { type Key, t } from "../t";
import { Inputs } from "./inputs";

const MOTIONS: [Motion, Key][] = [["gentle", "motion.gentle"], ["brisk", "motion.brisk"], ["tumble", "motion.tumble"], ["rest", "motion.rest"]];
const DISTURBANCES: [Disturbance, Key][] = [["none", "disturbance.none"], ["acceleration", "disturbance.acceleration"], ["magnetic", "disturbance.magnetic"], ["both", "disturbance.both"]];

/** What the iron in a magnetised virtual phone adds, for the calibration to find. */
const HARD_IRON: Triple = [25, -14, 30];

/** No two virtual phones of a page are alike. */
let seed = 1;

export function Connect() {
  const hello = state.hello;
  const urls = hello?.phone_urls ?? [];
  const [chosen, setChosen] = useState(0);
  const shown = Math.min(chosen, Math.max(urls.length - 1, 0));
  return (
    <>
      <p>{t("connect.scan")}</p>
      <div class="qr">{hello && <img src={hello.qr_svg.replace("url=0", `url=${shown}`)} width="190" height="190" alt={t("connect.qr", { url: urls[shown] ?? "" })} />}</div>
      {urls.length > 1 && <p class="small">{t("connect.several")}</p>}
      {urls.map((url, i) => urls.length > 1
        ? <button type="button" class="address" key={url} aria-pressed={i === shown} onClick={() => setChosen(i)}><code class="url">{url}</code></button>
        : <code class="url" key={url}>{url}</code>)}
      {urls.length > 0 && (
        <>
          <p class="small">{t("connect.laptops")}</p>
          <code class="url" data-join="address">{`${urls[shown]!.split("/p#")[0]}/join`}</code>
          {hello?.named_url && <code class="url" data-join="name">{hello.named_url}</code>}
        </>
      )}
      <VirtualPhone />
      <Inputs />
      <details>
        <summary>{t("connect.other")}</summary>
        <p class="small">{t("connect.push")}</p>
        {hello?.ingest_urls.map((url) => <code class="url" key={url}>{url}</code>)}
        <p class="small">{t("connect.fingerprint")}</p>
        <code class="url">{hello?.fingerprint}</code>
      </details>
      {state.devices.length > 0 && <button type="button" class="primary" onClick={() => goTo("place")}>{t("connect.next")}</button>}
    </>
  );
}

function VirtualPhone() {
  const [motion, setMotion] = useState<Motion>("gentle");
  const [disturbance, setDisturbance] = useState<Disturbance>("none");
  const [magnetised, setMagnetised] = useState(false);
  const add = (): void => {
    send({ type: "virtual_phone", action: "add", motion, disturbance, seed: seed++, hard_iron_ut: magnetised ? HARD_IRON : [0, 0, 0] });
  };
  return (
    <fieldset class="virtual">
      <legend>{t("virtual.title")}</legend>
      <label>{t("virtual.motion")}
        <select value={motion} onChange={(e) => setMotion(e.currentTarget.value as Motion)}>{MOTIONS.map(([v, key]) => <option key={v} value={v}>{t(key)}</option>)}</select>
      </label>
      <label>{t("virtual.disturbance")}
        <select value={disturbance} onChange={(e) => setDisturbance(e.currentTarget.value as Disturbance)}>{DISTURBANCES.map(([v, key]) => <option key={v} value={v}>{t(key)}</option>)}</select>
      </label>
      <label class="tick"><input type="checkbox" checked={magnetised} onChange={() => setMagnetised(!magnetised)} /> {t("virtual.magnetised")}</label>
      <p class="small">{t("virtual.does")}</p>
      <button type="button" class={state.devices.length ? "" : "primary"} onClick={add}>{t("virtual.add")}</button>
    </fieldset>
  );
}
