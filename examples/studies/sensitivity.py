#!/usr/bin/env python3
"""What each parameter of a study is worth: the change of a score over its span, with confidence bands over the recordings.

    python examples/studies/sensitivity.py sensitivity.parquet examples/studies/sensitivity.toml [--score total_rmse_deg]
        [--most 10] [--figure FILE.svg]

The study is a Latin hypercube over recordings. For each recording the logarithm of the score is fitted by a parabola in the
logarithm of every parameter at once; a parameter's share is that of its parabola in the variance of the fitted score. Bands are
95 % of 2000 draws of the recordings with replacement: they say what other recordings of the same kind would show. Needs numpy,
pyarrow, and matplotlib for the picture.
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

import numpy as np
import pyarrow.parquet

DRAWS = 2000


class Study:
    """The scores of a study by recording and point, and the parameters of the points, from -1 to 1 over their spans."""

    def __init__(self, table: Path, study: Path, score: str) -> None:
        spans = tomllib.loads(study.read_text())["latin_hypercube"]["parameters"]
        self.names = list(spans)
        self.spans = [(span["from"], span["to"]) for span in spans.values()]
        columns = pyarrow.parquet.read_table(table).to_pydict()
        where = np.array([np.log(columns[name]) for name in self.names]).T
        low, high = np.log(self.spans).T
        where = 2 * (where - low) / (high - low) - 1
        value, source = np.array(columns[score], float), np.array(columns["source"])
        self.recordings = [(where[mine], value[mine]) for one in np.unique(source) if np.isfinite(value[mine := source == one]).all()]
        self.left_out = len(np.unique(source)) - len(self.recordings)

    def fits(self) -> tuple[np.ndarray, float]:
        """For each recording and parameter the slope and the bend of the logarithm of the score; the share of its variance that
        they explain, the median over the recordings."""
        found, explained = [], []
        for where, value in self.recordings:
            design = np.hstack([np.ones((len(where), 1)), where, where**2 - 1 / 3])
            logarithm = np.log(value)
            fitted, *_ = np.linalg.lstsq(design, logarithm, rcond=None)
            found.append(fitted[1:].reshape(2, -1).T)
            explained.append(1 - np.var(logarithm - design @ fitted) / np.var(logarithm))
        return np.array(found), float(np.median(explained))


def variances(fits: np.ndarray) -> np.ndarray:
    """Of slope and bend over a span that is drawn evenly."""
    return fits[..., 0] ** 2 / 3 + fits[..., 1] ** 2 * 4 / 45


def effect(fits: np.ndarray, at: float) -> np.ndarray:
    """How the logarithm of the score differs from that in the middle of the span."""
    return fits[..., 0] * at + fits[..., 1] * at**2


def band(drawn: np.ndarray) -> np.ndarray:
    return np.quantile(drawn, [0.025, 0.975], axis=0)


def percent(logarithm: np.ndarray | float) -> np.ndarray:
    return 100 * np.expm1(logarithm)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path)
    parser.add_argument("study", type=Path)
    parser.add_argument("--score", default="total_rmse_deg", help="default %(default)s")
    parser.add_argument("--most", type=int, default=10, help="how many parameters; default %(default)s")
    parser.add_argument("--figure", type=Path)
    args = parser.parse_args()
    study = Study(args.table, args.study, args.score)
    fits, explained = study.fits()
    random = np.random.default_rng(1)
    drawn = fits[random.integers(len(fits), size=(DRAWS, len(fits)))].mean(axis=1)
    shares = variances(fits)
    share = (shares / shares.sum(axis=1, keepdims=True)).mean(axis=0)
    order = np.argsort(-share)[: args.most]
    mean = fits.mean(axis=0)

    left_out = f", {study.left_out} left out without a score" if study.left_out else ""
    print(f"`{args.score}` over {len(fits)} recordings{left_out}; change in percent against the middle of the span. The")
    print(f"parabolas explain {100 * explained:.0f} % of the variance (median of the recordings).\n")
    print("| parameter | span | share of the variance | at its lower end | at its upper end | recordings better by 1 % at an end |")
    print("|---|---|---|---|---|---|")
    for p in order:
        low, high = study.spans[p]
        cells = []
        for at in (-1.0, 1.0):
            lower, upper = percent(band(effect(drawn[:, p], at)))
            cells.append(f"{percent(effect(mean[p], at)):+.1f} ({lower:+.1f} to {upper:+.1f})")
        best = np.minimum(effect(fits[:, p], -1.0), effect(fits[:, p], 1.0))
        better = int((best < np.log(0.99)).sum())
        print(f"| `{study.names[p]}` | {low:g} to {high:g} | {100 * share[p]:.0f} % | {cells[0]} | {cells[1]} | {better} |")
    if args.figure:
        draw(study, [int(p) for p in order], mean, drawn, args)


def draw(study: Study, order: list[int], mean: np.ndarray, drawn: np.ndarray, args: argparse.Namespace) -> None:
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "northing", "font.size": 9})
    from matplotlib import pyplot

    rows = -(-len(order) // 5)
    figure, axes = pyplot.subplots(rows, 5, figsize=(13, 2.6 * rows), sharey=True, squeeze=False)
    at = np.linspace(-1, 1, 81)
    for axis, p in zip(axes.flat, order):
        low, high = np.log(study.spans[p])
        values = np.exp(low + (at + 1) / 2 * (high - low))
        curves = percent(drawn[:, p, 0, None] * at + drawn[:, p, 1, None] * at**2)
        axis.fill_between(values, *band(curves), color="#2a6fb0", alpha=0.25, linewidth=0)
        axis.plot(values, percent(mean[p, 0] * at + mean[p, 1] * at**2), color="#2a6fb0")
        axis.axvline(np.exp((low + high) / 2), color="#888", linewidth=0.8, linestyle=":")
        axis.axhline(0, color="#888", linewidth=0.8)
        axis.set_xscale("log")
        ticks = np.exp([low, (low + high) / 2, high])
        axis.set_xticks(ticks, [f"{tick:.3g}" for tick in ticks])
        axis.minorticks_off()
        axis.set_title(study.names[p].removeprefix("bounded_"), fontsize=9)
    for axis in axes.flat[len(order) :]:
        axis.remove()
    for axis in axes[:, 0]:
        axis.set_ylabel(f"{args.score.split('_')[0]} RMSE, %")
    figure.tight_layout()
    figure.savefig(args.figure, metadata={"Date": None})


if __name__ == "__main__":
    main()
