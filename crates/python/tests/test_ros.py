"""The node of ROS 2 beside an independent implementation of its wire, Eclipse Cyclone DDS."""

from __future__ import annotations

import csv
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import ros_peer as ros
from conftest import Samples, program, run_program

# Domains of their own: other nodes of this computer hear nothing of the tests, nor these of each other.
DOMAINS = iter(range(101, 200))


@pytest.fixture
def domain() -> int:
    return next(DOMAINS)


def node(*arguments: object) -> ros.Node:
    return ros.Node(program(), *arguments)


class Collected:
    """What comes on topics while something is sent."""

    def __init__(self, **readers: Any) -> None:
        self.readers = readers
        self.messages: dict[str, list[Any]] = {name: [] for name in readers}

    def take(self) -> None:
        for name, reader in self.readers.items():
            self.messages[name] += reader.take(500)

    def until(self, name: str, count: int, seconds: float = 10.0) -> list[Any]:
        """Waits for so many messages."""
        end = time.monotonic() + seconds
        while len(self.messages[name]) < count and time.monotonic() < end:
            self.take()
            time.sleep(0.005)
        return self.messages[name]

    def until_stamp(self, name: str, time_ns: int, seconds: float = 10.0) -> list[Any]:
        """Waits for the message of this stamp."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not any(ros.stamp(one) == time_ns for one in self.messages[name][-10:]):
            self.take()
            time.sleep(0.005)
        return self.messages[name]


def are_complete(heard: list[Any], wanted: Iterable[int]) -> bool:
    """Whether these stamps were heard, each once, in order, and no others.

    The second may be missing: a volatile reader begins with the first heartbeat that it hears. The first two estimates come in one
    burst, and a heartbeat between them may speak of both; what it speaks of and has not come yet is of the time before the reader
    (Cyclone DDS; https://github.com/ros2/rmw_cyclonedds/issues/367)."""
    wanted = sorted(wanted)
    return [ros.stamp(one) for one in heard] in (wanted, wanted[:1] + wanted[2:])


def ns(text: str) -> int:
    seconds, _, fraction = text.partition(".")
    return int(seconds) * 10**9 + int(fraction.ljust(9, "0"))


def in_step(drive: Samples, names: list[str], end: int, send: Any, answered: Any) -> None:
    """The messages of the drive in the order of their stamps; the next one is sent when the node has answered, or, while
    it has nothing to answer yet, after a while: the order in which messages of two topics come is settled."""
    first = drive["imu"][0][0]
    every = [(t, name, v) for name in names for t, v in drive[name] if t < first + end * 10_000_000]
    for time_ns, name, values in sorted(every, key=lambda one: one[0]):
        before = answered()
        send(name, time_ns, values)
        until = time.monotonic() + (5.0 if before else 0.02)
        while answered() == before and time.monotonic() < until:
            time.sleep(0.0003)


def test_attitudes_are_those_of_a_run_over_the_csv_to_the_bit(
    drive: Samples, table: Path, tmp_path: Path, domain: int
) -> None:
    out = tmp_path / "run.csv"
    run_program("run", table, "--estimator", "mekf", "--sensors", "gyro,acc", "--out", out)
    with out.open() as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        expected = {ns(row["t_s"]): [float(row[name]) for name in ("qw", "qx", "qy", "qz")] for row in rows}
    with node("--domain", domain, "--estimator", "mekf", "--reliable") as running:
        peer = ros.Peer(domain)
        writer = peer.writer("imu/data_raw", ros.Imu)
        collected = Collected(
            imu=peer.reader("imu/data", ros.Imu),
            tf=peer.reader("tf", ros.TFMessage),
            state=peer.reader("/diagnostics", ros.DiagnosticArray),
        )
        ros.matched(running, peer)

        def answered() -> int:
            collected.take()
            return len(collected.messages["imu"])

        in_step(drive, ["imu"], 1200, lambda _, t, v: writer.write(ros.imu(t, v[:3], v[3:])), answered)
        # 0.5 s of alignment have no estimate.
        answers = [time_ns for time_ns, _ in drive["imu"][50:1200]]
        heard = collected.until_stamp("imu", answers[-1])
        transforms = collected.until_stamp("tf", answers[-1])
        states = collected.until("state", len(collected.messages["state"]) + 1)
        told = running.stop()
    assert are_complete(heard, answers) and are_complete(transforms, answers), told
    assert "imu/data_raw: 1200 messages taken." in told and "/northing: mekf" in told, told
    for one in heard:
        q = one.orientation
        said, wanted = [q.w, q.x, q.y, q.z], expected[ros.stamp(one)]
        assert wanted in (said, [-part for part in said]), (ros.stamp(one), said, wanted)
        assert one.header.frame_id == "imu_link"
        assert one.orientation_covariance[0] > 0.0 and one.orientation_covariance[8] > 0.0
    last, measured = heard[-1], dict(drive["imu"])
    rate, force = last.angular_velocity, last.linear_acceleration
    assert [rate.x, rate.y, rate.z, force.x, force.y, force.z] == measured[ros.stamp(last)]
    turned = transforms[-1].transforms[0]
    assert (turned.header.frame_id, turned.child_frame_id) == ("map", "imu_link")
    names = {status.name for one in states for status in one.status}
    assert {"/northing: imu/data_raw", "/northing: estimate", "/northing: accelerometer"} <= names, names


def test_positions_are_those_of_a_run_over_the_csv_to_the_bit(
    drive: Samples, table: Path, tmp_path: Path, domain: int
) -> None:
    out = tmp_path / "run.mcap"
    run_program("run", table, "--estimator", "error-state", "--without", "magnetometer", "--out", out)
    expected: dict[int, Any] = {}
    with out.open("rb") as file:
        for one in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(["/odometry"]):
            expected[ros.stamp(one.decoded_message)] = one.decoded_message
    arguments = ["--domain", domain, "--estimator", "error-state", "--rate", 10000, "--body-frame", "base_link", "--reliable"]
    with node(*arguments) as running:
        peer = ros.Peer(domain)
        writers = {"imu": peer.writer("imu/data_raw", ros.Imu), "fix": peer.writer("fix", ros.NavSatFix)}
        collected = Collected(
            odometry=peer.reader("odometry", ros.Odometry),
            fix=peer.reader("gps/filtered", ros.NavSatFix),
            state=peer.reader("/diagnostics", ros.DiagnosticArray),
        )
        ros.matched(running, peer)

        def send(name: str, time_ns: int, v: list[float]) -> None:
            writers[name].write(ros.imu(time_ns, v[:3], v[3:]) if name == "imu" else ros.fix(time_ns, *v, std=1.5))

        def answered() -> int:
            collected.take()
            return len(collected.messages["odometry"])

        in_step(drive, ["imu", "fix"], 1500, send, answered)
        time.sleep(0.3)
        answered()
        states = collected.until("state", len(collected.messages["state"]) + 1)
        told = running.stop()
    assert "imu/data_raw: 1500 messages taken." in told and "fix: 75 messages taken." in told, told
    # Of one stamp the last: after the fix.
    odometry = {ros.stamp(one): one for one in collected.messages["odometry"]}
    end = max(odometry)
    assert len(odometry) > 1300 and are_complete(list(odometry.values()), (t for t in expected if t <= end)), told
    both = [(one, expected[time_ns]) for time_ns, one in odometry.items() if time_ns < end]
    for said, wanted in both:
        for ours, theirs in ((said.pose.pose, wanted.pose.pose), (said.twist.twist, wanted.twist.twist)):
            assert numbers(ours) == numbers(theirs), ros.stamp(said)
        assert list(said.pose.covariance) == list(wanted.pose.covariance)
        assert (said.header.frame_id, said.child_frame_id) == ("map", "base_link")
    assert abs(collected.messages["fix"][-1].latitude - 48.0) < 0.01
    names = {status.name: status.message for status in states[-1].status}
    assert "fix" in names["/northing: estimate"], names


def test_a_field_that_comes_behind_the_inertial_sample_is_used(drive: Samples, domain: int) -> None:
    with node("--domain", domain, "--reliable") as running:
        peer = ros.Peer(domain)
        writer = peer.writer("imu/data_raw", ros.Imu)
        field = peer.writer("imu/mag", ros.MagneticField)
        collected = Collected(imu=peer.reader("imu/data", ros.Imu))
        ros.matched(running, peer)
        fields = dict(drive["mag"])
        for time_ns, v in drive["imu"][:600]:
            writer.write(ros.imu(time_ns, v[:3], v[3:]))
            if time_ns in fields:
                header = ros.header(time_ns - 4_000_000, "imu_link")
                field.write(ros.MagneticField(header, ros.Vector3(*fields[time_ns]), ros.UNKNOWN))
            time.sleep(0.002)
        heard = collected.until("imu", 545)
        told = running.stop()
    # The first one is older than all that is known of turns.
    assert "imu/mag: 120 messages taken, 1 left out (stamp before the Imu's first, or before a pause of it)." in told, told
    # It knows where north is.
    assert heard[-1].orientation_covariance[8] < 0.5, told


def test_no_field_of_a_burst_is_lost_and_a_unit_that_cannot_be_is_said(drive: Samples, domain: int) -> None:
    with node("--domain", domain, "--estimator", "mekf", "--reliable") as running:
        peer = ros.Peer(domain)
        writer = peer.writer("imu/data_raw", ros.Imu)
        field = peer.writer("imu/mag", ros.MagneticField)
        state = peer.reader("/diagnostics", ros.DiagnosticArray)
        ros.matched(running, peer)
        fields = dict(drive["mag"])
        for burst in range(0, 600, 20):
            samples = drive["imu"][burst : burst + 20]
            for time_ns, v in samples:
                # Of g, where m/s^2 belong.
                writer.write(ros.imu(time_ns, v[:3], [x / 9.80665 for x in v[3:]]))
            for time_ns, _ in samples:
                if time_ns in fields:
                    values = ros.Vector3(*fields[time_ns])
                    field.write(ros.MagneticField(ros.header(time_ns, "imu_link"), values, ros.UNKNOWN))
            time.sleep(0.05)
        time.sleep(1.5)
        states = [status for one in state.take(100) for status in one.status]
        told = running.stop()
    assert "imu/mag: 120 messages taken." in told and "time stamp repeated" not in told, told
    doubt = "the numbers of the accelerometer do not fit their messages"
    assert told.count(doubt) == 2 and "looks like g" in told, told
    assert any(status.level == 2 and doubt in status.message for status in states), states


def numbers(one: Any) -> list[float]:
    """The numbers of a pose or a twist."""
    parts = [getattr(one, name) for name in ("position", "orientation", "linear", "angular") if hasattr(one, name)]
    return [getattr(part, axis) for part in parts for axis in "xyzw" if hasattr(part, axis)]


def at_rest(writer: Any, collected: Collected, first_ns: int, count: int, every_s: float = 0.002) -> None:
    """Samples of a sensor that lies on a table, 100 in a second of its clock."""
    for step in range(count):
        writer.write(ros.imu(first_ns + step * 10_000_000, [0.0, 0.0, 0.01], [0.0, 0.1, 9.81]))
        collected.take()
        time.sleep(every_s)


def at_rest_answers(first_ns: int, count: int) -> list[int]:
    """The stamps of the estimates: 0.5 s of alignment have none."""
    return [first_ns + step * 10_000_000 for step in range(50, count)]


def test_a_peer_that_is_killed_and_comes_back_is_heard_again(domain: int) -> None:
    code = (
        "import sys, time; sys.path.insert(0, sys.argv[1]); import ros_peer as ros\n"
        "writer = ros.Peer(int(sys.argv[2])).writer('imu/data_raw', ros.Imu, ros.BEST_EFFORT)\n"
        "while True:\n"
        "    writer.write(ros.imu(time.time_ns(), [0.0, 0.0, 0.01], [0.0, 0.1, 9.81]))\n"
        "    time.sleep(0.01)\n"
    )
    command = [sys.executable, "-c", code, str(Path(__file__).parent), str(domain)]
    with node("--domain", domain) as running:
        peer = ros.Peer(domain)
        collected = Collected(imu=peer.reader("imu/data", ros.Imu), state=peer.reader("/diagnostics", ros.DiagnosticArray))
        for _ in range(2):
            before = len(collected.messages["imu"])
            driver = subprocess.Popen(command)
            try:
                heard = collected.until("imu", before + 100, seconds=30.0)
                assert len(heard) >= before + 100
            finally:
                driver.send_signal(signal.SIGKILL)
                driver.wait()
            # Its silence is told.
            end = time.monotonic() + 5.0
            silent = False
            while not silent and time.monotonic() < end:
                collected.messages["state"].clear()
                states = collected.until("state", 1, seconds=2.0)
                silent = any("nothing heard for" in status.message for one in states for status in one.status)
            assert silent
        running.stop()


def test_two_robots_in_two_namespaces_hear_their_own(domain: int) -> None:
    robots = ["/robot_1", "/robot_2"]
    nodes = [node("--domain", domain, "--namespace", name, "--reliable") for name in robots]
    with nodes[0] as one, nodes[1] as two:
        peers = [ros.Peer(domain, name) for name in robots]
        writers = [peer.writer("imu/data_raw", ros.Imu) for peer in peers]
        collected = [Collected(imu=peer.reader("imu/data", ros.Imu), tf=peer.reader("tf", ros.TFMessage)) for peer in peers]
        for running, peer in zip((one, two), peers, strict=True):
            ros.matched(running, peer)
        at_rest(writers[0], collected[0], 10**18, 300)
        at_rest(writers[1], collected[1], 2 * 10**18, 200)
        for robot, count, first_ns in zip(collected, (300, 200), (10**18, 2 * 10**18), strict=True):
            answers = at_rest_answers(first_ns, count)
            assert are_complete(robot.until_stamp("imu", answers[-1]), answers)
        assert "/robot_1/northing" in one.stop() and "/robot_2/northing" in two.stop()


def test_a_clock_that_goes_back_begins_anew(domain: int) -> None:
    with node("--domain", domain, "--reliable") as running:
        peer = ros.Peer(domain)
        writer = peer.writer("imu/data_raw", ros.Imu)
        collected = Collected(imu=peer.reader("imu/data", ros.Imu))
        ros.matched(running, peer)
        at_rest(writer, collected, 5000 * 10**9, 200)
        at_rest(writer, collected, 10 * 10**9, 200)
        # The five messages by which it is noticed are lost, and those of the alignment have no estimate.
        before, anew = at_rest_answers(5000 * 10**9, 200), at_rest_answers(10 * 10**9 + 50_000_000, 195)
        heard = collected.until_stamp("imu", anew[-1])
        told = running.stop()
    assert are_complete([one for one in heard if ros.stamp(one) > 100 * 10**9], before), told
    assert [ros.stamp(one) for one in heard if ros.stamp(one) < 100 * 10**9] == anew, told
    assert "went back by 4991.950 s: begun anew" in told, told


def test_what_cannot_be_is_said(domain: int) -> None:
    for arguments, words in [
        (["--imu", "imu data"], "no name of ROS 2"),
        (["--estimator", "dead-reckoning"], "does not listen to"),
        (["--set", "nothing=1"], "unknown parameter"),
        (["--domain", "233"], "233"),
        (["--estimator", "device"], "choose an estimator"),
        (["--estimator", "mekf", "--fix", "/gps/fix"], "does not listen to it"),
    ]:
        ran = subprocess.run([program(), "ros", *arguments], capture_output=True, text=True, timeout=20, check=False)
        assert ran.returncode == 2 and words in ran.stderr, (arguments, ran.stderr)
    with node("--domain", domain) as running:
        time.sleep(1.0)
        told = running.stop()
    assert "No message on imu/data_raw: nothing was estimated." in told, told
