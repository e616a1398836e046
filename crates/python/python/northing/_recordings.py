"""Recordings in files: every format that the program reads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from . import _northing
from ._asked import Asked, AskedNavigation, Parameter, Path, Reading, calibrated, settings
from ._own import AnyEstimator, named
from ._results import Attitude, Track
from ._types import Floats, Integers


class Samples(NamedTuple):
    """The samples of one sensor."""

    time_ns: Integers
    # A row a sample, NaN for what is not known.
    values: Floats
    # What stands in each column, with its unit.
    columns: list[str]

    @property
    def t(self) -> Floats:
        """Stamps, s."""
        seconds: Floats = self.time_ns.astype(np.float64) * 1e-9
        return seconds


class Recording:
    """A recording; it is read anew for everything that is asked of it. Made by :func:`northing.open`."""

    def __init__(self, path: Path, reading: Reading) -> None:
        self._path = path
        self._reading = reading
        self._file = _northing.RecordingFile(path, reading)

    @property
    def name(self) -> str:
        """Its name."""
        return self._file.name

    @property
    def format(self) -> str:
        """The format it was read as."""
        return self._file.format

    @property
    def frame(self) -> str:
        """Its world frame: ``enu`` or ``ned``."""
        return self._file.frame

    @property
    def sensors(self) -> list[str]:
        """The sensors that it promises."""
        return self._file.sensors

    def arrays(self, sensor: str) -> Samples:
        """Every sample of one sensor."""
        samples, _ = self._file.arrays(sensor)
        return Samples(*samples)

    def run(
        self,
        estimator: AnyEstimator | None = None,
        *,
        profile: str | None = None,
        smooth: bool = False,
        sensors: str | None = None,
        magnetometer: str | None = None,
        calibrate_first: float | None = None,
        calibration: dict[str, Any] | None = None,
        magnetometer_calibration: dict[str, Any] | None = None,
        ignore_reference: bool = False,
        align_reference: bool = False,
        gnss_every: int | None = None,
        outages: Sequence[str] = (),
        without: Sequence[str] = (),
        score_from: float | None = None,
        **parameters: Parameter,
    ) -> Any:
        """Runs an estimator, as ``northing run`` does with options of the same names.

        Gives a :class:`northing.Attitude`, or of a navigation estimator a :class:`northing.Track`. ``outages`` are
        ``"START:DURATION"`` in seconds; every further argument is a parameter of the estimator.
        """
        estimator = named(estimator)
        kind, name = self._file.estimator_for(estimator)
        command = f"northing.open({str(self._path)!r}).run({estimator!r})" if estimator else (
            f"northing.open({str(self._path)!r}).run()"
        )
        attitude_alone = {
            "profile": profile,
            "sensors": sensors,
            "magnetometer": magnetometer,
            "calibrate_first": calibrate_first,
            "calibration": calibration,
            "magnetometer_calibration": magnetometer_calibration,
            "ignore_reference": ignore_reference or None,
            "align_reference": align_reference or None,
        }
        navigation_alone = {
            "gnss_every": gnss_every,
            "outages": list(outages) or None,
            "without": list(without) or None,
            "score_from": score_from,
        }
        if kind == "navigation" and name is not None:
            _refuse(attitude_alone, f"`{name}`: it is for attitude estimators")
            asked = AskedNavigation(gnss_every, list(outages), list(without), score_from)
            return Track(self._file.run_navigation(name, smooth, settings(parameters), asked), command)
        _refuse(navigation_alone, "an estimator of the attitude alone; choose estimator=\"error-state\" or another of navigation")
        return Attitude(
            self._file.run_attitude(
                Asked(
                    estimator=name,
                    profile=profile,
                    smooth=smooth,
                    sensors=sensors,
                    magnetometer=magnetometer,
                    calibrate_first_s=calibrate_first,
                    calibration=calibrated(calibration),
                    magnetometer_calibration=calibrated(magnetometer_calibration),
                    ignore_reference=ignore_reference,
                    align_reference=align_reference,
                    settings=settings(parameters),
                )
            ),
            command,
        )

    def __repr__(self) -> str:
        return f"<recording {self.name}: {self.format}, {self.frame}, {', '.join(self.sensors)}>"


def _refuse(options: dict[str, Any], why: str) -> None:
    for name, value in options.items():
        if value is not None:
            raise ValueError(f"{name} has no effect on {why}; leave it out")


def open(
    path: Path,
    *,
    format: str | None = None,
    device: str | None = None,
    manifest: Path | None = None,
    data: Path | None = None,
    gyroscope_unit: str | None = None,
    accelerometer_unit: str | None = None,
    magnetometer_unit: str | None = None,
    gap_limit: float = 0.5,
    describe: bool = False,
    reference: Path | None = None,
) -> Recording:
    """Opens a recording: any file or folder that ``northing run`` reads, with options of the same names. With ``describe``
    a table that nothing describes is read by a guess at its columns, as ``northing describe`` makes it; what was guessed
    is among the issues of a run. ``reference`` is another file with the truth to score against."""
    reading = Reading(
        format,
        device,
        manifest,
        data,
        gyroscope_unit,
        accelerometer_unit,
        magnetometer_unit,
        gap_limit,
        describe,
        reference,
    )
    return Recording(path, reading)


def compare(
    recordings: Sequence[Path | Recording] | Path | Recording,
    estimators: Sequence[AnyEstimator] = (),
    *,
    profile: str | None = None,
    smooth: bool = False,
    magnetometer: str | None = None,
    calibrate_first: float | None = None,
    parameters: dict[str, Parameter] | None = None,
) -> list[dict[str, Any]]:
    """Several attitude estimators (all of them without names) over several recordings, on all processors.

    One summary a run, in the order of recordings and estimators: what ``northing compare --json`` prints. Estimators are names,
    classes of your own (:class:`northing.Estimator`) or ``"FILE.py:CLASS"``, which runs in a process of its own. One of yours
    that fails gives ``{"recording", "estimator", "failure"}`` with the reason instead.
    """
    many = recordings if isinstance(recordings, (list, tuple)) else [recordings]
    paths: list[Any] = [one._path if isinstance(one, Recording) else one for one in many]
    asked = Asked(
        profile=profile,
        smooth=smooth,
        magnetometer=magnetometer,
        calibrate_first_s=calibrate_first,
        settings=settings(parameters or {}),
    )
    names = [name for name in map(named, estimators) if name is not None]
    return [json.loads(text) for text in _northing.compare(paths, names, asked, Reading())]


def tune(
    recording: Recording,
    estimator: str | None = None,
    *,
    profile: str | None = None,
    parameters: Sequence[str] = (),
    fit: float = 0.6,
) -> dict[str, Any]:
    """Noise parameters of an estimator by the likelihood of its innovations, as ``northing tune``.

    ``estimator`` is one of attitude or navigation (default: error-state where there are fixes, otherwise that of the
    profile), ``parameters`` are the names to fit (default: every noise that makes a difference), ``fit`` the share of the
    recording that the fit sees; the rest is held out.
    """
    outcome: dict[str, Any] = json.loads(
        _northing.tune(recording._file, estimator, profile, list(parameters), fit)
    )
    return outcome
