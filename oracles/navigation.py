#!/usr/bin/env python3
"""A factor graph (GTSAM) of inertial samples and fixes on recordings, scored as `northing benchmark navigation` scores ours.

usage: navigation.py PATH... [--out peers.csv]      (PATH: .csv recordings, or folders of them)

Other formats: `northing convert RECORDING out.csv` first. Columns: docs/formats.md; the world must be north, east, down.

One node (pose, velocity, biases) a used fix, CombinedImuFactor between them, GPSFactor at each, all noises as the defaults of
`northing estimators error-state`. Nothing is known of the heading at the start: until START_FIXES the graph is solved from several headings
and the one of least error goes on. Two answers: `gtsam-isam2` is causal, the newest node moved on by the samples since, as a
filter; `gtsam-batch` is the whole graph, as a smoother. Fixes are thinned and scored by the rule that the benchmark prints.
"""

import argparse
import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, V, X

SCORE_FROM_S = 5.0
GRAVITY = 9.80665
# Defaults of `error-state`; a random walk of the biases stands for its first-order Gauss-Markov ones as well.
GYROSCOPE_NOISE = 0.0025
ACCELEROMETER_NOISE = 0.015
GYROSCOPE_BIAS_WALK = 0.002 * np.sqrt(2 / 20.0)
ACCELEROMETER_BIAS_WALK = 0.02 * np.sqrt(2 / 60.0)
GYROSCOPE_BIAS_STD = 0.02
ACCELEROMETER_BIAS_STD = 0.15
POSITION_STD_FLOOR = np.array([0.01, 0.01, 0.025])
POSITION_STD = np.array([2.5, 2.5, 6.1])  # where the receiver states none
TILT_STD = 0.2
SPEED_STD = 30.0
START_HEADINGS = 8
START_FIXES = 12
WGS84_A, WGS84_E2 = 6378137.0, 6.69437999014e-3


class Unusable(Exception):
    """A recording that the graph cannot be built on."""


# ---------------------------------------------------------------- reading


def ecef(places):
    latitude, longitude, height = places.T
    n = WGS84_A / np.sqrt(1 - WGS84_E2 * np.sin(latitude) ** 2)
    level = (n + height) * np.cos(latitude)
    return np.column_stack(
        [level * np.cos(longitude), level * np.sin(longitude), (n * (1 - WGS84_E2) + height) * np.sin(latitude)]
    )


def local(places, origin):
    """North, east and down of places, m from `origin`."""
    latitude, longitude, _ = origin
    s, c, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    ned_from_ecef = np.array([[-s * cl, -s * sl, c], [-sl, cl, 0.0], [-c * cl, -c * sl, -s]])
    return (ecef(places) - ecef(np.array([origin]))) @ ned_from_ecef.T


@dataclass
class Recording:
    name: str
    t: np.ndarray  # of the inertial samples
    imu: np.ndarray  # angular rate and specific force, forward, right, down
    fix_t: np.ndarray
    fix: np.ndarray  # north, east, down
    fix_std: np.ndarray
    fix_velocity: np.ndarray  # not a number where the receiver gives none
    reference_t: np.ndarray
    reference: np.ndarray
    attitude_t: np.ndarray
    attitude: np.ndarray  # quaternions ned_from_body, w x y z
    arm: np.ndarray  # from the unit to the antenna


def read(path):
    with path.open(newline="") as file:
        head, line = {}, file.readline()
        while line.startswith("#"):
            key, _, value = line[1:].partition(":")
            head[key.strip()] = value.strip()
            line = file.readline()
        columns = [name.strip() for name in line.split(",")]
        rows = list(csv.reader(file))
    if head.get("world_frame", "enu") != "ned":
        raise Unusable("its world is not north, east, down (`# world_frame: ned`)")
    if "t_s" not in columns or "gnss_latitude_rad" not in columns:
        raise Unusable("no column t_s or gnss_latitude_rad")
    cell = lambda text: float(text) if text.strip() else np.nan
    table = np.array([[cell(text) for text in row] for row in rows])

    def take(*names):
        known = [table[:, columns.index(n)] if n in columns else np.full(len(table), np.nan) for n in names]
        return np.column_stack(known)

    t = take("t_s")[:, 0]
    geodetic = lambda who: take(*(f"{who}_{what}" for what in ("latitude_rad", "longitude_rad", "height_m")))
    imu = take(*(f"gyro_{a}_rad_s" for a in "xyz"), *(f"acc_{a}_m_s2" for a in "xyz"))
    fix, reference = geodetic("gnss"), geodetic("ref")
    attitude = take("ref_qw", "ref_qx", "ref_qy", "ref_qz")
    has = lambda rows: np.isfinite(rows).all(axis=1)
    if has(fix).sum() < 3 or has(imu).sum() < 100:
        raise Unusable("fewer than 3 fixes with height, or 100 inertial samples")
    origin = fix[has(fix)][0]
    std = take(*(f"gnss_std_{a}_m" for a in "ned"))[has(fix)]
    velocity = take(*(f"gnss_vel_{a}_m_s" for a in "ned"))
    arm = np.array([float(x) for x in head.get("gnss_lever_arm_m", "0 0 0").replace(",", " ").split()])
    near = lambda at: velocity[(np.abs(t - at) < 0.05) & has(velocity)]
    of_fix = lambda at: near(at)[0] if len(near(at)) else np.full(3, np.nan)
    fix_t = t[has(fix)]
    return Recording(
        path.name,
        t[has(imu)],
        imu[has(imu)],
        fix_t,
        local(fix[has(fix)], origin),
        np.where(np.isfinite(std), np.maximum(std, POSITION_STD_FLOOR), POSITION_STD),
        np.array([of_fix(at) for at in fix_t]),
        t[has(reference)],
        local(reference[has(reference)], origin) if has(reference).any() else np.empty((0, 3)),
        t[has(attitude)],
        attitude[has(attitude)],
        arm,
    )


def split(recording):
    """Which fixes are used, and times and places to score at: the benchmark's rule."""
    interval = np.median(np.diff(recording.fix_t))
    has_reference = len(recording.reference_t) > 0
    every = max(1 if has_reference else 2, round(1 / interval))
    used = np.arange(len(recording.fix_t)) % every == 0
    if has_reference:
        points = recording.reference_t, recording.reference
    else:
        points = recording.fix_t[~used], recording.fix[~used]
    # The program counts nanoseconds.
    late = points[0] >= recording.fix_t[0] + SCORE_FROM_S - 1e-9
    return used, points[0][late], points[1][late]


# ---------------------------------------------------------------- the graph


def parameters():
    p = gtsam.PreintegrationCombinedParams.MakeSharedD(GRAVITY)
    square = lambda std: np.eye(3) * std**2
    p.setGyroscopeCovariance(square(GYROSCOPE_NOISE))
    p.setAccelerometerCovariance(square(ACCELEROMETER_NOISE))
    p.setIntegrationCovariance(square(1e-4))
    p.setBiasOmegaCovariance(square(GYROSCOPE_BIAS_WALK))
    p.setBiasAccCovariance(square(ACCELEROMETER_BIAS_WALK))
    return p


def diagonal(stds):
    return gtsam.noiseModel.Diagonal.Sigmas(np.asarray(stds, dtype=float))


def preintegrated(recording, start, end, bias):
    """The samples between two times; the mean of both ends of each interval."""
    inside = recording.t[(recording.t > start) & (recording.t < end)]
    times = np.concatenate([[start], inside, [end]])
    ends = np.column_stack([np.interp(times, recording.t, column) for column in recording.imu.T])
    measured = gtsam.PreintegratedCombinedMeasurements(parameters(), bias)
    for dt, mean in zip(np.diff(times), 0.5 * (ends[1:] + ends[:-1])):
        if dt > 0:
            measured.integrateMeasurement(mean[3:], mean[:3], dt)
    return measured


class Graph:
    """Factors and values of the fixes so far."""

    def __init__(self, recording, times, places, stds):
        self.recording, self.times, self.places, self.stds = recording, times, places, stds
        t = recording.t
        first = (t >= times[0] - 0.5) & (t <= times[0] + 0.5)
        force = recording.imu[first, 3:].mean(axis=0)
        down = -force / np.linalg.norm(force)
        self.tilt = np.arctan2(down[1], down[2]), np.arcsin(np.clip(-down[0], -1, 1))

    def fix(self, k):
        return gtsam.GPSFactorArm(X(k), self.places[k], self.recording.arm, diagonal(self.stds[k]))

    def first_factors(self, heading_std):
        """Position, level and velocity at the first fix; the heading as free as its standard deviation says."""
        factors = gtsam.NonlinearFactorGraph()
        roll, pitch = self.tilt
        level = gtsam.Rot3.Ypr(self.heading, pitch, roll)
        prior = gtsam.Pose3(level, self.places[0] - level.rotate(self.recording.arm))
        # Errors of a pose are in body axes; the down axis of the body is near the vertical.
        pose_std = [TILT_STD, TILT_STD, heading_std, 100.0, 100.0, 100.0]
        factors.add(gtsam.PriorFactorPose3(X(0), prior, diagonal(pose_std)))
        factors.add(gtsam.PriorFactorVector(V(0), np.zeros(3), diagonal([SPEED_STD] * 3)))
        bias_std = [ACCELEROMETER_BIAS_STD] * 3 + [GYROSCOPE_BIAS_STD] * 3
        factors.add(gtsam.PriorFactorConstantBias(B(0), gtsam.imuBias.ConstantBias(), diagonal(bias_std)))
        factors.add(self.fix(0))
        values = gtsam.Values()
        values.insert(X(0), prior)
        seconds = self.times[1] - self.times[0]
        values.insert(V(0), (self.places[1] - self.places[0]) / seconds)
        values.insert(B(0), gtsam.imuBias.ConstantBias())
        return factors, values

    def next_factors(self, k, values):
        """What node `k` adds, with values that `values` predict."""
        bias = values.atConstantBias(B(k - 1))
        imu = preintegrated(self.recording, self.times[k - 1], self.times[k], bias)
        factors = gtsam.NonlinearFactorGraph()
        factors.add(gtsam.CombinedImuFactor(X(k - 1), V(k - 1), X(k), V(k), B(k - 1), B(k), imu))
        factors.add(self.fix(k))
        state = imu.predict(gtsam.NavState(values.atPose3(X(k - 1)), values.atVector(V(k - 1))), bias)
        more = gtsam.Values()
        more.insert(X(k), state.pose())
        more.insert(V(k), state.velocity())
        more.insert(B(k), bias)
        return factors, more

    def solved(self, count, heading):
        """The graph of the first `count` fixes from this heading: factors, values and the error."""
        self.heading = heading
        # Half a turn of standard deviation: the prior holds nothing.
        factors, values = self.first_factors(np.pi)
        for k in range(1, count):
            more = self.next_factors(k, values)
            factors.push_back(more[0])
            values.insert(more[1])
            if k % 4 == 0 or k == count - 1:
                values = optimized(factors, values)
        return factors, values, factors.error(values)

    def best(self, count):
        headings = np.arange(START_HEADINGS) * 2 * np.pi / START_HEADINGS
        return min((self.solved(count, heading) for heading in headings), key=lambda solution: solution[2])


def optimized(factors, values):
    return gtsam.LevenbergMarquardtOptimizer(factors, values, gtsam.LevenbergMarquardtParams()).optimize()


def state_at(values, k):
    return gtsam.NavState(values.atPose3(X(k)), values.atVector(V(k))), values.atConstantBias(B(k))


def newest_states(graph):
    """After each fix the newest node: causal."""
    count = len(graph.times)
    states, begin = [None], min(START_FIXES, count)
    for so_far in range(2, begin + 1):
        factors, values, _ = graph.best(so_far)
        states.append(state_at(values, so_far - 1))
    incremental = gtsam.ISAM2(gtsam.ISAM2Params())
    incremental.update(factors, values)
    for k in range(begin, count):
        more = graph.next_factors(k, incremental.calculateEstimate())
        incremental.update(*more)
        incremental.update()
        states.append(state_at(incremental.calculateEstimate(), k))
    return states


def smoothed_states(graph):
    factors, values, _ = graph.best(min(START_FIXES, len(graph.times)))
    for k in range(START_FIXES, len(graph.times)):
        more = graph.next_factors(k, values)
        factors.push_back(more[0])
        values.insert(more[1])
        if k % 20 == 0:
            values = optimized(factors, values)
    values = optimized(factors, values)
    return [state_at(values, k) for k in range(len(graph.times))]


# ---------------------------------------------------------------- scores


def answers(graph, states, times):
    """Positions of the antenna and attitudes at `times`, from the newest node before; not a number without one."""
    places, attitudes = np.full((len(times), 3), np.nan), [None] * len(times)
    for i, (at, k) in enumerate(zip(times, np.searchsorted(graph.times, times, side="right") - 1)):
        if k < 0 or states[k] is None:
            continue
        state, bias = states[k]
        if at > graph.times[k]:
            state = preintegrated(graph.recording, graph.times[k], at, bias).predict(state, bias)
        places[i] = state.position() + state.attitude().rotate(graph.recording.arm)
        attitudes[i] = state.attitude()
    return places, attitudes


def heading_rmse(recording, times, attitudes):
    """About the vertical, degrees; the reference at the nearest instant within 20 ms."""
    if not len(recording.attitude_t):
        return np.nan
    errors = []
    for at, attitude in zip(times, attitudes):
        k = np.argmin(np.abs(recording.attitude_t - at))
        if attitude is None or abs(recording.attitude_t[k] - at) > 0.02:
            continue
        d = attitude.compose(gtsam.Rot3.Quaternion(*recording.attitude[k]).inverse()).matrix()
        errors.append(np.degrees(np.arctan2(d[1, 0] - d[0, 1], d[0, 0] + d[1, 1])))
    return rms(np.array(errors)) if errors else np.nan


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def held(used_t, places, velocities, times):
    """The last used fix held, and moved on with its velocity."""
    k = np.searchsorted(used_t, times, side="right") - 1
    chord = np.vstack([np.zeros(3), np.diff(places, axis=0) / np.diff(used_t)[:, None]])
    velocity = np.where(np.isfinite(velocities).all(axis=1)[:, None], velocities, chord)
    return places[k], places[k] + velocity[k] * (times - used_t[k])[:, None]


def score(path):
    recording = read(path)
    used, times, truth = split(recording)
    # Nodes need inertial samples on both sides; past the last sample it is held.
    node = used & (recording.fix_t >= recording.t[0]) & (recording.fix_t <= recording.t[-1])
    if node.sum() < 3 or not len(times):
        raise Unusable("fewer than 3 fixes to use, or nothing to score at")
    graph = Graph(recording, recording.fix_t[node], recording.fix[node], recording.fix_std[node])
    hold, line = held(recording.fix_t[used], recording.fix[used], recording.fix_velocity[used], times)
    off = lambda places: rms(np.linalg.norm((places - truth)[:, :2], axis=1))
    for name, states in (("gtsam-isam2", newest_states(graph)), ("gtsam-batch", smoothed_states(graph))):
        places, attitudes = answers(graph, states, times)
        vertical = rms((places - truth)[:, 2])
        heading = heading_rmse(recording, times, attitudes)
        yield [name, int(node.sum()), off(places), vertical, heading, off(hold), off(line)]


def recordings(paths):
    for path in paths:
        yield from sorted(path.rglob("*.csv")) if path.is_dir() else [path]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("paths", metavar="PATH", type=Path, nargs="+", help="recordings, or folders of them")
    parser.add_argument("--out", type=Path, help="the CSV file to write; default: standard output")
    arguments = parser.parse_args()
    out = arguments.out.open("w", newline="") if arguments.out else sys.stdout
    writer = csv.writer(out)
    writer.writerow(
        "recording estimator fixes_used horizontal_rmse_m vertical_rmse_m heading_rmse_deg hold_rmse_m extrapolation_rmse_m".split()
    )
    horizontal = {}
    for path in recordings(arguments.paths):
        try:
            for name, fixes, *numbers in score(path):
                writer.writerow([path.stem, name, fixes, *(f"{x:.4f}" if np.isfinite(x) else "" for x in numbers)])
                horizontal.setdefault(name, []).append(numbers[0])
                out.flush()
        except (Unusable, OSError, ValueError, RuntimeError) as error:
            print(f"{path}: left out: {error}", file=sys.stderr)
    for name, values in horizontal.items():
        print(f"{name}: {len(values)} recordings, median {np.median(values):.3f} m horizontally", file=sys.stderr)


if __name__ == "__main__":
    main()
