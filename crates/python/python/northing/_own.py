"""Estimators of one's own in runs and comparisons: classes of this interpreter, watched over."""

from __future__ import annotations

import ctypes
import sys
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any, Union

from . import _northing
from ._estimator import Estimator, Served, Stalled

# The name of an estimator, a class in a file ("mine.py:Mine"), or a class.
AnyEstimator = Union[str, type[Estimator], Callable[[], Estimator]]

# How long one call may last, s.
PATIENCE_S = 5.0


class Watched(Served):
    """An estimator of which a call that does not come back is ended, as far as Python code can be."""

    def __init__(self, estimator: Any) -> None:
        super().__init__(estimator)
        self._call: tuple[float, int] | None = None
        self._lock = threading.Lock()
        threading.Thread(target=_watch, args=(weakref.ref(self),), daemon=True).start()

    def answer(self, request: bytes) -> bytes:
        self._call = (time.monotonic(), threading.get_ident())
        try:
            return super().answer(request)
        finally:
            with self._lock:
                self._call = None

    def end_a_stalled_call(self) -> bool:
        """Raises an exception in a call that has not come back for long; whether there was one."""
        with self._lock:
            call = self._call
            if call is None or time.monotonic() - call[0] <= PATIENCE_S:
                return False
            thread, raised = ctypes.c_ulong(call[1]), ctypes.py_object(Stalled)
            ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, raised)
            return True


def _watch(watched: weakref.ref[Watched]) -> None:
    while True:
        time.sleep(0.2)
        served = watched()
        if served is None or served.end_a_stalled_call():
            return
        del served


def named(estimator: AnyEstimator | None) -> str | None:
    """The name by which an estimator runs; a class is registered first, under its own."""
    if estimator is None:
        return None
    if isinstance(estimator, str):
        if ".py:" in estimator.lower():
            _northing.register_file(estimator, sys.executable)
        return estimator
    if not callable(estimator):
        raise TypeError(f"estimator={estimator!r}: expected a name, \"FILE.py:CLASS\", or a class derived from northing.Estimator")
    make = estimator
    name = str(getattr(estimator, "__name__", type(estimator).__name__))
    _northing.register_class(name, lambda: Watched(make()))
    return name
