"""The node on a robot: sensors mounted askew, a barometer, parameters that are set while it runs, a minute of samples."""

from __future__ import annotations

import math
import time
from typing import Any

import pytest

import ros_peer as ros
from conftest import Samples
from test_ros import Collected, node

# Domains of their own, apart from those of test_ros.py.
DOMAINS = iter(range(201, 230))


@pytest.fixture
def domain() -> int:
    return next(DOMAINS)


def tilt_deg(q: Any) -> float:
    """How far the body's up axis is from the vertical."""
    return math.degrees(math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (q.x * q.x + q.y * q.y)))))


# The Imu's x, y, z axes are the body's y, z, x axes: it lies on its side.
ON_ITS_SIDE = [0.5, 0.5, 0.5, 0.5]
LEVEL = [0.0, 0.0, 0.0, 1.0]
FRAMES = ros.TFMessage([
    ros.transform("base_link", "imu_link", [0.2, 0.0, 0.1], ON_ITS_SIDE),
    ros.transform("base_link", "gps", [-0.8, 0.3, 1.6], LEVEL),
])


def standing(peer: ros.Peer, running: ros.Node, seconds: float, collected: Collected, first_ns: int = 10**18) -> None:
    """A robot that stands: an Imu on its side, 100 Hz, and fixes at 5 Hz, three times as fast as it is."""
    imu, fix = peer.writer("imu/data_raw", ros.Imu), peer.writer("fix", ros.NavSatFix)
    ros.matched(running, peer)
    for step in range(int(seconds * 100)):
        time_ns = first_ns + step * 10_000_000
        if step % 20 == 0:
            # As of a receiver, no two are the same.
            fix.write(ros.fix(time_ns, 48.0 + 1e-7 * math.sin(step), 9.0, 300.0, std=0.5))
        # Up is the body's z axis, which is the Imu's y axis.
        imu.write(ros.imu(time_ns, [0.0, 0.001, 0.0], [0.01, 9.81, 0.02 * math.sin(step)]))
        collected.take()
        time.sleep(0.003)


@pytest.mark.parametrize("is_late", [False, True])
def test_sensors_mounted_askew_are_turned_and_the_pose_is_that_of_the_body(is_late: bool, domain: int) -> None:
    with node("--domain", domain, "--estimator", "error-state", "--reliable", "--rate", 200) as running:
        peer = ros.Peer(domain)
        frames = peer.writer("tf_static", ros.TFMessage, ros.LATCHED)
        collected = Collected(
            imu=peer.reader("imu/data", ros.Imu),
            odometry=peer.reader("odometry", ros.Odometry),
            tf=peer.reader("tf", ros.TFMessage),
        )
        if not is_late:
            # Long before anybody listens, as robot_state_publisher does.
            frames.write(FRAMES)
        standing(peer, running, 6.0, collected)
        if is_late:
            for readers in collected.messages.values():
                readers.clear()
            frames.write(FRAMES)
            time.sleep(0.3)
            standing(peer, running, 6.0, collected, 10**18 + 10**10)
        collected.until("odometry", 100)
        told = " ".join(running.stop().split())
    assert "turned into base_link, as /tf_static has it: the Imu by 120.0 deg" in told, told
    assert "From the Imu to the antenna, as /tf_static has it: -1.000 m forward, -0.300 m right, -1.500 m down." in told, told
    last = {name: collected.messages[name][-1] for name in ("imu", "odometry", "tf")}
    assert last["imu"].header.frame_id == last["odometry"].child_frame_id == "base_link"
    assert last["tf"].transforms[0].child_frame_id == "base_link"
    assert tilt_deg(last["imu"].orientation) < 1.0
    # What was measured is told in the axes of the body, too.
    assert last["imu"].linear_acceleration.z == pytest.approx(9.81)
    # The antenna is 1.6 m above the body's origin and 0.85 m beside it.
    place = last["odometry"].pose.pose.position
    assert place.z == pytest.approx(-1.6, abs=0.3)
    assert math.hypot(place.x, place.y) == pytest.approx(math.hypot(0.8, 0.3), abs=0.5)


def test_a_barometer_is_heard(drive: Samples, domain: int) -> None:
    """What the filter makes of it is its own affair: while the alignment in motion makes the state, nothing."""
    with node("--domain", domain, "--estimator", "error-state", "--reliable") as running:
        peer = ros.Peer(domain)
        collected = Collected(state=peer.reader("/diagnostics", ros.DiagnosticArray))
        imu, fix = peer.writer("imu/data_raw", ros.Imu), peer.writer("fix", ros.NavSatFix)
        pressure = peer.writer("pressure", ros.FluidPressure)
        ros.matched(running, peer)
        fixes = dict(drive["fix"])
        for step, (time_ns, v) in enumerate(drive["imu"][:1000]):
            if found := fixes.get(time_ns + 3_000_000):
                fix.write(ros.fix(time_ns, *found, std=1.5))
            if step % 10 == 0:
                # Of 300 m, with 0.2 m of noise.
                pressure.write(ros.FluidPressure(ros.header(time_ns, "baro"), 97_773.0 + 2.0 * math.sin(step), 4.0))
            imu.write(ros.imu(time_ns, v[:3], v[3:]))
            collected.take()
            time.sleep(0.002)
        collected.until("state", len(collected.messages["state"]) + 1)
        told = running.stop()
    assert "pressure: 100 messages taken." in told and "barometer" in told, told
    said = [status for one in collected.messages["state"] for status in one.status]
    assert any(status.name == "/northing: pressure" and "messages in a second" in status.message for status in said), said
    assert any(status.name == "/northing: barometer" for status in said), said


def test_parameters_are_set_while_the_node_runs_and_bad_ones_are_refused(domain: int) -> None:
    with node("--domain", domain, "--estimator", "mekf", "--reliable") as running:
        peer = ros.Peer(domain)
        collected = Collected(imu=peer.reader("imu/data", ros.Imu))
        imu = peer.writer("imu/data_raw", ros.Imu)
        ros.matched(running, peer)

        def lies(first_ns: int) -> Any:
            collected.messages["imu"].clear()
            for step in range(200):
                imu.write(ros.imu(first_ns + step * 10_000_000, [0.0, 0.0, 0.0], [0.0, 0.0, 9.81]))
                time.sleep(0.002)
            return collected.until("imu", 140)[-1]

        def value(name: str) -> float:
            reply = peer.call("/northing/get_parameters", ros.GetParameters([name]), ros.GetParametersReply)
            return float(reply.values[0].double_value)

        def put(*parameters: tuple[str, ros.ParameterValue]) -> list[tuple[bool, str]]:
            request = ros.SetParameters([ros.Parameter(*parameter) for parameter in parameters])
            reply = peer.call("/northing/set_parameters", request, ros.SetParametersReply)
            return [(bool(result.successful), result.reason) for result in reply.results]

        before = lies(10**18)
        usual = value("accelerometer_std")
        assert usual > 0.0
        assert put(("accelerometer_std", ros.number(10.0 * usual)), ("gyroscope_noise_density", ros.number(0.01))) == [(True, "")] * 2
        after = lies(10**18 + 10**10)
        assert value("accelerometer_std") == 10.0 * usual and value("gyroscope_noise_density") == 0.01
        # What is stated of the inclination follows R.
        assert after.orientation_covariance[0] > 4.0 * before.orientation_covariance[0]
        [(is_set, why)] = put(("accelerometer_std", ros.number(-1.0)))
        assert not is_set and "accelerometer_std" in why and "expected" in why, why
        [(is_set, why)] = put(("no_such_parameter", ros.number(1.0)))
        assert not is_set and "no_such_parameter" in why, why
        assert value("accelerometer_std") == 10.0 * usual
        told = " ".join(running.stop().split())
    assert f"Set accelerometer_std={10.0 * usual!r}" in told and "gyroscope_noise_density=0.01: begun anew." in told, told
    parameters = told.split("parameters")[-1]
    assert f"accelerometer_std {10.0 * usual:g} m/s^2 (set)" in parameters and "gyroscope_noise_density 0.01" in parameters, told


def test_of_a_minute_of_samples_none_is_lost(domain: int) -> None:
    """100 samples of an Imu and 5 fixes in each of 60 s, by best effort, five times as fast."""
    with node("--domain", domain, "--estimator", "error-state") as running:
        peer = ros.Peer(domain)
        imu = peer.writer("imu/data_raw", ros.Imu, ros.BEST_EFFORT)
        fix = peer.writer("fix", ros.NavSatFix, ros.BEST_EFFORT)
        ros.matched(running, peer)
        begin = time.monotonic()
        for step in range(6000):
            time.sleep(max(0.0, begin + 0.002 * step - time.monotonic()))
            time_ns = 10**18 + step * 10_000_000
            imu.write(ros.imu(time_ns, [0.0, 0.0, 0.1], [0.0, 0.0, 9.81]))
            if step % 20 == 0:
                fix.write(ros.fix(time_ns, 48.0 + 1e-7 * math.sin(step), 9.0, 300.0))
        time.sleep(0.5)
        told = running.stop()
    assert "imu/data_raw: 6000 messages taken." in told and "fix: 300 messages taken." in told, told
