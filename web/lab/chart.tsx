// A chart on the lab page: the instrument that reports use, too, in the page's colours and language.

import { useEffect, useLayoutEffect, useMemo, useRef } from "preact/hooks";
import { Bar } from "../instrument/bar";
import { Instrument } from "../instrument/instrument";
import { Span } from "../instrument/span";
import type { Data, Source, Spec } from "../instrument/spec";
import { instrumentWords } from "../words/instrument";
import { language } from "../words/language";
import { theme } from "./theme";

export type { Data, Rule, Source, Spec } from "../instrument/spec";

export const columns = (of: (number | null)[][]): Data => of as unknown as Data;

/** A chart that fills its box. The source is asked when it draws: all the time when `live`, otherwise when it changes. */
export function Chart({ spec, source, span, live }: { spec: Spec; source: Source; span: Span; live?: boolean }) {
  const box = useRef<HTMLDivElement>(null);
  const made = useRef<Instrument | null>(null);
  const current = useRef(source);
  const spoken = language();
  // Source and instrument change together, before any timer of the old instrument can ask the new source for curves it has not.
  useLayoutEffect(() => {
    current.current = source;
  });
  useLayoutEffect(() => {
    made.current = new Instrument({ spec, span, theme, words: instrumentWords(), source: (a, b) => current.current(a, b), ...(live ? { live } : {}) });
    box.current!.append(made.current.figure);
    made.current.refresh();
    return () => {
      made.current?.close();
      made.current = null;
    };
  }, [spec, span, live, spoken]);
  useEffect(() => {
    if (!live) made.current?.refresh();
  }, [source, live]);
  return <div class="chart-box" ref={box} />;
}

/** A chart of columns that do not grow, over a span of its own. */
export function Still({ spec, data }: { spec: Spec; data: Data }) {
  const span = useMemo(() => {
    const x = data[0] as ArrayLike<number>;
    return new Span(() => (x.length ? [x[0]!, x[x.length - 1]!] : null), null, spec.logX);
  }, [data, spec]);
  return <Chart spec={spec} span={span} source={() => data} />;
}

/** Pause, width, and the way back over the whole session, for the charts that share a span. */
export function SpanBar({ span, widths }: { span: Span; widths: number[] }) {
  const box = useRef<HTMLDivElement>(null);
  const spoken = language();
  useEffect(() => {
    const bar = new Bar(span, widths, instrumentWords());
    box.current!.append(bar.element);
    return () => bar.close();
  }, [span, widths.join(), spoken]);
  return <div ref={box} />;
}
