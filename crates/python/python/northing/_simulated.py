"""Simulated data: tracking scenarios, campaigns of them, and recordings of virtual phones and vehicles."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from . import _northing
from ._asked import Path, whole
from ._recordings import Recording, open
from ._tables import Table
from ._types import Floats, Integers


@dataclass(frozen=True)
class _Asked:
    """Which scenario, and what of it."""

    scenario: Path
    variant: str | None = None
    seed: int | None = None
    navigation: str | None = None
    trackers: list[str] = field(default_factory=list)


def _seed(seed: int | None) -> int | None:
    return None if seed is None else whole("seed", seed)


class SimulatedRun(Table):
    """One run of a tracking scenario: truth, own navigation, detections and every tracker, a row a scan."""

    def __init__(self, summary: str, columns: dict[str, Floats]) -> None:
        self.summary: dict[str, Any] = json.loads(summary)
        self._columns = columns

    def to_dict(self) -> dict[str, Any]:
        """The columns with the unit in every name; NaN where nothing was seen or estimated."""
        return dict(self._columns)

    def __getitem__(self, column: str) -> Floats:
        return self._columns[column]

    def __len__(self) -> int:
        return len(self._columns["time_s"])

    def __repr__(self) -> str:
        said = self.summary
        return f"<run {said['run']} of {said['scenario']}, seed {said['seed']}: {len(self)} scans, {', '.join(said['trackers'])}>"


def simulate(
    scenario: Path = "wilthil-brekke",
    *,
    run: int = 0,
    variant: str | None = None,
    seed: int | None = None,
    navigation: str | None = None,
    trackers: Sequence[str] = (),
) -> SimulatedRun:
    """One run of a tracking scenario, as ``northing simulate``: that which a campaign with this seed has under this number.

    ``scenario`` is a file (.toml) or ``"wilthil-brekke"``, which comes with the module; ``navigation`` is ``error-state`` or
    ``gnss-ins``; ``trackers`` are names (default: those of the scenario, or all).
    """
    asked = _Asked(scenario, variant, _seed(seed), navigation, list(trackers))
    return SimulatedRun(*_northing.simulate(asked, whole("run", run)))


class Campaign:
    """Many runs of a tracking scenario as exact sums. Parts of one campaign merge to the last digit of the whole."""

    def __init__(self, part: _northing.Part) -> None:
        self._part = part

    @cached_property
    def summary(self) -> dict[str, Any]:
        """What ``northing montecarlo --json`` prints: RMSE, NEES and its band for each tracker, and their series over time."""
        summary: dict[str, Any] = json.loads(self._part.summary_json())
        return summary

    @property
    def runs(self) -> int:
        """Runs that it holds."""
        return self._part.runs[0]

    def merge(self, *others: Campaign) -> Campaign:
        """This and other parts of the same campaign as one."""
        return Campaign(self._part.merged([other._part for other in others]))

    def save(self, path: Path, force: bool = False) -> None:
        """Writes it as a part (.parquet), which :meth:`load` and ``northing montecarlo merge`` read."""
        self._part.save(path, force)

    @staticmethod
    def load(path: Path) -> Campaign:
        """Reads a part that was written here or by ``northing montecarlo --out``."""
        return Campaign(_northing.Part.load(path))

    def report(self, path: Path, force: bool = False) -> None:
        """Writes the program's report: one HTML file with plots."""
        self._part.report(path, force)

    def __repr__(self) -> str:
        held, all_runs = self._part.runs
        of_all = "" if held == all_runs else f" of {all_runs}"
        return f"<campaign {self.summary['scenario']}: {held}{of_all} runs, {', '.join(self.summary['trackers'])}>"


def montecarlo(
    scenario: Path = "wilthil-brekke",
    *,
    runs: int | None = None,
    shard: tuple[int, int] | str | None = None,
    variant: str | None = None,
    seed: int | None = None,
    navigation: str | None = None,
    trackers: Sequence[str] = (),
    threads: int | None = None,
) -> Campaign:
    """Many runs of a tracking scenario on all processors, as ``northing montecarlo``; ``shard=(3, 16)`` is the third of sixteen
    parts. The result depends on scenario, seed and number of runs alone, to the last digit, however it is split."""
    part = shard if shard is None or isinstance(shard, str) else f"{shard[0]}/{shard[1]}"
    asked = _Asked(scenario, variant, _seed(seed), navigation, list(trackers))
    counts = [None if count is None else whole(name, count) for name, count in (("runs", runs), ("threads", threads))]
    return Campaign(_northing.montecarlo(asked, counts[0], part, counts[1]))


class VirtualRecording(Mapping[str, "Floats | Integers"]):
    """A simulated recording: arrays by name, truth among them. ``print(recording.description)`` says what it is."""

    def __init__(self, made: _northing.VirtualRecording) -> None:
        self._made = made

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        return self._made.arrays()

    @property
    def description(self) -> str:
        """What was simulated, in words."""
        return self._made.description

    @property
    def frame(self) -> str:
        """Its world frame: ``enu`` or ``ned``."""
        return self._made.frame

    def __getitem__(self, name: str) -> Any:
        return self._arrays[name]

    def __iter__(self) -> Any:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def save(self, path: Path, force: bool = False) -> Recording:
        """Writes it as a recording (.csv, .parquet or .mcap), and opens that."""
        self._made.save(path, force)
        return open(path)

    def __repr__(self) -> str:
        return f"<virtual recording: {', '.join(self)}>"


def virtual_phone(
    *, seed: int = 1, duration: float | None = None, motion: str = "gentle", disturbance: str = "none"
) -> VirtualRecording:
    """A phone that lies, is turned about and carried, and its true attitude, as ``northing demo`` has it.

    Arrays: ``gyr`` (rad/s), ``acc`` (m/s^2), ``mag`` (microtesla), ``device_quat``, ``true_quat`` (w, x, y, z, body to
    east-north-up), and stamps of each, ``gyr_time_ns`` and so on. ``motion`` is gentle, brisk, tumble or rest,
    ``disturbance`` none, acceleration, magnetic or both.
    """
    return VirtualRecording(_northing.VirtualRecording.phone(whole("seed", seed), duration, motion, disturbance))


def virtual_vehicle(
    kind: str = "car-smooth", *, seed: int = 1, duration: float | None = None, faults: bool = False
) -> VirtualRecording:
    """A vehicle with an inertial unit and a GNSS receiver, and where it truly was.

    Arrays: ``gyr`` (rad/s) and ``acc`` (m/s^2), forward, right, down; ``gnss_geodetic`` (deg, deg, m), ``gnss_ned`` and
    ``gnss_std`` (m), of half the receivers ``gnss_velocity`` and ``gnss_velocity_std`` (m/s); ``true_ned``, ``true_velocity``,
    ``true_antenna_ned``, ``true_quat`` (body to north-east-down) at the stamps ``true_time_ns``, and stamps of each. ``kind``
    is car-smooth, car-rough, car-parking, car-phone, bicycle, drone-sideways, drone-hovering, ship or pedestrian. With
    ``faults`` it is a random world as it comes: outliers, outages, latency, a lever arm and more, that nobody tells the filter.
    """
    return VirtualRecording(_northing.VirtualRecording.vehicle(kind, whole("seed", seed), duration, faults))
