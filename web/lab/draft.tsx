// A field that keeps what is being typed: the page draws itself anew many times a second, and must not write over it.

import { useState } from "preact/hooks";

interface Props {
  value: string;
  change: (value: string) => void;
  /** Whether a number is typed. */
  decimal?: boolean;
  placeholder?: string;
}

/** Tells the change when the field is left or Enter is pressed; Escape takes it back. */
export function Draft({ label, name, ...input }: Props & { label: string; name: string }) {
  return <label class={name}>{label} <DraftInput {...input} /></label>;
}

export function DraftInput({ value, change, decimal, placeholder }: Props) {
  const [draft, setDraft] = useState<string | null>(null);
  const commit = (): void => {
    if (draft !== null && draft !== value) change(draft);
    setDraft(null);
  };
  return (
    <input
      type="text" maxLength={60} inputMode={decimal ? "decimal" : "text"} value={draft ?? value} placeholder={placeholder}
      onInput={(e) => setDraft(e.currentTarget.value)}
      onBlur={commit}
      onKeyDown={(e) => {
        if (e.key === "Enter") commit();
        if (e.key === "Escape") setDraft(null);
      }}
    />
  );
}
