#!/usr/bin/env python3
"""Whether stated uncertainties are right, from the table of a study: NEES and coverage of each estimator over its runs.

    python examples/studies/consistency.py consistency.parquet

NEES is per degree of freedom: 1 is right, more is overconfident. Needs numpy and pyarrow.
"""

import sys

import numpy as np
import pyarrow.parquet

columns = pyarrow.parquet.read_table(sys.argv[1]).to_pydict()
estimator = np.array(columns["estimator"])
scores = {name: np.array(columns[name], float) for name in ("nees", "tilt_nees", "tilt_coverage_95", "heading_coverage_95")}

print("| estimator | runs | without a score | NEES: median (middle 90 %) | 0.5 to 2 | above 2 | above 10 | tilt: inside 95 % | heading: inside 95 % |")
print("|---|---|---|---|---|---|---|---|---|")
for name in dict.fromkeys(estimator):
    mine = {score: values[estimator == name] for score, values in scores.items()}
    nees = mine["nees"][np.isfinite(mine["nees"])]
    low, middle, high = np.quantile(nees, [0.05, 0.5, 0.95])
    share = lambda which: f"{100 * np.mean(which):.1f} %"
    inside = [f"{100 * np.nanmean(mine[score]):.1f} %" for score in ("tilt_coverage_95", "heading_coverage_95")]
    cells = [f"`{name}`", len(mine["nees"]), len(mine["nees"]) - len(nees), f"{middle:.2f} ({low:.2f} to {high:.1f})"]
    cells += [share((nees >= 0.5) & (nees <= 2)), share(nees > 2), share(nees > 10), *inside]
    print("| " + " | ".join(map(str, cells)) + " |")
