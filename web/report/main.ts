// The script of reports: makes instruments of the figures, from the data beside each picture. Prints keep the pictures.

import { Instrument } from "../instrument/instrument";
import { Span } from "../instrument/span";
import { short } from "../instrument/numbers";
import type { Curve, Data, Rule, Spec, Theme } from "../instrument/spec";
import words from "../words/instrument.json";
import uPlot from "uplot";
import "./style.css";

interface Layer {
  kind: "line" | "band" | "dots" | "bars" | "rule";
  class: string;
  name: string;
  angle?: boolean;
  x: number;
  y?: (number | null)[];
  low?: (number | null)[];
  high?: (number | null)[];
  value?: number;
}
interface Panel {
  title: string;
  unit: string;
  note: string;
  height: number;
  y_range: [number, number];
  log_y: boolean;
  layers: Layer[];
}
interface Figure {
  label: string;
  across: string;
  linked: boolean;
  x_range: [number, number];
  log_x: boolean;
  x: (number | null)[][];
  panels: Panel[];
}

const english = Object.fromEntries(Object.entries(words).map(([key, text]) => [key, text.en])) as Record<keyof typeof words, string>;

const listeners = new Set<() => void>();
let cache = new Map<string, string>();
const theme: Theme = {
  colour(role) {
    let value = cache.get(role);
    if (!value) cache.set(role, (value = getComputedStyle(document.documentElement).getPropertyValue(`--${role}`).trim() || "#888888"));
    return value;
  },
  onChange(listener) {
    listeners.add(listener);
    return () => listeners.delete(listener);
  },
};
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  cache = new Map();
  for (const listener of listeners) listener();
});

/** Words of a class that say how, not what. */
const SHAPES = new Set(["line", "dots", "band", "bar", "thin", "bold", "ghost", "dash", "big", "soft", "tag", "end"]);

/** The role of the colour that a class of the style sheet gives. */
const roleOf = (className: string): string => className.split(" ").find((part) => !SHAPES.has(part))?.replace(/-fill$/, "") ?? "muted";

function curveOf(layer: Layer, title: string): Curve {
  const parts = layer.class.split(" "), label = layer.name || title;
  return {
    label, role: roleOf(layer.class),
    ...(parts.includes("dash") ? { dash: true } : {}),
    ...(layer.kind === "dots" ? { points: parts.includes("gated") ? ("cross" as const) : ("dot" as const) } : {}),
    width: parts.includes("thin") ? 1.2 : parts.includes("bold") ? 2.6 : 1.8,
  };
}

/** Breaks a line where an angle jumps over ±180°. */
const unwrapped = (values: (number | null)[]): (number | null)[] => values.map((v, i) => (i && v !== null && values[i - 1] !== null && Math.abs(v - values[i - 1]!) > 180 ? null : v));

function columnsOf(figure: Figure, panel: Panel): { data: Data; curves: Curve[]; bands: Spec["bands"]; rules: Rule[] } {
  const curves: Curve[] = [], series: { x: number; y: (number | null)[] }[] = [], rules: Rule[] = [];
  const bands: NonNullable<Spec["bands"]> = [];
  const add = (curve: Curve, x: number, y: (number | null)[], angle?: boolean): number => {
    curves.push(curve);
    return series.push({ x, y: angle ? unwrapped(y) : y }) - 1;
  };
  for (const layer of panel.layers) {
    if (layer.kind === "rule") rules.push({ value: layer.value!, text: layer.name });
    else if (layer.kind === "band") {
      const name = layer.name || "band", role = roleOf(layer.class);
      const edge = (text: string): Curve => ({ label: `${name}, ${text}`, key: name, role, edge: true });
      bands.push({ high: add(edge("high"), layer.x, layer.high!), low: add(edge("low"), layer.x, layer.low!), role });
    } else add(curveOf(layer, panel.title), layer.x, layer.y!, layer.angle);
  }
  const used = [...new Set(series.map((s) => s.x))];
  const first = used[0];
  if (used.length <= 1) return { data: [first === undefined ? [] : figure.x[first]!, ...series.map((s) => s.y)] as unknown as Data, curves, bands, rules };
  // Curves with instants of their own: one axis with all of them, on which a curve is not broken where only others have a value.
  const tables = used.map((x) => [figure.x[x]!, ...series.filter((s) => s.x === x).map((s) => s.y)] as unknown as Data);
  const joined = uPlot.join(tables, tables.map((t) => t.map(() => 1)));
  const order = used.flatMap((x) => series.map((s, i) => [s, i] as const).filter(([s]) => s.x === x).map(([, i]) => i));
  const data: unknown[] = [joined[0]];
  order.forEach((of, place) => (data[of + 1] = joined[place + 1]));
  return { data: data as Data, curves, bands, rules };
}

/** Where all figures over time begin and end: they move together. */
let whole: [number, number] | null = null;
const shared = new Span(() => whole);
const made: Instrument[] = [];

function instruments(figure: Figure, box: HTMLElement): void {
  const span = figure.linked ? shared : new Span(() => figure.x_range, null, figure.log_x);
  if (figure.linked) whole = whole ? [Math.min(whole[0], figure.x_range[0]), Math.max(whole[1], figure.x_range[1])] : figure.x_range;
  figure.panels.forEach((panel, i) => {
    const { data, curves, bands, rules } = columnsOf(figure, panel);
    const spec: Spec = {
      id: `${figure.label} ${i}`, title: panel.title, unit: panel.unit, note: panel.note, across: figure.across,
      curves, ...(bands ? { bands } : {}), rules: () => rules, logX: figure.log_x, logY: panel.log_y, whole: { x: figure.x_range, y: panel.y_range },
    };
    const instrument = new Instrument({ spec, span, theme, words: english, source: () => data });
    instrument.figure.style.minHeight = `${Math.max(190, panel.height + 92)}px`;
    box.append(instrument.figure);
    made.push(instrument);
  });
}

for (const data of document.querySelectorAll<HTMLScriptElement>("script.figure-data")) {
  const outer = data.closest("figure")!;
  const box = document.createElement("div");
  box.className = "instruments";
  outer.prepend(box);
  outer.classList.add("alive");
  instruments(JSON.parse(data.textContent!) as Figure, box);
}
shared.follow();

/** What is shown of the time, and the way back to all of it: only while it is not all. */
const bar = document.createElement("div");
bar.className = "shown";
bar.hidden = true;
const text = document.createElement("span"), back = document.createElement("button");
back.type = "button";
back.textContent = "Show all";
back.addEventListener("click", () => shared.follow());
bar.append(text, back);
document.body.append(bar);
shared.onChange((what) => {
  if (what !== "range") return;
  bar.hidden = shared.follows;
  const [low, high] = shared.range();
  text.textContent = `Shown: ${short(low)} to ${short(high)} s`;
});

// A picture is sharp on paper at any size: charts are not needed there.
for (const instrument of made) instrument.refresh();
