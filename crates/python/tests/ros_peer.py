"""A peer of the node: Eclipse Cyclone DDS, which knows nothing of Northing, with the messages of ROS 2 that it speaks."""

import math
import pathlib
import signal
import subprocess
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, byte, float64, int8, int32, int64, sequence, uint8, uint16, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Imu(IdlStruct, typename="sensor_msgs::msg::dds_::Imu_"):
    header: Header
    orientation: Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: array[float64, 9]


@dataclass
class MagneticField(IdlStruct, typename="sensor_msgs::msg::dds_::MagneticField_"):
    header: Header
    magnetic_field: Vector3
    magnetic_field_covariance: array[float64, 9]


@dataclass
class NavSatStatus(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatStatus_"):
    status: int8
    service: uint16


@dataclass
class NavSatFix(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatFix_"):
    header: Header
    status: NavSatStatus
    latitude: float64
    longitude: float64
    altitude: float64
    position_covariance: array[float64, 9]
    position_covariance_type: uint8


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped]


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    level: byte
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]


@dataclass
class FluidPressure(IdlStruct, typename="sensor_msgs::msg::dds_::FluidPressure_"):
    header: Header
    fluid_pressure: float64
    variance: float64


@dataclass
class ParameterValue(IdlStruct, typename="rcl_interfaces::msg::dds_::ParameterValue_"):
    type: uint8
    bool_value: bool
    integer_value: int64
    double_value: float64
    string_value: str
    byte_array_value: sequence[uint8]
    bool_array_value: sequence[bool]
    integer_array_value: sequence[int64]
    double_array_value: sequence[float64]
    string_array_value: sequence[str]


@dataclass
class Parameter(IdlStruct, typename="rcl_interfaces::msg::dds_::Parameter_"):
    name: str
    value: ParameterValue


@dataclass
class SetParameters(IdlStruct, typename="rcl_interfaces::srv::dds_::SetParameters_Request_"):
    parameters: sequence[Parameter]


@dataclass
class SetParametersResult(IdlStruct, typename="rcl_interfaces::msg::dds_::SetParametersResult_"):
    successful: bool
    reason: str


@dataclass
class SetParametersReply(IdlStruct, typename="rcl_interfaces::srv::dds_::SetParameters_Response_"):
    results: sequence[SetParametersResult]


@dataclass
class GetParameters(IdlStruct, typename="rcl_interfaces::srv::dds_::GetParameters_Request_"):
    names: sequence[str]


@dataclass
class GetParametersReply(IdlStruct, typename="rcl_interfaces::srv::dds_::GetParameters_Response_"):
    values: sequence[ParameterValue]


def header(time_ns, frame):
    return Header(Time(time_ns // 10**9, time_ns % 10**9), frame)


def stamp(one):
    """Of a message in ns; of a TFMessage that of its first transform."""
    one = one.transforms[0] if hasattr(one, "transforms") else one
    return one.header.stamp.sec * 10**9 + one.header.stamp.nanosec


UNKNOWN = [0.0] * 9
NO_ORIENTATION = [-1.0] + [0.0] * 8


def imu(time_ns, rate, force, frame="imu_link"):
    return Imu(
        header(time_ns, frame),
        Quaternion(0.0, 0.0, 0.0, 1.0),
        NO_ORIENTATION,
        Vector3(*rate),
        UNKNOWN,
        Vector3(*force),
        UNKNOWN,
    )


def fix(time_ns, latitude, longitude, height, std=0.5):
    variances = [std * std, 0.0, 0.0, 0.0, std * std, 0.0, 0.0, 0.0, 4 * std * std]
    return NavSatFix(header(time_ns, "gps"), NavSatStatus(0, 1), latitude, longitude, height, variances, 2)


RELIABLE = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1000))
LATCHED = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal, Policy.History.KeepLast(10)
)
BEST_EFFORT = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1000))


def transform(parent, child, way, turned):
    """A static transform; `turned` is x, y, z, w."""
    return TransformStamped(header(0, parent), child, Transform(Vector3(*way), Quaternion(*turned)))


def number(value):
    """The value of a parameter that is a number."""
    return ParameterValue(3, False, 0, value, "", [], [], [], [], [])


class Peer:
    """Writes and reads topics of one domain, in a namespace."""

    def __init__(self, domain, namespace=""):
        self.participant = DomainParticipant(domain)
        self.namespace = namespace
        self.services = {}
        self.writers = []
        self.readers = []

    def _topic(self, name, kind, qos):
        full = name if name.startswith("/") else f"{self.namespace}/{name}"
        return Topic(self.participant, f"rt{full}", kind, qos=qos)

    def call(self, service, request, reply_kind, seconds=10.0):
        """Calls a service of a node and waits for its reply. The number of the call is in no field, so there is one at a time."""
        if service not in self.services:
            ends = [("rq", "Request", type(request)), ("rr", "Reply", reply_kind)]
            asks, answers = (Topic(self.participant, f"{way}{service}{end}", kind, qos=RELIABLE) for way, end, kind in ends)
            self.services[service] = DataWriter(self.participant, asks, qos=RELIABLE), DataReader(self.participant, answers, qos=RELIABLE)
        writer, reader = self.services[service]
        until = time.monotonic() + seconds
        while not (writer.get_matched_subscriptions() and reader.get_matched_publications()):
            assert time.monotonic() < until, f"no service {service}"
            time.sleep(0.02)
        # Each side finds the other's ends for itself: a node that has not found our reader yet answers nobody, so it is asked again.
        reader.take(100)
        asked = 0.0
        while time.monotonic() < until:
            if time.monotonic() - asked > 2.0:
                writer.write(request)
                asked = time.monotonic()
            for reply in reader.take(1):
                return reply
            time.sleep(0.005)
        raise AssertionError(f"{service} does not answer")

    def writer(self, name, kind, qos=RELIABLE):
        self.writers.append(DataWriter(self.participant, self._topic(name, kind, qos), qos=qos))
        return self.writers[-1]

    def reader(self, name, kind, qos=RELIABLE):
        self.readers.append(DataReader(self.participant, self._topic(name, kind, qos), qos=qos))
        return self.readers[-1]

    def is_matched(self):
        """Whether each writer has a subscription and each reader a publication."""
        return all(writer.get_matched_subscriptions() for writer in self.writers) and all(
            reader.get_matched_publications() for reader in self.readers
        )


def matched(node, peer, seconds=15.0):
    """Waits until a peer and a node have found each other: what is sent before is lost.

    Of the peer's ends each is asked. The node finds the peer's by itself, and cannot be asked: that wait is by the clock.
    """
    until = time.monotonic() + seconds
    while not peer.is_matched():
        assert node.process.poll() is None, node.process.communicate()
        assert time.monotonic() < until, "nobody listens, or nobody writes"
        time.sleep(0.02)
    time.sleep(0.5)


class Node:
    """A running node; its text is known when it has ended."""

    def __init__(self, program, *arguments):
        command = [str(program), "ros", *map(str, arguments)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def stop(self):
        """Ends it as Ctrl-C does; what it printed."""
        self.process.send_signal(signal.SIGINT)
        out, errors = self.process.communicate(timeout=20)
        assert self.process.returncode == 0, (self.process.returncode, out, errors)
        return out

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()


def recording(path: pathlib.Path):
    """The rows of a CSV recording as time in ns and numbers by column."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    for line in lines[1:]:
        row = dict(zip(names, line.split(",")))
        seconds, _, fraction = row["t_s"].partition(".")
        time_ns = int(seconds) * 10**9 + int(fraction.ljust(9, "0")[:9] or 0)
        yield time_ns, {name: float(cell) for name, cell in row.items() if cell and name != "t_s"}


def is_unit(q):
    return math.isclose(q.w**2 + q.x**2 + q.y**2 + q.z**2, 1.0, abs_tol=1e-12)
