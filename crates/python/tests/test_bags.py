"""Bags of third-party tools run as the CSV of the same samples does, to the bit; ours are read by third-party tools."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from conftest import Samples, run_program

def messages(drive: Samples, store: Any) -> Iterator[tuple[str, str, int, Any]]:
    """Topic, type, time of the log (later than the stamp) and message, in the order of time."""
    kinds = store.types
    zeros, time = np.zeros(9), kinds["builtin_interfaces/msg/Time"]
    is_ros_1 = "seq" in kinds["std_msgs/msg/Header"].__dataclass_fields__

    def header(time_ns: int, frame: str) -> Any:
        words = {"stamp": time(sec=time_ns // 10**9, nanosec=time_ns % 10**9), "frame_id": frame}
        return kinds["std_msgs/msg/Header"](**words, **({"seq": 7} if is_ros_1 else {}))

    def vector(values: list[float]) -> Any:
        return kinds["geometry_msgs/msg/Vector3"](*values)

    def imu(time_ns: int, v: list[float]) -> Any:
        nowhere = np.array([-1.0, 0, 0, 0, 0, 0, 0, 0, 0])
        turned = kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        made = kinds["sensor_msgs/msg/Imu"]
        return made(header(time_ns, "imu"), turned, nowhere, vector(v[:3]), zeros, vector(v[3:]), zeros)

    def mag(time_ns: int, v: list[float]) -> Any:
        return kinds["sensor_msgs/msg/MagneticField"](header(time_ns, "imu"), vector(v), zeros)

    def fix(time_ns: int, v: list[float]) -> Any:
        status = kinds["sensor_msgs/msg/NavSatStatus"](status=0, service=1)
        covariance = np.diag([2.25, 2.25, 9.0]).reshape(9)
        return kinds["sensor_msgs/msg/NavSatFix"](header(time_ns, "gps"), status, *v, covariance, 2)

    topics: list[tuple[str, str, Callable[[int, list[float]], Any], str]] = [
        ("/imu/data_raw", "sensor_msgs/msg/Imu", imu, "imu"),
        ("/imu/mag", "sensor_msgs/msg/MagneticField", mag, "mag"),
        ("/fix", "sensor_msgs/msg/NavSatFix", fix, "fix"),
    ]
    every = [(t, topic, kind, make, v) for topic, kind, make, name in topics for t, v in drive[name]]
    for time_ns, topic, kind, make, values in sorted(every, key=lambda one: one[0]):
        yield topic, kind, time_ns + 1_000_000, make(time_ns, values)


# Topic, type, time of the log, message.
Logged = tuple[str, str, int, Any]
Order = Callable[[Iterator[Logged]], Iterable[Logged]]


def write_bag_2(
    drive: Samples, path: Path, storage: StoragePlugin, mode: CompressionMode, order: Order = iter
) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer2(path, version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, log_ns, message in order(messages(drive, store)):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], log_ns, store.serialize_cdr(message, kind))


def assert_runs_as(table: Path, recording: Path, folder: Path) -> None:
    """The estimates of the default estimator and of the GNSS/INS are the same bytes."""
    for name, options in {"attitude": [], "navigation": ["--estimator", "error-state"]}.items():
        outs = [folder / f"{name}-{which}.csv" for which in ("table", "bag")]
        for source, out in zip((table, recording), outs):
            run_program("run", source, "--out", out, "--force", *options)
        expected, found = (out.read_text() for out in outs)
        # Two such texts are not for a difference to be shown.
        is_same = expected == found
        assert is_same and len(expected.splitlines()) > 5000, (name, recording)


def test_sensors_that_are_mounted_askew_are_turned_into_the_body(drive: Samples, table: Path, tmp_path: Path) -> None:
    """The Imu looks to the left and lies on its side, /tf_static says so: the run is that of the body; the way to the
    antenna, a barometer and a reference of orientations are read."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds, time = store.types, store.types["builtin_interfaces/msg/Time"]
    quaternion, vector = kinds["geometry_msgs/msg/Quaternion"], kinds["geometry_msgs/msg/Vector3"]
    turn = [0.5, 0.5, 0.5, 0.5]  # x, y, z, w: the Imu's x, y, z axes are the body's y, z, x axes

    def header(time_ns: int, frame: str) -> Any:
        return kinds["std_msgs/msg/Header"](time(time_ns // 10**9, time_ns % 10**9), frame)

    def placed(child: str, way: list[float], turned: list[float]) -> Any:
        made = kinds["geometry_msgs/msg/Transform"](vector(*way), quaternion(*turned))
        return kinds["geometry_msgs/msg/TransformStamped"](header(0, "base_link"), child, made)

    bag = tmp_path / "askew"
    with Writer2(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}

        def write(topic: str, kind: str, log_ns: int, message: Any) -> None:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], log_ns, store.serialize_cdr(message, kind))

        frames = [placed("imu", [0.2, 0.0, 0.1], turn), placed("gps", [-0.8, 0.3, 1.6], [0.0, 0.0, 0.0, 1.0])]
        start_ns = drive["imu"][0][0]
        write("/tf_static", "tf2_msgs/msg/TFMessage", start_ns, kinds["tf2_msgs/msg/TFMessage"](frames))
        for topic, kind, log_ns, message in messages(drive, store):
            names = {"/imu/data_raw": ["angular_velocity", "linear_acceleration"], "/imu/mag": ["magnetic_field"]}
            for name in names.get(topic, []):
                of_body = getattr(message, name)
                # The messages of rosbags may be frozen.
                object.__setattr__(message, name, vector(of_body.y, of_body.z, of_body.x))
            write(topic, kind, log_ns, message)
            time_ns = log_ns - 1_000_000
            if topic != "/imu/data_raw" or (time_ns - start_ns) % 100_000_000:
                continue
            truth = kinds["geometry_msgs/msg/QuaternionStamped"](header(time_ns, "map"), quaternion(0.0, 0.0, 0.0, 1.0))
            write("/ground_truth/orientation", "geometry_msgs/msg/QuaternionStamped", log_ns, truth)
            air = kinds["sensor_msgs/msg/FluidPressure"](header(time_ns, "baro"), 95_000.0, 9.0)
            write("/baro", "sensor_msgs/msg/FluidPressure", log_ns, air)

    told = " ".join(run_program("info", bag).split())
    assert "the Imu by 120.0 deg, the field by 120.0 deg" in told
    assert "-1.000 m forward, -0.300 m right, -1.500 m down" in told
    assert "pressure" in told and "reference" in told
    out, expected = tmp_path / "askew.csv", tmp_path / "level.csv"
    run_program("run", bag, "--out", out)
    run_program("run", table, "--out", expected)
    turned, level = ([[float(x or "nan") for x in line.split(",")[:5]] for line in path.read_text().splitlines()[1:]]
                     for path in (out, expected))
    assert len(turned) == len(level) > 5000
    np.testing.assert_allclose(turned, level, atol=1e-9)
    navigated = run_program("run", bag, "--estimator", "error-state", "--json")
    values = {p["name"]: (p["value"], p["origin"]) for p in json.loads(navigated)["parameters"]}
    arm, origin = values["lever_arm_m"]
    assert origin == "recording"
    np.testing.assert_allclose(arm, [-1.0, -0.3, -1.5], atol=1e-12)


BAGS = {
    "mcap": (StoragePlugin.MCAP, CompressionMode.NONE),
    "mcap-file": (StoragePlugin.MCAP, CompressionMode.FILE),
    "mcap-message": (StoragePlugin.MCAP, CompressionMode.MESSAGE),
    "sqlite": (StoragePlugin.SQLITE3, CompressionMode.NONE),
    "sqlite-file": (StoragePlugin.SQLITE3, CompressionMode.FILE),
    "sqlite-message": (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
}


@pytest.mark.parametrize("kind", BAGS)
def test_a_bag_of_ros_2_runs_as_its_csv(kind: str, drive: Samples, table: Path, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    write_bag_2(drive, bag, *BAGS[kind])
    assert_runs_as(table, bag, tmp_path)
    if kind in {"mcap", "sqlite", "sqlite-message"}:
        [file] = [*bag.glob("*.mcap"), *bag.glob("*.db3")]
        assert_runs_as(table, file, tmp_path)


def write_bag_1(drive: Samples, path: Path, compression: str | None, order: Order = iter) -> Path:
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer1(path)
    if compression:
        writer.set_compression(Writer1.CompressionFormat[compression])
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, log_ns, message in order(messages(drive, store)):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], log_ns, store.serialize_ros1(message, kind))
    return path


@pytest.mark.parametrize("compression", [None, *Writer1.CompressionFormat.__members__])
def test_a_bag_of_ros_1_runs_as_its_csv(compression: str | None, drive: Samples, table: Path, tmp_path: Path) -> None:
    assert_runs_as(table, write_bag_1(drive, tmp_path / "drive.bag", compression), tmp_path)


def by_topics(logged: Iterator[Logged]) -> list[Logged]:
    """One topic after the other, as a script writes that goes through its sensors."""
    return sorted(logged, key=lambda one: (one[0], one[2]))


def with_late_fixes(logged: Iterator[Logged]) -> list[Logged]:
    """Fixes come 0.15 s after the instant that they are of, as from a receiver."""
    late = [(topic, kind, ns + 150_000_000 * (topic == "/fix"), message) for topic, kind, ns, message in logged]
    return sorted(late, key=lambda one: one[2])


@pytest.mark.parametrize("order", [by_topics, with_late_fixes])
@pytest.mark.parametrize("storage", ["mcap", "sqlite", "ros1"])
def test_the_order_of_the_log_changes_nothing(
    storage: str, order: Order, drive: Samples, table: Path, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    if storage == "ros1":
        write_bag_1(drive, bag, None, order)
    else:
        write_bag_2(drive, bag, *BAGS[storage], order)
    assert "the topics are merged by their stamps" in " ".join(run_program("info", bag).split())
    assert_runs_as(table, bag, tmp_path)


def test_poses_are_fixes_where_a_manifest_says_so(drive: Samples, tmp_path: Path) -> None:
    """As the same positions are in a table."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds, time = store.types, store.types["builtin_interfaces/msg/Time"]
    origin = "origin = { latitude_deg = 48.0, longitude_deg = 9.0, height_m = 300.0 }"
    east_m = math.radians(1.0) * 6_371_000.0 * math.cos(math.radians(48.0))
    places = [
        (time_ns, [(longitude - 9.0) * east_m, math.radians(latitude - 48.0) * 6_371_000.0, height - 300.0])
        for time_ns, (latitude, longitude, height) in drive["fix"]
    ]
    covariance = np.zeros(36)
    covariance[[0, 7, 14]] = [2.25, 2.25, 9.0]
    bag = tmp_path / "bag"
    with Writer2(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}

        def write(topic: str, kind: str, log_ns: int, message: Any) -> None:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], log_ns, store.serialize_cdr(message, kind))

        for topic, kind, log_ns, message in messages(drive, store):
            write(topic, kind, log_ns, message)
        for time_ns, place in places:
            level = kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            pose = kinds["geometry_msgs/msg/Pose"](kinds["geometry_msgs/msg/Point"](*place), level)
            pose = kinds["geometry_msgs/msg/PoseWithCovariance"](pose, covariance)
            header = kinds["std_msgs/msg/Header"](time(time_ns // 10**9, time_ns % 10**9), "map")
            kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
            write("/amcl_pose", kind, time_ns, kinds[kind](header, pose))
    manifest = tmp_path / "of_the_bag.toml"
    use = 'use = { gyroscope = "/imu/data_raw", accelerometer = "/imu/data_raw" }\n'
    manifest.write_text(f'file = "bag"\n{use}local_position = {{ topic = "/amcl_pose", {origin} }}\n')

    with (tmp_path / "imu.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t", *(f"{sensor}{axis}" for sensor in "ga" for axis in "xyz")])
        rows.writerows([time_ns, *map(repr, map(float, v))] for time_ns, v in drive["imu"])
    with (tmp_path / "places.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow("tenu")
        rows.writerows([time_ns, *map(repr, map(float, place))] for time_ns, place in places)
    of_tables = tmp_path / "of_tables.toml"
    stamps = 'time = { column = "t", unit = "ns" }\n'
    of_tables.write_text(
        f'body_axes = "flu"\n[[source]]\nfile = "imu.csv"\n{stamps}'
        'gyroscope = { columns = ["gx", "gy", "gz"] }\naccelerometer = { columns = ["ax", "ay", "az"] }\n'
        f'[[source]]\nfile = "places.csv"\n{stamps}'
        f'local_position = {{ columns = ["e", "n", "u"], {origin}, std_m = [1.5, 1.5, 3.0] }}\n'
    )
    texts = []
    for name, recording in (("bag", manifest), ("tables", of_tables)):
        out = tmp_path / f"{name}.csv"
        run_program("run", recording, "--estimator", "error-state", "--out", out)
        texts.append(out.read_text())
    is_same = texts[0] == texts[1]
    assert is_same and len(texts[0].splitlines()) > 5000


def test_ours_is_read_by_rosbags_and_mcap(drive: Samples, table: Path, tmp_path: Path) -> None:
    ours = tmp_path / "ours.mcap"
    run_program("convert", table, ours)
    expected = {"/imu/data_raw": drive["imu"], "/imu/mag": drive["mag"], "/fix": drive["fix"]}

    def values(topic: str, message: Any) -> list[float]:
        if topic == "/fix":
            return [message.latitude, message.longitude, message.altitude]
        vectors = [message.magnetic_field] if topic == "/imu/mag" else [
            message.angular_velocity, message.linear_acceleration]
        return [x for v in vectors for x in (v.x, v.y, v.z)]

    def assert_equal(found: Samples) -> None:
        assert found.keys() == expected.keys()
        for topic, samples in expected.items():
            assert [t for t, _ in found[topic]] == [t for t, _ in samples]
            numbers = [np.array([v for _, v in s]) for s in (found[topic], samples)]
            np.testing.assert_allclose(*numbers, rtol=1e-15)

    found: Samples = {}
    with ours.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            stamp = message.header.stamp
            row = (stamp.sec * 10**9 + stamp.nanosec, values(channel.topic, message))
            found.setdefault(channel.topic, []).append(row)
    assert_equal(found)
    found = {}
    with AnyReader([ours]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            stamp = message.header.stamp
            row = (stamp.sec * 10**9 + stamp.nanosec, values(connection.topic, message))
            found.setdefault(connection.topic, []).append(row)
    assert_equal(found)


def test_what_is_written_is_read_back(table: Path, tmp_path: Path) -> None:
    """Our own `/fix`, once dropped as no sensor, and the fixes of a run."""
    ours, track = tmp_path / "ours.mcap", tmp_path / "track.mcap"
    run_program("convert", table, ours)
    told = run_program("run", ours, "--estimator", "error-state", "--out", track, "--json")
    assert json.loads(told)["fixes"] == 300
    assert "/gps/filtered" in run_program("info", track)


def columns(path: Path) -> dict[str, Any]:
    """The columns of a CSV of estimates."""
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0] if name != "validity"}


def by_topic(path: Path) -> dict[str, list[Any]]:
    """The messages of a file by topic, as two third-party tools decode them; both see the same kinds and numbers."""
    decoded: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            decoded.setdefault(channel.topic, []).append(message)
    with AnyReader([path]) as any_reader:
        counts = {connection.topic: connection.msgcount for connection in any_reader.connections}
        for connection, _, raw in any_reader.messages():
            any_reader.deserialize(raw, connection.msgtype)
    assert counts == {topic: len(messages) for topic, messages in decoded.items()}
    return decoded


def test_a_navigation_run_is_odometry_transforms_and_fixes(table: Path, tmp_path: Path) -> None:
    out, bag = tmp_path / "track.csv", tmp_path / "track.mcap"
    for path in (out, bag):
        run_program("run", table, "--estimator", "error-state", "--out", path)
    rows, topics = columns(out), by_topic(bag)
    assert set(topics) == {"/odometry", "/tf", "/imu/data", "/gps/filtered"}
    assert {len(messages) for messages in topics.values()} == {len(rows["t_s"])} and len(rows["t_s"]) > 1000
    poses = [message.pose for message in topics["/odometry"]]
    for axis, name, sign in (("x", "east_m", 1.0), ("y", "north_m", 1.0), ("z", "down_m", -1.0)):
        found = [sign * getattr(pose.pose.position, axis) for pose in poses]
        np.testing.assert_allclose(found, rows[name], atol=1e-4)
    for place, name in ((0, "east_std_m"), (7, "north_std_m"), (14, "down_std_m")):
        np.testing.assert_allclose([pose.covariance[place] ** 0.5 for pose in poses], rows[name], atol=1e-4)
    heading_std = [math.degrees(pose.covariance[35] ** 0.5) for pose in poses]
    np.testing.assert_allclose(heading_std, rows["heading_std_deg"], atol=1e-3)
    # Forward in the axes of the map is the heading, clockwise from north.
    turns = [message.transforms[0].transform.rotation for message in topics["/tf"]]
    forward = [(1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y + q.w * q.z)) for q in turns]
    heading = [math.degrees(math.atan2(east, north)) for east, north in forward]
    off = (np.array(heading) - rows["heading_deg"] + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(off, 0.0, atol=1e-3)
    # The velocity is in the axes of the body: this car drives forward.
    speed = np.hypot(rows["velocity_north_m_s"], rows["velocity_east_m_s"])
    ahead = np.array([message.twist.twist.linear.x for message in topics["/odometry"]])
    moves = speed > 5.0
    assert np.count_nonzero(moves) > 3000 and np.median(ahead[moves] / speed[moves]) > 0.9
    np.testing.assert_allclose([m.latitude for m in topics["/gps/filtered"]], rows["latitude_deg"], atol=1e-8)
    assert all(m.header.frame_id == "map" and m.child_frame_id == "base_link" for m in topics["/odometry"])


def test_an_attitude_run_is_imu_and_transforms(table: Path, tmp_path: Path) -> None:
    out, bag = tmp_path / "attitude.csv", tmp_path / "attitude.mcap"
    for path in (out, bag):
        run_program("run", table, "--estimator", "mekf", "--out", path)
    rows, topics = columns(out), by_topic(bag)
    assert set(topics) == {"/imu/data", "/tf"}
    for axis in "wxyz":
        found = [getattr(message.orientation, axis) for message in topics["/imu/data"]]
        np.testing.assert_allclose(found, rows["q" + axis], rtol=1e-15)
    heading = [message.orientation_covariance[8] ** 0.5 for message in topics["/imu/data"]]
    np.testing.assert_allclose(heading, rows["heading_std_rad"], rtol=1e-12)
    assert all(m.angular_velocity_covariance[0] == -1.0 for m in topics["/imu/data"])


def test_evo_scores_our_odometry(drive: Samples, table: Path, tmp_path: Path) -> None:
    """Against itself, and against the true path of the car."""
    estimates, truth = tmp_path / "estimates.mcap", tmp_path / "truth.tum"
    run_program("run", table, "--estimator", "error-state", "--out", estimates)
    with truth.open("w") as file:
        east = north = 0.0
        for (before_ns, _), (time_ns, (v_east, v_north, _)) in zip(drive["velocity"], drive["velocity"][1:]):
            seconds = (time_ns - before_ns) * 1e-9
            east, north = east + v_east * seconds, north + v_north * seconds
            file.write(f"{time_ns * 1e-9:.9f} {east:.6f} {north:.6f} 0 0 0 0 1\n")
    evo = Path(sys.executable).parent / "evo_ape"
    environment = {**os.environ, "HOME": str(tmp_path)}

    def scored(*words: object) -> float:
        command = [str(evo), *map(str, words), "--no_warnings"]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, check=False)
        assert ran.returncode == 0, ran.stderr + ran.stdout
        rmse = re.search(r"rmse\s+([0-9.]+)", ran.stdout)
        assert rmse, ran.stdout
        return float(rmse[1])

    # Against itself; of one stamp there may be two, before and after a fix.
    assert scored("mcap", estimates, "/odometry", "/odometry") < 0.5
    # As a trajectory that evo writes of the bag; the origin is the first fix, up to 1.5 m off, so both are laid over each other. The
    # fixes themselves are 3.7 m off (1.5, 1.5, 3).
    evo_traj = [str(evo.with_name("evo_traj")), "mcap", str(estimates), "/odometry", "--save_as_tum", "--no_warnings"]
    subprocess.run(evo_traj, check=True, capture_output=True, timeout=120, env=environment, cwd=tmp_path)
    [saved] = [path for path in tmp_path.glob("*.tum") if path != truth]
    assert scored("tum", truth, saved, "--align", "--t_max_diff", "0.02") < 2.5
