// The texts of the laboratory course, in the language of now: cards, questions, and what a check found.
// As `crates/evaluation/src/exercises/words.rs` says them.

import course from "../words/course.json";
import { filled, language, type Text } from "../words/language";
import type { Card, Judgement, Question, Reason } from "./protocol";

const texts: Record<string, Text> = course;

const text = (key: string): string => texts[key]?.[language()] ?? "";

/** A part of a card: title, task, hint, or a question by its name. */
export const ofCard = (card: Card, part: string): string => text(`card.${card}.${part}`);

/** A choice of a question. */
export const ofChoice = (card: Card, question: Question, choice: string): string => ofCard(card, `${question.name}.${choice}`) || choice;

/** A reason in words: where it does not hold, by the sentence that says so, if it has one of its own. */
export function reasonOf(reason: Reason): string {
  const sentence = (!reason.holds && text(`${reason.key}.not`)) || text(reason.key) || reason.key;
  // Words that have a translation of their own: questions, names of sensors, choices.
  const values = Object.entries(reason.values).map(([name, value]) => [name, text(`word.${value}`) || text(value) || value]);
  return filled(sentence, Object.fromEntries(values) as Record<string, string>);
}

/** What decided: the reason that does not hold, or the last of those that do. */
export function decisive(judgement: Judgement): string {
  const reason = judgement.reasons.find((one) => !one.holds) ?? judgement.reasons.at(-1);
  return reason ? reasonOf(reason) : "";
}
