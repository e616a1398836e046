#!/usr/bin/env python3
"""Time of one prediction and update of Stone Soup's trackers, beside `cargo bench -p northing-core --bench tracking`.

usage: tracking.py [--runs N]      (pip install -r oracles/requirements.txt)

The task is that of the benchmark: one target of constant velocity, seen in range and bearing once a second, its own ship's pose
either known exactly (extended Kalman filter), with its covariance added to a converted position (Kalman filter), or carried along as
15 states that are considered and not estimated (Schmidt-Kalman). CPU time of one thread, detections made beforehand.
"""

import argparse
import datetime
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import stonesoup
from stonesoup.base import Property
from stonesoup.models.base import GaussianModel
from stonesoup.models.measurement.base import MeasurementModel
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.angle import Bearing
from stonesoup.types.array import CovarianceMatrix, StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import ExtendedKalmanUpdater, KalmanUpdater, SchmidtKalmanUpdater

SCANS = 300
RADAR = np.diag([20.0**2, np.radians(1.0) ** 2])  # range (m) and bearing (rad)
START = np.array([3000.0, -5.0, 2000.0, -10.0])  # north, its rate, east, its rate
START_STD = np.array([30.0, 8.0, 30.0, 8.0])
OWN = 15  # states of the navigation filter: attitude, velocity, position, biases
OWN_STD = np.repeat([0.01, 0.5, 1.5, 0.02, 0.0004], 3)
NORTH, EAST, HEADING = 6, 7, 2  # where the pose stands among them


class RangeBearing(MeasurementModel, GaussianModel):
    """Range and bearing from the own ship, whose errors are the states after the first four, where there are any."""

    noise_covar: CovarianceMatrix = Property()
    ndim_state: int = Property()
    mapping: tuple = Property(default=(0, 2))

    @property
    def ndim_meas(self):
        return 2

    def covar(self, **_):
        return self.noise_covar

    def rvs(self, *_, **__):
        raise NotImplementedError

    def pdf(self, *_, **__):
        raise NotImplementedError

    def relative(self, state):
        x = np.asarray(state.state_vector, dtype=float).ravel()
        own = x[4:] if self.ndim_state > 4 else np.zeros(OWN)
        return x[0] - own[NORTH], x[2] - own[EAST], own[HEADING]

    def function(self, state, noise=False, **_):
        north, east, heading = self.relative(state)
        return StateVector([np.hypot(north, east), Bearing(np.arctan2(east, north) - heading)])

    def jacobian(self, state, **_):
        north, east, _heading = self.relative(state)
        r = np.hypot(north, east)
        rows = np.zeros((2, self.ndim_state))
        rows[:, [0, 2]] = [[north / r, east / r], [-east / r**2, north / r**2]]
        if self.ndim_state > 4:
            rows[:, [4 + NORTH, 4 + EAST]] = -rows[:, [0, 2]]
            rows[1, 4 + HEADING] = -1.0
        return rows


def blocks(a, b):
    joined = np.zeros((len(a) + len(b),) * 2)
    joined[: len(a), : len(a)] = a
    joined[len(a) :, len(a) :] = b
    return joined


def constant_velocity():
    one = np.array([[1.0, 1.0], [0.0, 1.0]])
    noise = 0.05**2 * np.outer([0.5, 1.0], [0.5, 1.0]) + 1e-12 * np.eye(2)
    return blocks(one, one), blocks(noise, noise)


def converted(z, pose_covariance):
    """The detection as a position, and its covariance with that of the own pose."""
    r, bearing = z
    c, s = np.cos(bearing), np.sin(bearing)
    by_measurement = np.array([[c, -r * s], [s, r * c]])
    by_pose = np.array([[1.0, 0.0, -r * s], [0.0, 1.0, r * c]])
    covariance = by_measurement @ RADAR @ by_measurement.T + by_pose @ pose_covariance @ by_pose.T
    return r * np.array([c, s]), covariance


def detections(rng):
    """One target on a straight line, 300 scans."""
    for k in range(1, SCANS + 1):
        north, east = START[0] + k * START[1], START[2] + k * START[3]
        noise = np.sqrt(np.diag(RADAR)) * rng.standard_normal(2)
        yield np.array([np.hypot(north, east), np.arctan2(east, north)]) + noise


def follow(kind, scans, stamps):
    motion, motion_noise = constant_velocity()
    own = np.diag(OWN_STD**2)
    x, p = START, np.diag(START_STD**2)
    considered = kind == "schmidt"
    if considered:
        x, p = np.r_[x, np.zeros(OWN)], blocks(p, own)
        motion, motion_noise = blocks(motion, 0.7 * np.eye(OWN)), blocks(motion_noise, 0.51 * own)
    transition = LinearGaussianTimeInvariantTransitionModel(transition_matrix=motion, covariance_matrix=motion_noise)
    predictor = KalmanPredictor(transition)
    state = GaussianState(StateVector(x), CovarianceMatrix(p), timestamp=stamps[0])
    radar = RangeBearing(noise_covar=CovarianceMatrix(RADAR), ndim_state=len(x))
    pose_covariance = own[np.ix_([NORTH, EAST, HEADING], [NORTH, EAST, HEADING])]
    for z, stamp in zip(scans, stamps[1:]):
        model, measured = radar, StateVector([z[0], Bearing(z[1])])
        if kind == "converted":
            position, noise = converted(z, pose_covariance)
            model, measured = LinearGaussian(4, (0, 2), CovarianceMatrix(noise)), StateVector(position)
            updater = KalmanUpdater(model)
        elif considered:
            updater = SchmidtKalmanUpdater(model, consider=np.arange(4 + OWN) >= 4)
        else:
            updater = ExtendedKalmanUpdater(model)
        predicted = predictor.predict(state, timestamp=stamp)
        state = updater.update(SingleHypothesis(predicted, Detection(measured, timestamp=stamp, measurement_model=model)))
    return np.asarray(state.state_vector, dtype=float).ravel()[:4]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10)
    runs = parser.parse_args().runs
    rng = np.random.default_rng(1)
    worlds = [list(detections(rng)) for _ in range(runs)]
    start = datetime.datetime(2020, 1, 1)
    stamps = [start + datetime.timedelta(seconds=k) for k in range(SCANS + 1)]
    truth = START + SCANS * np.array([START[1], 0.0, START[3], 0.0])
    print(f"Stone Soup {stonesoup.__version__}, {runs} runs of {SCANS} scans")
    for kind in ("uncompensated", "converted", "schmidt"):
        before = time.process_time()
        ends = np.array([follow(kind, scans, stamps) for scans in worlds])
        each = (time.process_time() - before) / (runs * SCANS)
        off = np.sqrt(np.mean(np.sum((ends - truth)[:, [0, 2]] ** 2, axis=1)))
        print(f"{kind:<15}{1e6 * each:8.0f} us an update{off:8.1f} m off at the end (RMS)")


if __name__ == "__main__":
    main()
