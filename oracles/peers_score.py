"""The attitude score of `northing benchmark attitude` (docs/results/attitude.md) for anybody's estimates, in numpy.

An estimate is interpolated to the instant of each reference sample, which does not count in a pause of the estimates. Errors are
those of the BROAD benchmark: `e = q_est conj(q_ref)`, RMS of total, heading and inclination. Where nothing says where north is, the
constant part of the heading error is removed.
"""

import numpy as np

from attitude_filters import between, conjugate, product

#: From the first sample on, not scored.
SKIP_NS = 5_000_000_000
#: A longer interval between two estimates is a pause, and so is one of three usual ones in which it turned by more than a degree.
GAP_S, USUAL, SMALL_TURN_RAD = 0.5, 3.0, np.radians(1.0)
#: Bins of a turn, of which the program keeps moments.
BINS = 360


def joined(time_ns, turn_rad):
    """Whether what lies between each two estimates can be interpolated."""
    interval = np.diff(time_ns) * 1e-9
    possible = (interval > 0.0) & (interval <= GAP_S)
    total, count = np.cumsum(np.where(possible, interval, 0.0)), np.cumsum(possible)
    before_total, before_count = np.r_[0.0, total[:-1]], np.r_[0, count[:-1]]
    usual = (before_count == 0) | (interval <= USUAL * before_total / np.maximum(before_count, 1))
    return possible & (usual | (turn_rad <= SMALL_TURN_RAD))


def places(reference_ns, time_ns, joins):
    """Before which estimate each reference lies, and whether it counts."""
    k = np.searchsorted(time_ns, reference_ns, side="right") - 1
    exact = (k >= 0) & (time_ns[np.maximum(k, 0)] == reference_ns)
    inside = (k >= 0) & (k < len(time_ns) - 1)
    return k, exact | (inside & joins[np.clip(k, 0, len(joins) - 1)])


def between_samples(reference_ns, gyro_ns, gyro):
    """Whether each reference lies where the gyroscope has no pause."""
    rate = np.linalg.norm(gyro, axis=1)
    turn = np.maximum(rate[:-1], rate[1:]) * np.diff(gyro_ns) * 1e-9
    return places(reference_ns, gyro_ns, joined(gyro_ns, turn))[1]


def of_estimates(time_ns, q, reference_ns, reference, is_arbitrary):
    """RMS of total, heading and inclination error, deg, of estimates `q` at `time_ns`; a heading may be arbitrary."""
    known = np.isfinite(q).all(axis=1)
    time_ns, q = time_ns[known], q[known]
    step = product(conjugate(q[:-1]), q[1:])
    turn = 2.0 * np.arctan2(np.linalg.norm(step[:, 1:], axis=1), np.abs(step[:, 0]))
    k, counts = places(reference_ns, time_ns, joined(time_ns, turn))
    k, reference_ns = np.minimum(k[counts], len(time_ns) - 2), reference_ns[counts]
    share = (reference_ns - time_ns[k]) / (time_ns[k + 1] - time_ns[k])
    return rms_deg(between(q[k], q[k + 1], share), reference[counts], is_arbitrary)


def rms_deg(estimates, reference, is_arbitrary):
    """RMS of total, heading and inclination error, deg, of estimates at the instants of the references."""
    e = product(estimates, conjugate(reference / np.linalg.norm(reference, axis=1, keepdims=True)))
    w, x, y, z = (e / np.linalg.norm(e, axis=1, keepdims=True) * np.where(e[:, :1] < 0.0, -1.0, 1.0)).T
    total = 2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), w)
    heading = 2.0 * np.arctan2(z, w)
    inclination = 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
    if is_arbitrary:
        heading, total = without_offset(heading, inclination)
    return tuple(float(np.degrees(np.sqrt(np.mean(part**2)))) for part in (total, heading, inclination))


def wrapped(angle):
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def without_offset(heading, inclination):
    """Heading and total errors without the mean direction of the heading errors, by the program's bins of a degree."""
    offset = np.arctan2(np.sin(heading).sum(), np.cos(heading).sum())
    index = ((heading + np.pi) / (2.0 * np.pi) * BINS).astype(int) % BINS
    middle = (np.arange(BINS) + 0.5) * 2.0 * np.pi / BINS - np.pi
    left = wrapped(heading - middle[index]) + wrapped(middle - offset)[index]
    count = np.maximum(np.bincount(index, minlength=BINS), 1)
    rms = [np.sqrt(np.bincount(index, weights=part**2, minlength=BINS) / count) for part in (left, inclination)]
    total = 2.0 * np.arccos(np.clip(np.cos(0.5 * rms[0]) * np.cos(0.5 * rms[1]), -1.0, 1.0))
    return left, total[index]
