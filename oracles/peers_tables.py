"""Tables and the picture of `attitude_peers.py`, from its rows."""

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot

OURS_COLOUR, PEERS_COLOUR = "#0072b2", "#d55e00"
#: The filter of the others that ours are compared with, recording by recording.
PEER = "vqf"


def by_estimator(rows, names, part):
    """For each estimator its errors by recording; those without any are left out."""
    found = {name: {row["recording"]: row["errors_deg"][part] for row in rows if row["estimator"] == name} for name in names}
    return {name: errors for name, errors in found.items() if errors}


def median_and_worst(errors):
    return f"{np.median(errors):.2f} / {np.max(errors):.1f}" if len(errors) else "-"


def firsts(errors):
    """How often each has the smallest error."""
    count = dict.fromkeys(errors, 0)
    for recording in {recording for one in errors.values() for recording in one}:
        there = {name: one[recording] for name, one in errors.items() if recording in one}
        count[min(there, key=there.__getitem__)] += 1
    return count


def table(rows, names, peers):
    """Median and worst total error of each family of recordings, deg, the best in all in the first row."""
    total, inclination = by_estimator(rows, names, 0), by_estimator(rows, names, 2)
    families = sorted({row["family"] for row in rows}, key=lambda family: (family.split(",")[0] == "phones", ", disturbed" in family))
    kin = {row["recording"]: row["family"] for row in rows}
    first = firsts(total)
    heads = ["", *families, "all", "inclination", "first", f"ahead of `{PEER}`"]
    lines = [heads, ["---"] * len(heads)]
    for name in sorted(total, key=lambda name: np.median(list(total[name].values()))):
        errors, other = total[name], total.get(PEER, {})
        shown = [median_and_worst([e for r, e in errors.items() if kin[r] == family]) for family in families]
        shown += [median_and_worst(list(one.values())) for one in (errors, inclination[name])]
        ahead = sum(errors[r] < other[r] for r in errors if r in other)
        beside = f"{ahead} of {len(errors)}" if other and name != PEER else "-"
        lines.append([f"`{name}`" if name in peers else f"**`{name}`**", *shown, str(first[name]), beside])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def picture(rows, names, peers, path):
    """Each filter's errors: least to worst, the middle half, the median; ours and theirs by colour."""
    pyplot.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "northing", "font.family": "sans-serif", "font.size": 10})
    figure, both = pyplot.subplots(1, 2, figsize=(11, 5.6), layout="constrained", facecolor="white")
    for axes, given, what in zip(both, ("9", "6"), ("with magnetometer", "without magnetometer")):
        errors = by_estimator([row for row in rows if row["given"] == given], names, 0)
        order = sorted(errors, key=lambda name: -np.median(list(errors[name].values())))
        for y, name in enumerate(order):
            least, low, middle, high, worst = np.percentile(list(errors[name].values()), [0, 25, 50, 75, 100])
            colour = PEERS_COLOUR if name in peers else OURS_COLOUR
            axes.plot([least, worst], [y, y], color=colour, linewidth=1.2)
            axes.plot([low, high], [y, y], color=colour, linewidth=8, solid_capstyle="butt", alpha=0.55)
            axes.plot([middle], [y], "|", color="black", markersize=11, markeredgewidth=2)
        axes.set_yticks(range(len(order)), order)
        for label, name in zip(axes.get_yticklabels(), order):
            label.set_color(PEERS_COLOUR if name in peers else OURS_COLOUR)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
        axes.grid(axis="x", which="both", color="#dfe4e9", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.tick_params(axis="y", length=0)
        axes.set(xlabel="total error, deg RMS, of each recording", title=what)
    for name, colour in (("Northing", OURS_COLOUR), ("VQF, Fusion, AHRS", PEERS_COLOUR)):
        both[0].plot([], [], color=colour, linewidth=8, alpha=0.55, label=name)
    both[0].plot([], [], "|", color="black", markersize=11, markeredgewidth=2, label="median")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(path, metadata={"Date": None, "Creator": None} if str(path).endswith(".svg") else None)
    pyplot.close(figure)
