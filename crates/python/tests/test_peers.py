"""The comparison of oracles/attitude_peers.py on simulated recordings, and its score against the program's."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import northing as no
from conftest import REPOSITORY

ORACLES = REPOSITORY / "oracles"
PACKAGES = ("ahrs", "imufusion", "vqf")


@pytest.fixture(scope="module")
def peers() -> Any:
    """The script as a module; without the others' packages the test is skipped, with NORTHING_REQUIRE_PYTHON=1 it fails."""
    sys.path.insert(0, str(ORACLES))
    try:
        for package in PACKAGES:
            importlib.import_module(package)
        return importlib.import_module("attitude_peers")
    except ModuleNotFoundError as error:
        assert error.name in PACKAGES, error
        assert os.environ.get("NORTHING_REQUIRE_PYTHON") != "1", f"{error}: pip install -r oracles/requirements.txt"
        pytest.skip(f"no package {error.name}: pip install -r oracles/requirements.txt")
    finally:
        sys.path.remove(str(ORACLES))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two phones, of which one is carried and turned quickly."""
    made = tmp_path_factory.mktemp("peers")
    no.virtual_phone(seed=7, duration=25.0).save(made / "gentle.csv")
    no.virtual_phone(seed=8, duration=25.0, motion="brisk", disturbance="magnetic").save(made / "brisk.csv")
    return made


def test_every_filter_s_conventions_are_proven(peers: Any) -> None:
    peers.prove(duration=25.0)
    with pytest.raises(AssertionError, match="vqf .* another convention"):
        turned = {**peers.FILTERS, "vqf": lambda recording: peers.conjugate(vqf(recording))}
        vqf, peers.FILTERS = peers.FILTERS["vqf"], turned
        try:
            peers.prove(duration=25.0, names=["vqf"])
        finally:
            peers.FILTERS = {**turned, "vqf": vqf}


def test_the_score_is_the_program_s(peers: Any, folder: Path) -> None:
    """Of ours every run is compared: to 1e-6 deg, where north is known and where it is not, also across pauses of the estimates."""
    pauses = folder / "pauses.csv"
    lines = (folder / "brisk.csv").read_text().splitlines(keepends=True)
    body = [line for line in lines if not line.startswith("#")]
    kept = [line for k, line in enumerate(body) if not any(start <= k < start + 60 for start in (4000, 6000, 6500))]
    pauses.write_text("".join(line for line in lines if line.startswith("#")) + "".join(kept))
    assert len(kept) < len(body)
    try:
        for path in peers.recordings(folder):
            for given in peers.GIVEN:
                for name in ("mekf", "bounded-velocity", "integration"):
                    total, heading, inclination = peers.ours(path, name, given)
                    assert 0.0 < max(heading, inclination) < total + 1e-9
    finally:
        pauses.unlink()
    # It is a comparison: other estimates have another score.
    run = peers.run_ours(folder / "gentle.csv", "mekf", "9")
    late = peers.score.of_estimates(run.time_ns + 50_000_000, run.quat, *peers.references(folder / "gentle.csv"), False)
    assert abs(late[0] - run.summary["error_deg"]["total_rmse"]) > 1e-3


def test_the_command_prints_tables_and_a_picture(peers: Any, folder: Path, tmp_path: Path) -> None:
    rows, figure = tmp_path / "rows.json", tmp_path / "picture.svg"
    names = "bounded-velocity,mekf,vqf,fusion,ahrs-madgwick,vqf-offline,mekf (smoothed)"
    command = [sys.executable, ORACLES / "attitude_peers.py", folder, "--rows", rows, "--figure", figure, "--estimators", names]
    printed = [subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True).stdout for _ in range(2)]
    assert printed[0] == printed[1]
    made = json.loads(rows.read_text())
    assert len(made) == 2 * 2 * 7 and all(np.isfinite(row["errors_deg"]).all() for row in made)
    with_field = [line for line in printed[0].split("Without it")[0].splitlines() if line.startswith(("| `", "| **"))]
    assert {line.split("`")[1] for line in with_field} == {"bounded-velocity", "mekf", "vqf", "fusion", "ahrs-madgwick"}
    assert sum(int(line.split("|")[-3]) for line in with_field) == 2
    assert "vqf-offline" in printed[0].split("The whole recording")[1]
    svg = figure.read_text()
    assert svg.count("bounded-velocity") >= 2 and "with magnetometer" in svg and len(svg) < 300_000


def test_all_of_ours_are_in_it(peers: Any) -> None:
    attitude = {listed["name"] for listed in no.estimators() if listed["question"] == "attitude"}
    assert attitude - set(peers.OURS) == {"cascade", "device"} and set(peers.OURS) <= attitude
