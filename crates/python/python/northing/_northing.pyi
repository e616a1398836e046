"""The compiled part of the module; what people call is in the Python files beside it."""

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, Protocol, final

import numpy as np
import numpy.typing as npt
from typing_extensions import Self

from ._types import Floats, Innovations, Integers

__version__: str

class _Reading(Protocol):
    @property
    def gap_limit_s(self) -> float: ...

class _Asked(Protocol):
    @property
    def settings(self) -> Sequence[str]: ...

class _AskedNavigation(Protocol):
    @property
    def gnss_every(self) -> int | None: ...

class _Measured(Protocol):
    @property
    def fixes(self) -> tuple[Integers, Floats]: ...

class _AskedScenario(Protocol):
    @property
    def scenario(self) -> str | PathLike[str]: ...

def attitude(
    gyroscope: tuple[Integers, Floats],
    accelerometer: tuple[Integers, Floats] | None,
    magnetometer: tuple[Integers, Floats] | None,
    frame: str,
    asked: _Asked,
    reading: _Reading,
) -> AttitudeRun: ...
def compare(
    paths: Sequence[str | PathLike[str]], estimators: Sequence[str], asked: _Asked, reading: _Reading
) -> list[str]: ...
def navigation(
    measured: _Measured,
    estimator: str,
    smooth: bool,
    settings: Sequence[str],
    asked: _AskedNavigation,
    reading: _Reading,
) -> NavigationRun: ...
def estimators() -> str: ...
def calibrate_rest(file: RecordingFile, which: str | None, start: float | None, stop: float | None) -> str: ...
def calibrate_magnetometer(
    file: RecordingFile, which: str | None, field_strength_ut: float | None, start: float | None, stop: float | None
) -> str: ...
def calibrate_allan(file: RecordingFile, sensor: str, start: float | None, stop: float | None) -> str: ...
def tune(
    file: RecordingFile, estimator: str | None, profile: str | None, parameters: Sequence[str], fitted_share: float
) -> str: ...
def arrow_stream(columns: Mapping[str, Any]) -> object: ...
def simulate(asked: _AskedScenario, run: int) -> tuple[str, dict[str, Floats]]: ...
def montecarlo(asked: _AskedScenario, runs: int | None, shard: str | None, threads: int | None) -> Part: ...
def register_class(name: str, make: Callable[[], Any]) -> None: ...
def register_file(text: str, python: str) -> None: ...
def in_words_of_the_module(sentence: str) -> str: ...

@final
class AttitudeRun:
    time_ns: Integers
    quat: Floats
    covariance: Floats
    gyro_bias: Floats
    gyro_bias_covariance: Floats
    position: Floats
    velocity: Floats
    innovations: dict[str, Innovations]
    def summary_json(self) -> str: ...
    def report_html(self, command: str) -> str: ...
    def report(self, path: str | PathLike[str], command: str, force: bool) -> None: ...
    def save(self, path: str | PathLike[str], force: bool) -> None: ...
    def __len__(self) -> int: ...

@final
class NavigationRun:
    time_ns: Integers
    geodetic: Floats
    ned: Floats
    covariance: Floats
    velocity: Floats
    quat: Floats
    heading: Floats
    validity: list[str]
    innovations: dict[str, Innovations]
    def summary_json(self) -> str: ...
    def report(self, path: str | PathLike[str], command: str, force: bool) -> None: ...
    def save(self, path: str | PathLike[str], force: bool) -> None: ...

@final
class Part:
    @property
    def runs(self) -> tuple[int, int]: ...
    def summary_json(self) -> str: ...
    def merged(self, others: Sequence[Part]) -> Part: ...
    def save(self, path: str | PathLike[str], force: bool) -> None: ...
    @staticmethod
    def load(path: str | PathLike[str]) -> Part: ...
    def report(self, path: str | PathLike[str], force: bool) -> None: ...

@final
class VirtualRecording:
    @staticmethod
    def phone(seed: int, duration: float | None, motion: str, disturbance: str) -> VirtualRecording: ...
    @staticmethod
    def vehicle(kind: str, seed: int, duration: float | None, faults: bool) -> VirtualRecording: ...
    @property
    def description(self) -> str: ...
    @property
    def frame(self) -> str: ...
    def arrays(self) -> dict[str, Any]: ...
    def save(self, path: str | PathLike[str], force: bool) -> None: ...

@final
class RecordingFile:
    name: str
    format: str
    frame: str
    sensors: list[str]
    def __new__(cls, path: str | PathLike[str], reading: _Reading) -> Self: ...
    def estimator_for(self, asked: str | None) -> tuple[str, str | None]: ...
    def arrays(self, sensor: str) -> tuple[tuple[Integers, Floats, list[str]], list[str]]: ...
    def run_attitude(self, asked: _Asked) -> AttitudeRun: ...
    def run_navigation(
        self, estimator: str, smooth: bool, settings: Sequence[str], asked: _AskedNavigation
    ) -> NavigationRun: ...

class _Config:
    """Parameters by name; `dir(config)` lists them, `northing.estimators()` says what they mean."""

    def __new__(cls, profile: str = ..., **changes: Any) -> Self: ...
    def to_dict(self) -> dict[str, Any]: ...
    def __getattr__(self, name: str) -> Any: ...
    def __setattr__(self, name: str, value: Any) -> None: ...

@final
class BoundedVelocityConfig(_Config):
    @staticmethod
    def hand_held(**changes: Any) -> BoundedVelocityConfig: ...
    @staticmethod
    def lab(**changes: Any) -> BoundedVelocityConfig: ...

@final
class AttitudeConfig(_Config):
    @staticmethod
    def hand_held(**changes: Any) -> AttitudeConfig: ...
    @staticmethod
    def lab(**changes: Any) -> AttitudeConfig: ...

@final
class GnssInsConfig(_Config):
    def __new__(cls, profile: str = ..., **changes: Any) -> Self: ...
    @staticmethod
    def default(**changes: Any) -> GnssInsConfig: ...

_Vector = Sequence[float] | npt.NDArray[np.float64] | npt.NDArray[np.float32]

@final
class Innovation:
    """What one measurement told a filter: residual, its covariance S, NIS, and what was done with it."""

    @property
    def residual(self) -> Floats: ...
    @property
    def covariance(self) -> Floats: ...
    @property
    def nis(self) -> float: ...
    @property
    def degrees_of_freedom(self) -> int: ...
    @property
    def outcome(self) -> str: ...
    @property
    def reason(self) -> str | None: ...

class _Stream:
    def gyroscope(self, time_ns: int, angular_rate: _Vector) -> str | None: ...
    def accelerometer(self, time_ns: int, specific_force: _Vector) -> Innovation: ...
    def magnetometer(self, time_ns: int, magnetic_field: _Vector) -> Innovation: ...
    def compass(self, time_ns: int, heading: float, std: float) -> Innovation: ...
    @property
    def is_started(self) -> bool: ...
    @property
    def quat(self) -> Floats | None: ...
    @property
    def covariance(self) -> Floats | None: ...
    @property
    def gyro_bias(self) -> Floats | None: ...
    state: str

@final
class BoundedVelocity(_Stream):
    def __new__(
        cls, config: BoundedVelocityConfig | None = None, *, alignment_s: float = 0.5, gap_limit_s: float = 0.5
    ) -> Self: ...
    @property
    def config(self) -> BoundedVelocityConfig: ...

@final
class Mekf(_Stream):
    def __new__(
        cls, config: AttitudeConfig | None = None, *, alignment_s: float = 0.5, gap_limit_s: float = 0.5
    ) -> Self: ...
    @property
    def config(self) -> AttitudeConfig: ...

@final
class GnssIns:
    """GNSS/INS, sample by sample: position, velocity and attitude from an inertial unit and a receiver.

    Body axes are forward, right, down, the world is north, east, down; stamps are integer nanoseconds of one clock, in order.
    The first fix is the origin; the frame moves along with the vehicle, unless a tracker follows it. Every measurement returns
    its innovation; what is not finite changes nothing.
    """

    def __new__(cls, config: GnssInsConfig | None = None) -> Self: ...
    def imu(self, time_ns: int, angular_rate: _Vector, specific_force: _Vector) -> str | None:
        """Takes rad/s and m/s^2 of one stamp; why they were skipped, if they were."""
    def gnss_position(
        self,
        time_ns: int,
        latitude_deg: float,
        longitude_deg: float,
        height_m: float | None = None,
        *,
        std: float | _Vector,
    ) -> tuple[Innovation, Innovation]:
        """Takes a fix with its standard deviations north, east, down, m: what it told horizontally and vertically."""
    def gnss_velocity(self, time_ns: int, ned: _Vector, *, std: float | _Vector) -> Innovation:
        """Takes a velocity over ground, m/s; down may be NaN."""
    def heading(self, time_ns: int, heading: float, *, std: float) -> Innovation:
        """Takes a true heading of the forward axis, rad clockwise from north."""
    def magnetometer(self, time_ns: int, magnetic_field: _Vector) -> Innovation:
        """Takes a magnetic field, microtesla; its heading is used."""
    def barometer(self, time_ns: int, pressure: float) -> Innovation:
        """Takes a static pressure, Pa."""
    def speed(self, time_ns: int, forward: float, *, std: float) -> Innovation:
        """Takes a speed along the forward axis, m/s, negative backwards."""
    @property
    def validity(self) -> str:
        """The solution status: aligning, heading-unknown, aided, dead-reckoning or invalid."""
    @property
    def time_ns(self) -> int | None: ...
    @property
    def geodetic(self) -> Floats | None:
        """Latitude and longitude of the antenna, deg, and its height above the ellipsoid, m."""
    @property
    def ned(self) -> Floats | None:
        """Position of the antenna, m north, east, down of the first fix."""
    @property
    def position_covariance(self) -> Floats | None:
        """Covariance of that, m^2: (3, 3)."""
    @property
    def velocity(self) -> Floats | None:
        """Velocity of the antenna, m/s north, east, down."""
    @property
    def quat(self) -> Floats | None:
        """Attitude, body to north-east-down, w, x, y, z."""
    @property
    def gyro_bias(self) -> Floats | None: ...
    @property
    def accelerometer_bias(self) -> Floats | None: ...
    @property
    def covariance(self) -> Floats | None:
        """Covariance of the errors of attitude, velocity, position, accelerometer bias and gyroscope bias: (15, 15)."""
    @property
    def config(self) -> GnssInsConfig: ...
    state: str

@final
class OwnShip:
    """Pose of the own ship: north and east (m), heading (rad, clockwise from north), with standard deviations or covariance."""

    def __new__(
        cls,
        north: float,
        east: float,
        heading: float,
        *,
        std: _Vector | None = None,
        covariance: Sequence[_Vector] | Floats | None = None,
    ) -> Self: ...
    @property
    def pose(self) -> Floats: ...
    @property
    def covariance(self) -> Floats: ...

@final
class SchmidtKalman:
    """One target seen by radar from a ship whose own pose is uncertain; starts from its first detection.

    ``own`` is an :class:`OwnShip`, of which each scan then needs one of its own, or a :class:`GnssIns`, whose errors the tracker
    follows from now on. Range in m, bearing in rad clockwise from the bow. ``acceleration_std`` (m/s^2) is that of the target's
    acceleration, held from one instant to the next: steps of other lengths are other models.
    """

    def __new__(
        cls,
        time_ns: int,
        range: float,
        bearing: float,
        own: OwnShip | GnssIns,
        *,
        range_std: float,
        bearing_std: float,
        acceleration_std: float,
        velocity_std: float,
        gate_nis: float = 0.0,
        coupling: str = "exact",
        position_correlation_s: float = 300.0,
        heading_correlation_s: float = 1e4,
    ) -> Self: ...
    def scan(self, time_ns: int, range: float, bearing: float, own: OwnShip | None = None) -> Innovation:
        """Takes a detection: moves the target on to its stamp and fuses. A GnssIns must have come to that stamp."""
    def move_on(self, time_ns: int) -> str | None:
        """Moves the target on to a stamp at which nothing was seen; why not, if so."""
    @property
    def time_ns(self) -> int: ...
    @property
    def track(self) -> Floats:
        """North (m), its rate (m/s), east (m), its rate (m/s)."""
    @property
    def covariance(self) -> Floats:
        """Its covariance: (4, 4)."""
    @property
    def std(self) -> Floats: ...
    @property
    def cross_covariance(self) -> Floats:
        """Covariance of the own ship's errors (rows) with the track (columns)."""
    def ellipse(self, probability: float = 0.95) -> tuple[float, float, float]:
        """Semi-axes (m) of the ellipse that holds the target with this probability, and the direction of the longer, rad from north."""

@final
class ScanSensor:
    """What a sensor of :class:`MultiTarget` is like, as the manifest of a tracking recording states it, in m, rad and s.

    ``detections`` is what a row of its detections is: ``range-bearing`` (m, rad clockwise from the bow), ``bearing``, ``relative``
    (north and east of the own ship, m), ``placed`` (north and east, m, placed with the own ship's pose) or ``reported`` (north and
    east that a target says of itself, as AIS). ``extent_std`` is the echo's place on a target, or the error of a reported position;
    ``clutter_per_km2`` (``clutter_per_rad`` of bearings alone) are the false detections of a scan. ``covers_all=False``: what it
    does not report was not missed. Of a sensor that starts tracks (``initiates``) the tracker wants to know ``scan_interval``, from
    one look at a target to the next, and ``largest_range``, beyond which it detects nothing, or ``typical_range``, within which
    nearly all of its detections lie.
    """

    def __new__(
        cls,
        *,
        detection_probability: float,
        clutter_per_km2: float | None = None,
        clutter_per_rad: float | None = None,
        range_std: float = 0.0,
        bearing_std: float = 0.0,
        extent_std: float = 0.0,
        largest_range: float | None = None,
        typical_range: float | None = None,
        scan_interval: float | None = None,
        covers_all: bool = True,
        initiates: bool = True,
        detections: str = "range-bearing",
    ) -> Self: ...

@final
class TargetTrack:
    """A track after a scan: estimate, existence, and what the last scan of those that were used was to it."""

    @property
    def id(self) -> int:
        """Its number, never used twice by one tracker."""
    @property
    def status(self) -> str:
        """``tentative`` or ``confirmed``."""
    @property
    def state(self) -> Floats:
        """North (m), its rate (m/s), east (m), its rate (m/s), turn rate (rad/s, clockwise)."""
    @property
    def covariance(self) -> Floats:
        """Its covariance: (5, 5)."""
    @property
    def std(self) -> Floats: ...
    @property
    def existence(self) -> float:
        """Probability that there is a target."""
    @property
    def reported(self) -> bool:
        """Whether it is told as a target: confirmed, and its target is there more likely than not (`report_existence`)."""
    @property
    def visibility(self) -> float:
        """Probability that the sensor can see it, if there is one."""
    @property
    def models(self) -> Floats:
        """Probabilities of the motion models: straight, turning, manoeuvring."""
    @property
    def age_s(self) -> float: ...
    @property
    def silent_s(self) -> float:
        """Seconds since a detection probably came from it."""
    @property
    def detections_in_gate(self) -> int: ...
    @property
    def detection(self) -> int | None:
        """Row of the detection that it most likely caused, of those in its gate."""
    @property
    def detection_probability(self) -> float | None:
        """Probability that it caused that one."""
    @property
    def missed_probability(self) -> float:
        """Probability that it caused none."""
    @property
    def innovation(self) -> Innovation:
        """Of the likeliest detection under the likeliest motion model."""

@final
class EndedTrack:
    """A track that ended in a scan."""

    @property
    def id(self) -> int: ...
    @property
    def status(self) -> str: ...
    @property
    def reason(self) -> str:
        """``existence``, ``position-std``, ``numerical`` or ``merged-into-`` and the number of the track that stays."""

@final
class ScanRecord:
    """What one scan told the tracker."""

    @property
    def time_ns(self) -> int: ...
    @property
    def sensor(self) -> str: ...
    @property
    def reason(self) -> str | None:
        """Why the scan was refused, and the tracks are as before; None: it was used."""
    @property
    def tracks(self) -> list[TargetTrack]:
        """Every track after it, tentative ones too."""
    @property
    def confirmed(self) -> list[TargetTrack]: ...
    @property
    def reported(self) -> list[TargetTrack]:
        """The confirmed ones whose targets are there more likely than not; the others are kept in case they are seen again."""
    @property
    def ended(self) -> list[EndedTrack]:
        """The tracks that ended in it, tentative ones too."""

@final
class MultiTarget:
    """Many targets in clutter (JIPDA, IMM), seen from a ship whose own pose is uncertain: the tracker of ``northing track``, scan by scan.

    ``sensors`` is a :class:`ScanSensor`, or several by name. Settings follow from them as there; every further argument is a
    parameter by its name (``northing estimators schmidt`` lists them; ``existence_lifetime_s`` is ``existence.lifetime_s``).
    ``tracker`` is ``schmidt`` (the own pose's correlation with each target is carried along), ``converted`` or ``uncompensated``.
    Seconds count from ``start_ns``, or from the first scan.
    """

    def __new__(
        cls,
        sensors: ScanSensor | Mapping[str, ScanSensor],
        *,
        tracker: str = "schmidt",
        start_ns: int | None = None,
        **parameters: float,
    ) -> Self: ...
    def update(
        self, time_ns: int, detections: npt.ArrayLike | None, own: OwnShip, *, sensor: str | None = None
    ) -> ScanRecord:
        """Takes everything that one sensor reports at one instant, a row a detection, as seen from this pose; None or no rows: nothing."""
    @property
    def tracks(self) -> list[TargetTrack]:
        """Every track after the last scan that was used, tentative ones too."""
    @property
    def time_ns(self) -> int | None:
        """Stamp of that scan."""
    @property
    def sensors(self) -> dict[str, ScanSensor]: ...
    @property
    def tracker(self) -> str: ...
    @property
    def parameters(self) -> dict[str, float]:
        """Every parameter with its value, those that followed from the sensors too."""
    @property
    def counts(self) -> dict[str, int]:
        """What was used and what was refused so far."""
    state: str
