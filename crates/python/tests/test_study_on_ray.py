"""A study on Ray, two of its four workers killed, has the hash of one process."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from conftest import REPOSITORY, program, run_program

ray = pytest.importorskip("ray", reason="Ray is not installed (pip install ray)")

STUDY = """
question = "attitude"
estimators = ["mekf", "usque", "bounded-velocity"]
seeds = { first = 1, count = 40 }
[sources.worlds]
count = 2
"""


def on_ray():
    """The example as a module."""
    found = importlib.util.spec_from_file_location("on_ray", REPOSITORY / "examples" / "studies" / "on_ray.py")
    assert found and found.loader
    module = importlib.util.module_from_spec(found)
    sys.modules["on_ray"] = module
    found.loader.exec_module(module)
    return module


def parent(pid: int) -> int:
    """The process that started another; 0 where there is none."""
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    except (OSError, ValueError):
        return 0


def is_ours(pid: int) -> bool:
    """Whether this test started a process, if by others."""
    while pid > 1:
        pid = parent(pid)
        if pid == os.getpid():
            return True
    return False


def workers() -> list[int]:
    """Processes of this test's own cluster that are at a shard."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            words = (folder / "cmdline").read_bytes().split(b"\0")[0]
        except OSError:
            continue
        if folder.name.isdigit() and words == b"ray::shard" and is_ours(int(folder.name)):
            found.append(int(folder.name))
    return found


def test_two_of_four_workers_killed(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(STUDY)
    whole = json.loads(run_program("study", study, "--json"))
    parts = tmp_path / "parts"
    killed: list[int] = []
    seen_four = threading.Event()

    def kill() -> None:
        until = time.monotonic() + 120
        while len(killed) < 2 and time.monotonic() < until:
            at_work = [pid for pid in workers() if pid not in killed]
            if len(at_work) >= 4:
                seen_four.set()
                for pid in at_work[:2]:
                    os.kill(pid, signal.SIGKILL)
                    killed.append(pid)
            time.sleep(0.02)

    module = on_ray()
    ray.cloudpickle.register_pickle_by_value(module)
    ray.init(num_cpus=4, include_dashboard=False, log_to_driver=False)
    try:
        killer = threading.Thread(target=kill)
        killer.start()
        outcome = module.run(program(), str(study), str(parts), shards=8, threads=1, retries=5)
        killer.join()
    finally:
        ray.shutdown()
    assert seen_four.is_set() and len(killed) == 2
    assert outcome["hash"] == whole["hash"]
    assert outcome == whole
