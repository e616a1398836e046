// What a chart is made of: curves with names and colours, bands, horizontal rules, axes with units.

import type uPlot from "uplot";

/** Colours by role, in whatever way the page keeps them. */
export interface Theme {
  colour(role: string): string;
  /** Calls when light changes to dark or back. */
  onChange(listener: () => void): () => void;
}

/** One column of the data. */
export interface Curve {
  label: string;
  /** Which colour; one role has one meaning everywhere. */
  role: string;
  dash?: number[] | boolean;
  width?: number;
  /** Points in place of a line. */
  points?: "dot" | "cross";
  /** Not drawn itself: an edge of a band. It follows the curve of this index, if there is one. */
  edge?: boolean;
  /** What is switched together in the legend; by default the label. */
  key?: string;
  /** Not switched, not in the legend. */
  silent?: boolean;
  /** Off until somebody switches it on. */
  off?: boolean;
}

export interface Band {
  high: number;
  low: number;
  role: string;
}

/** A horizontal line with a name. */
export interface Rule {
  value: number;
  text: string;
  /** The name stands below the line instead of above. */
  below?: boolean;
}

export interface Spec {
  /** What tells this chart from others, for the switches that somebody has set. */
  id: string;
  title: string;
  unit: string;
  /** The quantity on x with its unit, such as `time, s`. */
  across: string;
  curves: Curve[];
  bands?: Band[];
  rules?: () => Rule[];
  logX?: boolean;
  logY?: boolean;
  /** Fixed range of y; otherwise the data with some room, at least `leastSpan` wide. */
  y?: [number, number];
  leastSpan?: number;
  /** On a log axis at least this range is shown. */
  leastRange?: [number, number];
  /** While everything of x is shown, y is this range: it may leave out a peak that flattens all else. */
  whole?: { x: [number, number]; y: [number, number] };
  /** Marks a place on x. */
  mark?: () => number | null;
  /** A sentence beside the title, such as why there is nothing to judge. */
  note?: string;
}

export type Data = uPlot.AlignedData;
/** The columns of a range of x; the first is x. */
export type Source = (from: number, to: number) => Data;

/** What the tools of a chart are called, and the sentences of its keyboard. */
export interface Words {
  values: string;
  picture: string;
  table: string;
  full: string;
  leave: string;
  whole: string;
  keys: string;
}
