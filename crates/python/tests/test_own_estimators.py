"""A student's own filter runs, is judged and shown like ours; one that fails is said to have failed and disturbs nobody."""

from __future__ import annotations

import json
import re
import subprocess
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import northing as no
from conftest import REPOSITORY, free_port, program, run_program

TEMPLATE = REPOSITORY / "examples/estimators/mine.py"


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("walk") / "walk.csv"
    no.virtual_phone(seed=3, duration=40.0, motion="brisk").save(path)
    return path


def broken(folder: Path, body: str) -> str:
    """A file with an estimator whose gyroscope does this from the 200th sample on."""
    code = f"""
        import time, math
        import northing as no

        class Broken(no.Estimator):
            calls = 0
            def gyroscope(self, rate, dt):
                self.calls += 1
                if self.calls == 1: print("a word on standard output")
                if self.calls > 200:
                    {body}
        """
    (folder / "broken.py").write_text(textwrap.dedent(code))
    return f"{folder / 'broken.py'}:Broken"


def test_the_template_is_the_mekf_of_the_core_within_rounding(walk: Path) -> None:
    """The exercise's solution in a process of its own, beside ours: equal attitudes, covariances, verdicts."""
    ours, mine = no.compare([walk], ["mekf", f"{TEMPLATE}:Mine"])
    assert mine["estimator"].endswith("mine.py:Mine")
    assert mine["error_deg"]["total_rmse"] < ours["error_deg"]["total_rmse"] + 1.0
    assert mine["estimates"] == ours["estimates"]
    assert {v["sensor"] for v in mine["verdicts"]} == {v["sensor"] for v in ours["verdicts"]} != set()
    run = no.open(walk).run(f"{TEMPLATE}:Mine")
    assert run.covariance.shape == (len(run), 3, 3) and np.isfinite(run.covariance[-1]).all()
    assert run.summary["error_deg"] == mine["error_deg"] and len(run.nis["accelerometer"]) > 1000


def test_program_and_module_give_the_same_digits(walk: Path, tmp_path: Path) -> None:
    name = f"{TEMPLATE}:Mine"
    run_program("run", walk, "--estimator", name, "--out", tmp_path / "program.csv", "--report", tmp_path / "mine.html")
    no.open(walk).run(name).save(tmp_path / "module.csv")
    assert (tmp_path / "program.csv").read_bytes() == (tmp_path / "module.csv").read_bytes()
    assert "mine.py:Mine" in (tmp_path / "mine.html").read_text()
    printed = json.loads(run_program("compare", walk, "--estimators", f"mekf,{name}", "--json"))
    assert [one["estimator"] for one in printed] == ["mekf", name]
    table = run_program("benchmark", "attitude", "--data", walk.parent, "--estimator", name)
    assert name in table and "bounded-velocity" in table


class Turning(no.Estimator):
    """Integrates the gyroscope, in numpy, and knows how it errs."""

    def start(self, quat: Any, covariance: Any, gyro_bias: Any, gyro_bias_std: float, force: Any, field: Any) -> None:
        super().start(quat, covariance, gyro_bias, gyro_bias_std, force, field)
        self.covariance = np.array(covariance)

    def gyroscope(self, rate: Any, dt: float) -> None:
        half = np.array(rate) * dt / 2
        angle = np.linalg.norm(half)
        dw, dv = np.cos(angle), np.sinc(angle / np.pi) * half
        w, v = self.quat[0], np.array(self.quat[1:])
        q = np.concatenate([[w * dw - v @ dv], w * dv + dw * v + np.cross(v, dv)])
        self.quat = q / np.linalg.norm(q)
        self.covariance = self.covariance + np.eye(3) * 1e-6 * dt


def test_a_class_of_this_interpreter_is_the_integration_of_the_core(walk: Path) -> None:
    phone = no.virtual_phone(seed=3, duration=40.0, motion="brisk")
    sensors = [phone["gyr"], phone["acc"], phone["mag"]]
    stamps = {"t": phone["gyr_time_ns"], "acc_t": phone["acc_time_ns"], "mag_t": phone["mag_time_ns"]}
    mine = no.attitude(*sensors, **stamps, estimator=Turning)
    ours = no.attitude(*sensors, **stamps, estimator="integration")
    assert mine.estimator == "Turning" and mine.undefined == ours.undefined
    known = ~np.isnan(ours.quat[:, 0])
    agreement = np.abs(np.sum(mine.quat[known] * ours.quat[known], axis=1))
    assert np.degrees(2 * np.arccos(np.clip(agreement.min(), -1, 1))) < 0.5
    assert mine.parameters.keys() <= {"initial_tilt_std", "initial_heading_std", "maximum_attitude_std",
                                      "initial_gyroscope_bias_std", "compass_std"}
    summary = no.compare([walk], [Turning, "integration"])
    assert [one["estimator"] for one in summary] == ["Turning", "integration"]
    with pytest.raises(ValueError, match="an estimator of the project is called `mekf`"):
        no.attitude(*sensors, **stamps, estimator=type("mekf", (no.Estimator,), {}))
    with pytest.raises(ValueError, match="has no effect on `Turning`"):
        no.attitude(*sensors, **stamps, estimator=Turning, accelerometer_std=1.0)


@pytest.mark.parametrize(("body", "reason"), [
    ("raise ValueError('lost')", r"raises ValueError: lost \(broken.py, line \d+\) \(call \d+\)"),
    ("self.quat = (2.0, 0, 0, 0)", "says an attitude that is no rotation: quaternion"),
    ("self.quat = (1, 0, 0)", "raises ValueError: quat has 3 numbers; expected 4 numbers"),
    ("self.covariance = [[1, 0, 0], [0, -1, 0], [0, 0, 1]]", "its covariance is not finite, symmetric and positive"),
    ("import os; os._exit(3)", "has ended without an answer"),
    ("import sys; sys.exit()", "raises SystemExit"),
    ("time.sleep(60)", "has not answered for 5 s and was ended"),
])
def test_one_that_fails_is_said_to_and_disturbs_nobody(walk: Path, tmp_path: Path, body: str, reason: str) -> None:
    name = broken(tmp_path, body)
    began = time.monotonic()
    ours, mine = no.compare([walk], ["mekf", name])
    assert time.monotonic() - began < 30.0
    assert ours == no.compare([walk], ["mekf"])[0]
    assert re.search(reason, mine["failure"]) and mine["estimator"] == name, mine
    ran = subprocess.run([program(), "compare", walk, "--estimators", f"mekf,{name}"], capture_output=True, text=True, check=False)
    assert ran.returncode == 2 and "mekf" in ran.stdout and re.search(reason, ran.stderr), ran
    assert "panicked" not in ran.stderr


def test_a_class_here_that_stalls_is_ended(walk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("northing._own.PATIENCE_S", 0.5)

    class Stalls(no.Estimator):
        def gyroscope(self, rate: Any, dt: float) -> None:
            while True:
                pass

    (mine,) = no.compare([walk], [Stalls])
    assert "Stalls does not come back from a call and was ended" in mine["failure"]

    class Raises(no.Estimator):
        def gyroscope(self, rate: Any, dt: float) -> None:
            raise KeyError("bias")

    with pytest.raises(ValueError, match=r"Raises raises KeyError: 'bias' \(test_own_estimators.py, line \d+\)"):
        no.open(walk).run(Raises)


def test_refusals(walk: Path, tmp_path: Path) -> None:
    (tmp_path / "empty.py").write_text("import northing as no\nclass Other(no.Estimator): pass\n")
    for name, reason in [
        (f"{tmp_path}/no.py:Mine", "there is no file"),
        (f"{tmp_path}/empty.py:2x", "expected a file and a class in it, such as mine.py:Mine"),
        (f"{tmp_path}/empty.py:Mine", "no class Mine in empty.py; there are Other"),
        (f"{tmp_path}/empty.py:Other", r"raises NotImplementedError: def gyroscope\(self, rate, dt\)"),
    ]:
        with pytest.raises(ValueError, match=reason):
            no.open(walk).run(name)
        ran = subprocess.run([program(), "run", walk, "--estimator", name], capture_output=True, text=True, check=False)
        assert ran.returncode == 2 and re.search(reason, ran.stderr), ran.stderr
    ran = subprocess.run([program(), "run", walk, "--estimator", f"{TEMPLATE}:Mine"], capture_output=True, text=True,
                         check=False, env={"NORTHING_PYTHON": "/no/python", "PATH": ""})
    assert ran.returncode == 2 and "`/no/python` does not start" in ran.stderr
    with pytest.raises(TypeError, match="expected a name"):
        no.compare([walk], [3])  # type: ignore[list-item]


def test_a_template_runs_without_the_module(walk: Path, tmp_path: Path) -> None:
    """The program alone: `import northing` in the file finds the class and nothing else."""
    import sys

    bare = tmp_path / "python"
    bare.write_text(f"#!/bin/sh\nexec {sys.base_prefix}/bin/python3 -I -S \"$@\"\n")
    bare.chmod(0o755)
    mine = tmp_path / "mine.py"
    mine.write_text("import northing as no\nclass Still(no.Estimator):\n    def gyroscope(self, rate, dt): pass\n")
    ran = subprocess.run([program(), "run", walk, "--estimator", f"{mine}:Still", "--json"], capture_output=True, text=True,
                         check=False, env={"NORTHING_PYTHON": str(bare), "PATH": "/usr/bin:/bin"})
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["estimator"] == f"{mine}:Still"


def frames(port: int, seconds: float, stop: Any) -> list[dict[str, Any]]:
    """What the lab tells its pages, until `stop` says so."""
    from websockets.sync.client import connect

    told, patience = [], time.monotonic() + seconds
    with connect(f"ws://127.0.0.1:{port}/api/ws", open_timeout=20) as socket:
        while time.monotonic() < patience:
            try:
                told.append(json.loads(socket.recv(timeout=1.0)))
            except TimeoutError:
                continue
            if stop(told[-1]):
                break
    return told


def test_in_the_lab_it_runs_beside_ours_and_one_that_fails_is_told(walk: Path, tmp_path: Path) -> None:
    port = free_port()
    failing = broken(tmp_path, "raise ValueError('lost')")
    lab = no.live("--port", str(port), "--local", "--no-open", "--replay", str(walk), "--no-recording",
                  estimators=[f"{TEMPLATE}:Mine", failing])
    try:
        mine, seen, notes = f"{TEMPLATE}:Mine", [], []

        def look(message: dict[str, Any]) -> bool:
            text = json.dumps(message)
            if "raises ValueError: lost" in text and failing in text:
                notes.append(text)
            if message.get("type") == "frame" and mine in text:
                seen.append(message)
            return len(seen) > 30 and bool(notes)

        deadline = time.monotonic() + 30.0
        while True:
            try:
                told = frames(port, 30.0, look)
                break
            except OSError:
                assert time.monotonic() < deadline and lab.poll() is None
                time.sleep(0.2)
        assert notes, "the failure was not told"
        assert "It is left out from here on." in notes[0]
        hello = next(message for message in told if message.get("type") == "hello")
        assert {mine, failing} <= {line["name"] for line in hello["estimators"]}
        assert len(seen) > 30
    finally:
        lab.terminate()
        assert lab.wait(timeout=30) is not None
