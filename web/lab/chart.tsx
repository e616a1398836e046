// One chart: uPlot with the page's colours, fixed axes while data streams, and a legend above it.

import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { colour, faded, onTheme } from "./theme";
import { power } from "./words";

/** One line of a chart. */
export interface Line {
  role: string;
  dash?: boolean;
  width?: number;
  points?: boolean;
  /** Not drawn itself: only the edge of a band. */
  edge?: boolean;
}

/** A horizontal line with a name. */
export interface Rule {
  value: number;
  text: string;
  /** The name stands below the line instead of above. */
  below?: boolean;
}

export interface ChartSpec {
  title: string;
  unit: string;
  legend: { text: string; role: string; dash?: boolean; dot?: boolean }[];
  lines: Line[];
  bands?: { high: number; low: number; role: string }[];
  rules?: () => Rule[];
  logY?: boolean;
  logX?: boolean;
  /** Fixed range of y; otherwise the data with some room, at least `leastSpan` wide. */
  y?: [number, number];
  leastSpan?: number;
  /** Fixed range of x. */
  x?: [number, number];
  xUnit?: string;
  /** Marks a place on x. */
  mark?: () => number | null;
}

const FONT = "12.5px system-ui, -apple-system, 'Segoe UI', Roboto, Helvetica, Arial, sans-serif";

/** A range with round ends, so that axes jump seldom and never tremble. */
function roomy(low: number, high: number, least: number): [number, number] {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [-least / 2, least / 2];
  const span = Math.max(high - low, least);
  const step = 10 ** Math.floor(Math.log10(span)) / 2;
  const middle = (low + high) / 2;
  return [Math.floor((middle - span * 0.54) / step) * step, Math.ceil((middle + span * 0.54) / step) * step];
}

const isDecade = (v: number): boolean => Math.abs(Math.log10(v) - Math.round(Math.log10(v))) < 1e-6;

function short(v: number): string {
  const size = Math.abs(v);
  if (size !== 0 && (size < 0.001 || size >= 1e5)) return power(v);
  return String(+v.toPrecision(4)).replace("-", "−");
}

function options(spec: ChartSpec, width: number, height: number): uPlot.Options {
  const axis = (log: boolean | undefined): uPlot.Axis => ({
    stroke: () => colour("muted"),
    // On a log scale only the decades get a line.
    grid: { stroke: () => colour("grid"), width: 1, ...(log ? { filter: (_: uPlot, splits: number[]) => splits.map((v) => (isDecade(v) ? v : null)) } : {}) },
    ticks: { show: false },
    font: FONT,
    gap: 4,
    values: (_, splits) => splits.map((v) => (v === null || (log && !isDecade(v)) ? "" : short(v))),
  });
  return {
    width,
    height,
    legend: { show: false },
    cursor: { show: false },
    padding: [6, 14, 0, 0],
    scales: {
      x: { time: false, ...(spec.logX ? { distr: 3 as const } : {}), ...(spec.x ? { range: spec.x } : {}) },
      y: {
        ...(spec.logY ? { distr: 3 as const } : {}),
        range: spec.y ?? (spec.logY ? undefined : (_u: uPlot, low: number, high: number): [number, number] => roomy(low, high, spec.leastSpan ?? 1e-6)),
      } as uPlot.Scale,
    },
    axes: [{ ...axis(spec.logX), size: 24, space: 60 }, { ...axis(spec.logY), size: 46, space: 26 }],
    series: [
      {},
      ...spec.lines.map((line): uPlot.Series => ({
        stroke: () => colour(line.role),
        width: line.edge || line.points ? 0 : line.width ?? 1.8,
        ...(line.dash ? { dash: [6, 4] } : {}),
        points: line.points ? { show: true, size: 4.5, width: 0, fill: () => colour(line.role) } : { show: false },
        ...(line.points ? { paths: () => null } : {}),
        spanGaps: false,
      })),
    ],
    bands: (spec.bands ?? []).map((band) => ({ series: [band.high, band.low] as [number, number], fill: () => faded(band.role, 0.17) })),
    hooks: { draw: [(u) => drawRules(u, spec)] },
  };
}

function drawRules(u: uPlot, spec: ChartSpec): void {
  const { ctx } = u, ratio = devicePixelRatio;
  ctx.save();
  ctx.strokeStyle = colour("muted");
  ctx.fillStyle = colour("muted");
  ctx.font = `${12 * ratio}px system-ui, sans-serif`;
  ctx.lineWidth = 1.3 * ratio;
  ctx.setLineDash([3 * ratio, 4 * ratio]);
  const line = (x0: number, y0: number, x1: number, y1: number): void => {
    ctx.beginPath();
    ctx.moveTo(x0, y0);
    ctx.lineTo(x1, y1);
    ctx.stroke();
  };
  for (const rule of spec.rules?.() ?? []) {
    const y = u.valToPos(rule.value, "y", true);
    if (y < u.bbox.top || y > u.bbox.top + u.bbox.height) continue;
    line(u.bbox.left, y, u.bbox.left + u.bbox.width, y);
    ctx.textAlign = "left";
    ctx.textBaseline = rule.below ? "top" : "bottom";
    halo(ctx, rule.text, u.bbox.left + 5 * ratio, y + (rule.below ? 2 : -1) * ratio);
  }
  const mark = spec.mark?.();
  if (mark !== null && mark !== undefined) {
    ctx.strokeStyle = colour("ink");
    const x = u.valToPos(mark, "x", true);
    line(x, u.bbox.top, x, u.bbox.top + u.bbox.height);
  }
  ctx.restore();
}

/** Text that stays readable over lines. */
function halo(ctx: CanvasRenderingContext2D, text: string, x: number, y: number): void {
  ctx.save();
  ctx.setLineDash([]);
  ctx.lineJoin = "round";
  ctx.lineWidth = 5 * devicePixelRatio;
  ctx.strokeStyle = colour("paper");
  ctx.strokeText(text, x, y);
  ctx.fillText(text, x, y);
  ctx.restore();
}

/** A chart that fills its box. `data` is asked when it draws: at 12 Hz when `live`, otherwise when it changes. */
export function Chart({ spec, data, live }: { spec: ChartSpec; data: () => uPlot.AlignedData; live?: boolean }) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const current = useRef(data);
  current.current = data;

  useEffect(() => {
    const element = box.current!;
    const make = (): void => {
      plot.current?.destroy();
      plot.current = new uPlot(options(spec, Math.max(60, element.clientWidth), Math.max(50, element.clientHeight)), current.current(), element);
    };
    make();
    const watch = new ResizeObserver(() => plot.current?.setSize({ width: Math.max(60, element.clientWidth), height: Math.max(50, element.clientHeight) }));
    watch.observe(element);
    const stopTheme = onTheme(make);
    const timer = live ? window.setInterval(() => document.visibilityState === "visible" && plot.current?.setData(current.current()), 80) : 0;
    return () => {
      window.clearInterval(timer);
      watch.disconnect();
      stopTheme();
      plot.current?.destroy();
      plot.current = null;
    };
  }, [spec, live]);

  useEffect(() => {
    if (!live) plot.current?.setData(data());
  }, [data, live]);

  return (
    <figure class="chart">
      <figcaption>
        <b>{spec.title}</b> <span class="unit">{spec.unit}</span>
        <span class="legend">
          {spec.legend.map((l) => (
            <span key={l.text} class={`key ${l.dash ? "dashed" : ""} ${l.dot ? "dot" : ""}`} style={{ "--role": `var(--${l.role})` }}>
              {l.text}
            </span>
          ))}
        </span>
      </figcaption>
      <div class="canvas" ref={box} role="img" aria-label={`${spec.title}, ${spec.unit}`} />
    </figure>
  );
}
