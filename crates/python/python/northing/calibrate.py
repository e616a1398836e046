"""Calibrations from recordings: at rest, of the magnetometer, and Allan deviations.

What :func:`rest` and :func:`magnetometer` give is passed on as ``calibration=`` and ``magnetometer_calibration=``.
"""

from __future__ import annotations

import json
from typing import Any

from . import _northing
from ._recordings import Recording


def rest(
    recording: Recording, *, start: float | None = None, stop: float | None = None, magnetometer: str | None = "device"
) -> dict[str, Any]:
    """Bias, noise and references of a device that lies still, as ``northing calibrate rest``.

    Without a span (seconds after the first sample) from the beginning for as long as it rests. ``magnetometer`` is
    ``device``, ``uncalibrated`` or None. The values are under ``calibration``.
    """
    made: dict[str, Any] = json.loads(_northing.calibrate_rest(recording._file, magnetometer, start, stop))
    return made


def magnetometer(
    recording: Recording,
    *,
    start: float | None = None,
    stop: float | None = None,
    magnetometer: str | None = None,
    field_strength: float | None = None,
) -> dict[str, Any]:
    """Hard and soft iron of a device that is turned in all directions, as ``northing calibrate magnetometer``.

    ``field_strength`` is that of the place, microtesla, if known. The values are under ``calibration``.
    """
    text = _northing.calibrate_magnetometer(recording._file, magnetometer, field_strength, start, stop)
    made: dict[str, Any] = json.loads(text)
    return made


def allan(
    recording: Recording, sensor: str = "gyroscope", *, start: float | None = None, stop: float | None = None
) -> dict[str, Any]:
    """The Allan deviation of a sensor at rest and the noise that its slopes show, as ``northing calibrate allan``."""
    made: dict[str, Any] = json.loads(_northing.calibrate_allan(recording._file, sensor, start, stop))
    return made
