"""Attitude from arrays."""

from __future__ import annotations

from typing import Any

from . import _northing
from ._arrays import beside, gyroscope
from ._asked import Asked, Parameter, Reading, calibrated, settings
from ._own import AnyEstimator, named
from ._results import Attitude
from ._types import ArrayLike


def attitude(
    gyr: ArrayLike,
    acc: ArrayLike | None = None,
    mag: ArrayLike | None = None,
    *,
    rate: float | None = None,
    t: ArrayLike | None = None,
    acc_t: ArrayLike | None = None,
    mag_t: ArrayLike | None = None,
    estimator: AnyEstimator | None = None,
    profile: str | None = None,
    smooth: bool = False,
    frame: str = "enu",
    calibration: dict[str, Any] | None = None,
    magnetometer_calibration: dict[str, Any] | None = None,
    calibrate_first: float | None = None,
    gyroscope_unit: str | None = None,
    accelerometer_unit: str | None = None,
    magnetometer_unit: str | None = None,
    gap_limit: float = 0.5,
    **parameters: Parameter,
) -> Attitude:
    """Which way a device points, from its gyroscope, accelerometer and magnetometer.

    ``gyr`` in rad/s, ``acc`` the specific force in m/s^2 (at rest +9.81 on the axis that points up), ``mag`` in
    microtesla: (N, 3) each, as lists, arrays or DataFrames. Time is ``rate`` in Hz, or ``t``: seconds, int64
    nanoseconds or datetime64; a sensor of another rate has ``acc_t`` or ``mag_t`` of its own. ``estimator`` and
    ``profile`` are those of the program (default ``bounded-velocity``, ``hand-held``), or ``estimator`` is a class of your
    own (:class:`northing.Estimator`); every further argument is a
    parameter of the estimator by its name: :func:`northing.estimators` lists both. The result has a row for each row
    of ``gyr``; before the filter is aligned they are NaN. ValueError says what is wrong and in which row first.
    """
    time_ns, rates = gyroscope(gyr, rate, t)
    sensors = {
        name: beside(name, values, own_t, time_ns) for name, values, own_t in (("acc", acc, acc_t), ("mag", mag, mag_t))
    }
    asked = Asked(
        estimator=named(estimator),
        profile=profile,
        smooth=smooth,
        calibrate_first_s=calibrate_first,
        calibration=calibrated(calibration),
        magnetometer_calibration=calibrated(magnetometer_calibration),
        settings=settings(parameters),
    )
    reading = Reading(
        gyroscope_unit=gyroscope_unit,
        accelerometer_unit=accelerometer_unit,
        magnetometer_unit=magnetometer_unit,
        gap_limit_s=gap_limit,
    )
    run = _northing.attitude((time_ns, rates), sensors["acc"], sensors["mag"], frame, asked, reading)
    return Attitude(run, "northing.attitude(gyr, acc, mag)")
