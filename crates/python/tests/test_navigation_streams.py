"""The GNSS/INS and the Schmidt-Kalman tracker sample by sample: equal to runs, pickled in the middle, and what they refuse."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import northing as no
from conftest import Samples


def feed(ins: no.GnssIns, drive: Samples, start: int, stop: int) -> list[Any]:
    """The drive's samples as an inertial unit gives them, forward, right, down; what the fixes told."""
    events = [(time_ns, 0, values) for time_ns, values in drive["imu"]]
    events += [(time_ns, 1, values) for time_ns, values in drive["mag"]]
    events += [(time_ns, 2, values) for time_ns, values in drive["fix"]]
    events.sort(key=lambda event: event[:2])
    told = []
    for time_ns, kind, values in events[start:stop]:
        if kind == 0:
            turned = [values[0], -values[1], -values[2], values[3], -values[4], -values[5]]
            ins.imu(time_ns, turned[:3], turned[3:])
        elif kind == 1:
            ins.magnetometer(time_ns, [values[0] * 1e6, -values[1] * 1e6, -values[2] * 1e6])
        else:
            told.append(ins.gnss_position(time_ns, *values, std=(1.5, 1.5, 3.0)))
    return told


def test_a_gnss_ins_is_the_run_over_the_recording_to_the_bit_and_goes_on_from_a_pickle(drive: Samples, table: Path) -> None:
    run = no.open(table).run("error-state")
    ins = no.GnssIns()
    assert ins.validity == "aligning" and ins.geodetic is None and ins.covariance is None and ins.time_ns is None
    told = []
    cuts = [0, 30, 200, 900, 4000, 10**9]  # before the first fix, in the alignment, driving
    for start, stop in zip(cuts, cuts[1:]):
        again = pickle.loads(pickle.dumps(ins))
        assert again.state == ins.state and again.config == ins.config
        told += feed(ins, drive, start, stop)
        feed(again, drive, start, stop)
        assert again.state == ins.state
        ins = again
    np.testing.assert_array_equal(ins.geodetic, run.geodetic[-1])
    np.testing.assert_array_equal(ins.ned, run.ned[-1])
    np.testing.assert_array_equal(ins.position_covariance, run.covariance[-1])
    np.testing.assert_array_equal(ins.velocity, run.velocity[-1])
    np.testing.assert_array_equal(ins.quat, run.quat[-1])
    assert ins.validity == run.validity[-1] and ins.time_ns == run.time_ns[-1]
    nis = run.innovations["gnss-position"]["nis"]
    np.testing.assert_array_equal([horizontal.nis if horizontal.degrees_of_freedom else np.nan for horizontal, _ in told], nis)


def test_a_long_drive_takes_the_origin_along_as_a_run_does(tmp_path: Path) -> None:
    """Two minutes on a motorway: kilometres from the first fix; velocities, too."""
    drive = no.virtual_vehicle("car-smooth", seed=4, duration=150.0)
    run = drive.save(tmp_path / "drive.csv").run("error-state")
    ins = no.GnssIns()
    events = [(int(t), 0, k) for k, t in enumerate(drive["gyr_time_ns"])]
    events += [(int(t), 1, k) for k, t in enumerate(drive["gnss_time_ns"])]
    events += [(int(t), 2, k) for k, t in enumerate(drive.get("gnss_velocity_time_ns", []))]
    for time_ns, kind, k in sorted(events):
        if kind == 0:
            ins.imu(time_ns, drive["gyr"][k], drive["acc"][k])
        elif kind == 1:
            ins.gnss_position(time_ns, *drive["gnss_geodetic"][k], std=drive["gnss_std"][k])
        else:
            ins.gnss_velocity(time_ns, drive["gnss_velocity"][k], std=drive["gnss_velocity_std"][k])
    assert np.linalg.norm(ins.ned) > 1200.0
    # The file has degrees as radians: the last digit of a fix may differ.
    np.testing.assert_allclose(ins.ned, run.ned[-1], atol=1e-6)
    np.testing.assert_allclose(ins.quat, run.quat[-1], atol=1e-9)
    error = ins.ned - (drive["true_antenna_ned"][-1] - drive["gnss_ned"][0])
    assert np.linalg.norm(error) < 5.0 * np.sqrt(np.trace(ins.position_covariance))


def test_what_cannot_be_is_skipped_with_the_reason() -> None:
    ins = no.GnssIns(no.GnssInsConfig(validity_invalid_after_s=60.0))
    assert ins.config.validity_invalid_after_s == 60.0
    assert ins.imu(0, [np.nan, 0, 0], [0, 0, -9.81]) == "not a finite number"
    assert ins.imu(1, [0, 0, 0], [0, 0, -9.81]) is None
    assert ins.imu(1, [0, 0, 0], [0, 0, -9.81]) == "time stamp repeated or going back"
    for fix, std, reason in [
        ((91.0, 9.0), 2.0, "far out of range"),
        ((np.nan, 9.0), 2.0, "not a finite number"),
        ((48.0, 9.0), 0.0, "far out of range"),
        ((48.0, 9.0), np.nan, "not a finite number"),
    ]:
        horizontal, vertical = ins.gnss_position(2, *fix, std=std)
        assert (horizontal.outcome, horizontal.reason) == (vertical.outcome, vertical.reason) == ("skipped", reason)
    assert ins.barometer(3, 1.0).reason == "far out of range"
    with pytest.raises(TypeError):
        ins.gnss_position(4, 48.0, 9.0, 100.0)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="gravity=-1.0: expected"):
        no.GnssInsConfig(gravity=-1.0)
    with pytest.raises(ValueError, match="state: "):
        ins.state = '{"filter": {}, "frame": null}'


def test_a_schmidt_kalman_is_the_trackers_of_a_simulated_run() -> None:
    """The black-box tracker of the scenario, from the own poses and detections that the run's columns hold."""
    run = no.simulate(trackers=["schmidt-black-box"], seed=3, run=2)
    columns = run.to_dict()

    def ship(k: int) -> no.OwnShip:
        upper = [columns[name][k] for name in columns if name.startswith("nav_cov_")]
        nn, ne, nh, ee, eh, hh = upper
        pose = (columns[f"nav_{name}"][k] for name in ("north_m", "east_m", "heading_rad"))
        return no.OwnShip(*pose, covariance=[[nn, ne, nh], [ne, ee, eh], [nh, eh, hh]])

    target = no.SchmidtKalman(
        0, columns["range_m"][0], columns["bearing_rad"][0], ship(0), range_std=20.0, bearing_std=np.radians(1.0),
        acceleration_std=0.05, velocity_std=8.0,
        position_correlation_s=0.41, heading_correlation_s=3.3,
    )
    for k in range(1, len(run)):
        if k == 40:
            target = pickle.loads(pickle.dumps(target))
        told = target.scan(k * 1_000_000_000, columns["range_m"][k], columns["bearing_rad"][k], ship(k))
        assert told.outcome == "fused" and told.degrees_of_freedom == 2
    expected = [columns[f"schmidt-black-box_{name}"][-1] for name in ("north_m", "v_north_m_s", "east_m", "v_east_m_s")]
    np.testing.assert_allclose(target.track, expected, rtol=1e-6)
    long, short, direction = target.ellipse(0.95)
    assert long > short > 0.0 and abs(direction) <= np.pi
    np.testing.assert_allclose(target.std**2, np.diagonal(target.covariance))


def test_a_tracker_follows_the_errors_of_a_gnss_ins_and_is_pickled_with_it(drive: Samples) -> None:
    ins = no.GnssIns()
    feed(ins, drive, 0, 4000)
    first = no.SchmidtKalman(
        ins.time_ns, 900.0, 0.4, ins, range_std=5.0, bearing_std=0.01, acceleration_std=0.1, velocity_std=5.0
    )
    assert first.cross_covariance.shape[1] == 4 and np.abs(first.cross_covariance).max() > 0.0
    before = first.cross_covariance
    both = pickle.loads(pickle.dumps((ins, first)))
    for filter_, target in ((ins, first), both):
        feed(filter_, drive, 4000, 6000)
        assert target.scan(filter_.time_ns, 880.0, 0.42).outcome == "fused"
    np.testing.assert_array_equal(first.track, both[1].track)
    np.testing.assert_array_equal(first.cross_covariance, both[1].cross_covariance)
    assert not np.array_equal(before, first.cross_covariance)
    # The error of the heading stays in the position however often the target is seen.
    heading_std = np.sqrt(ins.covariance[2, 2])
    for _ in range(3):
        first.scan(first.time_ns + 1, 880.0, 0.42)
    assert first.ellipse(0.5)[0] > 0.0 and heading_std > 0.0


def test_refusals_of_trackers() -> None:
    ship = no.OwnShip(0.0, 0.0, 0.0, std=(1.0, 1.0, 0.01))
    noise = {"range_std": 5.0, "bearing_std": 0.01, "acceleration_std": 0.1, "velocity_std": 5.0}
    with pytest.raises(ValueError, match="how well is the pose known"):
        no.OwnShip(0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="no pose of a ship"):
        no.OwnShip(0.0, np.nan, 0.0, std=(1.0, 1.0, 0.01))
    with pytest.raises(ValueError, match="radar.bearing_std must be"):
        no.SchmidtKalman(0, 900.0, 0.4, ship, **{**noise, "bearing_std": -1.0})
    with pytest.raises(ValueError, match="the first detection, range=-1"):
        no.SchmidtKalman(0, -1.0, 0.4, ship, **noise)
    with pytest.raises(ValueError, match='coupling="loose": expected exact, feed-forward or open-loop'):
        no.SchmidtKalman(0, 900.0, 0.4, ship, coupling="loose", **noise)
    with pytest.raises(ValueError, match="no position yet"):
        no.SchmidtKalman(0, 900.0, 0.4, no.GnssIns(), **noise)
    target = no.SchmidtKalman(0, 900.0, 0.4, ship, **noise)
    with pytest.raises(ValueError, match="own is missing"):
        target.scan(1_000_000_000, 900.0, 0.4)
    assert target.scan(0, 900.0, 0.4, ship).reason == "time stamp repeated or going back"
    assert target.scan(10**9, np.nan, 0.4, ship).reason == "not a finite number"
    with pytest.raises(ValueError, match="probability=1"):
        target.ellipse(1.0)
