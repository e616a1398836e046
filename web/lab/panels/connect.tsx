// Step 1: phones come in by QR code; a virtual phone is one click away.

import { useState } from "preact/hooks";
import type { Disturbance, Motion, Triple } from "../protocol";
import { goTo, send, state } from "../store";
import { Inputs } from "./inputs";

const MOTIONS: [string, string][] = [["gentle", "gentle turns"], ["brisk", "brisk turns"], ["tumble", "turned all over"], ["rest", "stays at rest"]];
const DISTURBANCES: [string, string][] = [["none", "none"], ["acceleration", "shaking"], ["magnetic", "a magnet near"], ["both", "shaking and a magnet"]];

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
      <p>Scan with the phone's camera, accept the lab's own certificate once, then tap <b>Start sending</b>. Phone and laptop share one network.</p>
      <div class="qr">{hello && <img src={hello.qr_svg.replace("url=0", `url=${shown}`)} width="190" height="190" alt={`QR code of ${urls[shown] ?? "the phone page"}`} />}</div>
      {urls.length > 1 && <p class="small">This computer has several addresses. If the phone does not get through, choose another:</p>}
      {urls.map((url, i) => urls.length > 1
        ? <button type="button" class="address" key={url} aria-pressed={i === shown} onClick={() => setChosen(i)}><code class="url">{url}</code></button>
        : <code class="url" key={url}>{url}</code>)}
      <VirtualPhone />
      <Inputs />
      <details>
        <summary>Other apps, and the certificate</summary>
        <p class="small">Sensor Logger: HTTP push to</p>
        {hello?.ingest_urls.map((url) => <code class="url" key={url}>{url}</code>)}
        <p class="small">Fingerprint of the certificate, to compare with what the phone shows:</p>
        <code class="url">{hello?.fingerprint}</code>
      </details>
      {state.devices.length > 0 && <button type="button" class="primary" onClick={() => goTo("place")}>Next: place at rest</button>}
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
      <legend>No phone at hand?</legend>
      <label>Motion
        <select value={motion} onChange={(e) => setMotion(e.currentTarget.value as Motion)}>{MOTIONS.map(([v, t]) => <option key={v} value={v}>{t}</option>)}</select>
      </label>
      <label>Disturbance
        <select value={disturbance} onChange={(e) => setDisturbance(e.currentTarget.value as Disturbance)}>{DISTURBANCES.map(([v, t]) => <option key={v} value={v}>{t}</option>)}</select>
      </label>
      <label class="tick"><input type="checkbox" checked={magnetised} onChange={() => setMagnetised(!magnetised)} /> Magnetised: hard iron of 25, −14, 30 µT</label>
      <p class="small">It rests, is turned about, comes back after 75 s, and begins again. Its truth is known.</p>
      <button type="button" class={state.devices.length ? "" : "primary"} onClick={add}>Add a virtual phone</button>
    </fieldset>
  );
}
