// Recordings of elsewhere: dropped on the page or chosen, sent to the lab on this computer, played as a device or run as an experiment.

import { useEffect, useState } from "preact/hooks";
import type { Contents, Made, OpenedFile } from "../protocol";
import { goTo, showExperiment, state, titleOf, update } from "../store";
import { t } from "../t";
import { number, said } from "../words";
import { size } from "./recordings";

/** A file on its way, and what became of it. */
interface Taken {
  key: number;
  /** What it is called where it comes from. */
  given: string;
  contents: Contents | null;
  refused: string | null;
}

let takenSoFar = 0;
let taken: Taken[] = [];

function change(key: number, by: Partial<Taken>): void {
  taken = taken.map((one) => (one.key === key ? { ...one, ...by } : one));
  update(() => undefined);
}

/** An answer of the lab, or its sentence why not. */
async function ask<T>(path: string, options: RequestInit): Promise<T | null> {
  const response = await fetch(path, options).catch(() => null);
  if (!response) throw new Error(t("opened.noAnswer"));
  if (!response.ok) throw new Error((await response.text()) || response.statusText);
  return response.headers.get("content-type")?.includes("json") ? ((await response.json()) as T) : null;
}

/** Sends files to the lab, one after the other. */
export async function open(files: Iterable<File>): Promise<void> {
  const all = [...files].map((file) => ({ file, key: ++takenSoFar }));
  taken = [...all.map(({ file, key }): Taken => ({ key, given: file.name, contents: null, refused: null })), ...taken].slice(0, 20);
  update((s) => { s.view = "lab"; s.lower = "recordings"; });
  for (const { file, key } of all) {
    try {
      change(key, { contents: await ask<Contents>(`/api/opened?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file }) });
    } catch (error) {
      change(key, { refused: (error as Error).message });
    }
  }
}

/** Shows where files can be dropped while some are dragged over the page. */
export function DropZone() {
  const [over, setOver] = useState(false);
  useEffect(() => {
    const hasFiles = (e: DragEvent): boolean => e.dataTransfer?.types.includes("Files") ?? false;
    const drag = (e: DragEvent): void => {
      if (!hasFiles(e)) return;
      e.preventDefault();
      setOver(true);
    };
    const leave = (e: DragEvent): void => void (e.relatedTarget === null && setOver(false));
    const drop = (e: DragEvent): void => {
      if (!hasFiles(e)) return;
      e.preventDefault();
      setOver(false);
      void open(e.dataTransfer!.files);
    };
    window.addEventListener("dragenter", drag);
    window.addEventListener("dragover", drag);
    window.addEventListener("dragleave", leave);
    window.addEventListener("drop", drop);
    return () => {
      window.removeEventListener("dragenter", drag);
      window.removeEventListener("dragover", drag);
      window.removeEventListener("dragleave", leave);
      window.removeEventListener("drop", drop);
    };
  }, []);
  return over ? <div class="drop-zone" role="status"><p>{t("opened.drop")}</p></div> : null;
}

/** What can be done with a recording. */
export function Acts({ whose, name }: { whose: "opened" | "recordings"; name: string }) {
  const [busy, setBusy] = useState(false);
  const path = `/api/${whose}/${encodeURIComponent(name)}`;
  const act = async (work: () => Promise<void>): Promise<void> => {
    setBusy(true);
    await work().catch((error: Error) => update((s) => (s.error = error.message)));
    setBusy(false);
  };
  const run = (): Promise<void> => act(async () => {
    const made = (await ask<Made>(`${path}/experiments`, { method: "POST" }))!;
    if (made.refused.length) update((s) => (s.error = made.refused.join(" ")));
    const id = made.experiments.at(-1)!;
    showExperiment({ id, device_id: state.rows.find((row) => row.id === id)?.device_id ?? state.finished[id]?.device ?? "" });
    update((s) => (s.lower = "experiments"));
  });
  const play = (): Promise<void> => act(async () => {
    await ask(`${path}/play`, { method: "POST" });
    goTo("connect");
  });
  return (
    <>
      <button type="button" class="link" disabled={busy} aria-label={t("opened.run.of", { name })} onClick={() => void run()}>{busy ? t("opened.busy") : t("opened.run")}</button>{" "}
      <button type="button" class="link" disabled={busy} aria-label={t("opened.play.of", { name })} onClick={() => void play()}>{t("opened.play")}</button>
    </>
  );
}

/** The button that opens files, what became of those just sent, and all that are kept. */
export function OpenedFiles() {
  const [kept, setKept] = useState<OpenedFile[]>([]);
  const [sure, setSure] = useState<string | null>(null);
  const [asked, again] = useState(0);
  const done = taken.filter((one) => one.contents).length;
  useEffect(() => {
    let gone = false;
    fetch("/api/opened").then((r) => r.json()).then((all: OpenedFile[]) => gone || setKept(all), () => undefined);
    return () => void (gone = true);
  }, [done, asked]);
  const remove = (name: string): void => {
    if (sure !== name) return setSure(name);
    setSure(null);
    void ask(`/api/opened/${encodeURIComponent(name)}`, { method: "DELETE" }).catch((error: Error) => update((s) => (s.error = error.message))).then(() => again((n) => n + 1));
  };
  return (
    <section class="opened" aria-label={t("opened")}>
      <p class="row-of-links">
        <label class="file-button">{t("opened.choose")}<input type="file" multiple onChange={(e) => { const input = e.currentTarget; void open([...(input.files ?? [])]); input.value = ""; }} /></label>
        <span class="small">{t("opened.hint")}</span>
      </p>
      <ul class="taken" aria-live="polite">
        {taken.map((one) => (
          <li key={one.key} class={one.refused ? "bad" : one.contents ? "good" : "idle"} data-taken={one.given}>
            <b>{one.contents?.name ?? one.given}</b> <span>{one.refused ? said(one.refused) : one.contents ? inWords(one.contents) : t("opened.reading")}</span>
          </li>
        ))}
      </ul>
      {kept.length > 0 && (
        <table class="experiments">
          <thead><tr><th scope="col">{t("opened")}</th><th scope="col">{t("opened.at")}</th><th scope="col" class="num">{t("recordings.size")}</th><td /></tr></thead>
          <tbody>
            {kept.map((one) => (
              <tr key={one.name} data-opened={one.name}>
                <th scope="row">{one.name}</th>
                <td>{one.at ?? "–"}</td>
                <td class="num">{size(one.bytes)}</td>
                <td class="acts">
                  <Acts whose="opened" name={one.name} />{" "}
                  <button type="button" class="link" aria-label={sure === one.name ? t("experiments.delete.sure") : t("experiments.delete.of", { name: one.name })} onBlur={() => setSure(null)} onClick={() => remove(one.name)}>{t(sure === one.name ? "experiments.delete.sure" : "experiments.delete")}</button>
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
    </section>
  );
}

/** What is in a file, in a line. */
function inWords(contents: Contents): string {
  if (contents.recordings > 1) return t("opened.several", { format: contents.format, count: contents.recordings });
  return t("opened.contents", { format: contents.format, seconds: number(contents.duration_s, 1), sensors: contents.sensors.map(titleOf).join(", ") });
}
