"""The installed wheel: the program runs, the guide's snippets run."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

import northing as no
from conftest import REPOSITORY, free_port, program, run_program

Arrays = dict[str, np.ndarray]


def test_program_and_module_are_of_one_version() -> None:
    assert run_program("--version").split() == ["northing", no.__version__]


def test_the_demonstration_of_the_wheel(tmp_path: Path) -> None:
    said = run_program("demo", "--out", tmp_path / "demo")
    assert "deg" in said and list((tmp_path / "demo").glob("*.html"))


def test_the_lab_of_the_wheel_answers(tmp_path: Path) -> None:
    port = free_port()
    command = [program(), "live", "--local", "--port", str(port)]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as lab:
        try:
            page, patience = "", time.monotonic() + 30.0
            while not page:
                said = lab.stdout.read() if lab.stdout and lab.poll() is not None else ""
                assert lab.poll() is None and time.monotonic() < patience, said
                with contextlib.suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{port}/") as answer:
                    page = answer.read().decode()
        finally:
            lab.send_signal(signal.SIGINT)
        assert "<title>" in page and lab.wait(timeout=30) == 0


def test_the_module_that_is_tested_is_the_installed_one() -> None:
    if os.environ.get("NORTHING_PROGRAM"):
        pytest.skip("a module beside a program that is named")
    assert Path(no.__file__).is_relative_to(sys.prefix), no.__file__


def snippets(page: Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", page.read_text(), flags=re.DOTALL)


def test_every_snippet_of_the_guide_runs(phone: Arrays, tmp_path: Path) -> None:
    """One after the other in one interpreter, in a folder with the recordings that the guide names."""
    run_program("demo", "--record-only", tmp_path / "walk.csv")
    np.savez(tmp_path / "imu.npz", gyr=phone["gyr"], acc=phone["acc"], mag=phone["mag"])
    found = snippets(REPOSITORY / "docs/python.md")
    assert len(found) >= 5
    code = "\n".join(["import matplotlib", "matplotlib.use('Agg')", *found])
    (tmp_path / "guide.py").write_text(code)
    ran = subprocess.run([sys.executable, "guide.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr


def test_the_snippet_of_the_guide_to_estimators_runs(tmp_path: Path) -> None:
    no.virtual_phone(seed=3, duration=20.0).save(tmp_path / "walk.csv")
    (snippet,) = snippets(REPOSITORY / "docs/own_estimator.md")
    (tmp_path / "mine.py").write_text(snippet)
    table = run_program("compare", tmp_path / "walk.csv", "--estimators", f"integration,{tmp_path / 'mine.py'}:Mine")
    assert "mine.py:Mine" in table
