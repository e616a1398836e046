"""What the tests share: recordings, the program, and simulated arrays."""

from __future__ import annotations

import csv
import math
import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

# A program that is named is not beside the interpreter of the tests.
os.environ.setdefault("NORTHING_PYTHON", sys.executable)
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


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


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


START_NS = 1_700_000_000_000_000_000
Samples = dict[str, list[tuple[int, list[float]]]]


@pytest.fixture(scope="session")
def drive() -> Samples:
    """A minute of a car: 5 s of standstill, then a circle at 10 m/s; IMU 100 Hz, field 20 Hz, fixes and true velocities
    5 Hz; axes forward, left, up and the world east, north, up."""
    random = np.random.default_rng(8)
    samples: Samples = {"imu": [], "mag": [], "fix": [], "velocity": []}
    heading, east, north, speed = 0.3, 0.0, 0.0, 0.0
    for step in range(6000):
        moves = step >= 500
        acc, turn = (2.0 if moves and speed < 10.0 else 0.0), (0.1 if moves else 0.0)
        speed, heading = speed + acc * 0.01, heading + turn * 0.01
        east, north = east + speed * math.cos(heading) * 0.01, north + speed * math.sin(heading) * 0.01
        time_ns = START_NS + step * 10_000_000
        noise = random.normal(size=12)
        rate = [0.002 * noise[0], 0.002 * noise[1], turn + 0.002 * noise[2]]
        force = [acc + 0.05 * noise[3], speed * turn + 0.05 * noise[4], 9.81 + 0.05 * noise[5]]
        samples["imu"].append((time_ns, [*rate, *force]))
        if step % 5 == 0:
            field = [21e-6 * math.sin(heading), 21e-6 * math.cos(heading), -43e-6]
            samples["mag"].append((time_ns, [f + 0.3e-6 * n for f, n in zip(field, noise[6:9])]))
        if step % 20 == 0:
            latitude = 48.0 + math.degrees((north + 1.5 * noise[9]) / 6_371_000.0)
            longitude = 9.0 + math.degrees((east + 1.5 * noise[10]) / 6_371_000.0 / math.cos(math.radians(48.0)))
            samples["fix"].append((time_ns + 3_000_000, [latitude, longitude, 300.0 + 3.0 * noise[11]]))
            velocity = [speed * math.cos(heading), speed * math.sin(heading), 0.0]
            samples["velocity"].append((time_ns + 3_000_000, velocity))
    return samples


@pytest.fixture(scope="session")
def table(drive: Samples, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The samples as our CSV."""
    groups = [("gyro_{}_rad_s", "xyz"), ("acc_{}_m_s2", "xyz"), ("mag_{}_ut", "xyz")]
    names = [name.format(axis) for name, axes in groups for axis in axes]
    names += ["gnss_latitude_rad", "gnss_longitude_rad", "gnss_height_m", "gnss_std_n_m", "gnss_std_e_m",
              "gnss_std_d_m", "gnss_quality"]
    rows: dict[int, dict[str, float]] = {}
    for time_ns, values in drive["imu"]:
        rows.setdefault(time_ns, {}).update(zip(names[:6], values))
    for time_ns, values in drive["mag"]:
        rows.setdefault(time_ns, {}).update(zip(names[6:9], [value * 1e6 for value in values]))
    for time_ns, (latitude, longitude, height) in drive["fix"]:
        fix = [math.radians(latitude), math.radians(longitude), height, 1.5, 1.5, 3.0, 1]
        rows.setdefault(time_ns, {}).update(zip(names[9:], fix))
    path = tmp_path_factory.mktemp("table") / "drive.csv"
    with path.open("w", newline="") as file:
        file.write("# body_axes: flu\n")
        out = csv.writer(file)
        out.writerow(["t_ns", *names])
        for time_ns, row in sorted(rows.items()):
            out.writerow([time_ns, *(repr(float(row[name])) if name in row else "" for name in names)])
    return path
