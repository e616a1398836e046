"""Simulated runs, campaigns and recordings are the program's, and split and merge to the last digit."""

from __future__ import annotations

import _thread
import json
import threading
import time
from pathlib import Path

import numpy as np
import pandas
import polars
import pytest

import northing as no
from conftest import REPOSITORY, run_program

SCENARIO = REPOSITORY / "scenarios/tracking/wilthil_brekke.toml"


def test_one_run_is_the_programs(tmp_path: Path) -> None:
    out = tmp_path / "run.csv"
    printed = json.loads(run_program("simulate", SCENARIO, "--variant", "paper", "--run", 7, "--out", out, "--json"))
    run = no.simulate(SCENARIO, variant="paper", run=7)
    assert run.summary == printed
    written = pandas.read_csv(out)
    frame = run.to_pandas()
    assert list(frame.columns) == list(written.columns)
    np.testing.assert_array_equal(frame.to_numpy(), written.to_numpy(dtype=float))
    assert len(run) == len(frame) and run["time_s"][0] == 0.0 and "run 7 of" in repr(run)
    # The scenario of the module is the file's.
    assert no.simulate(variant="paper", run=7).summary == printed


def test_a_campaign_is_the_programs_however_it_is_split(tmp_path: Path) -> None:
    options = ["--runs", 6, "--trackers", "schmidt,converted"]
    printed = json.loads(run_program("montecarlo", SCENARIO, *options, "--json"))
    whole = no.montecarlo(SCENARIO, runs=6, trackers=["schmidt", "converted"])
    parts = [no.montecarlo(runs=6, trackers=["schmidt", "converted"], shard=(k, 3), threads=1) for k in (1, 2, 3)]
    parts[1].save(tmp_path / "part.parquet")
    with pytest.raises(FileExistsError, match="force=True"):
        parts[1].save(tmp_path / "part.parquet")
    merged = parts[2].merge(no.Campaign.load(tmp_path / "part.parquet"), parts[0])
    by_program = tmp_path / "part1.parquet"
    run_program("montecarlo", SCENARIO, *options, "--shard", "1/3", "--out", by_program)
    crossed = no.Campaign.load(by_program).merge(parts[1], parts[2])
    for campaign in (whole, merged, crossed):
        summary = {**campaign.summary, "elapsed_s": 0.0}
        assert summary == {**printed, "elapsed_s": 0.0}
    assert (whole.runs, parts[0].runs) == (6, 2) and "2 of 6 runs" in repr(parts[0])
    whole.report(tmp_path / "campaign.html")
    assert "<svg" in (tmp_path / "campaign.html").read_text()


def test_refusals(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match='scenario="harbour": no such file, and no scenario of the module'):
        no.simulate("harbour")
    with pytest.raises(FileNotFoundError):
        no.simulate(tmp_path / "harbour.toml")
    with pytest.raises(ValueError, match="unknown tracker `kalman`; expected"):
        no.simulate(trackers=["kalman"])
    with pytest.raises(ValueError, match='navigation="stars": expected error-state or gnss-ins'):
        no.simulate(navigation="stars")
    with pytest.raises(ValueError, match="runs is 0"):
        no.montecarlo(runs=0)
    with pytest.raises(ValueError, match="shard `4/3`"):
        no.montecarlo(runs=6, shard=(4, 3))
    with pytest.raises(ValueError, match="other"):
        no.montecarlo(runs=2, seed=1, shard=(1, 2)).merge(no.montecarlo(runs=2, seed=2, shard=(2, 2)))
    with pytest.raises(FileNotFoundError):
        no.Campaign.load(tmp_path / "no.parquet")
    with pytest.raises(ValueError, match='motion="wild": expected one of gentle, brisk, tumble, rest'):
        no.virtual_phone(motion="wild")
    with pytest.raises(ValueError, match='kind="plane": expected one of car-smooth'):
        no.virtual_vehicle("plane")
    with pytest.raises(ValueError, match="duration=0"):
        no.virtual_vehicle(duration=0)
    with pytest.raises(ValueError, match="seed=-1: expected a whole number from 0 on"):
        no.virtual_phone(seed=-1)
    with pytest.raises(ValueError, match="runs=-2: expected a whole number from 0 on"):
        no.montecarlo(runs=-2)


def test_a_campaign_ends_at_ctrl_c() -> None:
    threading.Timer(1.0, _thread.interrupt_main).start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        no.montecarlo(runs=1_000_000)
    assert time.monotonic() - began < 60.0
    assert no.montecarlo(runs=1, trackers=["schmidt"]).runs == 1


def test_a_virtual_phone_is_the_recording_of_the_demo(tmp_path: Path) -> None:
    run_program("demo", "--record-only", tmp_path / "demo.csv", "--seed", 5, "--motion", "brisk", "--duration", 20)
    phone = no.virtual_phone(seed=5, motion="brisk", duration=20.0)
    phone.save(tmp_path / "phone.csv")
    assert (tmp_path / "phone.csv").read_bytes() == (tmp_path / "demo.csv").read_bytes()
    assert {"gyr", "acc", "mag", "true_quat", "gyr_time_ns"} <= set(phone) and phone.frame == "enu"
    r = no.attitude(phone["gyr"], phone["acc"], phone["mag"], t=phone["gyr_time_ns"], acc_t=phone["acc_time_ns"],
                    mag_t=phone["mag_time_ns"], estimator="mekf", profile="lab")
    off = np.abs(np.sum(r.quat[-1] * phone["true_quat"][-1]))
    assert np.degrees(2 * np.arccos(min(off, 1.0))) < 10.0


def test_a_virtual_vehicle_has_its_truth(tmp_path: Path) -> None:
    car = no.virtual_vehicle("car-smooth", seed=2, duration=90.0)
    assert "car-smooth, 90 s" in car.description and car.frame == "ned"
    recording = car.save(tmp_path / "car.parquet")
    assert {"gyroscope", "gnss-position", "reference-position"} <= set(recording.sensors)
    run = recording.run("error-state")
    np.testing.assert_allclose(run.summary["position"]["horizontal_rmse_m"] if "position" in run.summary else 0.0, 0.0, atol=20.0)
    at = np.searchsorted(car["true_time_ns"], car["gnss_time_ns"])
    errors = (car["gnss_ned"] - car["true_antenna_ned"][np.minimum(at, len(car["true_ned"]) - 1)])[:, :2]
    assert np.sqrt((errors**2).sum(axis=1).mean()) < 10.0 * car["gnss_std"][:, 0].mean() + 1.0
    again = no.virtual_vehicle("car-smooth", seed=2, duration=90.0)
    np.testing.assert_array_equal(car["gyr"], again["gyr"])
    hard = no.virtual_vehicle("ship", seed=11, faults=True)
    assert len(hard["gyr"]) > 0 and "ship" in hard.description


class Wrapped:
    """Only the Arrow interface of a table."""

    def __init__(self, table: object) -> None:
        self._table = table

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self._table.__arrow_c_stream__(requested_schema)  # type: ignore[attr-defined]


def test_arrow_is_read_without_pyarrow(phone: dict[str, np.ndarray]) -> None:
    import nanoarrow

    r = no.attitude(phone["gyr"], phone["acc"], phone["mag"], rate=100.0)
    frame = polars.DataFrame(Wrapped(r))
    assert frame.columns == list(r.to_dict()) and frame.height == 3000
    known = frame["qw"].drop_nulls()
    assert frame["qw"].null_count() == r.undefined > 0 and frame["qw"].is_nan().sum() in (0, None)
    np.testing.assert_array_equal(known.to_numpy(), r.quat[r.undefined :, 0])
    assert r.to_polars().equals(frame)
    # An independent reader, twice from the same table.
    for _ in range(2):
        stream = nanoarrow.Array(Wrapped(r))
        assert [field.name for field in stream.schema.fields] == frame.columns
        np.testing.assert_array_equal(np.array(stream.child(1).to_pylist(), dtype=float), r.quat[:, 0] if frame.columns[1] == "qw" else r.to_dict()[frame.columns[1]])
    run = no.simulate(trackers=["schmidt"])
    assert polars.DataFrame(run)["time_s"].to_list() == run["time_s"].tolist()
    samples = no.virtual_phone(duration=5.0)
    assert len(samples["gyr"]) == len(samples["gyr_time_ns"])
