// A chart as a picture and as a table: exactly what is shown, with its names and units.

import type uPlot from "uplot";
import type { Spec, Theme } from "./spec";

/** Hands a file to the browser's downloads. */
export function save(name: string, content: Blob): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  window.setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** A name for a file from a title. */
export const fileName = (title: string): string => title.toLowerCase().normalize("NFKD").replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "") || "chart";

const quoted = (text: string): string => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/** Comma-separated columns of what is shown: x, then every curve that is switched on; edges of bands by their own names. */
export function table(spec: Spec, u: uPlot, shown: (curve: number) => boolean): string {
  const { min, max } = u.scales["x"]!;
  const columns = spec.curves.map((_, i) => i).filter((i) => shown(i));
  const unit = spec.unit ? ` (${spec.unit})` : "";
  const lines = [[spec.across, ...columns.map((i) => `${spec.curves[i]!.label}${unit}`)].map(quoted).join(",")];
  const x = u.data[0]!;
  for (let k = 0; k < x.length; k++) {
    if (x[k]! < min! || x[k]! > max!) continue;
    const values = columns.map((i) => u.data[i + 1]![k]);
    if (values.every((v) => v === null || v === undefined)) continue;
    lines.push([x[k]!, ...values].map((v) => (v === null || v === undefined ? "" : String(+v.toPrecision(9)))).join(","));
  }
  return `${lines.join("\n")}\n`;
}

/** The chart with title and legend as a picture, in the colours of now. */
export function picture(spec: Spec, u: uPlot, theme: Theme, shown: (curve: number) => boolean): Promise<Blob | null> {
  const ratio = devicePixelRatio, source = u.ctx.canvas;
  const head = 52 * ratio;
  const canvas = document.createElement("canvas");
  canvas.width = source.width + 16 * ratio;
  canvas.height = source.height + head + 8 * ratio;
  const ctx = canvas.getContext("2d")!;
  ctx.fillStyle = theme.colour("paper");
  ctx.fillRect(0, 0, canvas.width, canvas.height);
  ctx.drawImage(source, 8 * ratio, head);
  ctx.textBaseline = "middle";
  ctx.fillStyle = theme.colour("ink");
  ctx.font = `650 ${15 * ratio}px system-ui, sans-serif`;
  ctx.fillText(spec.title, 12 * ratio, 16 * ratio);
  const titled = ctx.measureText(spec.title).width;
  ctx.font = `${13 * ratio}px system-ui, sans-serif`;
  ctx.fillStyle = theme.colour("muted");
  ctx.fillText(spec.unit, 20 * ratio + titled, 16 * ratio);
  let x = 12 * ratio;
  const named = new Set<string>();
  spec.curves.forEach((curve, i) => {
    if (curve.edge || curve.silent || !shown(i) || named.has(curve.label)) return;
    named.add(curve.label);
    ctx.strokeStyle = theme.colour(curve.role);
    ctx.lineWidth = 3 * ratio;
    ctx.setLineDash(curve.dash ? [5 * ratio, 4 * ratio] : []);
    ctx.beginPath();
    ctx.moveTo(x, 38 * ratio);
    ctx.lineTo(x + 20 * ratio, 38 * ratio);
    ctx.stroke();
    ctx.fillStyle = theme.colour("ink");
    ctx.fillText(curve.label, x + 25 * ratio, 38 * ratio);
    x += 40 * ratio + ctx.measureText(curve.label).width;
  });
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}
