#!/usr/bin/env python3
"""GOSPA of tracks that `northing track --out tracks.csv` wrote, by Stone Soup's metric: mean over the scans with a true position.

    oracles/gospa.py DIR MANIFEST.toml tracks.csv [--cutoff 40]

DIR is the folder of the recordings. `gospa_m` of `northing track --json` is the same number.
"""

from __future__ import annotations

import argparse
import csv
import tomllib
from collections import defaultdict
from datetime import datetime
from pathlib import Path

import numpy as np
from stonesoup.metricgenerator.ospametric import GOSPAMetric
from stonesoup.types.state import State

#: Stone Soup wants a time; that of all states is one.
NOW = datetime(2000, 1, 1)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def state(north: str, east: str) -> State:
    return State(np.array([[float(north)], [float(east)]]), timestamp=NOW)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("manifest", type=Path)
    parser.add_argument("tracks", type=Path)
    parser.add_argument("--cutoff", type=float, default=40.0, help="m; default %(default)s, as the program's")
    args = parser.parse_args()
    manifest = tomllib.loads(args.manifest.read_text())
    scans, truth = manifest["scans"], manifest["truth"]
    used = {name for name, sensor in manifest["sensors"].items() if sensor.get("used", True)}

    tracks = defaultdict(list)
    for row in rows(args.tracks):
        tracks[int(row["scan"])].append(state(row["north_m"], row["east_m"]))
    true = defaultdict(list)
    for row in rows(args.folder / truth["file"]):
        true[int(row[truth["scan"]])].append(state(row[truth["north_m"]], row[truth["east_m"]]))
    metric = GOSPAMetric(c=args.cutoff, p=2, switching_penalty=0.0)
    distances = []
    for row in rows(args.folder / scans["file"]):
        scan = int(row[scans["scan"]])
        sensor = row[scans["sensor"]] if "sensor" in scans else next(iter(used))
        if sensor in used and true[scan]:
            distance, _assignment = metric.compute_gospa_metric(tracks[scan], true[scan])
            distances.append(distance.value["distance"])
    print(f"{len(distances)} scans, GOSPA {np.mean(distances):.9f} m")


if __name__ == "__main__":
    main()
