// The drawing itself: uPlot with axes whose text is readable at any width, bands, rules and marks.

import uPlot from "uplot";
import { decades, isDecade, powers, roomy, short } from "./numbers";
import type { Spec, Theme } from "./spec";

// uPlot scales whole pixels only.
const FONT = "13px system-ui, -apple-system, 'Segoe UI', Roboto, Helvetica, Arial, sans-serif";
const LABEL_FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, Helvetica, Arial, sans-serif";
const CROSS = 3.2;

/** The colour with an opacity of 0 to 1. */
export const faded = (colour: string, opacity: number): string => colour + Math.round(opacity * 255).toString(16).padStart(2, "0");

const nothing = () => null;
/** The pointer is looked after elsewhere: fingers, wheel and keys are more than uPlot knows. */
const UNBOUND: uPlot.Cursor.Bind = { mousedown: nothing, mouseup: nothing, click: nothing, dblclick: nothing, mousemove: nothing, mouseleave: nothing, mouseenter: nothing };

export function options(spec: Spec, theme: Theme, width: number, height: number, isOff: (curve: number) => boolean): uPlot.Options {
  const axis = (log: boolean | undefined, scale: "x" | "y"): uPlot.Axis => ({
    stroke: () => theme.colour("muted"),
    // On a log scale only the decades get a line.
    grid: { stroke: () => theme.colour("grid"), width: 1, ...(log ? { filter: (_: uPlot, splits: number[]) => splits.map((v) => (isDecade(v) ? v : null)) } : {}) },
    ticks: { show: false },
    font: FONT,
    gap: 4,
    values: (u, splits) => (log ? powers(splits, decadesApart(u, scale)) : splits.map((v) => (v === null ? "" : short(v)))),
  });
  const isWhole = (u: uPlot): boolean => !!spec.whole && u.scales["x"]!.min! <= spec.whole.x[0] && u.scales["x"]!.max! >= spec.whole.x[1];
  const y = (u: uPlot, low: number, high: number): [number, number] => (isWhole(u) ? spec.whole!.y : spec.logY ? decades(low, high, spec.leastRange ?? [0.1, 10]) : roomy(low, high, spec.leastSpan ?? 1e-6));
  return {
    width,
    height,
    legend: { show: false },
    cursor: { x: true, y: false, bind: UNBOUND, drag: { x: false, y: false }, points: { size: 7 } },
    padding: [6, 14, 0, 0],
    scales: {
      x: { time: false, auto: false, ...(spec.logX ? { distr: 3 as const } : {}) },
      y: { ...(spec.logY ? { distr: 3 as const } : {}), range: spec.y ?? y } as uPlot.Scale,
    },
    axes: [
      { ...axis(spec.logX, "x"), size: 22, space: 60, ...(isShort(spec) ? {} : { label: spec.across, labelSize: 16, labelGap: 0, labelFont: LABEL_FONT }) },
      { ...axis(spec.logY, "y"), size: 48, space: 26 },
    ],
    series: [{}, ...spec.curves.map((curve, i): uPlot.Series => ({
      show: !isOff(i),
      stroke: () => theme.colour(curve.role),
      width: curve.edge || curve.points ? 0 : curve.width ?? 1.8,
      ...(curve.dash ? { dash: curve.dash === true ? [6, 4] : curve.dash } : {}),
      points: curve.points === "dot" ? { show: true, size: 4.5, width: 0, fill: () => theme.colour(curve.role) } : { show: false },
      ...(curve.points || curve.edge ? { paths: () => null } : {}),
      spanGaps: false,
    }))],
    bands: (spec.bands ?? []).map((band) => ({ series: [band.high + 1, band.low + 1] as [number, number], fill: () => faded(theme.colour(band.role), 0.17) })),
    hooks: { draw: [(u) => drawCrosses(u, spec), (u) => drawRules(u, spec, theme), (u) => drawAcross(u, spec, theme)] },
  };
}

/** Room for a number on a log axis, CSS pixels. */
const ROOM_PX = { x: 46, y: 20 };

/** How many decades apart numbers on a log axis have to be for there to be room between them. */
function decadesApart(u: uPlot, scale: "x" | "y"): number {
  const { min, max } = u.scales[scale]!, length = (scale === "x" ? u.bbox.width : u.bbox.height) / devicePixelRatio;
  const shown = Math.log10(max! / min!);
  return length > 0 && shown > 0 ? Math.max(1, Math.ceil((ROOM_PX[scale] * shown) / length)) : 1;
}

/** Whether what x is finds room in the corner beside its numbers. */
const isShort = (spec: Spec): boolean => spec.across.length <= 10;

function drawAcross(u: uPlot, spec: Spec, theme: Theme): void {
  if (!isShort(spec)) return;
  const { ctx } = u, ratio = devicePixelRatio;
  ctx.save();
  ctx.font = LABEL_FONT.replace("12px", `${11.5 * ratio}px`);
  ctx.fillStyle = theme.colour("muted");
  ctx.textAlign = "left";
  ctx.textBaseline = "top";
  ctx.fillText(spec.across, 2 * ratio, u.bbox.top + u.bbox.height + 6 * ratio);
  ctx.restore();
}

/** Points of another shape, so that their meaning does not hang on the colour. */
function drawCrosses(u: uPlot, spec: Spec): void {
  const { ctx } = u, ratio = devicePixelRatio, arm = CROSS * ratio;
  spec.curves.forEach((curve, i) => {
    const series = u.series[i + 1]!;
    if (curve.points !== "cross" || !series.show) return;
    ctx.save();
    ctx.beginPath();
    ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    ctx.clip();
    ctx.beginPath();
    const [xs, ys] = [u.data[0]!, u.data[i + 1]!];
    for (let k = 0; k < xs.length; k++) {
      const value = ys[k];
      if (value === null || value === undefined) continue;
      const x = u.valToPos(xs[k]!, "x", true), at = u.valToPos(value, "y", true);
      ctx.moveTo(x - arm, at - arm);
      ctx.lineTo(x + arm, at + arm);
      ctx.moveTo(x - arm, at + arm);
      ctx.lineTo(x + arm, at - arm);
    }
    ctx.strokeStyle = (series.stroke as () => string)();
    ctx.lineWidth = 1.6 * ratio;
    ctx.stroke();
    ctx.restore();
  });
}

function drawRules(u: uPlot, spec: Spec, theme: Theme): void {
  const { ctx } = u, ratio = devicePixelRatio;
  ctx.save();
  ctx.strokeStyle = theme.colour("muted");
  ctx.fillStyle = theme.colour("muted");
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
    halo(ctx, theme, rule.text, u.bbox.left + 5 * ratio, y + (rule.below ? 2 : -1) * ratio);
  }
  const mark = spec.mark?.();
  if (mark !== null && mark !== undefined) {
    ctx.strokeStyle = theme.colour("ink");
    const x = u.valToPos(mark, "x", true);
    if (x >= u.bbox.left && x <= u.bbox.left + u.bbox.width) line(x, u.bbox.top, x, u.bbox.top + u.bbox.height);
  }
  ctx.restore();
}

/** Text that stays readable over lines. */
function halo(ctx: CanvasRenderingContext2D, theme: Theme, text: string, x: number, y: number): void {
  ctx.save();
  ctx.setLineDash([]);
  ctx.lineJoin = "round";
  ctx.lineWidth = 5 * devicePixelRatio;
  ctx.strokeStyle = theme.colour("paper");
  ctx.strokeText(text, x, y);
  ctx.fillText(text, x, y);
  ctx.restore();
}
