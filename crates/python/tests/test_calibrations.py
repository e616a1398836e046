"""Calibrations and fits are the program's."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import northing as no
from conftest import REPOSITORY, data, run_program


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("walk") / "walk.csv"
    run_program("demo", "--record-only", path)
    return path


def test_at_rest(walk: Path, tmp_path: Path) -> None:
    recording = no.open(walk)
    made = no.calibrate.rest(recording)
    printed = json.loads(run_program("calibrate", "rest", walk, "--json"))
    values = made.pop("calibration")
    assert {**made, **values} == printed
    run_program("calibrate", "rest", walk, "--out", tmp_path / "rest.toml")
    run_program("run", walk, "--calibration", tmp_path / "rest.toml", "--out", tmp_path / "program.csv")
    recording.run(calibration=no.calibrate.rest(recording)).save(tmp_path / "module.csv")
    assert (tmp_path / "module.csv").read_bytes() == (tmp_path / "program.csv").read_bytes()
    with pytest.raises(ValueError, match="start=3 is not before stop=2"):
        no.calibrate.rest(recording, start=3.0, stop=2.0)
    with pytest.raises(ValueError, match="no calibration"):
        no.calibrate.rest(recording, start=20.0, stop=60.0)


def test_of_the_magnetometer(walk: Path, tmp_path: Path) -> None:
    recording = no.open(walk)
    made = no.calibrate.magnetometer(recording)
    printed = json.loads(run_program("calibrate", "magnetometer", walk, "--json"))
    assert made["sentences"] == printed["sentences"]
    assert made["calibration"]["calibration"]["hard_iron_ut"] == printed["hard_iron_ut"]
    run_program("calibrate", "magnetometer", walk, "--out", tmp_path / "field.toml")
    options = ["--magnetometer-calibration", tmp_path / "field.toml"]
    run_program("run", walk, *options, "--out", tmp_path / "program.csv")
    recording.run(magnetometer_calibration=made).save(tmp_path / "module.csv")
    assert (tmp_path / "module.csv").read_bytes() == (tmp_path / "program.csv").read_bytes()


def test_allan_deviation(tmp_path: Path) -> None:
    path = tmp_path / "rest.csv"
    run_program("demo", "--record-only", path, "--motion", "rest", "--duration", 200)
    made = no.calibrate.allan(no.open(path))
    printed = json.loads(run_program("calibrate", "allan", path, "--json"))
    assert made == {key: printed[key] for key in made}
    with pytest.raises(ValueError, match='sensor="barometer": expected one of: gyroscope'):
        no.calibrate.allan(no.open(path), "barometer")


def test_tune() -> None:
    manifest = REPOSITORY / "examples/recordings/car_rtk.toml"
    options = ["--data", data(), "--estimator", "error-state", "--parameters", "accelerometer_noise_density"]
    printed = json.loads(run_program("tune", manifest, *options, "--json"))
    outcome = no.tune(no.open(manifest, data=data()), parameters=["accelerometer_noise_density"])
    assert outcome == {key: printed[key] for key in outcome}
    assert outcome["parameters"][0]["name"] == "accelerometer_noise_density"
    with pytest.raises(ValueError, match="fit=2"):
        no.tune(no.open(manifest, data=data()), fit=2.0)


def test_tune_of_an_attitude_estimator(walk: Path) -> None:
    options = ["--estimator", "mekf", "--profile", "lab", "--parameters", "accelerometer_std"]
    printed = json.loads(run_program("tune", walk, *options, "--json"))
    file = no.open(walk)
    outcome = no.tune(file, "mekf", profile="lab", parameters=["accelerometer_std"])
    assert outcome == {key: printed[key] for key in outcome}
    assert 0.5 < outcome["parameters"][0]["after"] / 0.05 < 2.0  # m/s^2, the virtual phone's
