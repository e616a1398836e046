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

import imufusion
import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from ahrs.filters import EKF, Madgwick, Mahony
from vqf import VQF, offlineVQF

SKIP_S = 5.0  # from the first sample on, not scored: the program's default
START_S = 0.5  # averaged for the attitude to start from, for filters that do not start themselves
STANDARD_GRAVITY = 9.80665
# Column names of the two formats: time, gyroscope, accelerometer, magnetometer, reference, score flag.
PARQUET = ("t", "g{}", "a{}", "m{}", "q{}", "moving")
CSV = ("t_s", "gyro_{}_rad_s", "acc_{}_m_s2", "mag_{}_ut", "ref_q{}", "scored")


class Unusable(Exception):
    """A recording that these filters cannot be scored on."""


# ---------------------------------------------------------------- quaternions, w x y z, rows of arrays


def product(p, q):
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def conjugate(q):
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def interpolated(times, t, q):
    """Attitudes at `times` between attitudes `q` at `t`, on the shortest arc; not a number outside."""
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    share = (times - t[k]) / (t[k + 1] - t[k])
    step = product(conjugate(q[k]), q[k + 1])
    step = np.where(step[:, :1] < 0, -step, step)
    sine = np.linalg.norm(step[:, 1:], axis=1)
    half = np.arctan2(sine, step[:, 0])
    scale = np.where(sine > 0, np.sin(share * half) / np.where(sine > 0, sine, 1.0), 0.0)
    part = np.column_stack([np.cos(share * half), step[:, 1:] * scale[:, None]])
    inside = (times >= t[0]) & (times <= t[-1])
    return np.where(inside[:, None], product(q[k], part), np.nan)


def from_vectors(up, field):
    """`enu_from_body` from specific force at rest and magnetic field, in body axes."""
    up = up / np.linalg.norm(up)
    east = np.cross(field, up)
    east = east / np.linalg.norm(east)
    matrix = np.stack([east, np.cross(up, east), up])
    # The eigenvector of the largest eigenvalue of this matrix is the quaternion (Bar-Itzhack 2000).
    d = matrix
    k = np.array(
        [
            [d[0, 0] + d[1, 1] + d[2, 2], d[2, 1] - d[1, 2], d[0, 2] - d[2, 0], d[1, 0] - d[0, 1]],
            [d[2, 1] - d[1, 2], d[0, 0] - d[1, 1] - d[2, 2], d[0, 1] + d[1, 0], d[0, 2] + d[2, 0]],
            [d[0, 2] - d[2, 0], d[0, 1] + d[1, 0], d[1, 1] - d[0, 0] - d[2, 2], d[1, 2] + d[2, 1]],
            [d[1, 0] - d[0, 1], d[0, 2] + d[2, 0], d[1, 2] + d[2, 1], d[2, 2] - d[0, 0] - d[1, 1]],
        ]
    )
    return np.linalg.eigh(k)[1][:, -1]


# ---------------------------------------------------------------- recordings


@dataclass
class Recording:
    """One stream of samples for the filters, and the references that count."""

    t: np.ndarray
    rate_hz: float
    gyro: np.ndarray  # rad/s
    acc: np.ndarray  # m/s^2
    mag: np.ndarray  # uT
    reference_t: np.ndarray
    reference: np.ndarray  # enu_from_body

    @property
    def start(self):
        """Mean specific force and field of the first moments."""
        n = max(1, int(START_S * self.rate_hz))
        return self.acc[:n].mean(0), self.mag[:n].mean(0)


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
    return Recording(grid, rate_hz, *map(np.ascontiguousarray, streams), t[counts], unit)


# ---------------------------------------------------------------- filters: Recording -> enu_from_body


def vqf(recording):
    return VQF(1 / recording.rate_hz).updateBatch(recording.gyro, recording.acc, recording.mag)["quat9D"]


def vqf_offline(recording):
    """Looks at the whole recording, forwards and backwards: compare with smoothers."""
    return offlineVQF(recording.gyro, recording.acc, recording.mag, 1 / recording.rate_hz)["quat9D"]


def fusion(recording, **more):
    settings = imufusion.AhrsSettings(sample_rate=recording.rate_hz, gain=0.5, **more)
    settings.convention = imufusion.CONVENTION_ENU  # 1.3.3 ignores it in the constructor
    ahrs = imufusion.Ahrs()
    ahrs.set_settings(settings)
    bias = None
    if more:
        bias = imufusion.Bias()
        bias.set_settings(imufusion.BiasSettings(sample_rate=recording.rate_hz))
    estimates = np.empty((len(recording.t), 4))
    gyro_deg_s, acc_g = np.degrees(recording.gyro), recording.acc / STANDARD_GRAVITY
    for k, (g, a, m) in enumerate(zip(gyro_deg_s, acc_g, recording.mag)):
        ahrs.update(bias.update(g) if bias else g, a, m)
        estimates[k] = ahrs.get_quaternion()
    return estimates


def fusion_advanced(recording):
    """The settings of the project's own advanced example."""
    limits = {"acceleration_rejection": 10, "magnetic_rejection": 10, "rejection_timeout": 5}
    return fusion(recording, gyroscope_range=2000, **limits)


def stepped(step, start, recording):
    estimates = np.empty((len(recording.t), 4))
    estimates[0] = q = start
    for k in range(1, len(estimates)):
        estimates[k] = q = step(q, recording.gyro[k], recording.acc[k], recording.mag[k])
    return estimates


def madgwick(recording):
    """Its world is north, west, up: a quarter turn from ours."""
    quarter = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    own = Madgwick(frequency=recording.rate_hz, gain=0.041)  # its default with a magnetometer
    start = product(conjugate(quarter), from_vectors(*recording.start))
    return product(quarter, stepped(own.updateMARG, start, recording))


def mahony(recording):
    own = Mahony(frequency=recording.rate_hz)
    return stepped(own.updateMARG, from_vectors(*recording.start), recording)


def ekf(recording):
    """With the dip of the field at the start, and -1 g on the up axis as its ENU world wants it."""
    up, field = recording.start
    down = -field @ (up / np.linalg.norm(up))
    dip = np.degrees(np.arctan2(down, np.sqrt(field @ field - down**2)))
    own = EKF(frequency=recording.rate_hz, frame="ENU", magnetic_ref=float(dip), mag=np.ones((1, 3)))
    step = lambda q, g, a, m: own.update(q, g, -a, m)
    return stepped(step, from_vectors(up, field), recording)


FILTERS = {
    "vqf": vqf,
    "vqf-offline": vqf_offline,
    "fusion": fusion,
    "fusion-advanced": fusion_advanced,
    "ahrs-madgwick": madgwick,
    "ahrs-mahony": mahony,
    "ahrs-ekf": ekf,
}


# ---------------------------------------------------------------- metric of the BROAD benchmark


def errors_deg(estimates, references):
    """RMS of total, heading and inclination error; e = q_est conj(q_ref), nothing is aligned."""
    w, x, y, z = np.abs(product(estimates, conjugate(references))).T
    parts = [np.arctan2(np.sqrt(x**2 + y**2 + z**2), w), np.arctan2(z, w), np.arctan2(np.hypot(x, y), np.hypot(w, z))]
    return [float(np.degrees(np.sqrt(np.mean((2 * part) ** 2)))) for part in parts]


def score(path, names):
    """Rows (estimator, three errors) of one recording, or the reason why there are none."""
    try:
        recording = load(path)
    except (Unusable, pa.ArrowException, OSError) as error:
        return str(error)
    rows = []
    for name in names:
        q = FILTERS[name](recording)
        at = interpolated(recording.reference_t, recording.t, q)
        # The streams may begin later and end earlier than the reference.
        inside = (recording.reference_t >= recording.t[0]) & (recording.reference_t <= recording.t[-1])
        if not np.isfinite(at[inside]).all():
            print(f"{path}: {name} gave estimates that are not finite; no row", file=sys.stderr)
            continue
        rows.append((name, *errors_deg(at[inside], recording.reference[inside])))
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
