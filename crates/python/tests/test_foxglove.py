"""A run in Foxglove: an independent viewer sees the transform, sets parameters, plays, pauses and seeks."""

from __future__ import annotations

import csv
import json
import math
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.decoder import DecoderFactory as McapDecoderFactory
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoder

from conftest import REPOSITORY, program, run_program
from foxglove_viewer import ENDED, PAUSED, PLAYING, Served, Viewer


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("walk")
    path = folder / "walk.csv"
    run_program("demo", "--record-only", path)
    return path


@pytest.fixture
def served(walk: Path) -> Iterator[Served]:
    with Served(program(), "run", walk, "--estimator", "mekf") as served:
        yield served
    assert served.ended == 0


def ns(seconds: str) -> int:
    whole, _, fraction = seconds.partition(".")
    return int(whole) * 10**9 + int(fraction.ljust(9, "0"))


def estimates(recording: Path, folder: Path, *options: str) -> dict[int, list[float]]:
    """Stamp, and quaternion w, x, y, z, as `--out` writes them."""
    out = folder / "estimates.csv"
    run_program("run", recording, "--estimator", "mekf", "--out", out, "--force", *options)
    with out.open() as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return {ns(r["t_s"]): [float(r[f"q{axis}"]) for axis in "wxyz"] for r in rows}


def compare(viewer: Viewer, expected: dict[int, list[float]]) -> int:
    """Every transform is the estimate of its stamp; how many there were."""
    for time_ns, transform in viewer.messages["/tf"]:
        assert (transform.parent_frame_id, transform.child_frame_id) == ("map", "base_link")
        assert transform.timestamp.ToNanoseconds() == time_ns
        got = [getattr(transform.rotation, axis) for axis in "wxyz"]
        assert got == pytest.approx(expected[time_ns], abs=1e-8)
    return len(viewer.messages["/tf"])


def test_a_viewer_sees_every_estimate_and_what_the_innovations_told(
    served: Served, walk: Path, tmp_path: Path
) -> None:
    expected = estimates(walk, tmp_path)
    viewer = served.viewer()
    assert {"playbackControl", "parameters", "time"} <= set(viewer.info["capabilities"])
    viewer.whole()
    # The recording has 100 a second, of which a viewer is given 50.
    assert compare(viewer, expected) == pytest.approx(len(expected) / 2, abs=2)
    stamps = [time_ns for time_ns, _ in viewer.messages["/tf"]]
    assert stamps == sorted(set(stamps)), "told once, in order"
    angles = viewer.messages["/attitude"][-1][1]
    assert 0.0 < angles["yaw_std_deg"] < 10.0
    innovations = [m for _, m in viewer.messages["/innovations/accelerometer"] if "nis" in m]
    assert sum(m["nis"] for m in innovations) / len(innovations) < 30.0
    for message in innovations:
        assert message["degrees_of_freedom"] == 3
        assert message["nis"] >= 0.0
    lamps = viewer.messages["/lamps/accelerometer"]
    assert {lamp["tone"] for _, lamp in lamps} <= {"good", "info", "warn", "bad", "idle"}
    assert viewer.messages["/log"], "a lamp that changes is told in the log"


def test_a_viewer_pauses_seeks_and_goes_on(served: Served) -> None:
    viewer = served.viewer()
    viewer.until(lambda: viewer.messages.get("/tf"))
    assert viewer.states[0].status == PLAYING, "it begins when the first viewer comes"
    paused = viewer.control(play=False)
    assert paused.status == PAUSED
    viewer.quiet()
    viewer.messages.clear()
    viewer.quiet()
    assert not viewer.messages, "nothing is told while it is paused"

    target = 30 * 10**9
    jumped = viewer.control(play=False, seek_ns=target)
    assert jumped.has_jumped
    assert (jumped.status, jumped.time_ns) == (PAUSED, target)
    viewer.quiet()
    [(time_ns, _)] = viewer.messages["/tf"]
    assert 0 <= target - time_ns <= 20_000_000, "the state of that moment is shown"
    assert viewer.time_ns == target

    viewer.messages.clear()
    assert viewer.control(play=True, speed=10.0).status == PLAYING
    viewer.until(lambda: viewer.messages.get("/tf") and viewer.messages["/tf"][-1][0] > target + 2 * 10**9)
    assert viewer.messages["/tf"][0][0] > target
    beyond = viewer.control(play=True, seek_ns=2**62)
    assert beyond.time_ns < 100 * 10**9, "a jump ends at the end of the recording"
    viewer.until(lambda: any(state.status in (ENDED, PLAYING) for state in viewer.states[-2:]))


def test_a_viewer_sets_r_and_the_estimator_runs_again(served: Served, walk: Path, tmp_path: Path) -> None:
    viewer = served.viewer()
    viewer.send("getParameters", parameterNames=[], id="all")
    viewer.until(lambda: viewer.parameters)
    usual = viewer.parameters["accelerometer_std"]
    assert usual > 0.0 and "gyroscope_noise_density" in viewer.parameters

    viewer.send("setParameters", parameters=[{"name": "accelerometer_std", "value": 2.5, "type": "float64"}], id="set")
    viewer.until(lambda: viewer.parameters["accelerometer_std"] == 2.5)
    viewer.until(lambda: any("ran again with accelerometer_std=2.5" in s["message"] for s in viewer.statuses))
    viewer.whole()
    changed, before = estimates(walk, tmp_path, "--set", "accelerometer_std=2.5"), estimates(walk, tmp_path)
    assert compare(viewer, changed) > 1000
    assert max(abs(a - b) for t in changed for a, b in zip(changed[t], before[t])) > 1e-4, "it makes a difference"


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("accelerometer_std", -1.0, "accelerometer_std"),
        ("accelerometer_std", "soft", "accelerometer_std"),
        ("position_std_m", 3.0, "no parameter of this estimator"),
    ],
)
def test_a_value_that_does_not_fit_is_refused_with_the_reason(served: Served, name: str, value: Any, reason: str) -> None:
    viewer = served.viewer()
    viewer.send("getParameters", parameterNames=["accelerometer_std"], id="one")
    viewer.until(lambda: viewer.parameters)
    before = dict(viewer.parameters)
    assert list(before) == ["accelerometer_std"]
    viewer.parameters.clear()
    viewer.send("setParameters", parameters=[{"name": name, "value": value}], id="set")
    viewer.until(lambda: any(s["level"] == 2 and reason in s["message"] for s in viewer.statuses))
    viewer.send("getParameters", parameterNames=["accelerometer_std"], id="again")
    viewer.until(lambda: "accelerometer_std" in viewer.parameters)
    assert viewer.parameters["accelerometer_std"] == before["accelerometer_std"]


def test_a_drive_is_on_the_map(table: Path) -> None:
    with Served(program(), "run", table, "--estimator", "error-state") as served:
        viewer = served.viewer()
        viewer.whole()
    fixes, places = viewer.messages["/fix"], viewer.messages["/position"]
    assert len(fixes) == 300, "each once"
    assert len(places) > 2500
    for time_ns, place in places[-500:]:
        _, fix = min(fixes, key=lambda entry: abs(entry[0] - time_ns))
        north = math.radians(place.latitude - fix.latitude) * 6.37e6
        east = math.radians(place.longitude - fix.longitude) * 6.37e6 * math.cos(math.radians(48.0))
        assert math.hypot(north, east) < 8.0
        assert place.position_covariance_type == 3 and 0.0 < place.position_covariance[0] < 25.0
    texts = [lamp["text"] for _, lamp in viewer.messages["/lamps/position"]]
    assert texts[-1].startswith("fixes are used")
    assert "nis" in viewer.messages["/innovations/gnss-position"][-1][1]
    assert viewer.messages["/velocity"][-1][1]["speed_m_s"] == pytest.approx(10.0, abs=1.0)


class Json(McapDecoderFactory):
    """Messages of JSON, for the reader of MCAP files."""

    def decoder_for(self, message_encoding: str, schema: Any) -> Any:
        return json.loads if message_encoding == "json" else None


def file_of(path: Path) -> dict[str, list[tuple[int, str, Any]]]:
    """Stamp, type and message by topic, as the library of the format and that of Protobuf read them."""
    found: dict[str, list[tuple[int, str, Any]]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[Json(), ProtobufDecoder()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema is not None
            found.setdefault(channel.topic, []).append((message.log_time, schema.name, decoded))
    return found


def test_a_run_is_a_file_of_foxglove(table: Path, walk: Path, tmp_path: Path) -> None:
    out, rows = tmp_path / "drive.mcap", tmp_path / "drive.csv"
    told = run_program("run", table, "--estimator", "error-state", "--out", out, "--messages", "foxglove")
    assert f"For Foxglove: {out}" in told
    run_program("run", table, "--estimator", "error-state", "--out", rows)
    topics = file_of(out)
    kinds = {topic: messages[0][1] for topic, messages in topics.items()}
    assert kinds["/tf"] == "foxglove.FrameTransform" and kinds["/position"] == kinds["/fix"] == "foxglove.LocationFix"
    assert kinds["/log"] == "foxglove.Log"
    assert {"/attitude", "/velocity", "/innovations/gnss-position", "/lamps/position"} <= set(topics)
    assert len(topics["/fix"]) == 300
    with rows.open() as file:
        # Of one stamp the last: after the fix.
        expected = {ns(row["t_s"]): row for row in csv.DictReader(file)}
    assert len(topics["/tf"]) == len(topics["/position"]) > 2500
    compared = 0
    for (time_ns, _, transform), (_, _, place) in zip(topics["/tf"], topics["/position"], strict=True):
        row = expected[time_ns]
        moved = [transform.translation.x - float(row["east_m"]), transform.translation.y - float(row["north_m"])]
        if max(map(abs, moved)) < 1e-3:
            # The other ones are those before a fix of the same stamp.
            assert place.latitude == pytest.approx(float(row["latitude_deg"]), abs=2e-9)
            assert place.position_covariance[4] == pytest.approx(float(row["north_std_m"]) ** 2, rel=1e-2)
            compared += 1
    assert compared > 0.9 * len(topics["/tf"])
    # The layout shows it.
    layout = json.loads((REPOSITORY / "examples" / "foxglove-layout.json").read_text())
    assert layout["configById"]["map!place"]["followTopic"] in topics

    attitude = tmp_path / "walk.mcap"
    run_program("run", walk, "--estimator", "mekf", "--out", attitude, "--messages", "foxglove")
    compare_file(file_of(attitude)["/tf"], estimates(walk, tmp_path))
    refusals = [
        (["--out", tmp_path / "x.csv", "--messages", "foxglove"], "name it .mcap"),
        (["--messages", "foxglove"], "--out"),
        (["--out", out, "--messages", "foxglove"], "exists already and is not overwritten"),
    ]
    for words, reason in refusals:
        ran = subprocess.run([program(), "run", walk, *words], capture_output=True, text=True, timeout=60, check=False)
        assert ran.returncode == 2 and reason in ran.stderr, ran.stderr


def compare_file(transforms: list[tuple[int, str, Any]], expected: dict[int, list[float]]) -> None:
    assert len(transforms) > 1000
    for time_ns, _, transform in transforms:
        got = [getattr(transform.rotation, axis) for axis in "wxyz"]
        assert got == pytest.approx(expected[time_ns], abs=1e-8)


def test_the_layout_names_topics_and_fields_that_there_are(served: Served, table: Path) -> None:
    layout = json.loads((REPOSITORY / "examples" / "foxglove-layout.json").read_text())
    plots = [path["value"] for config in layout["configById"].values() for path in config.get("paths", [])]
    viewer = served.viewer()
    viewer.whole()
    with Served(program(), "run", table, "--estimator", "error-state") as drive:
        driven = drive.viewer()
        driven.whole()
    for value in plots:
        topic, *fields = value.split(".")
        told = viewer.messages.get(topic) or driven.messages[topic]
        newest = next(m for _, m in reversed(told) if fields[0] in m)
        for name in fields:
            newest = newest[name]
        assert math.isfinite(newest), value
    assert layout["configById"]["map!place"]["followTopic"] in driven.messages
    assert layout["configById"]["RosOut!log"]["topicToRender"] in viewer.messages


def test_what_cannot_be_served_is_refused_at_once(walk: Path, served: Served) -> None:
    taken = served.address.removeprefix("ws://")
    words = [program(), "run", str(walk), f"--foxglove={taken}"]
    ran = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode == 2
    assert f"nothing can listen on {taken}" in ran.stderr


def test_the_lab_shows_every_device_and_takes_parameters(walk: Path, tmp_path: Path) -> None:
    words = [program(), "live", "--local", "--no-open", "--port", 0, "--replay", walk, "--data-dir", tmp_path]
    with Served(*words) as served:
        viewer = served.viewer()
        assert "playbackControl" not in viewer.info["capabilities"], "what is live cannot be paused"
        viewer.until(lambda: len(viewer.messages.get("/tf", [])) > 100)
        viewer.until(lambda: any(topic.endswith("/lamps/accelerometer") for topic in viewer.messages))
        frames = {transform.child_frame_id for _, transform in viewer.messages["/tf"]}
        device, estimator = sorted(frames)[0].split("/")
        topics = set(viewer.messages)
        assert {f"/{device}/{estimator}/attitude", f"/{device}/innovations/magnetometer"} <= topics
        angles = viewer.messages[f"/{device}/{estimator}/attitude"][-1][1]
        assert set(angles) >= {"yaw_deg", "pitch_deg", "roll_deg"}

        viewer.send("getParameters", parameterNames=[], id="all")
        viewer.until(lambda: viewer.parameters)
        name = next(n for n in viewer.parameters if n.endswith("gyroscope_noise_density"))
        assert name == f"{device}.gyroscope_noise_density"
        viewer.send("setParameters", parameters=[{"name": name, "value": 0.0123, "type": "float64"}], id="set")
        viewer.until(lambda: viewer.parameters[name] == 0.0123)
        viewer.send("setParameters", parameters=[{"name": "gyroscope_noise_density", "value": 1.0}], id="bad")
        viewer.until(lambda: any("names no device" in s["message"] for s in viewer.statuses))
        viewer.send("setParameters", parameters=[{"name": name, "value": -1.0}], id="bad")
        viewer.until(lambda: any(s["level"] == 2 and "gyroscope_noise_density" in s["message"] for s in viewer.statuses[-1:]))
        assert viewer.parameters[name] == 0.0123
    assert served.ended == 0
