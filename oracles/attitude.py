#!/usr/bin/env python3
"""Third-party attitude filters on recordings, scored as `northing benchmark attitude` scores ours.

usage: attitude.py PATH... --out peers.csv      (PATH: .parquet or .csv recordings, or folders of them)

Other formats: `northing convert RECORDING out.parquet` first. Columns: docs/formats.md.

Every filter gets one 9-axis stream at the rate of the gyroscope. Where each row of a recording carries all three sensors, that is
the recording as it is; otherwise accelerometer and magnetometer are interpolated linearly, which looks slightly ahead and so
favours these filters. Nothing is tuned: each has the defaults of its package, or of its package's own example.
"""

import argparse
import csv
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from attitude_filters import FILTERS, Recording, conjugate, interpolated, product

SKIP_S = 5.0  # from the first sample on, not scored: the program's default
# Column names of the two formats: time, gyroscope, accelerometer, magnetometer, reference, score flag.
PARQUET = ("t", "g{}", "a{}", "m{}", "q{}", "moving")
CSV = ("t_s", "gyro_{}_rad_s", "acc_{}_m_s2", "mag_{}_ut", "ref_q{}", "scored")


class Unusable(Exception):
    """A recording that these filters cannot be scored on."""


# ---------------------------------------------------------------- recordings


@dataclass
class Scored:
    """One stream of samples for the filters, and the references that count."""

    stream: Recording
    reference_t: np.ndarray
    reference: np.ndarray  # enu_from_body


def table(path):
    """The columns of a file, the names that its format has for them, and its metadata."""
    if path.suffix == ".parquet":
        read = pyarrow.parquet.read_table(path)
        metadata = {k.decode(): v.decode() for k, v in (read.schema.metadata or {}).items()}
        return read, PARQUET, metadata
    lines = path.read_bytes().splitlines(keepends=True)
    heads = [line for line in lines if line.startswith(b"#")]
    pairs = (head.decode().lstrip("# ").partition(":") for head in heads)
    body = pa.py_buffer(b"".join(line for line in lines if not line.startswith(b"#")))
    return pyarrow.csv.read_csv(pa.BufferReader(body)), CSV, {k.strip(): v.strip() for k, _, v in pairs}


def numbers(read, names):
    missing = [name for name in names if name not in read.column_names]
    if missing:
        raise Unusable(f"no columns {', '.join(missing)}")
    columns = [np.asarray(read[name].cast(pa.float64()).fill_null(np.nan)) for name in names]
    return np.stack(columns, axis=1)


def load(path):
    read, (time, gyro, acc, mag, reference, scored), metadata = table(path)
    if metadata.get("world_frame", "enu").lower() != "enu":
        raise Unusable(f"world frame {metadata['world_frame']}; expected enu")
    t = numbers(read, [time])[:, 0]
    streams = [numbers(read, [name.format(axis) for axis in "xyz"]) for name in (gyro, acc, mag)]
    q = numbers(read, [reference.format(part) for part in "wxyz"])
    counts = numbers(read, [scored])[:, 0] != 0 if scored in read.column_names else True
    counts = counts & np.isfinite(q).all(1) & (t - t[0] >= SKIP_S)
    if not counts.any():
        raise Unusable("no reference that counts")
    present = [np.isfinite(stream).all(1) for stream in streams]
    if not all(one.any() for one in present):
        raise Unusable("gyroscope, accelerometer or magnetometer without a sample")
    rate_hz = 1 / np.median(np.diff(t[present[0]]))
    if all(one.all() for one in present):
        grid = t
    else:
        first, last = max(t[one][0] for one in present), min(t[one][-1] for one in present)
        grid = np.arange(first, last, 1 / rate_hz)
        resample = lambda one, s: np.stack([np.interp(grid, t[one], s[one, i]) for i in range(3)], axis=1)
        streams = [resample(one, stream) for one, stream in zip(present, streams)]
    unit = q[counts] / np.linalg.norm(q[counts], axis=1, keepdims=True)
    stream = Recording(grid, rate_hz, *map(np.ascontiguousarray, streams))
    return Scored(stream, t[counts], unit)


# ---------------------------------------------------------------- metric of the BROAD benchmark


def errors_deg(estimates, references):
    """RMS of total, heading and inclination error; e = q_est conj(q_ref), nothing is aligned."""
    w, x, y, z = np.abs(product(estimates, conjugate(references))).T
    parts = [np.arctan2(np.sqrt(x**2 + y**2 + z**2), w), np.arctan2(z, w), np.arctan2(np.hypot(x, y), np.hypot(w, z))]
    return [float(np.degrees(np.sqrt(np.mean((2 * part) ** 2)))) for part in parts]


def score(path, names):
    """Rows (estimator, three errors) of one recording, or the reason why there are none."""
    try:
        scored = load(path)
    except (Unusable, pa.ArrowException, OSError) as error:
        return str(error)
    rows, t = [], scored.stream.t
    # The streams may begin later and end earlier than the reference.
    inside = (scored.reference_t >= t[0]) & (scored.reference_t <= t[-1])
    for name in names:
        at = interpolated(scored.reference_t, t, FILTERS[name](scored.stream))
        if not np.isfinite(at[inside]).all():
            print(f"{path}: {name} gave estimates that are not finite; no row", file=sys.stderr)
            continue
        rows.append((name, *errors_deg(at[inside], scored.reference[inside])))
    return rows


# ---------------------------------------------------------------- program


def recordings(paths):
    """Files as they are named; in folders all that `northing` would take."""
    for path in paths:
        if path.is_dir():
            files = sorted(p for p in path.rglob("*") if p.suffix in (".parquet", ".csv"))
            yield from (p for p in files if not p.name.startswith((".", "calib_")))
        elif path.is_file():
            yield path
        else:
            sys.exit(f"attitude.py: {path}: no such file or folder")


def names_of(files):
    """A name for each recording, with its folder where another has the same."""
    stems = sorted(path.stem for path in files)
    alone = {stem for stem, group in groupby(stems) if len(list(group)) == 1}
    return [p.stem if p.stem in alone else f"{p.absolute().parent.name}/{p.stem}" for p in files]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("paths", metavar="PATH", type=Path, nargs="+", help="recordings, or folders of them")
    parser.add_argument("--out", type=Path, required=True, help="the CSV file to write")
    parser.add_argument("--estimators", default=",".join(FILTERS), help="separated by commas; default: all")
    parser.add_argument("--jobs", type=int, default=1, help="recordings at a time")
    arguments = parser.parse_args()
    names = arguments.estimators.split(",")
    unknown = [name for name in names if name not in FILTERS]
    if unknown:
        parser.error(f"unknown estimator {unknown[0]}; expected some of {', '.join(FILTERS)}")
    files = list(recordings(arguments.paths))
    with ProcessPoolExecutor(arguments.jobs) as pool, arguments.out.open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(["recording", "estimator", "total_deg", "heading_deg", "inclination_deg"])
        results = pool.map(partial(score, names=names), files)
        for path, name, rows in zip(files, names_of(files), results):
            if isinstance(rows, str):
                print(f"{path}: left out: {rows}", file=sys.stderr)
                continue
            writer.writerows([name, estimator, *(f"{e:.6f}" for e in errors)] for estimator, *errors in rows)
            out.flush()
            print(f"{name}: {len(rows)} filters", file=sys.stderr)


if __name__ == "__main__":
    main()
