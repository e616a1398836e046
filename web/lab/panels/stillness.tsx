// Whether a device rests now, in words: read before a calibration, an experiment, a recording at rest.

import { useFrame } from "../live";
import type { Device } from "../protocol";

const STILL_DEG_S = 3;

export function Stillness({ device }: { device: Device }) {
  const rate = useFrame<number | null>(device.id, (f) => (f.rate_rad_s ? (Math.hypot(...f.rate_rad_s) * 180) / Math.PI : null), 4, null);
  const still = rate !== null && rate < STILL_DEG_S;
  return (
    <div class={`verdict ${rate === null ? "idle" : still ? "good" : "warn"}`}>
      {/* Only the word is read aloud, when it changes; the number changes all the time. */}
      <b aria-live="polite">{rate === null ? "Waiting" : still ? "At rest" : "Moving"}</b>
      <span>{rate === null ? "No readings yet." : `It turns at ${rate.toFixed(1)} deg/s.`}</span>
    </div>
  );
}
