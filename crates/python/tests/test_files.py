"""Every kind of file that users of this field bring: it opens at once, opens by a guess, or is refused with the reason.

Files are made by the tools of their own worlds, or are recordings of NORTHING_DATA; layouts without such a tool are written
here as their documents say.
"""

from __future__ import annotations

import json
import math
import shutil
import struct
import subprocess
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gpxpy.gpx
import h5py
import numpy as np
import openpyxl
import pandas as pd
import polars as pl
import pytest
import scipy.io
import ximu3
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_typestore

from conftest import REPOSITORY, START_NS, Samples, data, program, run_program
from test_bags import Logged, write_bag_1, write_bag_2

# What becomes of a file; otherwise it is refused, and these are words of the refusal.
OPENS, DESCRIBED, REFERENCE = "opens at once", "opens after `describe`", "opens as `--reference`"
# What a run over it must show: the phone's attitude, its inclination where there is no field, a position of the car.
PHONE, LEVEL, CAR = "phone", "level", "car"


class World:
    """The recordings that files are made of."""

    def __init__(self, phone: dict[str, np.ndarray], drive: Samples, folder: Path) -> None:
        self.phone, self.drive, self.folder = phone, drive, folder

    def path(self, name: str) -> Path:
        return self.folder / name

    def columns(
        self, names: str, rate: float = 1.0, force: float = 1.0, field: float = 1.0, seconds: float = 1.0
    ) -> pd.DataFrame:
        """Time, angular rate, specific force and field of the phone under these names, in units of these factors."""
        arrays = [np.round(self.phone["t"] * seconds, 9), *(self.phone["gyr"] * rate).T, *(self.phone["acc"] * force).T, *(self.phone["mag"] * field).T]
        return pd.DataFrame(dict(zip(names.split(";"), arrays)))

    def written(self, name: str, text: str) -> Path:
        self.path(name).write_text(text)
        return self.path(name)

    def csv(self, name: str, names: str, **options: Any) -> Path:
        how = {key: options.pop(key) for key in ("rate", "force", "field", "seconds") if key in options}
        self.columns(names, **how).to_csv(self.path(name), index=options.pop("index", False), **options)
        return self.path(name)


OURS = "t_s;gyro_x_rad_s;gyro_y_rad_s;gyro_z_rad_s;acc_x_m_s2;acc_y_m_s2;acc_z_m_s2;mag_x_ut;mag_y_ut;mag_z_ut"
PLAIN = "time;gx;gy;gz;ax;ay;az;mx;my;mz"
DEGREES = 180.0 / math.pi
G = 1.0 / 9.80665


def parquet(compression: str) -> Callable[[World], Path]:
    def make(world: World) -> Path:
        table = world.columns(PLAIN.replace("time", "t"))
        columns = {name: table[name].to_numpy() for name in table}
        pl.DataFrame(columns).write_parquet(world.path("table.parquet"), compression=compression)
        return world.path("table.parquet")

    return make


def bag(storage: StoragePlugin, mode: CompressionMode, is_file: bool) -> Callable[[World], Path]:
    def make(world: World) -> Path:
        path = world.path("bag")
        write_bag_2(world.drive, path, storage, mode)
        return next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3")) if is_file else path

    return make


def lz4_chunks(world: World) -> Path:
    """The same file with its chunks packed by the library of the format."""
    plain = bag(StoragePlugin.MCAP, CompressionMode.NONE, True)(world)
    path = world.path("lz4.mcap")
    with plain.open("rb") as source, path.open("wb") as sink:
        writer = McapWriter(sink, compression=CompressionType.LZ4)
        writer.start("ros2")
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            assert schema is not None
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


def two_robots(world: World) -> Path:
    """Beside the car's sensors an Imu and a field of somebody else, and a pose of motion capture."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    path = world.path("robots")

    def more(logged: Iterator[Logged]) -> Iterator[Logged]:
        for topic, kind, log_ns, message in logged:
            yield topic, kind, log_ns, message
            if topic == "/fix":
                continue
            stamp = kinds["std_msgs/msg/Header"](message.header.stamp, "elsewhere")
            if topic == "/imu/mag":
                field = kinds["geometry_msgs/msg/Vector3"](9e-6, 9e-6, 9e-6)
                yield "/phone/mag", kind, log_ns, kinds[kind](stamp, field, message.magnetic_field_covariance)
            else:
                other = [getattr(message, name) for name in message.__dataclass_fields__ if name not in ("header", "__msgtype__")]
                yield "/phone/imu", kind, log_ns, kinds[kind](stamp, *other)
                pose = kinds["geometry_msgs/msg/Pose"](kinds["geometry_msgs/msg/Point"](0.0, 0.0, 0.0), message.orientation)
                kind = "geometry_msgs/msg/PoseStamped"
                yield "/optitrack/pose", kind, log_ns, kinds[kind](stamp, pose)

    write_bag_2(world.drive, path, StoragePlugin.MCAP, CompressionMode.NONE, more)
    return path


def phyphox_tables(world: World) -> dict[str, str]:
    names = {"Gyroscope.csv": ("gyr", "rad/s"), "Accelerometer.csv": ("acc", "m/s^2"), "Magnetometer.csv": ("mag", "µT")}
    tables = {}
    for file, (sensor, unit) in names.items():
        rows = np.column_stack([world.phone["t"], world.phone[sensor]])
        header = ",".join(['"Time (s)"', *(f'"{axis} ({unit})"' for axis in "XYZ")])
        tables[file] = header + "\n" + "\n".join(",".join(map(repr, map(float, row))) for row in rows) + "\n"
    return tables


def phyphox_zip(world: World) -> Path:
    with zipfile.ZipFile(world.path("phyphox.zip"), "w") as file:
        for name, text in phyphox_tables(world).items():
            file.writestr(name, text)
        file.writestr("meta/time.csv", '"event","experiment time","system time"\n"START",0,1.7e9\n')
    return world.path("phyphox.zip")


def phyphox_folder(world: World) -> Path:
    folder = world.path("phyphox")
    folder.mkdir()
    for name, text in phyphox_tables(world).items():
        (folder / name).write_text(text)
    return folder


def euroc(world: World) -> Path:
    folder = world.path("mav0/imu0")
    folder.mkdir(parents=True)
    times = (world.phone["t"] * 1e9).astype(np.int64) + 1_403_636_579_758_555_392
    rows = np.hstack([world.phone["gyr"], world.phone["acc"]])
    header = "#timestamp [ns]," + ",".join(f"w_RS_S_{a} [rad s^-1]" for a in "xyz")
    header += "," + ",".join(f"a_RS_S_{a} [m s^-2]" for a in "xyz")
    lines = [f"{t}," + ",".join(map(repr, map(float, row))) for t, row in zip(times, rows)]
    (folder / "data.csv").write_text("\n".join([header, *lines]) + "\n")
    return world.path("mav0")


def kitti(world: World) -> Path:
    folder = world.path("drive/oxts/data")
    folder.mkdir(parents=True)
    stamps = []
    for k in range(300):
        stamps.append(f"2011-09-26 13:02:{20 + k // 10 % 40:02d}.{k % 10 * 100_000_000:09d}")
        row = [49.0, 8.4, 116.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.81, 0.0, 0.0, 9.81]
        row += [0.0, 0.0, 0.01] * 2 + [0.5, 0.1, 4, 9, 4, 4, 0]
        (folder / f"{k:010d}.txt").write_text(" ".join(map(str, row)) + "\n")
    (folder.parent / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    return world.path("drive")


def tum(world: World) -> Path:
    rows = []
    for t, axes in list(zip(world.phone["t"], world.phone["axes"]))[::10]:
        w = math.sqrt(max(1.0 + axes[0, 0] + axes[1, 1] + axes[2, 2], 1e-12)) / 2.0
        x, y, z = ((axes[2, 1] - axes[1, 2]), (axes[0, 2] - axes[2, 0]), (axes[1, 0] - axes[0, 1]))
        q = np.array([x, y, z, 4.0 * w * w]) / np.linalg.norm([x, y, z, 4.0 * w * w])
        rows.append(f"{t:.6f} 0 0 0 " + " ".join(f"{part:.9f}" for part in q))
    return world.written("truth.tum", "# timestamp tx ty tz qx qy qz qw\n" + "\n".join(rows) + "\n")


def gpx(world: World) -> Path:
    file = gpxpy.gpx.GPX()
    segment = gpxpy.gpx.GPXTrackSegment()
    for k in range(120):
        time = pd.Timestamp(1_700_000_000 + k, unit="s", tz="UTC").to_pydatetime()
        segment.points.append(gpxpy.gpx.GPXTrackPoint(48.0 + 1e-5 * k, 9.0, elevation=300.0, time=time))
    track = gpxpy.gpx.GPXTrack()
    track.segments.append(segment)
    file.tracks.append(track)
    return world.written("walk.gpx", file.to_xml())


def kf_gins(world: World) -> Path:
    folder = world.path("kf")
    folder.mkdir()
    for name in ("imu_kfgins.txt", "gnss_kfgins.txt"):
        shutil.copy(data("nav", "car_rtk", name), folder / name)
    return folder


def sensor_logger_folder(world: World) -> Path:
    folder = world.path("logger")
    folder.mkdir()
    for name, sensor in {"Gyroscope": "gyr", "TotalAcceleration": "acc", "Magnetometer": "mag"}.items():
        times = (world.phone["t"] * 1e9).astype(np.int64) + 1_700_000_000_000_000_000
        rows = zip(times, world.phone["t"], world.phone[sensor])
        lines = [f"{t},{e!r},{float(v[2])!r},{float(v[1])!r},{float(v[0])!r}" for t, e, v in rows]
        (folder / f"{name}.csv").write_text("\n".join(["time,seconds_elapsed,z,y,x", *lines]) + "\n")
    return folder


def sensor_logger_zip(world: World) -> Path:
    folder = sensor_logger_folder(world)
    return Path(shutil.make_archive(str(world.path("logger-zip")), "zip", folder))


def sensor_logger_json(world: World) -> Path:
    rows = []
    for name, sensor in {"Gyroscope": "gyr", "TotalAcceleration": "acc", "Magnetometer": "mag"}.items():
        for t, v in zip(world.phone["t"], world.phone[sensor]):
            stamp = str(int(t * 1e9) + 1_700_000_000_000_000_000)
            rows.append({"sensor": name, "time": stamp, "seconds_elapsed": repr(float(t)),
                         "x": repr(float(v[0])), "y": repr(float(v[1])), "z": repr(float(v[2]))})
    return world.written("logger.json", json.dumps(rows))


def ximu3_bytes(kind: str, time_us: int, numbers: list[float]) -> bytes:
    """A message of the device in bytes, as its manual has it."""
    plain = struct.pack(f"<BQ{len(numbers)}f", ord(kind) + 0x80, time_us, *numbers)
    return plain.replace(b"\xdb", b"\xdb\xdd").replace(b"\n", b"\xdb\xdc") + b"\n"


def ximu3_log(world: World) -> Path:
    """What the data logger of an x-IMU3 writes; its field at 20 Hz comes a little late."""
    phone = world.phone
    out = b'{"ping":{"interface":"Data Logger","name":"x-IMU3","sn":"0123456789ABCDEF"}}\n{"time":"2025-01-20 15:30:00"}\n'
    for k, t in enumerate(phone["t"]):
        time_us = 19_150_794 + int(round(t * 1e6))
        out += ximu3_bytes("I", time_us, [*(phone["gyr"][k] * DEGREES), *(phone["acc"][k] * G)])
        if k % 5 == 0:
            out += ximu3_bytes("M", time_us - 3000, list(phone["mag"][max(k, 0)] / 50.0))
    world.path("log.ximu3").write_bytes(out)
    return world.path("log.ximu3")


def ximu3_folder(world: World) -> Path:
    """As the software of its maker converts the file."""
    ximu3.FileConverter.convert(str(world.folder), "converted", [str(ximu3_log(world))])
    return world.path("converted")


def numpy_text(world: World) -> Path:
    rows = np.hstack([world.phone["gyr"], world.phone["acc"], world.phone["mag"]])
    np.savetxt(world.path("arrays.csv"), rows, delimiter=",")
    return world.path("arrays.csv")


def two_columns_of_time(world: World) -> Path:
    table = world.columns(PLAIN)
    stamps = pd.to_datetime(1_700_000_000 * 10**9 + (table.pop("time") * 1e9).astype("int64"))
    table.insert(0, "date", stamps.dt.strftime("%Y/%m/%d"))
    table.insert(1, "clock", stamps.dt.strftime("%H:%M:%S.%f"))
    table.to_csv(world.path("dated.csv"), index=False)
    return world.path("dated.csv")


def saved(name: str, save: Callable[[Path, World], object]) -> Callable[[World], Path]:
    def make(world: World) -> Path:
        save(world.path(name), world)
        return world.path(name)

    return make


def workbook(path: Path, world: World) -> None:
    book = openpyxl.Workbook()
    for row in world.columns(PLAIN).head(20).itertuples(index=False):
        book.active.append(list(row))
    book.save(path)


def telemetry(path: Path, _: World) -> None:
    link = mavlink.MAVLink(None, srcSystem=1)
    with path.open("wb") as file:
        for k in range(50):
            message = mavlink.MAVLink_raw_imu_message(1_700_000_000_000_000 + k * 10_000, 1, 2, -1000, 3, 4, 5, 6, 7, 8)
            file.write((1_700_000_000_000_000 + k * 10_000).to_bytes(8, "big") + message.pack(link))


def hdf5(path: Path, world: World) -> None:
    with h5py.File(path, "w") as file:
        for name in ("gyr", "acc", "mag"):
            file[name] = world.phone[name]


def arrays(path: Path, world: World) -> None:
    """As they come: single precision, a column for each sample, a rate and other things beside them."""
    phone = world.phone
    np.savez(path, gyr=phone["gyr"].astype("f4"), acc=phone["acc"].T, mag=phone["mag"], fs=100.0, who="a phone", R=np.eye(3))


# Of DataFlash: number, fields and labels of each message.
MESSAGES = {
    "FMT": (0x80, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "IMU": (1, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "MAG": (2, "QBhhh", "TimeUS,I,MagX,MagY,MagZ"),
    "GPS": (3, "QBBIHBcLLefff", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ"),
}


def data_flash(path: Path, world: World) -> None:
    """A log of ArduPilot of the drive: forward, right, down; milligauss."""
    sizes = {"n": "4s", "N": "16s", "Z": "64s", "c": "h", "L": "i", "e": "i"}

    def message(name: str, *values: Any) -> bytes:
        kind, fields, _ = MESSAGES[name]
        return b"\xa3\x95" + bytes([kind]) + struct.pack("<" + "".join(sizes.get(f, f) for f in fields), *values)

    out = []
    for name, (kind, fields, labels) in MESSAGES.items():
        length = 3 + struct.calcsize("<" + "".join(sizes.get(f, f) for f in fields))
        out.append((0, message("FMT", kind, length, name.encode(), fields.encode(), labels.encode())))
    frd = np.array([1.0, -1.0, -1.0])
    for time_ns, v in world.drive["imu"]:
        us = (time_ns - START_NS) // 1000
        out.append((us, message("IMU", us, 0, *(np.array(v[:3]) * frd), *(np.array(v[3:]) * frd))))
    for time_ns, v in world.drive["mag"]:
        us = (time_ns - START_NS) // 1000
        out.append((us, message("MAG", us, 0, *(int(round(x)) for x in np.array(v) * frd * 1e7))))
    for (time_ns, (latitude, longitude, height)), (_, (east, north, up)) in zip(world.drive["fix"], world.drive["velocity"]):
        us = (time_ns - START_NS) // 1000
        place = [int(round(latitude * 1e7)), int(round(longitude * 1e7)), int(round(height * 100))]
        moves = [math.hypot(east, north), math.degrees(math.atan2(east, north)) % 360.0, -up]
        out.append((us, message("GPS", us, 0, 3, us // 1000, 2300, 12, 90, *place, *moves)))
    path.write_bytes(b"".join(text for _, text in sorted(out, key=lambda one: one[0])))


RINEX = f"{'     3.04           OBSERVATION DATA    M':<60}RINEX VERSION / TYPE\n{'':<60}END OF HEADER\n"
GEOJSON = '{"type":"FeatureCollection","features":[{"type":"Feature","geometry":{"type":"Point","coordinates":[9,48]}}]}'


@dataclass
class Kind:
    """How such a file is made, what becomes of it, and what a run over it must show."""

    make: Callable[[World], Path]
    outcome: str
    shows: str = ""


KINDS: dict[str, Kind] = {
    "CSV with our column names": Kind(lambda w: w.csv("ours.csv", OURS), OPENS, PHONE),
    "Parquet of pandas or polars with our column names": Kind(parquet("zstd"), OPENS, PHONE),
    "Parquet, Snappy": Kind(parquet("snappy"), OPENS, PHONE),
    "Parquet, gzip": Kind(parquet("gzip"), OPENS, PHONE),
    "Parquet, LZ4": Kind(parquet("lz4"), OPENS, PHONE),
    "ROS 2: MCAP file, attitude": Kind(bag(StoragePlugin.MCAP, CompressionMode.NONE, True), OPENS),
    "ROS 2: MCAP file with NavSatFix, position": Kind(bag(StoragePlugin.MCAP, CompressionMode.NONE, True), OPENS, CAR),
    "ROS 2: folder of `ros2 bag record`": Kind(bag(StoragePlugin.MCAP, CompressionMode.NONE, False), OPENS, CAR),
    "ROS 2: SQLite (`.db3`)": Kind(bag(StoragePlugin.SQLITE3, CompressionMode.NONE, True), OPENS, CAR),
    "ROS 2: SQLite, folder": Kind(bag(StoragePlugin.SQLITE3, CompressionMode.NONE, False), OPENS, CAR),
    "ROS 2: messages compressed": Kind(bag(StoragePlugin.MCAP, CompressionMode.MESSAGE, False), OPENS, CAR),
    "ROS 2: file compressed": Kind(bag(StoragePlugin.MCAP, CompressionMode.FILE, False), OPENS, CAR),
    "ROS 2: MCAP with LZ4 chunks": Kind(lz4_chunks, OPENS, CAR),
    "ROS 2: two Imu, a field of another namespace, a pose of motion capture": Kind(two_robots, OPENS, CAR),
    "ROS 1: bag": Kind(lambda w: write_bag_1(w.drive, w.path("one.bag"), None), OPENS, CAR),
    "ROS 1: bag, bz2": Kind(lambda w: write_bag_1(w.drive, w.path("one.bag"), "BZ2"), OPENS, CAR),
    "ROS 1: bag, LZ4": Kind(lambda w: write_bag_1(w.drive, w.path("one.bag"), "LZ4"), OPENS, CAR),
    "Sensor Logger, folder": Kind(sensor_logger_folder, OPENS, PHONE),
    "Sensor Logger, zip": Kind(sensor_logger_zip, OPENS, PHONE),
    "Sensor Logger, JSON": Kind(sensor_logger_json, OPENS, PHONE),
    "Sensor Logger, merged CSV at 1 Hz": Kind(
        lambda _: data("nav", "phone_sensorlogger_1hz", "2025-03-01_15-04-26.csv"), DESCRIBED),
    "phyphox, zip": Kind(phyphox_zip, OPENS, PHONE),
    "phyphox, folder": Kind(phyphox_folder, OPENS, PHONE),
    "PX4 ULog": Kind(lambda _: data("nav", "px4_flight", "sample.ulg"), OPENS),
    "ArduPilot DataFlash (`.bin`)": Kind(saved("a.bin", data_flash), OPENS, CAR),
    "NMEA 0183, `--estimator dead-reckoning`": Kind(lambda _: data("nav", "nmea0183", "gps.log"), OPENS),
    "NMEA 0183, default estimator": Kind(lambda _: data("nav", "nmea0183", "gps.log"), OPENS),
    "UBX": Kind(lambda _: data("nav", "ubx", "pygpsdata-NAV.log"), OPENS),
    "VectorNav": Kind(lambda w: w.written("vn.txt", vectornav(w)), OPENS, PHONE),
    "KF-GINS, folder": Kind(kf_gins, OPENS),
    "EuRoC `mav0`": Kind(euroc, OPENS, LEVEL),
    "KITTI `oxts`": Kind(kitti, OPENS),
    "RTKLIB solution (`.pos`)": Kind(lambda _: data("nav", "car_rtk", "gnss_1934_first400s.pos"), OPENS),
    "GPX": Kind(gpx, OPENS),
    "TUM trajectory": Kind(tum, REFERENCE),
    "CSV of pandas, other names": Kind(lambda w: w.csv("plain.csv", PLAIN), DESCRIBED, PHONE),
    "CSV of pandas with its index": Kind(lambda w: w.csv("index.csv", PLAIN, index=True), DESCRIBED, PHONE),
    "CSV of NumPy: no names, no time": Kind(numpy_text, DESCRIBED, PHONE),
    "CSV of Excel: semicolons, decimal commas": Kind(
        lambda w: w.csv("excel.csv", PLAIN.replace("time", "Zeit (s)"), sep=";", decimal=","), DESCRIBED, PHONE),
    "x-IMU3, data logger (`.ximu3`)": Kind(ximu3_log, OPENS, PHONE),
    "x-IMU3, folder of its software": Kind(ximu3_folder, OPENS, PHONE),
    "x-IMU3, one table": Kind(
        lambda w: w.csv(
            "x-imu3.csv",
            "Timestamp (us);Gyroscope X (deg/s);Gyroscope Y (deg/s);Gyroscope Z (deg/s);Accelerometer X (g);Accelerometer Y (g);"
            "Accelerometer Z (g);Magnetometer X (a.u.);Magnetometer Y (a.u.);Magnetometer Z (a.u.)",
            rate=DEGREES, force=G, field=1.0 / 50.0, seconds=1e6),
        OPENS, PHONE),
    "Physics Toolbox": Kind(
        lambda w: w.csv("toolbox.csv", "time;wx;wy;wz;gFx;gFy;gFz;Bx;By;Bz", force=G), DESCRIBED, PHONE),
    "MATLAB Mobile, a table": Kind(
        lambda w: w.csv(
            "matlab.csv",
            "Timestamp;AngularVelocity_X;AngularVelocity_Y;AngularVelocity_Z;Acceleration_X;Acceleration_Y;Acceleration_Z;"
            "MagneticField_X;MagneticField_Y;MagneticField_Z"),
        DESCRIBED, PHONE),
    "date and time of day in two columns": Kind(two_columns_of_time, DESCRIBED, PHONE),
    "NumPy `.npy`": Kind(saved("a.npy", lambda p, w: np.save(p, w.columns(PLAIN).to_numpy())), DESCRIBED, PHONE),
    "NumPy `.npz`": Kind(saved("a.npz", arrays), DESCRIBED, PHONE),
    "MATLAB `.mat`": Kind(saved("a.mat", lambda p, w: scipy.io.savemat(p, {"gyr": w.phone["gyr"]})), "scipy.io.loadmat"),
    "HDF5": Kind(saved("a.hdf5", hdf5), "h5py"),
    "workbook of Excel": Kind(saved("a.xlsx", workbook), "workbook of Excel"),
    "MAVLink telemetry (`.tlog`)": Kind(saved("a.tlog", telemetry), "mavlogdump.py"),
    "RINEX": Kind(lambda w: w.written("a.rnx", RINEX), "raw observations"),
    "GeoJSON": Kind(lambda w: w.written("a.geojson", GEOJSON), "GeoJSON"),
}

# What users of this field bring most, as tried with tools of their worlds; the other kinds are variants of these.
BROUGHT = [
    "PX4 ULog", "Sensor Logger, folder", "Sensor Logger, JSON", "KF-GINS, folder", "NMEA 0183, `--estimator dead-reckoning`", "UBX",
    "VectorNav", "ROS 2: MCAP file, attitude", "ROS 2: MCAP file with NavSatFix, position", "ROS 2: folder of `ros2 bag record`",
    "ROS 2: SQLite (`.db3`)", "ROS 1: bag", "ROS 2: MCAP with LZ4 chunks",
    "ROS 2: two Imu, a field of another namespace, a pose of motion capture", "Parquet, gzip", "Parquet, LZ4",
    "Parquet of pandas or polars with our column names", "phyphox, zip", "phyphox, folder", "CSV of pandas, other names",
    "CSV of NumPy: no names, no time", "x-IMU3, one table", "Physics Toolbox", "CSV of Excel: semicolons, decimal commas",
    "EuRoC `mav0`", "KITTI `oxts`", "NumPy `.npz`", "NumPy `.npy`", "MATLAB `.mat`", "HDF5", "RTKLIB solution (`.pos`)", "RINEX", "GPX",
    "GeoJSON", "TUM trajectory", "ArduPilot DataFlash (`.bin`)", "NMEA 0183, default estimator", "Sensor Logger, merged CSV at 1 Hz",
]


def vectornav(world: World) -> str:
    """Lines `$VNYMR` behind the seconds of their arrival: yaw, pitch, roll, field (gauss), force, rate, and the checksum;
    forward, right, down."""
    lines = []
    frd = np.array([1.0, -1.0, -1.0])
    for t, gyr, acc, mag in zip(world.phone["t"], *(world.phone[name] * frd for name in ("gyr", "acc", "mag"))):
        numbers = [0.0, 0.0, 0.0, *(mag / 100.0), *acc, *gyr]
        body = "VNYMR," + ",".join(f"{number:+010.5f}" for number in numbers)
        checksum = 0
        for byte in body.encode():
            checksum ^= byte
        lines.append(f"{1_700_000_000 + t:.3f} ${body}*{checksum:02X}")
    return "\r\n".join(lines) + "\r\n"


def ran(*words: object) -> subprocess.CompletedProcess[str]:
    command = [program(), *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_of_38_kinds_that_users_bring_34_open_and_the_others_say_why_not() -> None:
    opened = [name for name in BROUGHT if KINDS[name].outcome in (OPENS, DESCRIBED, REFERENCE)]
    assert len(set(BROUGHT)) == 38 and len(opened) >= 34, sorted(set(BROUGHT) - set(opened))


def verdict(kind: Kind) -> str:
    return kind.outcome if kind.outcome in (OPENS, DESCRIBED, REFERENCE) else "refused, with what to do"


def test_the_document_says_what_these_tests_show() -> None:
    text = (REPOSITORY / "docs" / "formats.md").read_text()
    rows = text.split("<!-- kinds of files: crates/python/tests/test_files.py -->\n")[1].split("<!-- end -->")[0]
    assert rows == "| file | |\n|---|---|\n" + "".join(f"| {name} | {verdict(kind)} |\n" for name, kind in KINDS.items())


def turned(q: pd.Series) -> np.ndarray:
    """The matrix of a row's quaternion."""
    w, x, y, z = (q[name] for name in ("qw", "qx", "qy", "qz"))
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def shows(kind: Kind, name: str, path: Path, world: World) -> None:
    """A run over the file shows what it was made of, in right units and axes."""
    out = world.path("out.csv")
    guess = ["--describe"] if kind.outcome == DESCRIBED else []
    if kind.shows == CAR:
        run_program("run", path, "--estimator", "error-state", "--out", out)
        last, fixes = pd.read_csv(out).iloc[-1], world.drive["fix"]
        north_m = math.radians(last["latitude_deg"] - fixes[-1][1][0]) * 6_371_000.0
        east_m = math.radians(last["longitude_deg"] - fixes[-1][1][1]) * 6_371_000.0 * math.cos(math.radians(48.0))
        # The fixes have 1.5 m, and it drives on for 0.2 s at 10 m/s.
        assert math.hypot(north_m, east_m) < 8.0, (north_m, east_m)
    elif kind.shows:
        run_program("run", path, *guess, "--estimator", "mekf", "--out", out)
        last, truth = turned(pd.read_csv(out).iloc[-1]), world.phone["axes"][-1]
        if name == "VectorNav":
            truth = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ truth @ np.diag([1, -1, -1])
        assert math.degrees(math.acos(min(1.0, last[2] @ truth[2]))) < 2.0
        if kind.shows == PHONE:
            assert math.degrees(math.acos(min(1.0, (np.trace(last.T @ truth) - 1.0) / 2.0))) < 4.0


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_opens_or_says_why_not(
    name: str, phone: dict[str, np.ndarray], drive: Samples, tmp_path: Path
) -> None:
    kind, world = KINDS[name], World(phone, drive, tmp_path)
    path = kind.make(world)
    plain = ran("info", path)
    if kind.outcome == OPENS:
        assert plain.returncode == 0, plain.stderr
    elif kind.outcome == DESCRIBED:
        assert plain.returncode == 2 and "northing describe" in plain.stderr, plain.stderr
        guessed = ran("run", path, "--describe", "--estimator", "mekf")
        assert guessed.returncode == 0 and "Guessed" in guessed.stdout, guessed.stderr
    elif kind.outcome == REFERENCE:
        scored = ran("run", world.csv("table.csv", OURS), "--reference", path, "--json")
        assert scored.returncode == 0, scored.stderr
        assert json.loads(scored.stdout)["error_deg"]["total_rmse"] < 3.0
    else:
        assert plain.returncode == 2 and kind.outcome in plain.stderr, plain.stderr
    shows(kind, name, path, world)


def test_a_log_of_sentences_needs_no_estimator_named() -> None:
    """It was called too short, with its 1201 s."""
    log = data("nav", "nmea0183", "gps.log")
    for named in ([], ["--estimator", "dead-reckoning"]):
        told = run_program("run", log, *named)
        assert "dead-reckoning over 1201.0 s" in told and "1202 of 1202 fixes used" in told, told
    # What it is too short for is said in its own terms.
    refused = ran("run", log, "--estimator", "mekf")
    assert refused.returncode == 2 and "too short" not in refused.stderr and "no gyroscope" in refused.stderr, refused.stderr


def test_of_two_robots_in_a_bag_the_foreign_sensors_are_left_out_and_said(
    phone: dict[str, np.ndarray], drive: Samples, tmp_path: Path
) -> None:
    told = " ".join(run_program("info", two_robots(World(phone, drive, tmp_path))).split())
    assert "Topics that are read: /fix, /imu/data_raw, /imu/mag, /optitrack/pose." in told
    assert "/phone/imu (another Imu; choose it with --device /phone/imu)" in told and "/phone/mag (another field)" in told


def test_a_log_of_the_ximu3_is_what_its_own_converter_makes_of_it(
    phone: dict[str, np.ndarray], drive: Samples, tmp_path: Path
) -> None:
    folder = ximu3_folder(World(phone, drive, tmp_path))
    tables = []
    for recording in (tmp_path / "log.ximu3", folder):
        out = tmp_path / f"{recording.stem}.csv"
        run_program("convert", recording, out)
        tables.append(pd.read_csv(out, comment="#"))
    ours, theirs = tables
    assert list(ours["t_s"]) == list(theirs["t_s"]) and len(ours) > 3000
    for column in ("gyro_x_rad_s", "acc_z_m_s2", "mag_y_ut"):
        assert ours[column].count() == theirs[column].count() > 500
        # The converter writes six digits behind the point.
        np.testing.assert_allclose(ours[column], theirs[column], rtol=0, atol=6e-5)


def test_a_log_of_ardupilot_is_what_pymavlink_reads(phone: dict[str, np.ndarray], drive: Samples, tmp_path: Path) -> None:
    log, table = tmp_path / "flight.bin", tmp_path / "flight.csv"
    data_flash(log, World(phone, drive, tmp_path))
    run_program("convert", log, table)
    ours = pd.read_csv(table, comment="#")
    reader = DFReader_binary(str(log), False)
    theirs: dict[str, list[Any]] = {"IMU": [], "MAG": [], "GPS": []}
    while (message := reader.recv_msg()) is not None:
        if message.get_type() in theirs:
            theirs[message.get_type()].append(message)
    assert [len(messages) for messages in theirs.values()] == [len(drive[name]) for name in ("imu", "mag", "fix")]
    columns = {
        "gyro_x_rad_s": ("IMU", "GyrX", 1.0), "acc_z_m_s2": ("IMU", "AccZ", 1.0), "mag_y_ut": ("MAG", "MagY", 0.1),
        "gnss_latitude_rad": ("GPS", "Lat", math.pi / 180.0), "gnss_height_m": ("GPS", "Alt", 1.0),
    }
    for column, (kind, field, factor) in columns.items():
        expected = np.array([getattr(message, field) for message in theirs[kind]]) * factor
        np.testing.assert_allclose(ours[column].dropna(), expected, rtol=1e-12, atol=1e-12)
