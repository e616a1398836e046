"""Estimators of one's own: the class to derive from, and the loop that serves one over pipes.

A file with such a class runs beside the project's estimators: ``northing compare walk.csv --estimators mekf,mine.py:Mine``.
The loop needs nothing but Python; where the module is not installed, ``import northing`` finds this class alone.
"""

from __future__ import annotations

import os
import struct
import sys
import traceback
from typing import Any, BinaryIO

_REQUEST = struct.Struct("<B24d")
_ANSWER = struct.Struct("<BB37d")
_ROWS = (9, 9, 9)


class Estimator:
    """An attitude estimator of one's own: derive from it, keep ``quat`` and whatever else is known, and it is run, judged and
    shown like every other.

    Attitudes are quaternions w, x, y, z that turn body axes into those of the reference (east-north-up, or what the recording
    says); vectors are of three numbers, matrices of three rows: lists or arrays, as you like. Gravity never appears with a sign
    to guess: ``accelerometer`` is handed the specific force, which at rest points up.
    """

    #: Attitude, body to reference, w, x, y, z.
    quat: Any = (1.0, 0.0, 0.0, 0.0)
    #: Covariance (rad^2) of its local error in body axes, or None: without it the innovations are not judged.
    covariance: Any = None
    #: Gyroscope bias (rad/s) and its covariance, or None where they are not estimated.
    gyro_bias: Any = None
    gyro_bias_covariance: Any = None

    def start(self, quat: Any, covariance: Any, gyro_bias: Any, gyro_bias_std: float, force: Any, field: Any) -> None:
        """Starts, or starts again: the attitude that the first samples show, its covariance, the gyroscope bias (rad/s), and
        what accelerometer (m/s^2) and magnetometer (microtesla, or None) read in the axes of the reference."""
        self.quat = quat
        self.force, self.field = force, field

    def gyroscope(self, rate: Any, dt: float) -> None:
        """Moves on by an angular rate, rad/s, that held for ``dt`` seconds."""
        raise NotImplementedError("def gyroscope(self, rate, dt): the estimator cannot move on without it")

    def accelerometer(self, force: Any) -> Any:
        """Uses a specific force, m/s^2. Returns what it told, (residual, covariance of the residual), or None."""
        return None

    def magnetometer(self, field: Any) -> Any:
        """Uses a magnetic field, microtesla. Returns what it told, or None."""
        return None

    def compass(self, heading: float, std: float, frame: str) -> Any:
        """Uses a heading, rad clockwise from north, of a world that is ``enu`` or ``ned``. Returns (residual, variance) or None."""
        return None

    def unseen(self, variance: float) -> None:
        """Something unseen happened, such as a gap: add this variance, rad^2, to each component of the attitude."""


class Stalled(BaseException):
    """Raised inside an estimator of which a call does not come back."""


class Served:
    """An estimator that answers requests."""

    def __init__(self, estimator: Any, quiet: bool = True) -> None:
        self._estimator = estimator
        self._quiet = quiet

    def answer(self, request: bytes) -> bytes:
        """The answer to a request, or why there is none."""
        try:
            number, *numbers = _REQUEST.unpack(request)
            return self._said(self._asked(number, numbers))
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            if not self._quiet:
                traceback.print_exc()
            return failure(error)

    def _asked(self, number: int, n: list[float]) -> Any:
        own = self._estimator
        if number == 0:
            field = tuple(n[21:24]) if n[20] else None
            own.start(tuple(n[:4]), _matrix(n[4:13]), tuple(n[13:16]), n[16], tuple(n[17:20]), field)
        elif number == 1:
            own.gyroscope(tuple(n[:3]), n[3])
        elif number == 2:
            return own.accelerometer(tuple(n[:3]))
        elif number == 3:
            return own.magnetometer(tuple(n[:3]))
        elif number == 4:
            return own.compass(n[0], n[1], "ned" if n[2] else "enu")
        else:
            own.unseen(n[0])
        return None

    def _said(self, told: Any) -> bytes:
        own = self._estimator
        flags, numbers = 0, _numbers("quat", own.quat, 4)
        for bit, name, size in ((1, "covariance", 9), (2, "gyro_bias", 3), (4, "gyro_bias_covariance", 9)):
            value = getattr(own, name)
            if value is not None:
                flags |= bit
            numbers += [0.0] * size if value is None else _numbers(name, value, size)
        residual, covariance = (None, None) if told is None else _innovation(told)
        flags |= (8 if residual is not None else 0) | (16 if covariance is not None else 0)
        numbers += residual or [0.0] * 3
        numbers += covariance or [0.0] * 9
        return _ANSWER.pack(0, flags, *numbers)


def _matrix(numbers: list[float]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(numbers[i : i + 3]) for i in (0, 3, 6))


def _numbers(name: str, value: Any, size: int) -> list[float]:
    """The numbers of lists, tuples or arrays, row by row."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    try:
        flat = [float(x) for row in value for x in (row if hasattr(row, "__len__") else (row,))]
    except TypeError:
        raise TypeError(f"{name} is {value!r}; expected {_shape(size)}") from None
    if len(flat) != size:
        raise ValueError(f"{name} has {len(flat)} numbers; expected {_shape(size)}")
    return flat


def _shape(size: int) -> str:
    return "three rows of three numbers" if size == 9 else f"{size} numbers"


def _innovation(told: Any) -> tuple[list[float], list[float] | None]:
    """A residual and its covariance; of a heading each is one number."""
    try:
        residual, covariance = told
    except (TypeError, ValueError):
        raise TypeError(f"an update has returned {told!r}; expected (residual, covariance of the residual), or None") from None
    if isinstance(residual, (int, float)):
        return [float(residual), 0.0, 0.0], [float(covariance), 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    whole = None if covariance is None else _numbers("the covariance of the residual", covariance, 9)
    return _numbers("the residual", residual, 3), whole


def failure(error: BaseException) -> bytes:
    """What was raised, and where, as an answer."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if os.path.basename(frame.filename) not in ("<string>", "_estimator.py")]
    where = f" ({os.path.basename(own[-1].filename)}, line {own[-1].lineno})" if own else ""
    said = str(error).strip().splitlines()
    what = f"raises {type(error).__name__}{': ' + said[0] if said else ''}{where}"
    if isinstance(error, Stalled):
        what = f"does not come back from a call and was ended{where}"
    text = what.encode()[: 1 << 16]
    return b"\1" + struct.pack("<I", len(text)) + text


def _made(file: str, name: str, quiet: bool) -> Served:
    """An estimator of the class in the file."""
    import importlib.util
    import types

    sys.path.insert(0, os.path.dirname(os.path.abspath(file)))
    if importlib.util.find_spec("northing") is None:
        stand_in = types.ModuleType("northing")
        stand_in.Estimator = Estimator  # type: ignore[attr-defined]
        sys.modules["northing"] = stand_in
    spec = importlib.util.spec_from_file_location(os.path.splitext(os.path.basename(file))[0], file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    if not hasattr(module, name):
        classes = [key for key, value in vars(module).items() if isinstance(value, type) and value.__module__ == module.__name__]
        raise AttributeError(f"no class {name} in {os.path.basename(file)}; there are {', '.join(classes) or 'none'}")
    return Served(getattr(module, name)(), quiet)


def serve(file: str, name: str) -> None:
    """Answers requests from standard input until it ends. What the estimator prints goes to standard error."""
    requests: BinaryIO = sys.stdin.buffer
    answers: BinaryIO = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    quiet = bool(os.environ.get("NORTHING_ESTIMATOR_QUIET"))
    try:
        served = _made(file, name, quiet)
        answer = _ANSWER.pack(0, 0, *[0.0] * 37)
    except BaseException as error:
        if not quiet:
            traceback.print_exc()
        answers.write(failure(error))
        answers.flush()
        return
    while True:
        answers.write(answer)
        answers.flush()
        request = requests.read(_REQUEST.size)
        if len(request) < _REQUEST.size:
            return
        answer = served.answer(request)


if __name__ == "__main__" and sys.argv[0] == "-c":
    try:
        serve(*sys.argv[1:3])
    except (BrokenPipeError, KeyboardInterrupt):
        pass
