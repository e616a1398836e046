// Numbers over time, column by column: everything of a session, the older the coarser, in bounded memory.

/** So many rows are kept; when there are more, every second one of the older half goes. */
const MOST_ROWS = 24_000;
const FIRST_ROWS = 1024;

export class Table {
  private t = new Float64Array(FIRST_ROWS);
  private columns = new Map<string, Float32Array>();
  private rows = 0;

  get length(): number {
    return this.rows;
  }

  /** First and last time; `null` while it is empty. */
  extent(): [number, number] | null {
    return this.rows ? [this.t[0]!, this.t[this.rows - 1]!] : null;
  }

  /** Takes a row; columns that it does not name have no value there. Time that does not go on is left out. */
  push(t: number, values: Record<string, number | null | undefined>): void {
    if (this.rows && t <= this.t[this.rows - 1]!) return;
    if (this.rows >= MOST_ROWS) this.thin();
    if (this.rows === this.t.length) this.grow();
    this.t[this.rows] = t;
    for (const column of this.columns.values()) column[this.rows] = NaN;
    for (const name in values) {
      const value = values[name];
      if (value === null || value === undefined) continue;
      let column = this.columns.get(name);
      if (!column) this.columns.set(name, (column = new Float32Array(this.t.length).fill(NaN)));
      column[this.rows] = value;
    }
    this.rows++;
  }

  clear(): void {
    this.rows = 0;
    this.columns.clear();
  }

  private grow(): void {
    const size = this.t.length * 2;
    const longer = <T extends Float32Array | Float64Array>(old: T, made: T): T => {
      made.set(old);
      return made;
    };
    this.t = longer(this.t, new Float64Array(size));
    for (const [name, column] of this.columns) this.columns.set(name, longer(column, new Float32Array(size)));
  }

  private thin(): void {
    const half = this.rows >> 1;
    for (const column of [this.t, ...this.columns.values()]) {
      for (let k = 0; k < half / 2; k++) column[k] = column[2 * k]!;
      column.copyWithin(Math.ceil(half / 2), half, this.rows);
    }
    this.rows -= half - Math.ceil(half / 2);
  }

  private firstAfter(time: number): number {
    let low = 0, high = this.rows;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.t[middle]! < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The rows between two times, one more on either side so that lines reach the frame; at most so many, evenly picked. */
  pick(from: number, to: number, most = Infinity): number[] {
    const first = Math.max(0, this.firstAfter(from) - 1), last = Math.min(this.rows - 1, this.firstAfter(to));
    const step = Math.max(1, Math.ceil((last - first + 1) / most));
    // Counted from the beginning, so that the same rows are picked while the window moves.
    const rows: number[] = [];
    for (let k = first - (first % step); k <= last; k += step) rows.push(k);
    return rows;
  }

  /** The row nearest to a time. */
  at(time: number): number | null {
    if (!this.rows) return null;
    const k = Math.min(this.firstAfter(time), this.rows - 1);
    return k > 0 && time - this.t[k - 1]! < this.t[k]! - time ? k - 1 : k;
  }

  time(row: number): number {
    return this.t[row]!;
  }

  times(rows: number[]): number[] {
    return rows.map((k) => this.t[k]!);
  }

  has(name: string): boolean {
    return this.columns.has(name);
  }

  /** A value; `null` where there is none. */
  value(name: string, row: number): number | null {
    const v = this.columns.get(name)?.[row];
    return v === undefined || Number.isNaN(v) ? null : v;
  }

  /** A column at these rows. */
  column(name: string, rows: number[]): (number | null)[] {
    const column = this.columns.get(name);
    if (!column) return rows.map(() => null);
    return rows.map((k) => (Number.isNaN(column[k]!) ? null : column[k]!));
  }
}
