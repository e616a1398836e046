#!/usr/bin/env python3
"""Our attitude estimators, through the module `northing`, beside VQF, Fusion and AHRS on every recording of a folder, one score for all.

    attitude_peers.py DIR [--rows rows.json] [--figure picture.svg] [--jobs 2]     the tables, as Markdown
    attitude_peers.py --times RECORDING                                            CPU time of a sample

`scripts/attitude-peers` runs it with the packages that it needs. First every filter has to find the attitude of a phone that is
simulated, or nothing is printed: quaternions, frames and axes are then as they should be. With `--rows` what the file holds is not
computed again. Nothing is tuned. Ours get a recording as it is; the others get one stream at the rate of its gyroscope, as
`attitude.py` says, and the attitude of the first half second where they do not find one themselves.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import lru_cache
from pathlib import Path

import northing as no
import numpy as np

import peers_score as score
from attitude_filters import FILTERS, Recording, conjugate, interpolated, product
from peers_tables import picture, table

#: All but `device`, which is no filter of ours, and `cascade`, which without positions is `complementary`.
OURS = (
    "bounded-velocity",
    "mekf",
    "usque",
    "quaternion-ekf",
    "cascade-ekf",
    "complementary",
    "mekf3",
    "complementary-passive",
    "complementary-direct",
    "integration",
)
#: All but the slowest: `ahrs-ekf` takes as long as all others together, and has to be named to run.
PEERS = tuple(name for name in FILTERS if name != "ahrs-ekf")
#: They look at the whole recording.
SMOOTHED = {"bounded-velocity (smoothed)": "bounded-velocity", "mekf (smoothed)": "mekf"}
OFFLINE = ("vqf-offline", *SMOOTHED)
#: What everybody is given: with the magnetometer, or without.
GIVEN = {"9": "gyro,acc,mag", "6": "gyro,acc"}
#: Largest error of a filter on the simulated phone, deg. Another order or frame is off by far more.
FOUND_DEG = 4.0
#: Of the simulated phone's world, east, north, up.
FIELD_UT = (0.0, 21.0, -43.0)


# ---------------------------------------------------------------- recordings


@lru_cache(maxsize=2)
def samples(path):
    """Stamps and values of every sensor of a recording."""
    opened = no.open(path)
    if opened.frame != "enu":
        raise ValueError(f"{path}: its world is {opened.frame}; expected enu")
    found = {}
    for name in opened.sensors:
        read = opened.arrays(name)
        keep = np.isfinite(read.values).all(axis=1)
        if keep.any():
            found[name] = read.time_ns[keep], np.ascontiguousarray(read.values[keep])
    return found


def references(path):
    """Stamps and attitudes of the references that count, pauses of the gyroscope among them."""
    found = samples(path)
    started = min(stamps[0] for stamps, _ in found.values())
    reference_ns, values = found["reference"]
    counts = (values[:, 4] != 0) & (reference_ns - started >= score.SKIP_NS)
    return reference_ns[counts], values[counts, :4]


def load(path, given):
    """The stream for the peers with its stamps, and the references that count with theirs."""
    names = ("gyroscope", "accelerometer", "magnetometer")[: 3 if given == "9" else 2]
    sensors = [samples(path)[name] for name in names]
    reference_ns, reference = references(path)
    gyro_ns, rate_hz = sensors[0][0], 1e9 / float(np.median(np.diff(sensors[0][0])))
    if all(np.array_equal(gyro_ns, stamps) for stamps, _ in sensors):
        grid = gyro_ns
    else:
        first, last = max(stamps[0] for stamps, _ in sensors), min(stamps[-1] for stamps, _ in sensors)
        grid = np.round(np.arange(first, last, 1e9 / rate_hz)).astype(np.int64)
    at = lambda stamps, rows: rows if grid is stamps else np.stack([np.interp(grid - grid[0], stamps - grid[0], r) for r in rows.T], 1)
    streams = [np.ascontiguousarray(at(*one)) for one in sensors] + [None] * (3 - len(sensors))
    counts = score.between_samples(reference_ns, *sensors[0]) & (reference_ns >= grid[0]) & (reference_ns <= grid[-1])
    return grid, Recording((grid - grid[0]) * 1e-9, rate_hz, *streams), reference_ns[counts], reference[counts]


def run_ours(path, name, given):
    asked = {"estimator": SMOOTHED.get(name, name), "smooth": name in SMOOTHED, "sensors": GIVEN[given]}
    if given == "9":
        asked["magnetometer"] = "device"
    return no.open(path).run(**asked)


def ours(path, name, given):
    """Errors of one of ours: those that the program states, which our own arithmetic has to come to."""
    run = run_ours(path, name, given)
    stated = run.summary["error_deg"]
    found = score.of_estimates(run.time_ns, run.quat, *references(path), stated["heading_offset_removed"])
    said = [stated[f"{part}_rmse"] for part in ("total", "heading", "inclination")]
    if not np.allclose(found, said, rtol=0.0, atol=1e-6):
        raise AssertionError(f"{path}, {name}: errors {found}, but the program says {said}")
    return said


# ---------------------------------------------------------------- rows


def rows_of(path, given, names):
    """A row for each filter on one recording."""
    grid, stream, reference_ns, reference = load(path, given)
    rows = []
    for name in names:
        if name in FILTERS:
            errors = score.of_estimates(grid, FILTERS[name](stream), reference_ns, reference, given == "6")
        else:
            errors = ours(path, name, given)
        rows.append({"recording": path.stem, "family": family(path), "given": given, "estimator": name, "errors_deg": list(errors)})
    return rows


def family(path):
    """What kind of recording it is, by folder and name."""
    device = {"broad": "wearable", "smartphone": "phones"}.get(path.parent.name)
    if device is None:
        return path.parent.name
    quiet = "_undisturbed_" in path.name or "_NoDist_" in path.name
    return f"{device}, {'undisturbed' if quiet else 'disturbed'}"


def recordings(folder):
    """Every recording with a reference in a folder and those inside."""
    files = sorted(p for p in folder.rglob("*") if p.suffix in (".parquet", ".csv") and not p.name.startswith((".", "calib_")))
    return [path for path in files if "reference" in no.open(path).sensors and "reference" in samples(path)]


def all_rows(files, known, names, jobs, keep):
    """Rows of every recording, those that are known among them; `keep` is called whenever there are more."""
    have = {(row["recording"], row["given"], row["estimator"]) for row in known}
    rows, work = list(known), []
    for given in GIVEN:
        for path in files:
            missing = [name for name in names if (path.stem, given, name) not in have]
            # The slow ones for themselves, so that all processes end at about the same time.
            slow = [name for name in missing if name.startswith("ahrs-")]
            quick = [name for name in missing if name not in slow]
            work += [(path, given, some) for some in ([[name] for name in slow] + [quick]) if some]
    with ProcessPoolExecutor(jobs) as pool:
        pending = [pool.submit(rows_of, *item) for item in work]
        for done, future in enumerate(as_completed(pending), start=1):
            rows += future.result()
            keep(rows)
            print(f"{done} of {len(pending)}", file=sys.stderr)
    stems = {path.stem for path in files}
    return [row for row in rows if row["recording"] in stems and row["estimator"] in names]


# ---------------------------------------------------------------- conventions and times


def without_errors(path, grid, stream):
    """The stream with the rates and the field of the true attitude: the simulated phone has bias and hard iron, which are not asked."""
    reference_ns, values = samples(path)["reference"]
    truth = interpolated(np.clip(grid, reference_ns[0], reference_ns[-1]), reference_ns, values[:, :4])
    step = product(conjugate(truth[:-1]), truth[1:])
    step = np.where(step[:, :1] < 0.0, -step, step)
    rate = 2.0 * step[:, 1:] / (np.diff(grid) * 1e-9)[:, None]  # turns of a degree or two: the sine is the angle
    field = product(product(conjugate(truth), np.broadcast_to([0.0, *FIELD_UT], truth.shape)), truth)[:, 1:]
    clean = None if stream.mag is None else np.ascontiguousarray(field)
    return Recording(stream.t, stream.rate_hz, np.concatenate([rate[:1], rate]), stream.acc, clean)


def prove(seed=4, duration=60.0, names=tuple(FILTERS)):
    """Every filter finds the attitude of a simulated phone; given in another way, the score would tell."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "phone.csv"
        no.virtual_phone(seed=seed, duration=duration, motion="gentle").save(path)
        for given in GIVEN:
            grid, stream, reference_ns, reference = load(path, given)
            stream = without_errors(path, grid, stream)
            for name in names:
                q = FILTERS[name](stream)
                errors = score.of_estimates(grid, q, reference_ns, reference, given == "6")
                if not max(errors) < FOUND_DEG:
                    raise AssertionError(f"{name} of {GIVEN[given]} is off by {errors} deg on a simulated phone: another convention?")
                # The inverse, the vector part in front, and the body for the world are all refused.
                for wrong in (conjugate(q), np.roll(q, 1, axis=1), np.roll(q, -1, axis=1)):
                    if max(score.of_estimates(grid, wrong, reference_ns, reference, given == "6")) < FOUND_DEG:
                        raise AssertionError(f"{name}: the simulated phone does not tell conventions apart")
            ours(path, "bounded-velocity", given)


def times(path):
    """CPU time of a sample with magnetometer, microseconds: the best of some runs."""
    _, stream, _, _ = load(path, "9")
    began = lambda: time.process_time()
    print("| filter | us a sample |\n|---|---|")
    runs = {name: lambda name=name: no.attitude(stream.gyro, stream.acc, stream.mag, rate=stream.rate_hz, estimator=name) for name in OURS}
    runs |= {name: lambda name=name: FILTERS[name](stream) for name in FILTERS}
    for name, run in runs.items():
        least = np.inf
        for _ in range(3):
            start = began()
            run()
            least = min(least, began() - start)
        print(f"| `{name}` | {least / len(stream.t) * 1e6:.2f} |", flush=True)


# ---------------------------------------------------------------- program


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=Path, help="recordings with a reference, or folders of them; one recording with --times")
    named = os.environ.get("NORTHING_PEERS_ROWS")
    parser.add_argument("--rows", type=Path, default=named and Path(named), help="JSON file: its rows are taken, the others added")
    parser.add_argument("--figure", type=Path, help="the SVG file to write")
    parser.add_argument("--jobs", type=int, default=2, help="processes; default %(default)s")
    parser.add_argument("--estimators", help="names separated by commas; default: all of ours and theirs but ahrs-ekf")
    parser.add_argument("--times", action="store_true", help="print the CPU time of a sample instead")
    given = parser.parse_args()
    if given.times:
        times(given.folder)
        return
    everybody = (*OURS, *FILTERS, *SMOOTHED)
    names = given.estimators.split(",") if given.estimators else (*OURS, *PEERS, *SMOOTHED)
    unknown = [name for name in names if name not in everybody]
    if unknown:
        parser.error(f"unknown estimator {unknown[0]}; expected some of {', '.join(everybody)}")
    files = recordings(given.folder)
    if not files:
        parser.error(f"{given.folder}: no recording with a reference")
    prove(names=[name for name in names if name in FILTERS])
    known = json.loads(given.rows.read_text()) if given.rows and given.rows.exists() else []
    keep = (lambda rows: given.rows.write_text(json.dumps(rows, indent=0))) if given.rows else (lambda rows: None)
    rows = all_rows(files, known, names, given.jobs, keep)
    peers = [name for name in FILTERS if name in names]
    causal = [name for name in names if name not in OFFLINE]
    print(f"{len(files)} recordings. With the magnetometer:\n")
    print(table([row for row in rows if row["given"] == "9"], causal, peers))
    print("\nWithout it:\n")
    print(table([row for row in rows if row["given"] == "6"], causal, peers))
    if any(name in names for name in OFFLINE):
        print("\nThe whole recording seen, with the magnetometer:\n")
        print(table([row for row in rows if row["given"] == "9"], [name for name in names if name in OFFLINE], peers))
    if given.figure:
        picture(rows, causal, peers, given.figure)


if __name__ == "__main__":
    main()
