"""Northing: attitude and navigation from noisy sensors, each estimate with a covariance that is tested.

>>> import northing as no
>>> r = no.attitude(gyr, acc, mag, rate=100.0)      # (N, 3) each: rad/s, m/s^2, microtesla
>>> r.quat, r.covariance, r.verdicts
>>> no.open("walk.zip").run("mekf").report("walk.html")

The estimators, readers and writers are those of the program ``northing``, and give the same digits.
"""

from __future__ import annotations

import json as _json
from typing import Any

from . import _northing, calibrate, vqf
from ._attitude import attitude
from ._estimator import Estimator
from ._northing import (
    AttitudeConfig,
    BoundedVelocity,
    BoundedVelocityConfig,
    EndedTrack,
    GnssIns,
    GnssInsConfig,
    Innovation,
    Mekf,
    MultiTarget,
    OwnShip,
    ScanRecord,
    ScanSensor,
    SchmidtKalman,
    TargetTrack,
    __version__,
)
from ._live import live
from ._navigation import navigation
from ._recordings import Recording, Samples, compare, open, tune
from ._results import Attitude, Track, Verdict
from ._simulated import Campaign, SimulatedRun, VirtualRecording, montecarlo, simulate, virtual_phone, virtual_vehicle

__all__ = [
    "Attitude",
    "AttitudeConfig",
    "BoundedVelocity",
    "BoundedVelocityConfig",
    "Campaign",
    "EndedTrack",
    "Estimator",
    "GnssIns",
    "GnssInsConfig",
    "Innovation",
    "Mekf",
    "MultiTarget",
    "OwnShip",
    "Recording",
    "Samples",
    "ScanRecord",
    "ScanSensor",
    "SchmidtKalman",
    "SimulatedRun",
    "TargetTrack",
    "Track",
    "Verdict",
    "VirtualRecording",
    "__version__",
    "attitude",
    "calibrate",
    "compare",
    "estimators",
    "live",
    "montecarlo",
    "navigation",
    "open",
    "simulate",
    "tune",
    "virtual_phone",
    "virtual_vehicle",
    "vqf",
]


def estimators() -> list[dict[str, Any]]:
    """Every estimator of attitude and navigation with its parameters: name, unit, range, defaults, meaning."""
    listed: list[dict[str, Any]] = _json.loads(_northing.estimators())
    return listed
