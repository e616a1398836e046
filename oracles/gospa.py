#!/usr/bin/env python3
"""GOSPA of tracks that `northing track --out tracks.csv` wrote, by Stone Soup's metric: mean over the scans with a true position.

    oracles/gospa.py DIR MANIFEST.toml tracks.csv [--cutoff 40]

DIR is the folder of the recordings. `gospa_m` of `northing track --json` is the same number.
"""

from __future__ import annotations

from datetime import datetime

import numpy as np
from stonesoup.metricgenerator.ospametric import GOSPAMetric
from stonesoup.types.state import State

from tracks_and_truth import Place, arguments, scored

#: Stone Soup wants a time; that of all states is one.
NOW = datetime(2000, 1, 1)


def states(places: dict[str, Place]) -> list[State]:
    return [State(np.array([[north], [east]]), timestamp=NOW) for north, east in places.values()]


def main() -> None:
    args = arguments(__doc__)
    metric = GOSPAMetric(c=args.cutoff, p=2, switching_penalty=0.0)
    distances = []
    for true, tracks in scored(args.folder, args.manifest, args.tracks):
        distance, _assignment = metric.compute_gospa_metric(states(tracks), states(true))
        distances.append(distance.value["distance"])
    print(f"{len(distances)} scans, GOSPA {np.mean(distances):.9f} m")


if __name__ == "__main__":
    main()
