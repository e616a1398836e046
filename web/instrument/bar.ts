// The bar above charts that share a span: pause and go on, how much is shown, and a slider over everything there is.

import { moment } from "./numbers";
import type { Span } from "./span";

const LOOK_MS = 250;

/** What the bar says. */
export interface BarWords {
  pause: string;
  goOn: string;
  shown: string;
  whole: string;
  seconds: string;
  minutes: string;
  everything: string;
  zoomIn: string;
  zoomOut: string;
}

const widthText = (width: number, words: BarWords): string => (width < 60 ? `${width} ${words.seconds}` : `${width / 60} ${words.minutes}`);

export class Bar {
  readonly element = document.createElement("div");
  private readonly hold = document.createElement("button");
  private readonly width = document.createElement("select");
  private readonly slider = document.createElement("input");
  private readonly time = document.createElement("output");
  private readonly ends: (() => void)[] = [];

  constructor(private readonly span: Span, widths: number[], private readonly words: BarWords) {
    this.element.className = "span-bar";
    this.hold.type = "button";
    this.hold.className = "hold";
    this.hold.addEventListener("click", () => (span.follows ? span.pause() : span.follow()));
    for (const width of [...widths, null]) {
      const option = new Option(width === null ? words.everything : widthText(width, words), width === null ? "" : String(width));
      this.width.append(option);
    }
    this.width.setAttribute("aria-label", words.shown);
    this.width.addEventListener("change", () => span.follow(this.width.value === "" ? null : Number(this.width.value)));
    Object.assign(this.slider, { type: "range", step: "any" });
    this.slider.setAttribute("aria-label", words.whole);
    this.slider.addEventListener("input", () => this.scrub(Number(this.slider.value)));
    this.element.append(this.hold, this.width, this.slider, this.time, ...this.zooms());
    this.ends.push(span.onChange(() => this.show()));
    const timer = window.setInterval(() => document.visibilityState === "visible" && this.show(), LOOK_MS);
    this.ends.push(() => window.clearInterval(timer));
    this.show();
  }

  private zooms(): HTMLElement[] {
    const zooms: [string, string, number][] = [["−", this.words.zoomOut, 1.6], ["+", this.words.zoomIn, 1 / 1.6]];
    return zooms.map(([text, name, factor]) => {
      const button = document.createElement("button");
      Object.assign(button, { type: "button", className: "zoom", textContent: text, title: name });
      button.setAttribute("aria-label", name);
      button.addEventListener("click", () => this.span.zoom(factor, this.span.cursor ?? undefined));
      return button;
    });
  }

  /** The slider stands for the end of what is shown. */
  private scrub(end: number): void {
    const [low, high] = this.span.range(), [first, last] = this.span.whole();
    if (high - low >= last - first) return this.span.point(end);
    this.span.set([end - (high - low), end]);
    this.span.point(end);
  }

  private show(): void {
    const { span, words } = this, [first, last] = span.whole(), [low, high] = span.range();
    this.hold.textContent = span.follows ? words.pause : words.goOn;
    this.hold.setAttribute("aria-pressed", String(!span.follows));
    this.width.value = span.width === null ? "" : String(span.width);
    const wide = high - low >= last - first;
    [this.slider.min, this.slider.max] = [String(first), String(Math.max(last, first + 1e-3))];
    this.slider.value = String(span.moment ?? (wide ? last : high));
    this.time.textContent = span.moment !== null ? `${moment(span.moment)} s` : `${moment(Math.max(first, low)).split(".")[0]}–${moment(high).split(".")[0]} s`;
  }

  close(): void {
    for (const end of this.ends) end();
    this.element.remove();
  }
}
