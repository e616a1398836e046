"""What is asked of readers and runs, as plain data; the names are those of the program's options."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Union

import numpy as np

from ._types import Floats, Integers

Path = Union[str, "os.PathLike[str]"]
Parameter = Union[float, int, bool, str, None, Sequence[float]]


@dataclass(frozen=True)
class Reading:
    """How a recording is read."""

    format: str | None = None
    device: str | None = None
    manifest: Path | None = None
    data: Path | None = None
    gyroscope_unit: str | None = None
    accelerometer_unit: str | None = None
    magnetometer_unit: str | None = None
    gap_limit_s: float = 0.5
    describe: bool = False
    reference: Path | None = None


@dataclass(frozen=True)
class Asked:
    """How attitude is estimated."""

    estimator: str | None = None
    profile: str | None = None
    smooth: bool = False
    sensors: str | None = None
    magnetometer: str | None = None
    calibrate_first_s: float | None = None
    calibration: str | None = None
    magnetometer_calibration: str | None = None
    ignore_reference: bool = False
    align_reference: bool = False
    settings: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Measured:
    """Stamps and rows of what a navigation run over arrays takes: of fixes and velocities six numbers, values and standard deviations."""

    gyroscope: tuple[Integers, Floats]
    accelerometer: tuple[Integers, Floats]
    magnetometer: tuple[Integers, Floats] | None
    fixes: tuple[Integers, Floats]
    velocities: tuple[Integers, Floats] | None


@dataclass(frozen=True)
class AskedNavigation:
    """What a navigation run is given and scored at."""

    gnss_every: int | None = None
    outages: list[str] = field(default_factory=list)
    without: list[str] = field(default_factory=list)
    score_from_s: float | None = None


def whole(name: str, value: Any, least: int = 0) -> int:
    """A number that counts, from ``least`` on."""
    is_whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not is_whole or not least <= int(value) < 2**63:
        raise ValueError(f"{name}={value!r}: expected a whole number from {least} on")
    return int(value)


def settings(parameters: Mapping[str, Parameter]) -> list[str]:
    """Parameters as `NAME=VALUE`, to the last digit."""
    return [f"{name}={_text(value)}" for name, value in parameters.items()]


def _text(value: Parameter) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value
    if isinstance(value, (int, float)):
        return repr(value) if type(value) in (int, float) else _text(float(value))
    return ",".join(_text(item) for item in value)


def calibrated(made: Mapping[str, Any] | None) -> str | None:
    """The values of what a function of :mod:`northing.calibrate` gave."""
    return None if made is None else json.dumps(made["calibration"])
