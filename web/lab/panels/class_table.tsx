// Who of the class has passed which exercise card, for the teacher.

import { useEffect, useState } from "preact/hooks";
import { language } from "../../words/language";
import { decisive, ofCard } from "../course";
import type { Card, ClassTable as Table } from "../protocol";
import { byName } from "../store";
import { t } from "../t";

const POLL_MS = 5000;

export function ClassTable() {
  const [table, setTable] = useState<Table | null>(null);
  useEffect(() => {
    let gone = false;
    const look = (): void => void fetch("/api/class").then((r) => (r.ok ? r.json() : null)).then((now: Table | null) => gone || (now && setTable(now)), () => undefined);
    look();
    const timer = setInterval(look, POLL_MS);
    return () => {
      gone = true;
      clearInterval(timer);
    };
  }, []);
  if (!table || (!table.hand_ins.length && !table.not_judged.length)) return null;
  const students = [...table.students].sort((a, b) => byName(a.student, b.student));
  return (
    <>
      <h2>{t("class")}</h2>
      <div class="scroll" tabIndex={0} role="group" aria-label={t("class")}>
        <table class="compact class-table">
          <thead><tr><th scope="col">{t("class.student")}</th>{table.cards.map((card) => <th key={card} scope="col">{ofCard(card, "title")}</th>)}</tr></thead>
          <tbody>
            {students.map(({ student, passed }) => (
              <tr key={student} data-student={student}>
                <th scope="row">{student}</th>
                {table.cards.map((card) => <Cell key={card} card={card} passed={passed[card]} why={why(table, student, card)} />)}
              </tr>
            ))}
          </tbody>
        </table>
        {table.shared.map((names) => <p key={names.join()} class="small">{t("class.shared", { names: names.join(", ") })}</p>)}
        {table.not_judged.map(([file, reason]) => <p key={file} class="small">{t("class.notJudged", { file, reason })}</p>)}
      </div>
      <p class="row-of-links"><a href={`/api/class.csv?language=${language()}`} download="class.csv">{t("class.csv")}</a></p>
    </>
  );
}

function Cell({ card, passed, why }: { card: Card; passed: boolean | undefined; why: string }) {
  if (passed === undefined) return <td data-card={card}>–</td>;
  return <td data-card={card} title={why}><span class={`tag ${passed ? "good" : "warn"}`}>{t(passed ? "class.passed" : "class.notYet")}</span></td>;
}

/** What decided the newest hand-in, or that which passes. */
function why(table: Table, student: string, card: Card): string {
  const all = table.hand_ins.filter((one) => one.student === student && one.card === card);
  const one = all.find((each) => each.judgement.passed) ?? all.at(-1);
  return one ? `${one.at}: ${decisive(one.judgement)}` : "";
}
