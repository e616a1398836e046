// The range of x that charts share: what zoom, pan, pause and the cursor of one do, all of them do.

export type Range = [number, number];

/** Where the data begin and end now; `null` while there are none. */
export type Extent = () => Range | null;

/** Zooming in further than this many units of x shows nothing new. */
const NARROWEST = 1e-3;

export class Span {
  /** The range that is held; `null` while the newest is followed. */
  private held: Range | null = null;
  private listeners = new Set<(what: "range" | "cursor") => void>();
  private pointed: number | null = null;

  /**
   * @param extent of the data
   * @param width of what is followed, in units of x; `null` shows everything from the beginning
   * @param log whether x is logarithmic: zoom and pan then multiply
   */
  constructor(private readonly extent: Extent, private followed: number | null = null, private readonly log = false) {}

  /** What is shown. */
  range(): Range {
    if (this.held) return this.held;
    const [first, last] = this.extent() ?? [0, 1];
    if (this.followed === null) return last > first ? [first, last] : [first, first + 1];
    // A session that is shorter fills what is shown from its beginning.
    return last - first < this.followed ? [first, first + this.followed] : [last - this.followed, last];
  }

  /** Everything there is. */
  whole(): Range {
    return this.extent() ?? [0, 1];
  }

  get follows(): boolean {
    return this.held === null;
  }

  /** The width that is followed; `null` for everything. */
  get width(): number | null {
    return this.followed;
  }

  get cursor(): number | null {
    return this.pointed;
  }

  /** The moment that a scene beside the charts shows: that of the cursor, or where a held range ends; `null` while the newest is followed. */
  get moment(): number | null {
    if (this.pointed !== null && (this.held || this.followed === null)) return this.pointed;
    return this.held ? this.held[1] : null;
  }

  onChange(listener: (what: "range" | "cursor") => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  private tell(what: "range" | "cursor"): void {
    for (const listener of this.listeners) listener(what);
  }

  point(x: number | null): void {
    if (this.pointed === x) return;
    this.pointed = x;
    this.tell("cursor");
  }

  /** Holds what is shown now. */
  pause(): void {
    if (this.follows) this.set(this.range());
  }

  /** Follows the newest, as wide as before or as told. */
  follow(width: number | null = this.followed): void {
    this.held = null;
    this.followed = width;
    this.tell("range");
  }

  /** Shows a range, kept within the data. */
  set([low, high]: Range): void {
    if (!(high > low)) return;
    const [first, last] = this.whole();
    const [a, b] = [this.to(low), this.to(high)];
    const size = Math.max(b - a, this.log ? 1e-2 : NARROWEST);
    const room = [this.to(first), this.to(last)] as const;
    // A range as wide as the data may lie anywhere that shows them; a narrower one stays inside.
    const least = Math.min(room[0], room[1] - size), most = Math.max(room[1], room[0] + size) - size;
    const from = Math.min(Math.max(a, least), most);
    this.held = [this.from(from), this.from(from + size)];
    this.tell("range");
  }

  /** Zooms by a factor (below 1: in) about a place on x. */
  zoom(factor: number, about?: number): void {
    const [low, high] = this.range().map((v) => this.to(v)) as Range;
    const centre = about === undefined ? (low + high) / 2 : this.to(about);
    const [first, last] = this.whole().map((v) => this.to(v)) as Range;
    // Out beyond everything is the same as everything.
    const size = Math.min((high - low) * factor, Math.max(last - first, high - low));
    const share = (centre - low) / (high - low);
    this.set([this.from(centre - size * share), this.from(centre + size * (1 - share))]);
  }

  /** Moves by a share of what is shown. */
  pan(share: number): void {
    const [low, high] = this.range().map((v) => this.to(v)) as Range;
    const step = (high - low) * share;
    this.set([this.from(low + step), this.from(high + step)]);
  }

  private to(v: number): number {
    return this.log ? Math.log10(Math.max(v, 1e-300)) : v;
  }

  private from(v: number): number {
    return this.log ? 10 ** v : v;
  }
}
