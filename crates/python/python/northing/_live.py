"""The lab, with estimators of one's own in it."""

from __future__ import annotations

import inspect
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path as _Path

from ._estimator import Estimator


def _program() -> str:
    beside = shutil.which("northing", path=str(_Path(sys.executable).parent))
    found = os.environ.get("NORTHING_PROGRAM") or beside or shutil.which("northing")
    if not found:
        raise FileNotFoundError("the program `northing` is neither beside this interpreter nor on the path; the wheel brings it")
    return found


def _place(estimator: str | type[Estimator]) -> str:
    """`FILE.py:CLASS` of a class."""
    if isinstance(estimator, str):
        return estimator
    try:
        file = inspect.getsourcefile(estimator)
    except (TypeError, OSError):
        file = None
    if file is None or not file.endswith(".py"):
        raise ValueError(
            f"{estimator.__name__} is not in a file: the lab runs an estimator in a process of its own, which reads it from one. "
            "Save it, and import it or name it as \"mine.py:Mine\""
        )
    return f"{file}:{estimator.__qualname__}"


def live(*arguments: str, estimators: Sequence[str | type[Estimator]] = ()) -> subprocess.Popen[bytes]:
    """Starts the lab, as ``northing live`` with these arguments, with estimators of your own beside ours on every device.

    ``estimators`` are classes derived from :class:`northing.Estimator`, in files, or ``"FILE.py:CLASS"``. Gives the running
    process: ``terminate()`` ends the lab, ``wait()`` waits for it.
    """
    own = [word for estimator in estimators for word in ("--estimator", _place(estimator))]
    environment = {"NORTHING_PYTHON": sys.executable, **os.environ}
    return subprocess.Popen([_program(), "live", *arguments, *own], env=environment)
