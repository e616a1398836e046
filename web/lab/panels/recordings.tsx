// What is recorded: a light in the header, and the list of recordings with their files.

import { useEffect, useState } from "preact/hooks";
import type { Listed } from "../protocol";
import { isOld, state, update } from "../store";
import { Acts, OpenedFiles } from "./opened";
import { type Key, t } from "../t";
import { said } from "../words";

const LIGHTS: Record<string, { tone: string; text: Key }> = {
  idle: { tone: "idle", text: "light.ready" }, on: { tone: "bad", text: "light.on" }, off: { tone: "idle", text: "light.off" }, failed: { tone: "bad", text: "light.failed" },
};

function clock(seconds: number): string {
  const whole = Math.floor(seconds), two = (v: number): string => String(v).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  return `${hours ? `${hours}:${two(Math.floor(whole / 60) % 60)}` : Math.floor(whole / 60)}:${two(whole % 60)}`;
}

export const size = (bytes: number): string => (bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(bytes < 1e8 ? 1 : 0)} MB`);

/** Whether everything is recorded, in the header; nothing while the program does not record at all. */
export function RecordingLight() {
  const recording = state.recording;
  if (!recording) return null;
  const light = LIGHTS[recording.state] ?? LIGHTS["off"]!;
  const old = isOld();
  const shown = old ? "–" : recording.state === "on" ? clock(recording.seconds) : t(light.text);
  return (
    <button
      type="button" class={old ? "recording idle" : `recording ${light.tone} ${recording.state}`} title={old ? t("connectionLost") : said(recording.text)} aria-label={`${shown}. ${t("light.on")}: ${old ? t("connectionLost") : said(recording.text)}`}
      onClick={() => update((s) => { s.view = "lab"; s.lower = "recordings"; })}
    >
      <span aria-hidden="true" />
      {shown}
    </button>
  );
}

/** The recordings of the data folder, read when the tab is opened and when one begins or ends. */
export function Recordings() {
  const [listed, setListed] = useState<Listed[] | null>(null);
  const recording = state.recording;
  useEffect(() => {
    let gone = false;
    fetch("/api/recordings").then((r) => r.json()).then((all: Listed[]) => gone || setListed(all), () => gone || setListed([]));
    return () => void (gone = true);
  }, [recording?.state, recording?.file]);
  if (!listed) return <p class="empty">{t("recordings.looking")}</p>;
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={t("recordings")}>
      <OpenedFiles />
      {recording && <div class={`verdict ${recording.state === "failed" ? "bad" : recording.state === "on" ? "good" : "idle"}`}><b>{t((LIGHTS[recording.state] ?? LIGHTS["off"]!).text)}</b><span>{said(recording.text)}</span></div>}
      {listed.length === 0 ? <p class="empty">{t("recordings.none")}</p> : (
        <table class="experiments">
          <thead><tr><th scope="col">{t("recordings.name")}</th><th scope="col">{t("recordings.begun")}</th><th scope="col">{t("devices")}</th><th scope="col" class="num">{t("recordings.size")}</th><th scope="col">{t("recordings.state")}</th><td /></tr></thead>
          <tbody>
            {listed.map((one) => (
              <tr key={one.name} data-recording={one.name}>
                <th scope="row"><a href={`/api/recordings/${encodeURIComponent(one.name)}`} download="">{one.name}</a></th>
                <td>{one.start ?? "–"}</td>
                <td class="wide">{one.devices.join(", ") || "–"}</td>
                <td class="num">{size(one.name === recording?.file ? recording.bytes : one.bytes)}</td>
                <td>{one.finished ? t("recordings.complete") : one.name === recording?.file ? t("recordings.written") : t("recordings.broken")}</td>
                <td class="acts">{one.name !== recording?.file && <Acts whose="recordings" name={one.name} />}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
    </div>
  );
}
