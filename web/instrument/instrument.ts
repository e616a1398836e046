// A chart that works like an instrument: values under the pointer, zoom, pan, curves to switch, picture, table, keyboard.
//
// Charts that share a `Span` move together. The lab and the reports use this same component.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import "./style.css";
import { fileName, picture, save, table } from "./export";
import { gestures } from "./gestures";
import { moment, reading } from "./numbers";
import { options } from "./plot";
import type { Span } from "./span";
import type { Source, Spec, Theme, Words } from "./spec";

const LIVE_MS = 80;
/** A curve's value is looked for so far from the pointer, CSS pixels: samples of different sensors do not share their instants. */
const NEAR_PX = 14;

/** So many switches stand beside the title where there is room. */
const FEW_KEYS = 3;

/** What is switched off, of charts that are made anew again and again. */
const switchedOff = new Map<string, Set<string>>();

const ICONS = {
  picture: "M2 3h12v10H2zM4 11l3-4 2 2.6L11 7l2 4M5 6h.01",
  table: "M2 3h12v10H2zM2 6.5h12M2 9.8h12M6.2 3v10",
  full: "M2 6V2h4M14 6V2h-4M2 10v4h4M14 10v4h-4",
};

function element<K extends keyof HTMLElementTagNameMap>(tag: K, className: string, text = ""): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text) made.textContent = text;
  return made;
}

function icon(path: string): SVGElement {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("aria-hidden", "true");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
  line.setAttribute("d", path);
  svg.append(line);
  return svg;
}

export interface Setup {
  spec: Spec;
  source: Source;
  span: Span;
  theme: Theme;
  words: Words;
  /** Whether data come all the time. */
  live?: boolean;
}

export class Instrument {
  readonly figure = element("figure", "chart");
  private readonly box = element("div", "canvas");
  private readonly readout = element("div", "readout");
  private readonly spoken = element("p", "spoken");
  private readonly legend = element("div", "legend");
  private plot: uPlot | null = null;
  private endGestures = (): void => undefined;
  private readonly off: Set<string>;
  private readonly ends: (() => void)[] = [];
  private asked = 0;

  constructor(private readonly setup: Setup) {
    const { spec, words } = setup;
    let off = switchedOff.get(spec.id);
    if (!off) switchedOff.set(spec.id, (off = new Set(spec.curves.filter((c) => c.off).map((c) => this.keyOf(c)))));
    this.off = off;
    this.figure.dataset["chart"] = spec.id;
    this.spoken.setAttribute("aria-live", "polite");
    Object.assign(this.box, { tabIndex: 0 });
    this.box.setAttribute("role", "application");
    this.box.setAttribute("aria-roledescription", "chart");
    this.box.setAttribute("aria-label", `${spec.title}${spec.unit ? `, ${spec.unit}` : ""}. ${words.keys}`);
    this.readout.setAttribute("aria-hidden", "true");
    this.readout.hidden = true;
    this.figure.append(this.caption(), this.box, this.spoken);
    this.buildLegend();
    this.box.addEventListener("keydown", (e) => this.key(e));
    // The browser's own way out of the full screen.
    this.figure.addEventListener("fullscreenchange", () => !document.fullscreenElement && this.figure.classList.contains("full") && this.toggleFull());
    this.make();
    const watch = new ResizeObserver(() => this.resize());
    watch.observe(this.box);
    this.ends.push(() => watch.disconnect(), setup.theme.onChange(() => this.make()), setup.span.onChange((what) => (what === "range" ? this.ask() : this.point())));
    if (setup.live) {
      const timer = window.setInterval(() => document.visibilityState === "visible" && setup.span.follows && this.refresh(), LIVE_MS);
      this.ends.push(() => window.clearInterval(timer));
    }
  }

  private keyOf(curve: Spec["curves"][number]): string {
    return curve.key ?? curve.label;
  }

  private isOff = (curve: number): boolean => this.off.has(this.keyOf(this.setup.spec.curves[curve]!));

  private caption(): HTMLElement {
    const { spec, words } = this.setup;
    const caption = element("figcaption", ""), tools = element("span", "tools");
    caption.append(element("b", "", spec.title), element("span", "unit", spec.unit));
    caption.append(element("span", "note", spec.note ?? ""));
    const tool = (name: keyof typeof ICONS, does: () => void): HTMLButtonElement => {
      const button = element("button", "tool");
      button.type = "button";
      button.title = words[name];
      button.dataset["tool"] = name;
      button.setAttribute("aria-label", `${words[name]}: ${spec.title}`);
      button.append(icon(ICONS[name]));
      button.addEventListener("click", does);
      tools.append(button);
      return button;
    };
    tool("picture", () => void this.savePicture());
    tool("table", () => this.saveTable());
    tool("full", () => this.toggleFull());
    caption.append(this.legend, tools);
    return caption;
  }

  private buildLegend(): void {
    const { spec, words } = this.setup;
    this.legend.setAttribute("role", "group");
    this.legend.setAttribute("aria-label", `${words.values}: ${spec.title}`);
    const made = new Set<string>();
    spec.curves.forEach((curve, i) => {
      const key = this.keyOf(curve);
      if (curve.edge || curve.silent || made.has(key)) return;
      made.add(key);
      const button = element("button", `key ${curve.points ?? ""} ${curve.dash ? "dashed" : ""}`, curve.key ?? curve.label);
      button.type = "button";
      button.dataset["role"] = curve.role;
      button.style.setProperty("--role", `var(--${curve.role})`);
      button.setAttribute("aria-pressed", String(!this.isOff(i)));
      button.addEventListener("click", () => this.toggle(key, button));
      this.legend.append(button);
    });
    this.legend.classList.toggle("many", made.size > FEW_KEYS);
    // A single curve needs no switch.
    this.legend.hidden = made.size < 2;
  }

  private toggle(key: string, button: HTMLElement): void {
    if (this.off.has(key)) this.off.delete(key);
    else this.off.add(key);
    button.setAttribute("aria-pressed", String(!this.off.has(key)));
    this.plot?.batch(() => this.setup.spec.curves.forEach((_, i) => this.plot!.setSeries(i + 1, { show: !this.isOff(i) })));
    this.refresh();
  }

  private make(): void {
    const { spec, theme, span } = this.setup;
    this.endGestures();
    this.plot?.destroy();
    const [width, height] = this.size();
    this.plot = new uPlot(options(spec, theme, width, height, this.isOff), [[], ...spec.curves.map(() => [])] as unknown as uPlot.AlignedData, this.box);
    this.endGestures = gestures(this.plot, span, () => document.activeElement === this.box || this.figure.classList.contains("full"));
    this.plot.over.append(this.readout);
    this.refresh();
  }

  private size(): [number, number] {
    return [Math.max(60, this.box.clientWidth), Math.max(50, this.box.clientHeight)];
  }

  private resize(): void {
    const [width, height] = this.size();
    if (!this.plot || (this.plot.width === width && this.plot.height === height)) return;
    this.plot.setSize({ width, height });
    this.point();
  }

  /** Draws at the next chance: several changes of a moment cost one drawing. */
  private ask(): void {
    this.asked ||= requestAnimationFrame(() => {
      this.asked = 0;
      this.refresh();
    });
  }

  /** Draws what the source has of the span. */
  refresh(): void {
    const plot = this.plot;
    if (!plot) return;
    const [min, max] = this.setup.span.range();
    plot.batch(() => {
      plot.setData(this.setup.source(min, max), false);
      plot.setScale("x", { min, max });
    });
    this.point();
  }

  /** The place of the value of a curve nearest to x; `null` when there is none near. */
  private nearest(curve: number, x: number): number | null {
    const plot = this.plot!, xs = plot.data[0]!, ys = plot.data[curve + 1]!;
    const start = plot.valToIdx(x), reach = Math.abs(plot.posToVal(NEAR_PX, "x") - plot.posToVal(0, "x"));
    let best: number | null = null;
    for (const step of [1, -1]) {
      for (let k = start; k >= 0 && k < xs.length; k += step) {
        // A log axis has no one reach: the next sample on either side will do.
        if (!this.setup.spec.logX && Math.abs(xs[k]! - x) > reach && k !== start) break;
        if (ys[k] === null || ys[k] === undefined) continue;
        if (best === null || Math.abs(xs[k]! - x) < Math.abs(xs[best]! - x)) best = k;
        break;
      }
    }
    return best;
  }

  /** Moves the cursor to where the span has it, and reads the curves there. */
  private point(): void {
    const plot = this.plot, x = this.setup.span.cursor, { spec } = this.setup;
    if (!plot || !plot.data[0]!.length) return;
    const [low, high] = this.setup.span.range();
    if (x === null || x < low || x > high) {
      this.readout.hidden = true;
      plot.setCursor({ left: -10, top: -10 }, false);
      return;
    }
    const left = plot.valToPos(x, "x");
    plot.setCursor({ left, top: 0 }, false);
    const rows = spec.curves.flatMap((curve, i) => {
      if (curve.edge || this.isOff(i)) return [];
      const at = this.nearest(i, x);
      if (at === null) return [];
      const row = element("div", "");
      row.style.setProperty("--role", `var(--${curve.role})`);
      row.append(element("i", ""), element("span", "", curve.label), element("b", "", reading(plot.data[i + 1]![at]) + this.spread(i, at)));
      return [row];
    });
    const head = element("div", "at", `${moment(x)} ${this.setup.spec.across.split(", ")[1] ?? ""}`);
    this.readout.replaceChildren(head, ...rows);
    this.readout.hidden = false;
    // On the other side of the pointer, so that it never hides what is read.
    this.readout.classList.toggle("left", left > plot.over.clientWidth / 2);
  }

  /** The half width of the band about a curve, as ±. */
  private spread(curve: number, at: number): string {
    const plot = this.plot!, key = this.keyOf(this.setup.spec.curves[curve]!);
    const band = this.setup.spec.bands?.find((b) => this.setup.spec.curves[b.high]?.key === key);
    if (!band) return "";
    const [high, low] = [plot.data[band.high + 1]![at], plot.data[band.low + 1]![at]];
    return high === null || high === undefined || low === null || low === undefined ? "" : ` ±${reading((high - low) / 2)}`;
  }

  private key(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const { span } = this.setup;
    const actions: Record<string, () => void> = {
      ArrowLeft: () => (e.shiftKey ? span.pan(-0.1) : this.step(-1)),
      ArrowRight: () => (e.shiftKey ? span.pan(0.1) : this.step(1)),
      PageUp: () => span.pan(-0.9),
      PageDown: () => span.pan(0.9),
      Home: () => this.goTo(0),
      End: () => this.goTo(1),
      "+": () => span.zoom(0.7, span.cursor ?? undefined),
      "-": () => span.zoom(1 / 0.7, span.cursor ?? undefined),
      "0": () => span.follow(),
      " ": () => (span.follows ? span.pause() : span.follow()),
      f: () => this.toggleFull(),
      Escape: () => (this.figure.classList.contains("full") ? this.toggleFull() : (span.point(null), span.follow())),
    };
    const action = actions[e.key];
    if (!action) return;
    e.preventDefault();
    e.stopPropagation();
    action();
  }

  private goTo(end: 0 | 1): void {
    const { span } = this.setup, [low, high] = span.range(), whole = span.whole();
    span.set(end ? [whole[1] - (high - low), whole[1]] : [whole[0], whole[0] + (high - low)]);
  }

  /** Moves the cursor to the next sample and says what is there. */
  private step(direction: 1 | -1): void {
    const { span, spec } = this.setup, plot = this.plot!;
    const xs = plot.data[0]!, [low, high] = span.range();
    if (!xs.length) return;
    span.pause();
    const from = span.cursor === null ? plot.valToIdx((low + high) / 2) : plot.valToIdx(span.cursor);
    // Not every sample: as far as the eye can tell apart.
    const least = Math.abs(plot.posToVal(2, "x") - plot.posToVal(0, "x"));
    let k = from + direction;
    while (!spec.logX && xs[k] !== undefined && Math.abs(xs[k]! - (span.cursor ?? xs[from]!)) < least) k += direction;
    const x = xs[Math.min(Math.max(k, 0), xs.length - 1)]!;
    if (x < low) span.pan(-0.2);
    if (x > high) span.pan(0.2);
    span.point(x);
    this.spoken.textContent = [...this.readout.children].map((row) => [...row.children].map((c) => c.textContent).join(" ") || row.textContent).join(", ");
  }

  toggleFull(): void {
    const { words, spec } = this.setup, full = this.figure.classList.toggle("full");
    const button = this.figure.querySelector<HTMLButtonElement>("[data-tool=full]")!;
    button.title = full ? words.leave : words.full;
    button.setAttribute("aria-label", `${button.title}: ${spec.title}`);
    button.setAttribute("aria-pressed", String(full));
    // The whole screen where the browser allows it; the whole window everywhere.
    if (full) void this.figure.requestFullscreen?.().catch(() => undefined);
    else if (document.fullscreenElement === this.figure) void document.exitFullscreen();
    this.box.focus();
  }

  private shown = (curve: number): boolean => !this.isOff(curve);

  private async savePicture(): Promise<void> {
    const { spec, theme } = this.setup;
    const made = await picture(spec, this.plot!, theme, this.shown);
    if (made) save(`${fileName(spec.title)}.png`, made);
  }

  private saveTable(): void {
    const { spec } = this.setup;
    save(`${fileName(spec.title)}.csv`, new Blob([table(spec, this.plot!, this.shown)], { type: "text/csv" }));
  }

  close(): void {
    for (const end of this.ends) end();
    cancelAnimationFrame(this.asked);
    this.endGestures();
    this.plot?.destroy();
    this.plot = null;
    this.figure.remove();
  }
}
