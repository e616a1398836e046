"""What the tests share: recordings, the program, and simulated arrays."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

REPOSITORY = Path(__file__).resolve().parents[3]


def data(*parts: str) -> Path:
    """A recording of NORTHING_DATA; without it the test is skipped, with NORTHING_REQUIRE_DATA=1 it fails."""
    folder = os.environ.get("NORTHING_DATA")
    if folder:
        path = Path(folder, *parts)
        assert path.exists(), path
        return path
    assert os.environ.get("NORTHING_REQUIRE_DATA") != "1", "NORTHING_DATA is not set"
    pytest.skip("NORTHING_DATA is not set")


def program() -> str:
    """The program of the wheel, beside this interpreter, or the one that NORTHING_PROGRAM names."""
    named = os.environ.get("NORTHING_PROGRAM")
    found = named or shutil.which("northing", path=str(Path(sys.executable).parent))
    assert found, "no program `northing` beside the interpreter"
    return found


def run_program(*arguments: object) -> str:
    """What the program prints; it must succeed."""
    words = [program(), *map(str, arguments)]
    ran = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
    assert ran.returncode == 0, f"{words}: {ran.stderr}"
    return ran.stdout


@pytest.fixture(scope="session")
def phone() -> dict[str, np.ndarray]:
    """Half a minute of a device that turns slowly about all axes: 100 Hz, east-north-up."""
    random = np.random.default_rng(5)
    t = np.arange(3000) / 100.0
    moves = np.clip(t - 2.0, 0.0, 1.0)[:, None]
    rate = moves * np.stack([0.4 * np.sin(0.7 * t), 0.3 * np.cos(0.5 * t), 0.5 * np.sin(0.3 * t)], axis=1)
    axes = [np.eye(3)]
    for w in rate[:-1]:
        angle = np.linalg.norm(w) * 0.01
        k = w / (np.linalg.norm(w) or 1.0)
        K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
        axes.append(axes[-1] @ (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K))
    turned = np.array(axes)
    acc = turned.transpose(0, 2, 1) @ [0.0, 0.0, 9.81] + random.normal(0.0, 0.02, (3000, 3))
    mag = turned.transpose(0, 2, 1) @ [0.0, 21.0, -43.0] + random.normal(0.0, 0.3, (3000, 3))
    gyr = rate + 0.005 + random.normal(0.0, 0.002, (3000, 3))
    return {"t": t, "gyr": gyr, "acc": acc, "mag": mag, "axes": turned}
