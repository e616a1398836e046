// What a verdict of the return-to-start test is about: the whole attitude error, or the tilt alone where nothing said where north is.

import type { FinalSummary } from "./protocol";
import { t } from "./t";

type Numbers = Pick<FinalSummary, "calculated_error_deg" | "estimated_error_deg" | "calculated_tilt_deg" | "estimated_tilt_deg" | "degrees_of_freedom">;
/** As messages carry them: a row without degrees of freedom has the whole attitude error only. */
type Stated = { [K in keyof Numbers]?: Numbers[K] | null };

/** The numbers that the verdict compares, degrees. */
export interface Judged {
  calculated: number | null;
  estimated: number | null;
  isTilt: boolean;
}

/** Degrees of freedom of the tilt: two components, where the whole attitude has three. */
const TILT = 2;

export function judged(test: Stated | null | undefined): Judged {
  const isTilt = test?.degrees_of_freedom === TILT;
  const [calculated, estimated] = isTilt ? [test?.calculated_tilt_deg, test?.estimated_tilt_deg] : [test?.calculated_error_deg, test?.estimated_error_deg];
  return { calculated: calculated ?? null, estimated: estimated ?? null, isTilt };
}

/** The word that tells an error of the tilt from one of the whole attitude. */
export const TiltMark = ({ of }: { of: Judged }) => (of.isTilt ? <small class="mark"> {t("tilt")}</small> : null);

/** Shorter than asked by less than this is the last sample before the end, s. */
const EARLY_S = 0.5;
const seconds = (v: number): string => String(Math.round(10 * v) / 10);

/** That an experiment ended before the time that was asked; null where it did not, and where what was asked is not known. */
export function endedEarly(row: { duration_s: number; asked_s?: number | null } | undefined): string | null {
  if (!row?.asked_s || row.duration_s > row.asked_s - EARLY_S) return null;
  return t("experiments.early", { after: seconds(row.duration_s), asked: seconds(row.asked_s) });
}
