// Q and R by maximum likelihood on an experiment: asked for with a button, the numbers go to the sliders.

import { useEffect, useState } from "preact/hooks";
import { type Tuned as Subject, tunable } from "../parameters";
import type { ExperimentRow, FittedParameter, Settings, Tuned } from "../protocol";
import { send, state } from "../store";
import { t } from "../t";
import { degrees, figures, number } from "../words";
import type { Trial } from "./alterations";

/** Apart from the numbers of what-if, so that no answer is taken for the other's. */
let request = 1_000_000;
/** What was asked last and is not answered, and over which connection: one that has ended brings no answer. */
let underWay: number | null = null;
let askedOver = 0;

/** Another question ends a fit. */
export function endFit(): void {
  underWay = null;
}

/** The button, how far it is, and what came out. `take` gets the settings with the fitted numbers. */
export function FitButton({ row, settings, trial, tuned, take }: { row: ExperimentRow; settings: Settings; trial: Trial; tuned: Subject; take: (settings: Settings) => void }) {
  const [, again] = useState(0);
  const message = state.tuned?.id === row.id ? state.tuned : null;
  const isMine = message !== null && message.request === underWay;
  useEffect(() => {
    if ((state.failed !== null && state.failed === underWay) || state.closed !== askedOver) endFit();
    if (!isMine || !message.fit) return;
    endFit();
    const found = message.fit.parameters.filter((p) => !p.ran_off);
    take({ ...settings, ...Object.fromEntries(found.map((p) => [p.name, p.after])) });
  }, [message, state.failed, state.closed]);
  const begin = (): void => {
    underWay = ++request;
    askedOver = state.closed;
    send({ type: "tune", request: underWay, id: row.id, settings, ...trial, parameters: tunable(tuned).filter((name) => Number(settings[name]) > 0) });
    again((n) => n + 1);
  };
  return (
    <>
      <button type="button" disabled={underWay !== null} onClick={begin}>{t("fit")}</button>
      <p class="small" data-fit={underWay !== null ? "running" : message?.fit ? "done" : "none"} aria-live="polite">
        {underWay !== null ? t("fit.running", { runs: isMine ? message.runs : 0 }) : t("fit.hint")}
      </p>
      {underWay === null && message?.fit && <Outcome message={message} />}
    </>
  );
}

/** A name that may go on in the next line after an underscore. */
const breakable = (name: string) => name.split("_").map((part, i) => <span key={i}>{i > 0 && <>_<wbr /></>}{part}</span>);

function Outcome({ message }: { message: Tuned }) {
  const fit = message.fit!;
  const far = fit.parameters.filter((p) => p.ran_off).map((p) => p.name);
  return (
    <>
      <table class="compact fitted">
        <caption>{t("fit.done", { runs: message.runs })}</caption>
        <thead><tr><th scope="col">{t("fit.parameter")}</th><th scope="col" class="num">{t("fit.before")}</th><th scope="col" class="num">{t("fit.after")}</th></tr></thead>
        <tbody>
          {fit.parameters.map((p: FittedParameter) => (
            <tr key={p.name} data-fitted={p.name}><th scope="row"><code>{breakable(p.name)}</code></th><td class="num">{figures(p.before)}</td><td class="num">{p.ran_off ? "–" : figures(p.after)}</td></tr>
          ))}
        </tbody>
      </table>
      <ul class="sentences">
        <li class={fit.over_fits ? "warn" : "good"}>{t(fit.over_fits ? "fit.overfits" : fit.gain_held_out > 0 ? "fit.heldOut" : "fit.heldOutSame", { gain: number(fit.gain_held_out, 3) })}</li>
        {far.length > 0 && <li class="warn">{t("fit.far", { names: far.join(", ") })}</li>}
        {fit.without_effect.length > 0 && <li class="info">{t("fit.without", { names: fit.without_effect.join(", ") })}</li>}
        {fit.error_deg && <li class="info">{t("fit.error", { before: degrees(fit.error_deg[0]), after: degrees(fit.error_deg[1]) })}</li>}
      </ul>
    </>
  );
}
