// Handing an experiment in for an exercise card of the course: choose the card, answer, and be told at once.

import { useEffect, useState } from "preact/hooks";
import { ofCard, ofChoice, reasonOf } from "../course";
import type { Card, CardLine, Change, HandedIn, HandInRequest, Question } from "../protocol";
import { state } from "../store";
import { t } from "../t";
import { said } from "../words";

/** What is typed, kept so that leaving the step does not lose it. */
const draft: { open: boolean; card: Card; student: string | null; answers: Partial<Record<Card, Record<string, string>>> } = { open: false, card: "experiment", student: null, answers: {} };

/** What became of the last hand-in, and of which experiment and card it was. */
type Outcome = { of: string; busy: true } | { of: string; refused: string } | { of: string; done: HandedIn };
let outcome: Outcome | null = null;

let cards: CardLine[] = [];

async function cardsOfLab(): Promise<CardLine[]> {
  if (!cards.length) cards = (await (await fetch("/api/exercises")).json()) as CardLine[];
  return cards;
}

/** `change`: what the experiment is handed in with, if not as it was. */
export function HandIn({ id, change = {} }: { id: string; change?: Partial<Change> }) {
  const [, redraw] = useState(0);
  const again = (): void => redraw((n) => n + 1);
  useEffect(() => {
    let gone = false;
    cardsOfLab().then(() => gone || again(), () => undefined);
    return () => void (gone = true);
  }, []);
  const line = cards.find((one) => one.card === draft.card);
  if (!line) return null;
  const row = state.rows.find((one) => one.id === id);
  const device = state.devices.find((one) => one.id === row?.device_id)?.name ?? row?.device ?? "";
  const student = draft.student ?? device;
  const answers = (draft.answers[draft.card] ??= {});
  const hand = async (): Promise<void> => {
    const of = `${id} ${line.card}`;
    outcome = { of, busy: true };
    again();
    const given = Object.fromEntries(line.questions.map((q) => [q.name, answers[q.name] ?? ""]));
    outcome = await handIn(id, { card: line.card, student, answers: given, ...change } as HandInRequest).then(
      (done): Outcome => ({ of, done }), (error: Error): Outcome => ({ of, refused: error.message }));
    again();
  };
  const shown = outcome?.of === `${id} ${line.card}` ? outcome : null;
  return (
    <details class="hand-in" open={draft.open} onToggle={(e) => (draft.open = e.currentTarget.open)}>
      <summary>{t("handIn")}</summary>
      <form onSubmit={(e) => { e.preventDefault(); void hand(); }}>
        <label class="field">{t("handIn.card")}
          <select name="card" value={line.card} onChange={(e) => { draft.card = e.currentTarget.value as Card; again(); }}>
            {cards.map(({ card }) => <option key={card} value={card}>{ofCard(card, "title")}</option>)}
          </select>
        </label>
        <p>{ofCard(line.card, "task")}</p>
        <p class="small">{ofCard(line.card, "hint")}</p>
        {line.questions.map((question) => (
          <Answer key={`${line.card} ${question.name}`} card={line.card} question={question} value={answers[question.name] ?? ""} set={(value) => { answers[question.name] = value; again(); }} />
        ))}
        <label class="field">{t("handIn.student")}
          <input type="text" name="student" required maxLength={80} value={student} onInput={(e) => { draft.student = e.currentTarget.value; again(); }} />
        </label>
        <button type="submit" class="primary" disabled={!!shown && "busy" in shown}>{t(shown && "busy" in shown ? "handIn.busy" : "handIn.send")}</button>
      </form>
      <div class="handed-in" aria-live="polite">{shown && !("busy" in shown) && <Verdict outcome={shown} />}</div>
    </details>
  );
}

function Answer({ card, question, value, set }: { card: Card; question: Question; value: string; set: (value: string) => void }) {
  const label = ofCard(card, question.name);
  if (question.kind === "number") {
    return (
      <label class="answer">{label}
        <span><input type="text" inputMode="decimal" name={question.name} required maxLength={80} autocomplete="off" value={value} onInput={(e) => set(e.currentTarget.value)} /> {question.unit}</span>
      </label>
    );
  }
  return (
    <fieldset class="answer">
      <legend>{label}</legend>
      {question.choices.map((choice) => (
        <label key={choice}><input type="radio" required name={`${card} ${question.name}`} value={choice} checked={value === choice} onChange={() => set(choice)} /> {ofChoice(card, question, choice)}</label>
      ))}
    </fieldset>
  );
}

function Verdict({ outcome }: { outcome: Exclude<Outcome, { busy: true }> }) {
  if ("refused" in outcome) return <div class="verdict bad" data-hand-in="refused"><b>{t("handIn.refused")}</b><span>{said(outcome.refused)}</span></div>;
  const { judgement, url, file, kept, problem } = outcome.done;
  return (
    <>
      <div class={`verdict ${judgement.passed ? "good" : "warn"}`} data-hand-in={judgement.passed ? "passed" : "not-passed"}><b>{t(judgement.passed ? "handIn.passed" : "handIn.notPassed")}</b><span>{t(judgement.passed ? "handIn.passed.hint" : "handIn.notPassed.hint")}</span></div>
      <ul class="sentences">
        {judgement.reasons.map((reason, i) => <li key={i} class={reason.holds ? "good" : "warn"} data-reason={reason.key}>{reasonOf(reason)}</li>)}
      </ul>
      <p class="small">{t(kept ? "handIn.kept" : "handIn.notKept")} {problem && said(problem)}</p>
      <p class="buttons downloads"><a href={url} download={file}>{file}</a></p>
    </>
  );
}

/** An answer of the lab, or its sentence why not. */
async function handIn(id: string, request: HandInRequest): Promise<HandedIn> {
  const options = { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(request) };
  const response = await fetch(`/api/experiments/${encodeURIComponent(id)}/hand-in`, options).catch(() => null);
  if (!response) throw new Error(t("handIn.noAnswer"));
  const reply = (await response.json().catch(() => null)) as (HandedIn & { error?: string }) | null;
  if (!response.ok || !reply) throw new Error(reply?.error ?? response.statusText);
  return reply;
}
