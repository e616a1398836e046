// Inputs that the program goes out for or listens for: apps with a server of their own, boards on a serial line.

import { useState } from "preact/hooks";
import { DraftInput } from "../draft";
import { send, state } from "../store";
import { t } from "../t";
import { said } from "../words";

const TONES: Record<string, string> = { connected: "good", connecting: "idle", waiting: "info", failed: "bad" };

export function Inputs() {
  const kinds = state.hello?.input_kinds ?? [];
  const [kind, setKind] = useState<string>(kinds[0]?.kind ?? "");
  const [address, setAddress] = useState("");
  const chosen = kinds.find((k) => k.kind === kind) ?? kinds[0];
  if (!chosen) return null;
  const add = (): void => {
    send({ type: "input", action: "add", kind: chosen.kind, address });
    setAddress("");
  };
  return (
    <details class="inputs" open={state.inputs.length > 0}>
      <summary>{t("inputs.title")}</summary>
      <div class="stack">
        <label class="field">{t("inputs.kind")}
          <select value={chosen.kind} onChange={(e) => setKind(e.currentTarget.value)}>{kinds.map((k) => <option key={k.kind} value={k.kind}>{k.title ?? k.kind}</option>)}</select>
        </label>
        <label class="field">{t("inputs.address")} <DraftInput value={address} change={setAddress} placeholder={chosen.example ?? ""} /></label>
        <p class="small">{said(chosen.hint)}</p>
        <button type="button" onClick={add}>{t("inputs.add")}</button>
        <ul class="stack">
          {state.inputs.map((input) => (
            <li key={input.id} class={`input ${TONES[input.state] ?? "idle"}`} data-input={input.id}>
              <b>{kinds.find((k) => k.kind === input.kind)?.title ?? input.kind}</b> <code>{input.address}</code>
              <span aria-live="polite">{said(input.text)}</span>
              <button type="button" class="link" onClick={() => send({ type: "input", action: "remove", id: input.id })}>{t("remove")}</button>
            </li>
          ))}
        </ul>
      </div>
    </details>
  );
}
