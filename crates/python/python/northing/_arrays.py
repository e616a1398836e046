"""Arrays that people have, as the arrays that a run takes: checked, with the first bad row named."""

from __future__ import annotations

from datetime import datetime, timezone
from typing import Any

import numpy as np

from ._types import ArrayLike, Floats, Integers

_EXPECTED = {
    "gyr": "angular rates in rad/s",
    "acc": "specific forces in m/s^2",
    "mag": "magnetic fields in microtesla",
}


def vectors(name: str, values: ArrayLike) -> Floats:
    """Rows of three finite numbers. No copy is made of an array of float64, whatever its strides."""
    expected = f"expected {_EXPECTED[name]}, shape (N, 3)"
    try:
        rows = np.asarray(_without_mask(values))
        if rows.dtype.kind not in "fiu":
            rows = rows.astype(np.float64) if rows.dtype.kind == "O" else rows
        if rows.dtype.kind not in "fiu":
            raise TypeError
        rows = rows.astype(np.float64, copy=False)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: not an array of numbers; {expected}") from None
    if rows.ndim != 2 or rows.shape[1] != 3:
        hint = "; transpose it" if rows.ndim == 2 and rows.shape[0] == 3 else ""
        raise ValueError(f"{name}: shape {rows.shape}; {expected}{hint}")
    # All at once: row by row it would cost a tenth of a filter, and is asked where something is wrong.
    if not np.isfinite(rows).all():
        bad = ~np.isfinite(rows).all(axis=1)
        row = int(np.argmax(bad))
        more = int(bad.sum()) - 1
        others = f", and {more} more" if more else ""
        raise ValueError(
            f"{name}: row {row} is {_shown(rows[row])}, not finite{others}; leave such samples out: "
            f"a sensor may have stamps of its own (t=, acc_t=, mag_t=)"
        )
    return rows


def _without_mask(values: ArrayLike) -> Any:
    """What is masked is no number; `asarray` alone would take what stands below the mask."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.getmaskarray(values).any():
        return np.ma.filled(np.ma.asarray(values, dtype=np.float64), np.nan)
    return values


def _shown(row: Floats) -> str:
    return "(" + ", ".join(f"{x:g}" for x in row) + ")"


# Intervals of integer stamps below this are no nanoseconds: no inertial sensor has 50 000 samples a second.
_SHORTEST_NS = 20_000.0


def stamps(name: str, t: ArrayLike, rows: int) -> Integers:
    """Stamps in ns of seconds, whole nanoseconds (int64), datetime64, or datetimes (UTC without a zone); they must increase."""
    times = np.asarray(_without_mask(t))
    if times.ndim != 1 or times.shape[0] != rows:
        raise ValueError(f"{name}: shape {times.shape}; expected one stamp for each of {rows} rows")
    if times.dtype.kind == "O" and all(isinstance(date, datetime) for date in times):
        times = np.array([_utc(date) for date in times], dtype="datetime64[ns]")
    if times.dtype.kind == "M":
        if np.isnat(times).any():
            raise ValueError(f"{name}: row {int(np.argmax(np.isnat(times)))} is NaT; leave such samples out")
        time_ns = times.astype("datetime64[ns]").astype(np.int64)
    elif times.dtype.kind in "iu":
        time_ns = times.astype(np.int64)
        usual = float(np.median(np.diff(time_ns))) if rows > 1 else _SHORTEST_NS
        if 0.0 < usual < _SHORTEST_NS:
            raise ValueError(
                f"{name}: integers are nanoseconds, and these are {usual:g} apart: {1e9 / usual:g} samples a second; "
                "multiply microseconds by 1000 and milliseconds by 1000000, or give seconds as floats"
            )
    elif times.dtype.kind == "f":
        seconds = times.astype(np.float64, copy=False)
        bad = ~(np.abs(seconds) < 9e9)
        if bad.any():
            row = int(np.argmax(bad))
            raise ValueError(f"{name}: row {row} is {seconds[row]:g}; expected seconds (or int64 nanoseconds)")
        time_ns = np.rint(seconds * 1e9).astype(np.int64)
    else:
        raise ValueError(
            f"{name}: expected seconds, int64 nanoseconds, datetime64 or datetimes, not {times.dtype}"
        )
    back = np.diff(time_ns) <= 0
    if back.any():
        row = int(np.argmax(back)) + 1
        raise ValueError(
            f"{name}: row {row} is not later than the row before it ({time_ns[row]} after {time_ns[row - 1]} ns); "
            "sort the rows by time and leave repeated stamps out"
        )
    return np.ascontiguousarray(time_ns)


def _utc(date: datetime) -> Any:
    """The date without its zone, in UTC, to the nanosecond where it is one of pandas."""
    if date.tzinfo is not None:
        date = date.astimezone(timezone.utc).replace(tzinfo=None)
    to_datetime64 = getattr(date, "to_datetime64", None)
    return date if to_datetime64 is None else to_datetime64()


def stamps_at(rate: float, rows: int) -> Integers:
    """Stamps in ns of samples at a constant rate (Hz), from 0 on."""
    if not (np.isfinite(rate) and 0.0 < rate <= 1e6):
        raise ValueError(f"rate={rate!r}: expected samples a second, above 0 and up to 1e6, e.g. rate=100")
    time_ns: Integers = np.rint(np.arange(rows) * (1e9 / rate)).astype(np.int64)
    return time_ns


Timed = tuple[Integers, Floats]


def gyroscope(gyr: ArrayLike, rate: float | None, t: ArrayLike | None) -> Timed:
    """Stamps and rows of the gyroscope, whose time is that of sensors without stamps of their own."""
    rates = vectors("gyr", gyr)
    if len(rates) == 0:
        raise ValueError("gyr: no rows; expected angular rates in rad/s, shape (N, 3)")
    if rate is not None:
        if t is not None:
            raise ValueError("give rate= or t=, not both")
        return stamps_at(float(rate), len(rates)), rates
    if t is None:
        raise ValueError("time is missing: give rate= in Hz, or t= in seconds")
    return stamps("t", t, len(rates)), rates


def beside(name: str, values: ArrayLike | None, own_t: ArrayLike | None, time_ns: Integers) -> Timed | None:
    """Stamps and rows of a sensor beside the gyroscope, with its stamps or its own."""
    if values is None:
        if own_t is not None:
            raise ValueError(f"{name}_t: given without {name}")
        return None
    rows = vectors(name, values)
    if own_t is not None:
        return stamps(f"{name}_t", own_t, len(rows)), rows
    if len(rows) != len(time_ns):
        raise ValueError(
            f"{name}: {len(rows)} rows, but gyr has {len(time_ns)}; expected as many, or stamps of its own ({name}_t=)"
        )
    return time_ns, rows


def fixes(
    names: tuple[str, str, str], expected: str, values: ArrayLike, t: ArrayLike | None, std: ArrayLike | None
) -> Timed:
    """Stamps and rows of six: three numbers with their standard deviations, of which the third pair may be missing (NaN).

    ``names`` are those of the arguments for values, stamps and standard deviations.
    """
    name, name_t, name_std = names
    rows = _table(name, values, expected)
    if t is None:
        raise ValueError(f"{name_t} is missing: give stamps of {name} in the time of t= (of rate=: from 0 on)")
    time_ns = stamps(name_t, t, len(rows))
    if not np.isfinite(rows[:, :2]).all():
        row = int(np.argmax(~np.isfinite(rows[:, :2]).all(axis=1)))
        raise ValueError(f"{name}: row {row} is {_shown(rows[row])}, not finite; leave such rows out ({name_t}= says when others were)")
    if std is None:
        stated = np.full_like(rows, np.nan)
    else:
        given = np.asarray(_without_mask(std), dtype=np.float64)
        try:
            stated = np.broadcast_to(given, rows.shape)
        except ValueError:
            raise ValueError(
                f"{name_std}: shape {given.shape}; expected a number, three (north, east, down) or three for each of {len(rows)} rows"
            ) from None
        bad = ~(stated > 0.0) & ~np.isnan(stated)
        missing = np.isnan(stated[:, :2]).any(axis=1) & ~np.isnan(stated).all(axis=1)
        missing |= np.isnan(stated[:, 2]) & ~np.isnan(stated[:, 0]) & ~np.isnan(rows[:, 2])
        if (bad.any(axis=1) | missing).any():
            row = int(np.argmax(bad.any(axis=1) | missing))
            raise ValueError(
                f"{name_std}: row {row} is {_shown(stated[row])}; expected standard deviations above 0, or NaN in all three where "
                "none is stated"
            )
    return time_ns, np.hstack([rows, stated])


def _table(name: str, values: ArrayLike, expected: str) -> Floats:
    """Rows of three numbers, which may be NaN."""
    expected = f"expected {expected}, shape (N, 3)"
    try:
        rows = np.asarray(_without_mask(values), dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: not an array of numbers; {expected}") from None
    if rows.ndim != 2 or rows.shape[1] != 3:
        hint = "; transpose it" if rows.ndim == 2 and rows.shape[0] == 3 else ""
        raise ValueError(f"{name}: shape {rows.shape}; {expected}{hint}")
    if len(rows) == 0:
        raise ValueError(f"{name}: no rows; {expected}")
    return rows
