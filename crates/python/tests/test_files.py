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
from collections.abc import Callable
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
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from conftest import START_NS, Samples, data, program, run_program
from test_bags import write_bag_1, write_bag_2

# What becomes of a file.
OPENS, DESCRIBED, REFERENCE = "opens", "opens by a guess", "is a reference"


class World:
    """The recordings that files are made of."""

    def __init__(self, phone: dict[str, np.ndarray], drive: Samples, folder: Path) -> None:
        self.phone, self.drive, self.folder = phone, drive, folder

    def path(self, name: str) -> Path:
        return self.folder / name

    def columns(self, names: str, rate: float = 1.0, force: float = 1.0, field: float = 1.0) -> pd.DataFrame:
        """Time, angular rate, specific force and field of the phone under these names, in units of these factors."""
        arrays = [self.phone["t"], *(self.phone["gyr"] * rate).T, *(self.phone["acc"] * force).T, *(self.phone["mag"] * field).T]
        return pd.DataFrame(dict(zip(names.split(";"), arrays)))

    def written(self, name: str, text: str) -> Path:
        self.path(name).write_text(text)
        return self.path(name)

    def csv(self, name: str, names: str, **options: Any) -> Path:
        how = {key: options.pop(key) for key in ("rate", "force", "field") if key in options}
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
    for time_ns, (latitude, longitude, height) in world.drive["fix"]:
        us = (time_ns - START_NS) // 1000
        place = [int(round(latitude * 1e7)), int(round(longitude * 1e7)), int(round(height * 100))]
        out.append((us, message("GPS", us, 0, 3, us // 1000, 2300, 12, 90, *place, 0.0, 0.0, 0.0)))
    path.write_bytes(b"".join(text for _, text in sorted(out, key=lambda one: one[0])))


RINEX = f"{'     3.04           OBSERVATION DATA    M':<60}RINEX VERSION / TYPE\n{'':<60}END OF HEADER\n"
GEOJSON = '{"type":"FeatureCollection","features":[{"type":"Feature","geometry":{"type":"Point","coordinates":[9,48]}}]}'

Kind = tuple[Callable[[World], Path], str]
KINDS: dict[str, Kind] = {
    "our CSV": (lambda w: w.csv("ours.csv", OURS), OPENS),
    "Parquet, Snappy as pandas has it": (parquet("snappy"), OPENS),
    "Parquet, gzip": (parquet("gzip"), OPENS),
    "Parquet, Zstandard as polars has it": (parquet("zstd"), OPENS),
    "Parquet, LZ4": (parquet("lz4"), OPENS),
    "bag of ROS 2, folder": (bag(StoragePlugin.MCAP, CompressionMode.NONE, False), OPENS),
    "MCAP of ROS 2": (bag(StoragePlugin.MCAP, CompressionMode.NONE, True), OPENS),
    "MCAP, messages compressed": (bag(StoragePlugin.MCAP, CompressionMode.MESSAGE, False), OPENS),
    "MCAP, file compressed": (bag(StoragePlugin.MCAP, CompressionMode.FILE, False), OPENS),
    "bag in SQLite, folder": (bag(StoragePlugin.SQLITE3, CompressionMode.NONE, False), OPENS),
    "bag in SQLite (.db3)": (bag(StoragePlugin.SQLITE3, CompressionMode.NONE, True), OPENS),
    "bag of ROS 1": (lambda w: write_bag_1(w.drive, w.path("one.bag"), None), OPENS),
    "bag of ROS 1, bz2": (lambda w: write_bag_1(w.drive, w.path("one.bag"), "BZ2"), OPENS),
    "bag of ROS 1, LZ4": (lambda w: write_bag_1(w.drive, w.path("one.bag"), "LZ4"), OPENS),
    "Sensor Logger, folder": (sensor_logger_folder, OPENS),
    "Sensor Logger, zip": (sensor_logger_zip, OPENS),
    "Sensor Logger, JSON": (sensor_logger_json, OPENS),
    "Sensor Logger, merged CSV": (
        lambda _: data("nav", "phone_sensorlogger_1hz", "2025-03-01_15-04-26.csv"), DESCRIBED),
    "phyphox, zip": (phyphox_zip, OPENS),
    "phyphox, folder": (phyphox_folder, OPENS),
    "PX4 ULog": (lambda _: data("nav", "px4_flight", "sample.ulg"), OPENS),
    "NMEA 0183": (lambda _: data("nav", "nmea0183", "gps.log"), OPENS),
    "UBX": (lambda _: data("nav", "ubx", "pygpsdata-NAV.log"), OPENS),
    "VectorNav": (lambda w: w.written("vn.txt", vectornav(w)), OPENS),
    "KF-GINS": (kf_gins, OPENS),
    "EuRoC": (euroc, OPENS),
    "KITTI": (kitti, OPENS),
    "RTKLIB solution": (lambda _: data("nav", "car_rtk", "gnss_1934_first400s.pos"), OPENS),
    "GPX": (gpx, OPENS),
    "TUM trajectory": (tum, REFERENCE),
    "CSV of pandas, other names": (lambda w: w.csv("plain.csv", PLAIN), DESCRIBED),
    "CSV of pandas with its index": (lambda w: w.csv("index.csv", PLAIN, index=True), DESCRIBED),
    "arrays of numpy, no names, no time": (numpy_text, DESCRIBED),
    "Excel's CSV: semicolons, decimal commas": (
        lambda w: w.csv("excel.csv", PLAIN.replace("time", "Zeit (s)"), sep=";", decimal=","), DESCRIBED),
    "x-IMU3": (
        lambda w: w.csv(
            "x-imu3.csv",
            "Timestamp (us);Gyroscope X (deg/s);Gyroscope Y (deg/s);Gyroscope Z (deg/s);Accelerometer X (g);Accelerometer Y (g);"
            "Accelerometer Z (g);Magnetometer X (a.u.);Magnetometer Y (a.u.);Magnetometer Z (a.u.)",
            rate=DEGREES, force=G, field=1.0 / 50.0),
        DESCRIBED),
    "Physics Toolbox": (
        lambda w: w.csv("toolbox.csv", "time;wx;wy;wz;gFx;gFy;gFz;Bx;By;Bz", force=G), DESCRIBED),
    "MATLAB Mobile, as a table": (
        lambda w: w.csv(
            "matlab.csv",
            "Timestamp;AngularVelocity_X;AngularVelocity_Y;AngularVelocity_Z;Acceleration_X;Acceleration_Y;Acceleration_Z;"
            "MagneticField_X;MagneticField_Y;MagneticField_Z"),
        DESCRIBED),
    "date and time of day in two columns": (two_columns_of_time, DESCRIBED),
    "an array of numpy (.npy)": (saved("a.npy", lambda p, w: np.save(p, w.columns(PLAIN).to_numpy())), DESCRIBED),
    "arrays of numpy (.npz)": (saved("a.npz", arrays), DESCRIBED),
    "MATLAB (.mat)": (saved("a.mat", lambda p, w: scipy.io.savemat(p, {"gyr": w.phone["gyr"]})), "scipy.io.loadmat"),
    "HDF5": (saved("a.hdf5", hdf5), "h5py"),
    "workbook of Excel": (saved("a.xlsx", workbook), "workbook of Excel"),
    "telemetry of MAVLink": (saved("a.tlog", telemetry), "mavlogdump.py"),
    "log of ArduPilot": (saved("a.bin", data_flash), OPENS),
    "RINEX": (lambda w: w.written("a.rnx", RINEX), "raw observations"),
    "GeoJSON": (lambda w: w.written("a.geojson", GEOJSON), "GeoJSON"),
}


def vectornav(world: World) -> str:
    """Lines `$VNYMR`: yaw, pitch, roll, field (gauss), force, rate, and the checksum."""
    lines = []
    for gyr, acc, mag in list(zip(world.phone["gyr"], world.phone["acc"], world.phone["mag"]))[:1000]:
        numbers = [0.0, 0.0, 0.0, *(mag / 100.0), *acc, *gyr]
        body = "VNYMR," + ",".join(f"{number:+010.5f}" for number in numbers)
        checksum = 0
        for byte in body.encode():
            checksum ^= byte
        lines.append(f"${body}*{checksum:02X}")
    return "\r\n".join(lines) + "\r\n"


def ran(*words: object) -> subprocess.CompletedProcess[str]:
    command = [program(), *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_the_table_is_as_long_as_is_said() -> None:
    outcomes = [outcome for _, outcome in KINDS.values()]
    opened = [outcome for outcome in outcomes if outcome in (OPENS, DESCRIBED, REFERENCE)]
    assert (len(outcomes), len(opened)) == (47, 41)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_opens_or_says_why_not(
    kind: str, phone: dict[str, np.ndarray], drive: Samples, tmp_path: Path
) -> None:
    make, outcome = KINDS[kind]
    path = make(World(phone, drive, tmp_path))
    plain = ran("info", path)
    if outcome == OPENS:
        assert plain.returncode == 0, plain.stderr
    elif outcome == DESCRIBED:
        assert plain.returncode == 2 and "northing describe" in plain.stderr, plain.stderr
        guessed = ran("run", path, "--describe", "--estimator", "mekf")
        assert guessed.returncode == 0 and "Guessed" in guessed.stdout, guessed.stderr
    elif outcome == REFERENCE:
        table = World(phone, drive, tmp_path).csv("table.csv", OURS)
        scored = ran("run", table, "--reference", path, "--json")
        assert scored.returncode == 0, scored.stderr
        assert json.loads(scored.stdout)["error_deg"]["total_rmse"] < 3.0
    else:
        assert plain.returncode == 2 and outcome in plain.stderr, plain.stderr


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
