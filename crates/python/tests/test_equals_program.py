"""The module gives the program's digits, to the bit."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path

import numpy as np
import pytest

import northing as no
from conftest import REPOSITORY, data, run_program

RECORDINGS = [
    ("attitude/broad", "06_undisturbed_fast_rotation_A.parquet"),
    ("attitude/broad", "28_disturbed_stationary_magnet_A.parquet"),
]
ESTIMATORS = ["bounded-velocity", "mekf", "usque", "complementary", "integration", "cascade"]
if os.environ.get("NORTHING_PYTHON_EVERY") == "1":
    RECORDINGS = [(folder, path.name) for folder in ("attitude/broad", "attitude/smartphone")
                  for path in sorted(data(folder).glob("*.parquet"))]
    ESTIMATORS = [one["name"] for one in no.estimators() if one["question"] == "attitude" and one["name"] != "device"]


Table = dict[str, np.ndarray]


def number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def table_of(path: Path) -> Table:
    """Numbers of a CSV file to the last digit, NaN for empty cells and words."""
    names, *rows = csv.reader(path.read_text().splitlines())
    return dict(zip(names, np.array([[number(cell) for cell in row] for row in rows]).T))


def program_csv(folder: Path, recording: Path, *options: object) -> Table:
    out = folder / "program.csv"
    run_program("run", recording, "--out", out, "--force", *options)
    return table_of(out)


def assert_equal(run: no.Attitude, table: Table) -> None:
    known = ~np.isnan(run.quat[:, 0])
    assert known.sum() == len(table["t_s"]) > 1000
    assert [f"{t // 10**9}.{t % 10**9:09}" for t in run.time_ns[known][:50]] == [f"{t:.9f}" for t in table["t_s"][:50]]
    for name, column in run.to_dict().items():
        if name != "t_s":
            np.testing.assert_array_equal(column[known], table[name], err_msg=name)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("place", RECORDINGS)
def test_attitude(tmp_path: Path, place: tuple[str, str], estimator: str) -> None:
    path = data(*place)
    table = program_csv(tmp_path, path, "--estimator", estimator, "--magnetometer", "device")
    recording = no.open(path)
    run = recording.run(estimator, magnetometer="device")
    assert_equal(run, table)
    gyr, acc, mag = (recording.arrays(name) for name in ("gyroscope", "accelerometer", "magnetometer"))
    # A phone has a second magnetometer, which says what hard iron to expect of the first.
    expected = {name: used for name, used in run.parameters.items() if name == "bounded_initial_hard_iron_std_ut"}
    arrays = no.attitude(gyr.values, acc.values, mag.values, t=gyr.time_ns, acc_t=acc.time_ns, mag_t=mag.time_ns,
                         estimator=estimator, **expected)
    assert_equal(arrays, table)


def test_defaults_smoothing_and_parameters(tmp_path: Path) -> None:
    path = data(*RECORDINGS[0])
    recording = no.open(path)
    assert_equal(recording.run(), program_csv(tmp_path, path))
    assert_equal(recording.run("mekf", smooth=True), program_csv(tmp_path, path, "--estimator", "mekf", "--smooth"))
    run = recording.run("mekf", profile="lab", calibrate_first=3.0, accelerometer_std=0.123, magnetometer_use="heading")
    options = ["--profile", "lab", "--calibrate-first", "3"]
    options += ["--set", "accelerometer_std=0.123", "--set", "magnetometer_use=heading", "--estimator", "mekf"]
    assert_equal(run, program_csv(tmp_path, path, *options))
    assert run.parameters["accelerometer_std"] == 0.123


def test_summary_is_the_programs_document() -> None:
    path = data(*RECORDINGS[1])
    printed = json.loads(run_program("run", path, "--json"))
    assert no.open(path).run().summary == printed
    compared = no.compare([path], ["mekf", "integration"])
    assert compared == json.loads(run_program("compare", path, "--estimators", "mekf,integration", "--json"))


@pytest.mark.parametrize("ending", ["csv", "parquet", "tum", "mcap"])
def test_files_are_the_programs(tmp_path: Path, ending: str) -> None:
    path = data(*RECORDINGS[0])
    by_program, by_module = tmp_path / f"program.{ending}", tmp_path / f"module.{ending}"
    run_program("run", path, "--out", by_program)
    no.open(path).run().save(by_module)
    assert by_module.read_bytes() == by_program.read_bytes()


@pytest.mark.parametrize("estimator", ["error-state", "axis-filters"])
def test_navigation(tmp_path: Path, estimator: str) -> None:
    manifest = REPOSITORY / "examples/recordings/car_rtk.toml"
    folder = data()
    options = ["--data", folder, "--estimator", estimator, "--gnss-every", "4", "--outage", "120:30"]
    for ending in ("csv", "gpx"):
        run_program("run", manifest, *options, "--out", tmp_path / f"program.{ending}")
    recording = no.open(manifest, data=folder)
    run = recording.run(estimator, gnss_every=4, outages=["120:30"])
    for ending in ("csv", "gpx"):
        run.save(tmp_path / f"module.{ending}")
        assert (tmp_path / f"module.{ending}").read_bytes() == (tmp_path / f"program.{ending}").read_bytes()
    table = table_of(tmp_path / "program.csv")
    assert len(table["t_s"]) == len(run) > 10_000
    # The file is rounded, the arrays are not.
    for name, digits in (("latitude_deg", 9), ("height_m", 4), ("north_std_m", 4), ("velocity_east_m_s", 4)):
        np.testing.assert_allclose(run.track[name], table[name], rtol=0, atol=0.51 * 10.0**-digits)
    rows = (tmp_path / "program.csv").read_text().splitlines()[1:]
    assert [row.rsplit(",", 1)[1] for row in rows] == run.validity
    printed = json.loads(run_program("run", manifest, *options, "--json"))
    assert run.summary["position"] == printed["position"] and run.summary["aids"] == printed["aids"]
