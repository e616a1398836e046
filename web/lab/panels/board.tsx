// The results board: each device's newest experiment, ranked by consistency and not by the size of its error.

import { endedEarly, judged, TiltMark } from "../judged";
import type { Standing } from "../protocol";
import { byName, showExperiment, state } from "../store";
import { t } from "../t";
import { nameOf } from "../theme";
import { degrees, number, VERDICTS } from "../words";
import { ClassTable } from "./class_table";

/** How far the mean NIS is from what is expected, in words. */
export function departure(one: Standing): string {
  if (one.nis_factor === null) return "–";
  return t(one.is_nis_large || one.nis_factor < 1.05 ? "board.large" : "board.small", { factor: number(one.nis_factor, one.nis_factor < 9.95 ? 1 : 0) });
}

const nameOfDevice = (one: Standing): string =>
  state.devices.find((d) => d.id === one.device_id)?.name ?? state.rows.find((row) => row.id === one.experiment)?.device ?? one.device_id;

export function Board() {
  // Who share a place stand in the order of their names.
  const board = [...state.board].sort((a, b) => a.place - b.place || byName(nameOfDevice(a), nameOfDevice(b)));
  return (
    <section class="board" aria-label={t("board")}>
      <h2>{t("board")}</h2>
      <p class="small">{t("board.how")}</p>
      {!board.length ? <p class="small">{t("board.none")}</p> : (
        <div class="scroll" tabIndex={0} role="group" aria-label={t("board.name")}>
          <table class="compact">
            <thead><tr><th scope="col" class="num">{t("board.place")}</th><th scope="col">{t("board.name")}</th><th scope="col">{t("board.verdict")}</th><th scope="col" title={t("board.nis.hint")}>NIS</th><th scope="col" class="num" title={t("board.error.hint")}>{t("board.error")}</th></tr></thead>
            <tbody>{board.map((one) => <Row key={one.device_id} one={one} />)}</tbody>
          </table>
        </div>
      )}
      <ClassTable />
    </section>
  );
}

function Row({ one }: { one: Standing }) {
  const row = state.rows.find((r) => r.id === one.experiment);
  const of = judged(row?.results[row.subject]), early = endedEarly(row), verdict = one.verdict ? VERDICTS[one.verdict] : undefined;
  return (
    <tr data-standing={one.device_id}>
      <td class="num">{one.place}</td>
      <th scope="row">
        <button type="button" class="link" title={row && `${row.name}, ${nameOf(row.subject)}`} onClick={() => row && showExperiment(row)}>{nameOfDevice(one)}</button>
        {early && <small class="mark"> {early}</small>}
      </th>
      <td><span class={`tag ${verdict?.tone ?? ""}`}>{t(verdict?.text ?? "wall.noVerdict")}</span></td>
      <td title={t("board.nis.hint")}>{departure(one)}</td>
      <td class="num" title={t("board.error.hint")}>{degrees(of.calculated)} <small>/ {degrees(of.estimated)}</small><TiltMark of={of} /></td>
    </tr>
  );
}
