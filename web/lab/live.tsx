// Things that follow the frames without passing through the page's state: numbers, states, lamps.

import { useEffect, useRef, useState } from "preact/hooks";
import { followShown } from "./moments";
import type { Frame, Lamp, TruthError } from "./protocol";
import { historyOf, isOld, onFrame, state, titleOf } from "./store";
import { t } from "./t";
import { said, unnamed } from "./words";

/** Text made of the frame that is shown of a device, at most five times a second: faster cannot be read. */
export function LiveText({ device, text, className }: { device: string; text: (frame: Frame) => string; className?: string }) {
  const element = useRef<HTMLSpanElement>(null);
  const make = useRef(text);
  make.current = text;
  useEffect(() => {
    let last = 0;
    return followShown(device, (frame, isPast) => {
      if ((!isPast && performance.now() - last < 200) || !element.current || document.visibilityState === "hidden") return;
      last = performance.now();
      element.current.textContent = make.current(frame);
    });
  }, [device]);
  return <span class={className} ref={element}>–</span>;
}

/** The state of the newest frame as something to draw again for, at most `hz` times a second. */
export function useFrame<T>(device: string, read: (frame: Frame) => T, hz: number, start: T): T {
  const [value, set] = useState<T>(start);
  const reader = useRef(read);
  reader.current = read;
  useEffect(() => {
    let last = 0;
    const take = (frame: Frame): void => {
      if (document.visibilityState === "hidden" || frame.device !== device || performance.now() - last < 1000 / hz) return;
      last = performance.now();
      set(reader.current(frame));
    };
    const latest = historyOf(device).latest;
    if (latest) take(latest);
    return onFrame(take);
  }, [device]);
  return value;
}

interface Shown {
  key: string;
  title: string;
  tone: string;
  text: string;
  number: string;
  hint: string;
}

const nis = (value: number | null): string => (value === null ? "–" : value.toFixed(value < 0.95 ? 2 : value < 99.5 ? 1 : 0));

function ofSensor(lamp: Lamp): Shown {
  return {
    key: lamp.sensor, title: titleOf(lamp.sensor), tone: lamp.tone, text: unnamed(said(lamp.text)), number: `NIS ${nis(lamp.nis_mean)}`,
    hint: lamp.nis_expected === null ? t("lamp.nothing") : t("lamp.nis", { expected: lamp.nis_expected }),
  };
}

function ofTruth(error: TruthError): Shown {
  return {
    key: "truth", title: t("truth"), tone: error.tone, text: error.sigmas === null ? `${said(error.text)} ${t("lamp.noCovariance")}` : said(error.text), number: `NEES ${nis(error.nees)}`,
    hint: t("lamp.nees", { expected: error.degrees_of_freedom }),
  };
}

/** One lamp a sensor, and one for the truth where it is known: is what the subject states consistent? In words. */
export function Lamps({ device }: { device: string }) {
  const frame = useFrame<Frame | null>(device, (frame) => frame, 2, null);
  const told: Shown[] = [...(frame?.lamp.map(ofSensor) ?? []), ...(frame?.truth?.error ? [ofTruth(frame.truth.error)] : [])];
  const row = state.devices.find((d) => d.id === device);
  const grey = isOld() ? t("lamp.old") : row && !row.delivers ? t("lamp.nothingReceived") : null;
  const none: Shown = { key: "none", title: t("nothingReceived"), tone: "idle", text: t("lamp.nothing"), number: "NIS –", hint: t("lamp.nothing") };
  const shown = told.length ? told : [none];
  return (
    <div class={`lamps ${shown.length > 2 ? "many" : ""}`} role="group" aria-label={t("lamps")} style={{ "--lamps": String(shown.length) }}>
      {shown.map((lamp) => ({ ...lamp, ...(grey ? { tone: "idle", text: grey } : {}) })).map((lamp) => (
        <details key={lamp.key} class={`lamp ${lamp.tone}`} data-lamp={lamp.key}>
          <summary>
            <span class="light" aria-hidden="true" />
            <p title={lamp.text}><b>{lamp.title}</b> {lamp.text}</p>
            <span class="spoken" aria-live="polite">{`${lamp.title}: ${toneText(lamp.tone)}`}</span>
            <span class="nis" title={lamp.hint}>{lamp.number}</span>
          </summary>
          <p class="whole">{lamp.text} <small>{lamp.hint}</small></p>
        </details>
      ))}
    </div>
  );
}

/** Read aloud when a lamp changes its colour; its number changes all the time. */
const toneText = (tone: string): string => (tone === "good" ? t("lamp.good") : tone === "warn" ? t("lamp.warn") : tone === "bad" ? t("lamp.bad") : t("lamp.idle"));
