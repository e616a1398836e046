"""Position, velocity and attitude from arrays."""

from __future__ import annotations

from collections.abc import Sequence

from . import _northing
from ._arrays import beside, fixes, gyroscope
from ._asked import AskedNavigation, Measured, Parameter, Reading, settings
from ._results import Track
from ._types import ArrayLike


def navigation(
    gyr: ArrayLike,
    acc: ArrayLike,
    gnss: ArrayLike,
    *,
    gnss_t: ArrayLike,
    gnss_std: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    velocity_t: ArrayLike | None = None,
    velocity_std: ArrayLike | None = None,
    mag: ArrayLike | None = None,
    rate: float | None = None,
    t: ArrayLike | None = None,
    acc_t: ArrayLike | None = None,
    mag_t: ArrayLike | None = None,
    estimator: str = "error-state",
    smooth: bool = False,
    gnss_every: int | None = None,
    outages: Sequence[str] = (),
    without: Sequence[str] = (),
    score_from: float | None = None,
    gyroscope_unit: str | None = None,
    accelerometer_unit: str | None = None,
    magnetometer_unit: str | None = None,
    gap_limit: float = 0.5,
    **parameters: Parameter,
) -> Track:
    """Where a vehicle is and which way it points, from its inertial unit and a satellite receiver.

    ``gyr`` (rad/s), ``acc`` (specific force, m/s^2) and their time are those of :func:`northing.attitude`; body axes are forward,
    right, down, or any others: then the attitude is that of the axes that the unit has. ``gnss`` are fixes of the receiver: latitude and longitude in
    degrees, height above the ellipsoid in m (NaN where there is none), (M, 3), taken at ``gnss_t`` of the same clock;
    ``gnss_std`` their standard deviations north, east and down in m as the receiver states them: a number, three, or (M, 3),
    NaN where none is stated. ``velocity`` is the receiver's, north, east and down in m/s, with stamps (``gnss_t`` where it has as
    many rows) and standard deviations of its own. Further arguments are those of :meth:`northing.Recording.run`: ``smooth`` for
    the fixed-interval smoother, ``gnss_every=4`` to hold fixes out and score at them, ``outages=["120:30"]``; every parameter of
    the estimator by its name. The result has rows from the first fix on. ValueError says what is wrong and in which row first.
    """
    time_ns, rates = gyroscope(gyr, rate, t)
    accelerations = beside("acc", acc, acc_t, time_ns)
    if accelerations is None:
        raise ValueError("acc is missing: expected specific forces in m/s^2, shape (N, 3)")
    positions = fixes(
        ("gnss", "gnss_t", "gnss_std"), "latitude and longitude in degrees, height in m", gnss, gnss_t, gnss_std
    )
    velocities = None
    if velocity is not None:
        own_t = gnss_t if velocity_t is None else velocity_t
        names = ("velocity", "gnss_t" if velocity_t is None else "velocity_t", "velocity_std")
        velocities = fixes(names, "velocities north, east and down in m/s", velocity, own_t, velocity_std)
    elif velocity_t is not None or velocity_std is not None:
        raise ValueError("velocity_t and velocity_std: given without velocity")
    run = _northing.navigation(
        Measured((time_ns, rates), accelerations, beside("mag", mag, mag_t, time_ns), positions, velocities),
        estimator,
        smooth,
        settings(parameters),
        AskedNavigation(gnss_every, list(outages), list(without), score_from),
        Reading(
            gyroscope_unit=gyroscope_unit,
            accelerometer_unit=accelerometer_unit,
            magnetometer_unit=magnetometer_unit,
            gap_limit_s=gap_limit,
        ),
    )
    return Track(run, "northing.navigation(gyr, acc, gnss)")
