"""Tracks of `northing track` in the tools that people have: pandas, polars, rosbags, a reader of NMEA, JSON, XML."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pynmea2
import pytest
from rosbags.highlevel import AnyReader

from conftest import run_program

MANIFEST = """
name = "bay"
[plane]
latitude_deg = 60.0
longitude_deg = 5.0
[scans]
file = "scans.csv"
scan = "scan"
time_s = "t_s"
own_north_m = "n_m"
own_east_m = "e_m"
[detections]
file = "detections.csv"
scan = "scan"
relative_north_east_m = ["n_m", "e_m"]
[sensors.radar]
range_std_m = 3.0
bearing_std_deg = 0.5
detection_probability = 0.95
clutter_per_km2 = 1.0
"""
#: 2026-01-02 03:04:05 UTC.
START_S = 1_767_323_045
SCANS, SEEN = 90, 40


def place(k: int) -> np.ndarray:
    """The boat, north and east, m; the own ship goes east at 4 m/s."""
    return np.array([900.0 - 5.0 * k, 200.0 + 2.0 * k])


@pytest.fixture(scope="module")
def bay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A boat that is seen for 40 scans and then no more, behind eight other echoes, anew in each scan."""
    folder = tmp_path_factory.mktemp("bay")
    random = np.random.default_rng(4)
    scans, detections = ["scan,t_s,n_m,e_m"], ["scan,n_m,e_m"]
    for k in range(SCANS):
        own = np.array([0.0, 4.0 * k])
        scans.append(f"{k},{START_S + k},{own[0]},{own[1]}")
        seen = [random.uniform(-2000.0, 2000.0, 2) for _ in range(8)]
        seen += [place(k) - own + random.normal(0.0, 2.0, 2)] if k < SEEN else []
        detections += [f"{k},{n:.3f},{e:.3f}" for n, e in seen]
    (folder / "bay.toml").write_text(MANIFEST)
    (folder / "scans.csv").write_text("\n".join(scans) + "\n")
    (folder / "detections.csv").write_text("\n".join(detections) + "\n")
    for extension in ("csv", "parquet", "mcap", "geojson", "kml", "nmea"):
        run_program("track", folder / "bay.toml", "--out", folder / f"tracks.{extension}")
    return folder


@pytest.fixture(scope="module")
def table(bay: Path) -> pd.DataFrame:
    return pd.read_csv(bay / "tracks.csv")


def boat(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of the boat: the longest track."""
    return table[table.track == table.track.mode()[0]]


def test_the_table_has_state_covariance_detection_and_the_end(table: pd.DataFrame) -> None:
    rows = boat(table)
    scans = (rows.t_s - START_S).round().astype(int)
    truth = np.stack([place(k) for k in scans])
    errors = rows[["north_m", "east_m"]].to_numpy() - truth
    seen = scans.to_numpy() < SEEN
    assert np.sqrt((errors[seen] ** 2).sum(axis=1).mean()) < 5.0
    # positive definite, place and velocity, at every instant
    for row in rows.itertuples():
        p = np.array([
            [row.cov_nn_m2, row.cov_n_vel_n_m2_s, row.cov_ne_m2, row.cov_n_vel_e_m2_s, row.cov_n_turn_m_rad_s],
            [0, row.vel_cov_nn_m2_s2, row.cov_e_vel_n_m2_s, row.vel_cov_ne_m2_s2, row.cov_vel_n_turn_m_rad_s2],
            [0, 0, row.cov_ee_m2, row.cov_e_vel_e_m2_s, row.cov_e_turn_m_rad_s],
            [0, 0, 0, row.vel_cov_ee_m2_s2, row.cov_vel_e_turn_m_rad_s2],
            [0, 0, 0, 0, row.turn_rate_var_rad2_s2],
        ])
        assert np.linalg.eigvalsh(np.triu(p) + np.triu(p, 1).T).min() > 0.0
        assert math.isclose(row.model_straight + row.model_turning + row.model_manoeuvring, 1.0, rel_tol=1e-9)
    # the boat's echo is the last of each scan, the ninth
    likely = rows[seen & (rows.detection_probability > 0.5)]
    assert len(likely) > 25 and (likely.detection == 8).all()
    assert (likely.scan == (likely.t_s - START_S).round()).all() and (rows.sensor == "radar").all()
    # given up after it was not seen any more, which the last row says and no other
    assert rows.end.iloc[:-1].isna().all() and rows.end.iloc[-1] in ("existence", "position-std")
    # reported until it has more likely left than not
    assert (rows.reported == (rows.existence >= 0.5)).all() and rows.reported.iloc[0] == 1 and rows.reported.iloc[-1] == 0


def test_parquet_is_the_same_table(bay: Path, table: pd.DataFrame) -> None:
    parquet = pl.read_parquet(bay / "tracks.parquet")
    assert parquet.columns == list(table.columns) and parquet.height == len(table)
    assert parquet["track"].dtype == pl.Int64 and parquet["end"].dtype == pl.String
    for name in table.columns:
        if table[name].dtype == float and parquet[name].dtype == pl.Float64:
            np.testing.assert_allclose(parquet[name].to_numpy(), table[name], rtol=0.0, atol=1e-9)
    assert parquet["detection"].null_count() == int(table.detection.isna().sum())


def test_a_bag_has_each_track_as_odometry_and_fix(bay: Path, table: pd.DataFrame) -> None:
    rows = boat(table)
    rows = rows[rows.reported == 1]
    name = f"/track_{rows.track.iloc[0]}"
    with AnyReader([bay / "tracks.mcap"]) as reader:
        topics = {c.topic: c for c in reader.connections}
        assert len(topics) == 2 * table.track.nunique()
        odometry = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages([topics[f"{name}/odometry"]])]
        fixes = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages([topics[f"{name}/fix"]])]
    assert len(odometry) == len(fixes) == len(rows)
    for row, pose, fix in zip(rows.itertuples(), odometry, fixes, strict=True):
        at, covariance = pose.pose.pose.position, pose.pose.covariance.reshape(6, 6)
        assert (at.x, at.y) == (row.east_m, row.north_m) and pose.child_frame_id == name[1:]
        assert (covariance[0, 0], covariance[0, 1], covariance[1, 1]) == (row.cov_ee_m2, row.cov_ne_m2, row.cov_nn_m2)
        assert (pose.twist.twist.linear.x, pose.twist.twist.linear.y) == (row.vel_e_m_s, row.vel_n_m_s)
        assert abs(fix.latitude - row.latitude_deg) < 1e-9 and abs(fix.longitude - row.longitude_deg) < 1e-9


def test_maps_have_a_line_for_each_track(bay: Path, table: pd.DataFrame) -> None:
    features = json.loads((bay / "tracks.geojson").read_text())["features"]
    assert [f["properties"]["track"] for f in features] == sorted(table.track.unique())
    root = ET.parse(bay / "tracks.kml").getroot()
    spaces = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
    lines = root.findall(".//k:Placemark", spaces)
    assert len(lines) == len(features)
    points = [len(line.findall(".//gx:coord", spaces)) for line in lines]
    assert points == [table[table.track == f["properties"]["track"]].reported.sum() for f in features]


def test_a_chart_plotter_reads_the_sentences(bay: Path, table: pd.DataFrame) -> None:
    rows = boat(table)
    number = rows.track.iloc[0]
    sentences = [pynmea2.parse(line, check=True) for line in (bay / "tracks.nmea").read_text().splitlines()]
    kinds = {kind: [s for s in sentences if s.sentence_type == kind] for kind in ("RMC", "TTM", "TLL")}
    assert len(kinds["RMC"]) == SCANS
    ours = [s for s in kinds["TTM"] if s.data[10] == f"T{number}"]
    assert len(ours) == len(rows) == len([s for s in kinds["TLL"] if f"T{number}" in s.data])
    for row, sentence in zip(rows.itertuples(), ours, strict=True):
        k = round(row.t_s - START_S)
        north, east = row.north_m, row.east_m - 4.0 * k
        distance, bearing = float(sentence.data[1]) * 1852.0, float(sentence.data[2])
        assert abs(distance - math.hypot(north, east)) < 1.0
        turn = (bearing - math.degrees(math.atan2(east, north)) + 180.0) % 360.0 - 180.0
        assert abs(turn) < 0.06
    assert ours[0].data[0] == f"{number % 100:02}" and ours[-1].data[11] == "L"
