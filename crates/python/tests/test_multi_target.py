"""The multi-target tracker scan by scan: equal to `northing track` to the bit, pickled in the middle, and what it refuses."""

from __future__ import annotations

import csv
import json
import math
import pickle
import threading
import tomllib
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import northing as no
from conftest import run_program

#: Columns of `northing track --out x.parquet`, and where a track has them.
PLACES = {"north_m": 0, "vel_n_m_s": 1, "east_m": 2, "vel_e_m_s": 3, "turn_rate_rad_s": 4}
COVARIANCES = {
    "cov_nn_m2": (0, 0), "cov_ne_m2": (0, 2), "cov_ee_m2": (2, 2), "vel_cov_nn_m2_s2": (1, 1), "vel_cov_ne_m2_s2": (1, 3),
    "vel_cov_ee_m2_s2": (3, 3), "cov_n_vel_n_m2_s": (0, 1), "cov_n_vel_e_m2_s": (0, 3), "cov_e_vel_n_m2_s": (2, 1),
    "cov_e_vel_e_m2_s": (2, 3), "turn_rate_var_rad2_s2": (4, 4), "cov_n_turn_m_rad_s": (0, 4), "cov_e_turn_m_rad_s": (2, 4),
    "cov_vel_n_turn_m_rad_s2": (1, 4), "cov_vel_e_turn_m_rad_s2": (3, 4),
}
COLUMNS = {
    "relative": ("relative_north_m", "relative_east_m"),
    "placed": ("north_m", "east_m"),
    "range-bearing": ("range_m", "bearing_rad"),
    "bearing": ("bearing_rad",),
}


def row(time_ns: int, track: no.TargetTrack) -> dict[str, Any]:
    """A track as a row of that table, of the columns that are numbers."""
    cells: dict[str, Any] = {"t_s": time_ns * 1e-9, "track": track.id}
    cells |= {name: track.state[place] for name, place in PLACES.items()}
    cells |= {name: track.covariance[place] for name, place in COVARIANCES.items()}
    cells |= {"existence": track.existence, "visibility": track.visibility, "reported": int(track.reported)}
    cells |= dict(zip(("model_straight", "model_turning", "model_manoeuvring"), track.models, strict=True))
    cells |= {"detections_in_gate": track.detections_in_gate, "detection": track.detection}
    cells |= {"detection_probability": track.detection_probability, "missed_probability": track.missed_probability}
    return cells


class Scans:
    """A tracking recording: a manifest, its tables, and what the tracker takes of them."""

    def __init__(self, manifest: Path) -> None:
        self.manifest = manifest
        self.described = tomllib.loads(manifest.read_text())
        self.scans = self.table("scans")
        self.detections: dict[str, list[dict[str, str]]] = {}
        for detection in self.table("detections"):
            self.detections.setdefault(detection["scan"], []).append(detection)

    def table(self, name: str) -> list[dict[str, str]]:
        with (self.manifest.parent / self.described[name]["file"]).open(newline="") as file:
            return list(csv.DictReader(file))

    @staticmethod
    def time_ns(scan: dict[str, str]) -> int:
        return int((Decimal(scan["t_s"]) * 10**9).to_integral_value())

    def kind(self, sensor: str) -> str:
        """What the detections of a sensor are: the first kind whose cells are filled."""
        of = {scan["scan"] for scan in self.scans if scan["sensor"] == sensor}
        first = next(rows[0] for scan, rows in self.detections.items() if scan in of)
        filled = [kind for kind, columns in COLUMNS.items() if all(first.get(column) for column in columns)]
        return "bearing" if filled == ["bearing"] else next(kind for kind in filled if kind != "bearing")

    def sensors(self, **more: float) -> dict[str, no.ScanSensor]:
        """As the manifest states them, each with its median interval, as the program finds it."""
        made = {}
        for name, stated in self.described["sensors"].items():
            times = [self.time_ns(scan) for scan in self.scans if scan["sensor"] == name]
            intervals = sorted(b - a for a, b in zip(times, times[1:]) if b > a)
            middle = math.floor(0.5 * (len(intervals) - 1) + 0.5)
            made[name] = no.ScanSensor(
                detections=self.kind(name),
                range_std=stated.get("range_std_m", 0.0),
                bearing_std=math.radians(stated.get("bearing_std_deg", 0.0)),
                extent_std=stated.get("extent_std_m", 0.0),
                detection_probability=stated["detection_probability"],
                clutter_per_km2=stated.get("clutter_per_km2"),
                clutter_per_rad=stated.get("clutter_per_rad"),
                largest_range=stated.get("largest_range_m"),
                scan_interval=intervals[middle] * 1e-9,
                covers_all=stated.get("covers_all", True),
                initiates=stated.get("initiates", True),
                **more,
            )
        return made

    def update(self, tracker: no.MultiTarget, scan: dict[str, str]) -> no.ScanRecord:
        stds = [float(scan.get(name) or 0.0) for name in ("own_position_std_m", "own_heading_std_deg")]
        own = no.OwnShip(
            float(scan["own_north_m"]), float(scan["own_east_m"]), math.radians(float(scan["own_heading_deg"])),
            std=(stds[0], stds[0], math.radians(stds[1])),
        )
        columns = COLUMNS[self.kind(scan["sensor"])]
        seen = [[float(detection[column]) for column in columns] for detection in self.detections.get(scan["scan"], [])]
        return tracker.update(self.time_ns(scan), seen, own, sensor=scan["sensor"])

    def tracked(self, *options: str) -> pl.DataFrame:
        """The table that the program writes."""
        out = self.manifest.with_name("tracks.parquet")
        run_program("track", self.manifest, "--out", out, "--force", *options)
        return pl.read_parquet(out)


def assert_equal(rows: list[dict[str, Any]], table: pl.DataFrame) -> None:
    assert len(rows) == table.height > 20
    for name in rows[0]:
        if name == "t_s":
            np.testing.assert_allclose([cells[name] for cells in rows], table[name], rtol=0.0, atol=1e-9)
            continue
        ours = pl.Series([cells[name] for cells in rows])
        pairs = zip(ours, table[name], strict=True)
        both_missing = lambda a, b: a is None and (b is None or math.isnan(b))  # noqa: E731
        differ = [k for k, (a, b) in enumerate(pairs) if a != b and not both_missing(a, b)]
        assert not differ, f"{name}, row {differ[0]}: {ours[differ[0]]!r} {table[name][differ[0]]!r}"


@pytest.mark.parametrize(
    ("number", "tracker", "parameters"),
    [(0, "schmidt", {}), (1, "converted", {}), (2, "uncompensated", {"gate_sigmas": 4.0}), (3, "schmidt", {})],
)
def test_scan_by_scan_is_northing_track_to_the_bit(
    tmp_path: Path, number: int, tracker: str, parameters: dict[str, float]
) -> None:
    """A scene of each class; the tracker is pickled every few scans."""
    run_program("experiment", "tracking-worlds", "--world", number, "--save", tmp_path)
    (manifest,) = tmp_path.glob("*.toml")
    scene = Scans(manifest)
    targets = no.MultiTarget(scene.sensors(), tracker=tracker, **parameters)
    rows, ended = [], {}
    for k, scan in enumerate(scene.scans):
        if k % 17 == 5:
            again = pickle.loads(pickle.dumps(targets))
            assert again.state == targets.state and again.parameters == targets.parameters
            assert [repr(track) for track in again.tracks] == [repr(track) for track in targets.tracks]
            assert [track.detection for track in again.tracks] == [track.detection for track in targets.tracks]
            targets = again
        record = scene.update(targets, scan)
        assert record.reason is None and targets.time_ns == record.time_ns == scene.time_ns(scan)
        doubtful = [track for track in record.confirmed if not track.reported]
        rows += [row(record.time_ns, track) for track in [*record.reported, *doubtful]]
        ended |= {track.id: track.reason for track in record.ended if track.status == "confirmed"}
    settings = [f"--set={name}={value}" for name, value in parameters.items()]
    table = scene.tracked("--tracker", tracker, *settings)
    assert_equal(rows, table)
    told = table.filter(pl.col("end").is_not_null() & (pl.col("end") != ""))
    assert dict(zip(told["track"], told["end"], strict=True)).items() <= ended.items()
    summary = json.loads(run_program("track", manifest, "--tracker", tracker, *settings, "--json"))
    assert {one["name"]: one["value"] for one in summary["parameters"]} == targets.parameters
    assert targets.counts["scans"] == summary["counts"]["scans"] == len(scene.scans)
    assert targets.counts["initiated"] == summary["counts"]["initiated"]


MANIFEST = """
name = "bay"
[scans]
file = "scans.csv"
scan = "scan"
time_s = "t_s"
sensor = "sensor"
own_north_m = "own_north_m"
own_east_m = "own_east_m"
own_heading_deg = "own_heading_deg"
[detections]
file = "detections.csv"
scan = "scan"
relative_north_east_m = ["relative_north_m", "relative_east_m"]
bearing_rad = "bearing_rad"
[sensors.radar]
range_std_m = 3.0
bearing_std_deg = 0.5
detection_probability = 0.9
clutter_per_km2 = 1.0
largest_range_m = 3000.0
[sensors.camera]
bearing_std_deg = 0.2
detection_probability = 0.8
clutter_per_rad = 0.5
"""


def bay(folder: Path, scans: int, clutter: int) -> Scans:
    """Two boats before a ship that turns, seen by radar and, half a second later, by a camera; then more and more clutter."""
    random = np.random.default_rng(9)
    head = ["scan,t_s,sensor,own_north_m,own_east_m,own_heading_deg"]
    seen = ["scan,relative_north_m,relative_east_m,bearing_rad"]
    for k in range(scans):
        own, heading = np.array([2.0 * k, 1.0 * k]), math.radians(10.0 + 0.7 * k)
        boats = [np.array([800.0 - 5.0 * k, 300.0]), np.array([500.0, -400.0 + 6.0 * k])]
        head.append(f"{2 * k},{1000 + 2 * k},radar,{own[0]},{own[1]},{math.degrees(heading)}")
        head.append(f"{2 * k + 1},{1000.5 + 2 * k},camera,{own[0]},{own[1]},{math.degrees(heading)}")
        of_radar = [boat - own + random.normal(0.0, 3.0, 2) for boat in boats]
        of_radar += [random.uniform(-1500.0, 1500.0, 2) for _ in range(3 if k < 6 else clutter)]
        seen += [f"{2 * k},{n},{e}," for n, e in of_radar]
        for boat in boats:
            bearing = math.atan2(*(boat - own)[::-1]) - heading + random.normal(0.0, 0.003)
            seen.append(f"{2 * k + 1},,,{bearing}")
    (folder / "bay.toml").write_text(MANIFEST)
    (folder / "scans.csv").write_text("\n".join(head) + "\n")
    (folder / "detections.csv").write_text("\n".join(seen) + "\n")
    return Scans(folder / "bay.toml")


def test_two_sensors_and_scans_too_long_for_the_usual_room(tmp_path: Path) -> None:
    """From the seventh scan on there are more detections than the usual room is for: it grows, and no bit differs."""
    scene = bay(tmp_path, scans=16, clutter=1000)
    targets = no.MultiTarget(scene.sensors())
    rows, most = [], 0
    for k, scan in enumerate(scene.scans):
        if k in (7, 20):  # before it has grown and after
            targets = pickle.loads(pickle.dumps(targets))
        record = scene.update(targets, scan)
        assert record.sensor == scan["sensor"] and record.reason is None
        doubtful = [track for track in record.confirmed if not track.reported]
        rows += [row(record.time_ns, track) for track in [*record.reported, *doubtful]]
        most = max(most, len(record.tracks))
    assert most > 1024, "it had to grow"
    assert_equal(rows, scene.tracked())


RADAR = {
    "range_std": 5.0, "bearing_std": 0.01, "detection_probability": 0.9, "clutter_per_km2": 0.2, "scan_interval": 2.0,
    "largest_range": 3000.0,
}
OWN = no.OwnShip(0.0, 0.0, 0.0, std=(1.0, 1.0, 0.01))


def boat(k: int) -> list[float]:
    """Range and bearing of a boat that goes north."""
    return [math.hypot(500.0 + 8.0 * k, 200.0), math.atan2(200.0, 500.0 + 8.0 * k)]


def test_a_track_is_found_confirmed_and_ends() -> None:
    targets = no.MultiTarget(no.ScanSensor(**RADAR))
    told: dict[int, str] = {}
    for k in range(60):
        record = targets.update(k * 2_000_000_000, [boat(k)] if k < 15 else None, OWN)
        told |= {track.id: track.reason for track in record.ended}
        if k == 0:
            (track,) = record.tracks
            assert (track.id, track.status, track.detection, track.age_s) == (1, "tentative", 0, 0.0)
        if k == 14:
            (track,) = record.confirmed
            assert abs(track.state[0] - 612.0) < 4.0 * track.std[0] and track.existence > 0.99 and track.silent_s == 0.0
            assert track.innovation.outcome == "fused" and track.innovation.degrees_of_freedom == 2
            # the heading's error is in it, however often the boat is seen
            assert track.std[2] > 0.01 * 600.0 * 0.9
            np.testing.assert_allclose(np.diagonal(track.covariance), track.std**2)
            assert "track 1, confirmed" in repr(track) and "1 tracks confirmed" in repr(record)
    assert told == {1: "existence"} or told == {1: "position-std"}
    assert targets.tracks == [] and targets.counts["deleted_confirmed"] == 1


def test_whatever_numpy_makes_an_array_of_is_taken() -> None:
    wanted = None
    rows = np.array([boat(0), [700.0, -1.0]])
    for detections in (rows, rows.tolist(), rows.T.copy().T, np.repeat(rows, 2, axis=0)[::2], pl.DataFrame(rows)):
        record = no.MultiTarget(no.ScanSensor(**RADAR)).update(0, detections, OWN)
        states = np.array([track.state for track in record.tracks])
        wanted = states if wanted is None else wanted
        np.testing.assert_array_equal(states, wanted)
    single = no.MultiTarget(no.ScanSensor(**RADAR)).update(0, rows.astype(np.float32), OWN)
    np.testing.assert_allclose([track.state for track in single.tracks], wanted, rtol=1e-6)
    for kind, detections in (("relative", [[500.0, 200.0]]), ("placed", [[510.0, 190.0]]), ("reported", [[510.0, 190.0]])):
        sensor = no.ScanSensor(**{**RADAR, "extent_std": 4.0}, detections=kind)
        ship = no.OwnShip(10.0, -10.0, 0.5, std=(1.0, 1.0, 0.01))
        (track,) = no.MultiTarget(sensor).update(0, detections, ship).tracks
        np.testing.assert_allclose(track.state, [510.0, 0.0, 190.0, 0.0, 0.0], atol=1e-9)


def test_what_cannot_be_is_refused_and_changes_nothing() -> None:
    targets = no.MultiTarget(no.ScanSensor(**RADAR))
    targets.update(0, [boat(0)], OWN)
    before = targets.state
    for detections, said in [
        ([boat(0), [np.nan, 0.1], [5.0, np.inf]], r"detections: row 1 is \(NaN, 0\.1\) \(and 1 more rows? like it\)"),
        ([boat(0), boat(0), [-3.0, 0.1]], r"detections: row 2 is \(-3, 0\.1\); expected range in m, above 0, and bearing in rad"),
        (boat(0), r"detections: shape \(2,\); expected .* shape \(N, 2\), a row a detection"),
        (np.ones((2, 5)), r"detections: shape \(2, 5\); .*; transpose it"),
        (["a", "b"], "detections: not an array of numbers"),
    ]:
        with pytest.raises(ValueError, match=said):
            targets.update(2_000_000_000, detections, OWN)
    with pytest.raises(ValueError, match='sensor="lidar": expected one of sensor'):
        targets.update(2_000_000_000, None, OWN, sensor="lidar")
    assert targets.state == before
    record = targets.update(-1, [boat(0)], OWN)
    assert record.reason == "time before the last scan" and len(record.tracks) == 1 and record.ended == []
    far = no.OwnShip(9e4, 0.0, 0.0, std=(1.0, 1.0, 0.01))
    assert targets.update(2_000_000_000, [boat(1)], far).reason == "own ship's pose jumps"
    assert targets.counts["time_goes_back"] == targets.counts["pose_jumps"] == 1
    with pytest.raises(ValueError, match="state: "):
        targets.state = "{}"
    with pytest.raises(ValueError, match="state: its associations"):
        targets.state = json.dumps(json.loads(before) | {"associations": []})
    targets.state = before
    assert targets.state == before


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"range_std": -1.0}, "range_std=-1: expected a standard deviation in m, 0 or above"),
        ({"bearing_std": 0.0}, "the sensor has no noise"),
        ({"detection_probability": 1.0}, "detection_probability=1: expected above 0 and below 1"),
        ({"clutter_per_km2": None}, "false detections a scan: give one of"),
        ({"clutter_per_rad": 1.0}, "false detections a scan: give one of"),
        ({"scan_interval": 0.0}, "scan_interval=0: expected s, above 0"),
        ({"detections": "echo"}, 'detections="echo": expected one of range-bearing, bearing, relative, placed, reported'),
    ],
)
def test_a_sensor_that_cannot_be(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        no.ScanSensor(**{**RADAR, **changed})


def test_what_a_tracker_cannot_be_made_of() -> None:
    radar = no.ScanSensor(**RADAR)
    for sensors, said in [
        (no.ScanSensor(**{**RADAR, "scan_interval": None}), "`sensor` starts tracks: how often does it look"),
        ({"radar": no.ScanSensor(**{**RADAR, "largest_range": None})}, "`radar` starts tracks: how far does it see"),
        (no.ScanSensor(**{**RADAR, "initiates": False}), "no sensor starts tracks"),
        (no.ScanSensor(**{**RADAR, "scan_interval": 1e9}), "no settings follow from scan_interval=1000000000"),
    ]:
        with pytest.raises(ValueError, match=said):
            no.MultiTarget(sensors)
    with pytest.raises(ValueError, match="`jpda` is no tracker"):
        no.MultiTarget(radar, tracker="jpda")
    with pytest.raises(ValueError, match="unknown parameter `gate_sigma`; did you mean `gate_sigmas`"):
        no.MultiTarget(radar, gate_sigma=3.0)
    with pytest.raises(ValueError, match="parameter `gate_sigmas`: `-1` does not fit"):
        no.MultiTarget(radar, gate_sigmas=-1.0)
    with pytest.raises(TypeError, match="gate_sigmas=wide: expected a number"):
        no.MultiTarget(radar, gate_sigmas="wide")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"`converted` takes pose errors as new"):
        no.MultiTarget(radar, tracker="converted", pose_error_correlation_heading_s=5.0)
    two = no.MultiTarget({"bow": radar, "stern": radar}, existence_lifetime_s=700.0, **{"motion.straight_dwell_s": 9.0})
    assert two.parameters["existence.lifetime_s"] == 700.0 and two.parameters["motion.straight_dwell_s"] == 9.0
    learns = "learn_pose_error_correlation"
    assert two.parameters[learns] is True
    assert no.MultiTarget(radar, learn_pose_error_correlation=False).parameters[learns] is False
    # Whoever says how long errors last means it; a pickled tracker goes on so.
    said = no.MultiTarget(radar, pose_error_correlation_heading_s=20.0)
    assert said.parameters[learns] is False
    assert pickle.loads(pickle.dumps(said)).parameters == said.parameters
    assert pickle.loads(pickle.dumps(two)).parameters == two.parameters
    with pytest.raises(ValueError, match="parameter `gate_sigmas`: `true` does not fit"):
        no.MultiTarget(radar, gate_sigmas=True)
    assert list(two.sensors) == ["bow", "stern"] and two.sensors["bow"] == radar == pickle.loads(pickle.dumps(radar))
    with pytest.raises(ValueError, match="sensor= is missing: which one looked\\? bow, stern"):
        two.update(0, None, OWN)


def test_trackers_run_on_small_stacks() -> None:
    """Made, pickled and fed on a thread whose stack is smaller than a tracker."""
    done = []

    def work() -> None:
        targets = no.MultiTarget(no.ScanSensor(**RADAR))
        for k in range(3):
            targets = pickle.loads(pickle.dumps(targets))
            targets.update(k * 2_000_000_000, [boat(k)] * (1 if k < 2 else 400), OWN)
        done.append(len(targets.tracks))

    before = threading.stack_size(512 * 1024)
    try:
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    finally:
        threading.stack_size(before)
    assert done and done[0] > 1
