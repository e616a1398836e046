// Mouse, fingers and wheel over a chart: point, zoom, pan.

import type uPlot from "uplot";
import type { Span } from "./span";

/** Shorter moves are a click or a tap, CSS pixels. */
const STILL_PX = 5;
const WHEEL = 1.0018;
const DOUBLE_TAP_MS = 320;

/** What a plot's pointers do; returns how to end it. */
export function gestures(u: uPlot, span: Span, wheelIsFree: () => boolean): () => void {
  const over = u.over, down = new Map<number, { x: number; from: number; touch: boolean }>();
  let mode: "none" | "select" | "pan" | "pinch" = "none";
  let last = 0, apart = 0, tapped = 0;
  const at = (x: number): number => u.posToVal(x, "x");
  const place = (e: PointerEvent | WheelEvent): number => e.clientX - over.getBoundingClientRect().left;
  const select = (a: number, b: number): void => u.setSelect({ left: Math.min(a, b), top: 0, width: Math.abs(b - a), height: over.clientHeight }, false);

  const pressed = (e: PointerEvent): void => {
    if (e.button > 1) return;
    over.setPointerCapture(e.pointerId);
    const x = place(e), touch = e.pointerType !== "mouse";
    down.set(e.pointerId, { x, from: x, touch });
    last = x;
    if (down.size === 2) {
      mode = "pinch";
      apart = spread();
    } else mode = "none";
    if (e.button === 1) e.preventDefault();
  };
  const spread = (): number => {
    const [a, b] = [...down.values()];
    return Math.max(Math.abs(a!.x - b!.x), 1);
  };
  const moved = (e: PointerEvent): void => {
    const x = place(e), held = down.get(e.pointerId);
    if (!held) {
      if (e.pointerType === "mouse") span.point(at(Math.min(Math.max(x, 0), over.clientWidth)));
      return;
    }
    held.x = x;
    if (mode === "pinch") return pinch();
    if (mode === "none" && Math.abs(x - held.from) > STILL_PX) {
      mode = held.touch || e.shiftKey || e.buttons === 4 ? "pan" : "select";
      if (mode === "pan") span.pause();
    }
    if (mode === "select") select(held.from, x);
    if (mode === "pan") span.pan((last - x) / over.clientWidth);
    last = x;
  };
  const pinch = (): void => {
    if (down.size < 2) return;
    const now = spread(), [a, b] = [...down.values()];
    span.zoom(apart / now, at((a!.x + b!.x) / 2));
    apart = now;
  };
  const released = (e: PointerEvent): void => {
    const held = down.get(e.pointerId);
    down.delete(e.pointerId);
    if (!held) return;
    if (mode === "select") {
      const [a, b] = [at(Math.min(held.from, held.x)), at(Math.max(held.from, held.x))];
      select(0, 0);
      if (e.type === "pointerup") span.set([a, b]);
    } else if (mode === "none" && e.type === "pointerup") tap(e, held.x);
    if (!down.size) mode = "none";
  };
  const tap = (e: PointerEvent, x: number): void => {
    const now = performance.now();
    if (now - tapped < DOUBLE_TAP_MS) {
      tapped = 0;
      span.follow();
      return;
    }
    tapped = now;
    if (e.pointerType !== "mouse") span.point(at(x));
  };
  const left = (e: PointerEvent): void => {
    if (e.pointerType === "mouse" && !down.size) span.point(null);
  };
  const wheel = (e: WheelEvent): void => {
    if (!(e.ctrlKey || e.metaKey || e.shiftKey || wheelIsFree())) return;
    e.preventDefault();
    if (Math.abs(e.deltaX) > Math.abs(e.deltaY) || e.shiftKey) span.pan((e.deltaX || e.deltaY) / 1500);
    else span.zoom(WHEEL ** e.deltaY, at(place(e)));
  };
  const listeners: [string, (e: never) => void][] = [["pointerdown", pressed], ["pointermove", moved], ["pointerup", released], ["pointercancel", released], ["pointerleave", left], ["wheel", wheel]];
  for (const [type, listener] of listeners) over.addEventListener(type, listener as EventListener, type === "wheel" ? { passive: false } : undefined);
  return () => {
    for (const [type, listener] of listeners) over.removeEventListener(type, listener as EventListener);
  };
}
