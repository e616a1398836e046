"""What runs give: arrays, verdicts and the summary that the program prints; tables, plots, reports and files."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ._asked import Path
from ._northing import AttitudeRun, NavigationRun, in_words_of_the_module
from ._tables import Table
from ._types import Floats, Innovations, Integers

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Verdict:
    """Whether the stated noise of a sensor is consistent with its innovations."""

    sensor: str
    verdict: str
    # By how much the variance of the residuals differs from what was stated; None with too few samples.
    variance_factor: float | None
    confidence: float
    sentences: list[str]

    def __str__(self) -> str:
        return f"{self.sensor}: {self.verdict}. " + " ".join(self.sentences)


def _frozen(array: Any) -> Any:
    """A result says what the run said: it cannot be changed by accident."""
    array.flags.writeable = False
    return array


class _Run(Table):
    """What attitude and navigation runs share."""

    _run: AttitudeRun | NavigationRun
    _command: str

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The object that `northing run --json` prints."""
        summary: dict[str, Any] = json.loads(self._run.summary_json())
        return summary

    @property
    def estimator(self) -> str:
        """The estimator that ran."""
        return str(self.summary["estimator"])

    @property
    def parameters(self) -> dict[str, Any]:
        """Every parameter of the estimator as it ran."""
        return {used["name"]: used["value"] for used in self.summary["parameters"]}

    @property
    def notes(self) -> list[str]:
        """What was odd, and what is undefined, one sentence each."""
        return [in_words_of_the_module(sentence) for sentence in self.summary["issues"]]

    @cached_property
    def time_ns(self) -> Integers:
        """Stamps, ns."""
        return _frozen(self._run.time_ns)  # type: ignore[no-any-return]

    @cached_property
    def t(self) -> Floats:
        """Stamps, s."""
        return _frozen(self.time_ns * 1e-9)  # type: ignore[no-any-return]

    @cached_property
    def innovations(self) -> dict[str, Innovations]:
        """What each sensor's measurements told: a row a measurement."""
        return dict(self._run.innovations)

    @property
    def nis(self) -> dict[str, Floats]:
        """Normalised innovation squared of each sensor's measurements, NaN where one was skipped."""
        return {sensor: told["nis"] for sensor, told in self.innovations.items()}

    def save(self, path: Path, force: bool = False) -> None:
        """Writes the estimates as the program does, by extension; an existing file only with `force`."""
        self._run.save(path, force)

    def report(self, path: Path, force: bool = False) -> None:
        """Writes the program's report: one HTML file with plots."""
        self._run.report(path, self._command, force)


class Attitude(_Run):
    """An attitude run: the estimate at every sample of the gyroscope, NaN where there is none."""

    _run: AttitudeRun

    def __init__(self, run: AttitudeRun, command: str) -> None:
        self._run = run
        self._command = command

    @cached_property
    def quat(self) -> Floats:
        """Attitude, body to world, w, x, y, z: (N, 4)."""
        return _frozen(self._run.quat)  # type: ignore[no-any-return]

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of its local error in body axes, rad^2: (N, 3, 3)."""
        return _frozen(self._run.covariance)  # type: ignore[no-any-return]

    @cached_property
    def std(self) -> Floats:
        """Standard deviations about the body axes, rad: (N, 3)."""
        variances = np.diagonal(self.covariance, axis1=1, axis2=2)
        std: Floats = np.sqrt(np.maximum(variances, 0.0))
        return std

    @cached_property
    def gyro_bias(self) -> Floats:
        """Gyroscope bias, rad/s: (N, 3); NaN of estimators that do not estimate it."""
        return _frozen(self._run.gyro_bias)  # type: ignore[no-any-return]

    @cached_property
    def gyro_bias_covariance(self) -> Floats:
        """Its covariance, (rad/s)^2: (N, 3, 3)."""
        return _frozen(self._run.gyro_bias_covariance)  # type: ignore[no-any-return]

    @cached_property
    def position(self) -> Floats:
        """Position in the world frame, m: (N, 3); NaN of estimators without positions."""
        return _frozen(self._run.position)  # type: ignore[no-any-return]

    @cached_property
    def velocity(self) -> Floats:
        """Velocity in the world frame, m/s: (N, 3)."""
        return _frozen(self._run.velocity)  # type: ignore[no-any-return]

    @cached_property
    def yaw_pitch_roll(self) -> Floats:
        """The same attitude as angles, rad: (N, 3)."""
        w, x, y, z = self.quat.T
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
        roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        return np.stack([yaw, pitch, roll], axis=1)

    @property
    def verdicts(self) -> list[Verdict]:
        """Whether each sensor's stated noise is consistent, in words."""
        names = Verdict.__dataclass_fields__
        return [Verdict(**{name: one[name] for name in names}) for one in self.summary["verdicts"]]

    @property
    def findings(self) -> list[str]:
        """What is wrong, the first to act on first, a sentence or two each; empty where nothing is."""
        return [in_words_of_the_module(finding["sentence"]) for finding in self.summary["findings"]]

    @property
    def undefined(self) -> int:
        """Rows without an estimate."""
        return int(np.isnan(self.quat[:, 0]).sum())

    @property
    def notes(self) -> list[str]:
        """What was odd, and what is undefined, one sentence each."""
        notes = super().notes
        without = np.isnan(self.quat[:, 0])
        if without.any():
            first = int(np.argmin(without)) if not without.all() else len(without)
            later = int(without[first:].sum())
            if first:
                notes.append(f"Rows 0 to {first - 1} have no estimate and are NaN: the filter aligns itself first.")
            if later:
                notes.append(f"{later} later rows have no estimate and are NaN: their samples were left out.")
        return notes

    def to_dict(self) -> dict[str, Any]:
        """The estimates as columns with the unit in every name."""
        columns: dict[str, Any] = {"t_s": self.t}
        columns.update(zip(("qw", "qx", "qy", "qz"), self.quat.T))
        for i, axis in enumerate("xyz"):
            columns[f"attitude_std_{axis}_rad"] = self.std[:, i]
        for i, axis in enumerate("xyz"):
            columns[f"gyro_bias_{axis}_rad_s"] = self.gyro_bias[:, i]
        for (i, j), axes in zip(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)), ("xx", "xy", "xz", "yy", "yz", "zz")):
            columns[f"attitude_cov_{axes}_rad2"] = self.covariance[:, i, j]
        return columns

    def plot(self) -> Figure:
        """Angles, standard deviations and NIS over time; needs matplotlib."""
        from matplotlib import pyplot

        figure, (angles, stds, nis) = pyplot.subplots(3, 1, sharex=True, figsize=(9, 7), layout="constrained")
        t = self.t - self.t[0]
        for i, name in enumerate(("yaw", "pitch", "roll")):
            angles.plot(t, np.degrees(self.yaw_pitch_roll[:, i]), label=name, linewidth=0.9)
        for i, axis in enumerate("xyz"):
            stds.plot(t, np.degrees(self.std[:, i]), label=f"about {axis}", linewidth=0.9)
        for sensor, told in self.innovations.items():
            nis.plot(told["time_ns"] * 1e-9 - self.t[0], told["nis"], ".", markersize=1.5, label=sensor)
        angles.set(ylabel="deg", title=f"{self.estimator}: attitude")
        stds.set(ylabel="deg", yscale="log", title="standard deviation, body axes")
        nis.set(xlabel="s", yscale="log", title="NIS; 3 is consistent of a vector")
        for axes in (angles, stds, nis):
            if axes.get_legend_handles_labels()[0]:
                axes.legend(loc="upper right", fontsize="small")
        return figure

    def __len__(self) -> int:
        return len(self._run)

    def __repr__(self) -> str:
        verdicts = ", ".join(f"{v.sensor} {v.verdict}" for v in self.verdicts)
        rows = f"{len(self)} rows, {self.undefined} without an estimate"
        return f"<attitude by {self.estimator}: {rows}; {verdicts or 'no verdicts'}>"


class Track(_Run):
    """A navigation run: position, velocity and attitude at every inertial sample once they are known."""

    _run: NavigationRun

    def __init__(self, run: NavigationRun, command: str) -> None:
        self._run = run
        self._command = command

    @cached_property
    def geodetic(self) -> Floats:
        """Latitude and longitude, deg, and height above the ellipsoid, m: (N, 3)."""
        return _frozen(self._run.geodetic)  # type: ignore[no-any-return]

    @cached_property
    def ned(self) -> Floats:
        """Position north, east and down of the first fix, m: (N, 3)."""
        return _frozen(self._run.ned)  # type: ignore[no-any-return]

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of the position, m^2: (N, 3, 3)."""
        return _frozen(self._run.covariance)  # type: ignore[no-any-return]

    @cached_property
    def velocity(self) -> Floats:
        """Velocity north, east and down, m/s: (N, 3)."""
        return _frozen(self._run.velocity)  # type: ignore[no-any-return]

    @cached_property
    def quat(self) -> Floats:
        """Attitude, body to north-east-down, w, x, y, z: (N, 4)."""
        return _frozen(self._run.quat)  # type: ignore[no-any-return]

    @cached_property
    def heading(self) -> Floats:
        """Heading from true north and its standard deviation, rad: (N, 2)."""
        return _frozen(self._run.heading)  # type: ignore[no-any-return]

    @cached_property
    def validity(self) -> list[str]:
        """The solution status of each row."""
        return self._run.validity

    @property
    def track(self) -> dict[str, Any]:
        """As :meth:`to_dict`."""
        return self.to_dict()

    def to_dict(self) -> dict[str, Any]:
        """The estimates as columns with the unit in every name."""
        columns: dict[str, Any] = {"t_s": self.t}
        columns.update(zip(("latitude_deg", "longitude_deg", "height_m"), self.geodetic.T))
        columns.update(zip(("north_m", "east_m", "down_m"), self.ned.T))
        variances = np.diagonal(self.covariance, axis1=1, axis2=2)
        columns.update(zip(("north_std_m", "east_std_m", "down_std_m"), np.sqrt(np.maximum(variances, 0.0)).T))
        columns.update(zip(("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s"), self.velocity.T))
        columns.update(zip(("qw", "qx", "qy", "qz"), self.quat.T))
        columns.update(zip(("heading_rad", "heading_std_rad"), self.heading.T))
        columns["validity"] = self.validity
        return columns

    def plot(self) -> Figure:
        """The track, east and north of the first fix; needs matplotlib."""
        from matplotlib import pyplot

        figure, axes = pyplot.subplots(figsize=(7, 7), layout="constrained")
        axes.plot(self.ned[:, 1], self.ned[:, 0], linewidth=1.0)
        axes.set(xlabel="east, m", ylabel="north, m", aspect="equal", title=f"{self.estimator}: track")
        return figure

    def __len__(self) -> int:
        return len(self.time_ns)

    def __repr__(self) -> str:
        return f"<track by {self.estimator}: {len(self)} rows>"
