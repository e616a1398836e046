// Whether a device rests now, in words: read before a calibration, an experiment, a recording at rest.

import { useFrame } from "../live";
import type { Device } from "../protocol";
import { receives, silenceOf } from "../store";
import { t } from "../t";
import { said } from "../words";

/** Slower than this a device rests. */
export const STILL_DEG_S = 3;

/** Without samples there is no rest: then why there are none, and what to do. */
export function Stillness({ device }: { device: Device }) {
  const rate = useFrame<number | null>(device.id, (f) => (f.rate_rad_s ? (Math.hypot(...f.rate_rad_s) * 180) / Math.PI : null), 4, null);
  if (!receives(device)) return <Silence device={device} />;
  const still = rate !== null && rate < STILL_DEG_S;
  return (
    <div class={`verdict ${rate === null ? "idle" : still ? "good" : "warn"}`} data-stillness={rate === null ? "waiting" : still ? "rest" : "moving"}>
      {/* Only the word is read aloud, when it changes; the number changes all the time. */}
      <b aria-live="polite">{rate === null ? t("still.waiting") : still ? t("still.rest") : t("still.moving")}</b>
      <span>{rate === null ? t("still.none") : t("still.rate", { rate: rate.toFixed(1) })}</span>
    </div>
  );
}

/** That nothing is received, why, and what to do. */
export function Silence({ device }: { device: Device }) {
  return (
    <div class="verdict bad" data-stillness="nothing">
      <b aria-live="polite">{t("nothingReceived")}</b>
      <span>{said(silenceOf(device))}</span>
    </div>
  );
}
