#!/usr/bin/env python3
"""T-GOSPA of tracks that `northing track --out tracks.csv` wrote, as the linear program of its paper, solved by HiGHS (scipy).

    oracles/tgospa.py DIR MANIFEST.toml tracks.csv [--cutoff 40]

DIR is the folder of the recordings; p = 2, alpha = 2, gamma is the cut-off, divided by the scans with a true position. Between
`tgospa_at_least_m` and `tgospa_m` of `northing track --json`, which are one where the best assignment is known.
"""

from __future__ import annotations


import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array

from tracks_and_truth import arguments, scored


def distance(scans: list[tuple[dict, dict]], cutoff: float) -> float:
    """Weights of the pairs at every scan, and the sizes of their changes: the least cost, in squared cut-offs."""
    alone = sum(len(true) + len(tracks) for true, tracks in scans) / 2
    gains = []
    for true, tracks in scans:
        near = {(i, j): 1 - (np.hypot(*np.subtract(x, y)) / cutoff) ** 2 for i, x in true.items() for j, y in tracks.items()}
        gains.append({pair: gain for pair, gain in near.items() if gain > 0})
    pairs = sorted({pair for gain in gains for pair in gain})
    count, times = len(pairs), len(scans)
    if not count:
        return cutoff * (alone / times) ** 0.5
    weight = lambda k, t: t * count + k
    change = lambda k, t: times * count + t * count + k
    cost = np.zeros(2 * times * count)
    entries, limits = [], []

    def at_most(limit: float, row: list[tuple[int, float]]) -> None:
        entries.extend((len(limits), column, value) for column, value in row)
        limits.append(limit)

    for t, gain in enumerate(gains):
        for k, pair in enumerate(pairs):
            cost[weight(k, t)] = -gain.get(pair, 0.0)
            if t:
                cost[change(k, t)] = 0.5
                for sign in (1, -1):
                    at_most(0, [(weight(k, t), sign), (weight(k, t - 1), -sign), (change(k, t), -1)])
        for side in (0, 1):
            for one in {pair[side] for pair in pairs}:
                at_most(1, [(weight(k, t), 1) for k, pair in enumerate(pairs) if pair[side] == one])
    rows, columns, values = map(np.array, zip(*entries))
    matrix = coo_array((values, (rows, columns)), shape=(len(limits), len(cost))).tocsr()
    solved = linprog(cost, A_ub=matrix, b_ub=limits, bounds=(0, None), method="highs")
    return cutoff * ((alone + solved.fun) / times) ** 0.5


def main() -> None:
    args = arguments(__doc__)
    scans = list(scored(args.folder, args.manifest, args.tracks))
    print(f"{len(scans)} scans, T-GOSPA {distance(scans, args.cutoff):.9f} m")


if __name__ == "__main__":
    main()
