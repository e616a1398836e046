"""Tracks that `northing track --out tracks.csv` wrote, and the true positions of the same scans."""

from __future__ import annotations

import argparse
import csv
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

#: North and east, m.
Place = tuple[float, float]


def arguments(description: str | None) -> argparse.Namespace:
    """Folder of the recordings, manifest, tracks, and the cut-off."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("manifest", type=Path)
    parser.add_argument("tracks", type=Path)
    parser.add_argument("--cutoff", type=float, default=40.0, help="m; default %(default)s; that of the run")
    return parser.parse_args()


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def places(
    path: Path, scan: str, who: str | None, north: str, east: str, *, wanted: str | None = None
) -> dict[int, dict[str, Place]]:
    """By scan and number of track or target; where a column tells which rows are wanted, those with a 1."""
    found: dict[int, dict[str, Place]] = defaultdict(dict)
    for row in rows(path):
        if wanted and row[wanted] != "1":
            continue
        place = (float(row[north]), float(row[east]))
        found[int(row[scan])].setdefault(row[who] if who else "1", place)
    return found


def scored(folder: Path, manifest: Path, tracks: Path) -> Iterator[tuple[dict[str, Place], dict[str, Place]]]:
    """True positions and tracks of each scan that has a true position and is of a sensor in use."""
    described = tomllib.loads(manifest.read_text())
    scans, truth = described["scans"], described["truth"]
    used = {name for name, sensor in described["sensors"].items() if sensor.get("used", True)}
    seen = places(tracks, "scan", "track", "north_m", "east_m", wanted="reported")
    true = places(folder / truth["file"], truth["scan"], truth.get("target"), truth["north_m"], truth["east_m"])
    for row in rows(folder / scans["file"]):
        scan = int(row[scans["scan"]])
        sensor = row[scans["sensor"]] if "sensor" in scans else next(iter(used))
        if sensor in used and true.get(scan):
            yield true[scan], seen.get(scan, {})
