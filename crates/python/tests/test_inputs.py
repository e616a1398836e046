"""What people have is taken; what cannot be is refused in our words, with the first bad row."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import polars
import pytest

import northing as no

Arrays = dict[str, np.ndarray]


def quat(*arrays: Any, **options: Any) -> np.ndarray:
    return no.attitude(*arrays, **{"rate": 100.0, **options}).quat


def test_an_estimate_is_right_and_its_uncertainty_too(phone: Arrays) -> None:
    r = no.attitude(phone["gyr"], phone["acc"], phone["mag"], rate=100.0)
    w, x, y, z = r.quat[-1]
    axes = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])
    error = np.arccos(np.clip((np.trace(axes.T @ phone["axes"][-1]) - 1) / 2, -1, 1))
    assert np.degrees(error) < 2.0
    assert error < 4 * np.sqrt(np.trace(r.covariance[-1]))
    assert r.quat.shape == (3000, 4) and r.covariance.shape == (3000, 3, 3) and r.gyro_bias.shape == (3000, 3)
    np.testing.assert_allclose(r.gyro_bias[-1], 0.005, atol=0.002)
    np.testing.assert_allclose(r.t, phone["t"], atol=1e-9)
    assert set(r.nis) == {"accelerometer", "magnetometer"} and len(r.nis["magnetometer"]) == 3000
    assert {v.sensor for v in r.verdicts} <= {"accelerometer", "magnetometer"} and r.parameters


def test_samples_that_come_in_bunches_are_put_back_where_they_were_taken(phone: Arrays) -> None:
    regular = no.attitude(phone["gyr"], phone["acc"], phone["mag"], t=phone["t"])
    count = np.arange(3000)
    arrived = phone["t"][count // 4 * 4 + 3] + 1e-4 * (count % 4)
    r = no.attitude(phone["gyr"], phone["acc"], phone["mag"], t=arrived)
    assert r.quat.shape == (3000, 4) and abs(r.undefined - regular.undefined) <= 1
    # The last of a bunch is read 0.3 ms after it is taken.
    np.testing.assert_allclose(r.t[10:], phone["t"][10:], atol=1e-3)
    same = np.abs(np.sum(r.quat[500:] * regular.quat[500:], axis=1))
    assert np.degrees(2 * np.arccos(np.clip(same, -1, 1))).max() < 0.2


def test_what_alignment_leaves_undefined_is_nan_and_said(phone: Arrays) -> None:
    r = no.attitude(phone["gyr"], phone["acc"], phone["mag"], rate=100.0)
    first = r.undefined
    assert 40 <= first <= 60
    assert np.isnan(r.quat[:first]).all() and np.isfinite(r.quat[first:]).all()
    assert f"Rows 0 to {first - 1} have no estimate and are NaN: the filter aligns itself first." in r.notes


def test_lists_strides_frames_and_types(phone: Arrays) -> None:
    arrays = [phone["gyr"], phone["acc"], phone["mag"]]
    expected = quat(*arrays)
    wide = np.full((3000, 9), np.nan)
    wide[:, ::3] = arrays[0]
    for same in (
        [array.tolist() for array in arrays],
        [np.asfortranarray(array) for array in arrays],
        [wide[:, ::3], *arrays[1:]],
        [array[::-1].copy()[::-1] for array in arrays],
        [pandas.DataFrame(array, columns=["x", "y", "z"]) for array in arrays],
        [polars.DataFrame(array, schema=["x", "y", "z"]) for array in arrays],
    ):
        np.testing.assert_array_equal(quat(*same), expected)
    single = [array.astype(np.float32) for array in arrays]
    np.testing.assert_array_equal(quat(*single), quat(*(array.astype(np.float64) for array in single)))
    assert np.nanmax(np.abs(quat(*single) - expected)) < 1e-4


def test_stamps(phone: Arrays) -> None:
    arrays = [phone["gyr"], phone["acc"], phone["mag"]]
    time_ns = np.arange(3000) * 10_000_000
    expected = quat(*arrays)
    for t in (phone["t"], phone["t"].tolist(), time_ns, time_ns.astype("datetime64[ns]")):
        np.testing.assert_array_equal(quat(*arrays, rate=None, t=t), expected)
    slow = no.attitude(phone["gyr"], phone["acc"], phone["mag"][::4], rate=100.0, mag_t=phone["t"][::4])
    assert len(slow) == 3000 and len(slow.nis["magnetometer"]) == 750


def bad(values: np.ndarray, row: int, value: float) -> np.ndarray:
    changed = values.copy()
    changed[row, 1] = value
    return changed


def bad_date(t: np.ndarray, row: int) -> np.ndarray:
    dates = np.datetime64("2026-01-01", "ns") + np.rint(t * 1e9).astype("timedelta64[ns]")
    dates[row] = np.datetime64("NaT")
    return dates


def test_dates_with_a_zone_are_stamps_and_a_mask_that_hides_nothing_is_none(phone: Arrays) -> None:
    gyr, acc = phone["gyr"], np.ma.masked_array(phone["acc"])
    expected = no.attitude(gyr, phone["acc"], t=phone["t"]).quat
    dates = pandas.Timestamp("2026-01-01", tz="Europe/Berlin") + pandas.to_timedelta(phone["t"], unit="s")
    for times in [dates, list(dates.to_pydatetime())]:
        np.testing.assert_allclose(no.attitude(gyr, acc, t=times).quat, expected, atol=1e-6)


def test_a_sensor_on_another_clock_is_said(phone: Arrays) -> None:
    r = no.attitude(phone["gyr"], phone["acc"], phone["mag"], rate=100.0, mag_t=phone["t"] + 1.7e9)
    said = [note for note in r.notes if note.startswith("None of the 3000 samples of the magnetometer was used")]
    assert len(said) == 1 and "two clocks, or two recordings" in said[0], r.notes


def test_refusals(phone: Arrays) -> None:
    gyr, acc, mag, t = (phone[name] for name in ("gyr", "acc", "mag", "t"))
    gravity = phone["axes"].transpose(0, 2, 1) @ [0.0, 0.0, 9.81]
    rolls = np.tile([1.0, 0.0, 0.0], (3000, 1)), 9.81 * np.stack([0 * t, np.sin(t), np.cos(t)], axis=1)
    for arguments, options, sentence in [
        ((bad(gyr, 17, np.nan), acc), {}, r"gyr: row 17 is \(.*nan.*\), not finite; leave such samples out"),
        ((gyr, bad(bad(acc, 30, np.inf), 21, np.nan)), {}, r"acc: row 21 .* not finite, and 1 more"),
        ((gyr, acc, bad(mag, 0, np.nan)), {}, "mag: row 0 .* not finite"),
        ((gyr.T, acc), {}, r"gyr: shape \(3, 3000\); expected angular rates in rad/s, shape \(N, 3\); transpose it"),
        ((gyr, acc[:, :2]), {}, r"acc: shape \(3000, 2\); expected specific forces"),
        ((gyr, acc[:100]), {}, "acc: 100 rows, but gyr has 3000"),
        ((gyr, "acc"), {}, "acc: not an array of numbers"),
        ((gyr, [[1.0, 2.0, "x"]]), {}, "acc: not an array of numbers"),
        ((gyr[:0], acc[:0]), {}, "gyr: no rows"),
        ((gyr, acc / 9.81), {}, r'accelerometer: the median norm .* looks like g; if so, use accelerometer_unit="g"'),
        ((np.degrees(gyr) * 10, acc), {}, r'gyroscope: .* deg/s; if so, use gyroscope_unit="deg-per-s"'),
        ((gyr, acc, mag * 1e-6), {}, r'magnetometer: .* tesla; if so, use magnetometer_unit="tesla"'),
        ((gyr, acc), {"rate": 0.0}, "rate=0.0: expected samples a second"),
        ((gyr, acc), {"rate": None}, "time is missing: give rate= in Hz, or t="),
        ((gyr, acc), {"t": t}, "give rate= or t=, not both"),
        ((gyr, acc), {"rate": None, "t": t[:-1]}, "t: shape .*expected one stamp for each of 3000 rows"),
        ((gyr, acc), {"rate": None, "t": bad(t[:, None].repeat(2, 1), 7, 0.0)[:, 1]}, "t: row 7 is not later than the row before"),
        ((gyr, acc), {"rate": None, "t": bad(t[:, None].repeat(2, 1), 9, np.nan)[:, 1]}, "t: row 9 is nan"),
        ((gyr, acc), {"estimator": "kalman"}, 'estimator="kalman": unknown estimator `kalman`; expected one of'),
        ((gyr, acc), {"profile": "car"}, "unknown profile `car`"),
        ((gyr, acc), {"acelerometer_std": 1.0}, "did you mean `accelerometer_std`"),
        ((gyr, acc), {"estimator": "mekf", "bounded_velocity_psd": 1.0}, "has no effect on `mekf`"),
        ((gyr, acc), {"estimator": "mekf", "accelerometer_std": -1.0}, "expected a number from 1e-6"),
        ((gyr, acc), {"estimator": "usque", "smooth": True}, "no smoother for `usque`"),
        ((gyr, acc), {"frame": "nwu"}, 'frame="nwu": expected enu or ned'),
        ((gyr[:20], acc[:20]), {}, "too short"),
        ((gyr, np.ma.masked_array(acc, mask=np.arange(9000).reshape(3000, 3) == 36)), {}, "acc: row 12 .* not finite"),
        ((gyr, acc), {"rate": None, "t": np.rint(t * 1e6).astype(np.int64)}, "integers are nanoseconds.*microseconds by 1000"),
        ((gyr, acc), {"rate": None, "t": bad_date(t, 5)}, "t: row 5 is NaT"),
        ((-rolls[0], rolls[1]), {}, "gravity turns the other way .* signs look reversed"),
        ((gyr, acc - gravity), {}, "acceleration without gravity"),
        ((gyr, acc, mag * 1e3), {}, 'nanotesla; if so, use magnetometer_unit="nanotesla"'),
        ((gyr, acc, mag * 1e-3), {}, 'millitesla; if so, use magnetometer_unit="millitesla"'),
    ]:
        with pytest.raises(ValueError) as refused:
            no.attitude(*arguments, **{"rate": 100.0, **options})
        said = str(refused.value)
        assert re.search(sentence, said), said
        assert "--" not in said, said


def test_units_that_are_named_are_converted(phone: Arrays) -> None:
    converted = quat(np.degrees(phone["gyr"]), phone["acc"] / 9.80665, gyroscope_unit="deg-per-s", accelerometer_unit="g")
    np.testing.assert_allclose(converted[100:], quat(phone["gyr"], phone["acc"])[100:], atol=1e-9)


def test_recordings(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="cannot open it"):
        no.open(tmp_path / "no.csv")
    with pytest.raises(ValueError, match='format="tape"'):
        no.open(tmp_path / "no.csv", format="tape")
    rows = "\n".join(f"{k / 100:.2f},0.01,0,0,0,0,9.81" for k in range(500))
    names = ["gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s", "acc_x_m_s2", "acc_y_m_s2", "acc_z_m_s2"]
    path = tmp_path / "table.csv"
    path.write_text(f"t_s,{','.join(names)}\n{rows}\n")
    recording = no.open(path)
    assert recording.sensors == ["gyroscope", "accelerometer"] and recording.frame == "enu" and recording.format == "csv"
    samples = recording.arrays("gyroscope")
    assert samples.columns == ["x_rad_s", "y_rad_s", "z_rad_s"] and samples.values.shape == (500, 3)
    np.testing.assert_allclose(samples.t, np.arange(500) / 100)
    with pytest.raises(ValueError, match="no sensor `barometer`; it has gyroscope, accelerometer"):
        recording.arrays("barometer")
    with pytest.raises(ValueError, match="gnss_every has no effect on an estimator of the attitude alone"):
        recording.run("mekf", gnss_every=2)
    with pytest.raises(ValueError, match="profile has no effect on `error-state`"):
        recording.run("error-state", profile="lab")
    with pytest.raises(ValueError, match="no usable fix"):
        recording.run("error-state")
    # A table of somebody's own: columns and units are guessed, and said.
    own = tmp_path / "own.txt"
    turning = [2.0 * math.cos(k / 50) for k in range(1000)]
    angles = [math.sin(k / 50) for k in range(1000)]
    own.write_text("ms;gx;gy;gz;ax;ay;az\n" + "".join(
        f"{10 * k};{math.degrees(w):.5f};0;0;0;{math.sin(a):.6f};{math.cos(a):.6f}\n"
        for k, (w, a) in enumerate(zip(turning, angles))))
    with pytest.raises(ValueError, match="northing describe"):
        no.open(own)
    guessed = no.open(own, describe=True)
    np.testing.assert_allclose(guessed.arrays("gyroscope").values[:, 0], turning, atol=1e-6)
    assert any("gyroscope from gx, gy, gz" in issue for issue in guessed.run("mekf").summary["issues"])


def test_tables_plots_reports_and_files(phone: Arrays, tmp_path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    r = no.attitude(phone["gyr"], phone["acc"], phone["mag"], rate=100.0)
    frame = r.to_pandas()
    assert len(frame) == 3000 and list(r.to_polars().columns) == list(frame.columns)
    np.testing.assert_array_equal(frame["qw"].to_numpy(), r.quat[:, 0])
    assert len(r.plot().axes) == 3
    with pytest.raises(ValueError, match="read-only"):
        r.quat[0, 0] = 1.0
    r.report(tmp_path / "r.html")
    assert "<svg" in (tmp_path / "r.html").read_text()
    with pytest.raises(FileExistsError, match="force=True"):
        r.report(tmp_path / "r.html")
    r.report(tmp_path / "r.html", force=True)
    r.save(tmp_path / "r.csv")
    assert len(pandas.read_csv(tmp_path / "r.csv")) == 3000 - r.undefined
    with pytest.raises(ValueError, match=r"\.csv, \.parquet, \.tum or \.mcap"):
        r.save(tmp_path / "r.txt")


def test_the_names_of_vqf(phone: Arrays) -> None:
    from northing.vqf import VQF

    answer = VQF(0.01).updateBatch(phone["gyr"], phone["acc"], phone["mag"])
    np.testing.assert_array_equal(answer["quat9D"], quat(phone["gyr"], phone["acc"], phone["mag"], rate=None, t=phone["t"]))
    np.testing.assert_array_equal(answer["quat6D"], quat(phone["gyr"], phone["acc"], rate=None, t=phone["t"]))
    assert answer["biasSigma"].shape == (3000,) and answer["bias"].shape == (3000, 3)
    assert "quat9D" not in VQF(gyrTs=0.01).updateBatch(phone["gyr"], phone["acc"])
    with pytest.raises(ValueError, match="gyrTs=0"):
        VQF(0)


def test_estimators_are_the_programs() -> None:
    names = [one["name"] for one in no.estimators()]
    assert {"bounded-velocity", "mekf", "error-state"} <= set(names)
    assert all(parameter["meaning"] for one in no.estimators() for parameter in one["parameters"])


def mypy(folder: Path, *arguments: str, tool: str = "mypy") -> subprocess.CompletedProcess[str]:
    package = Path(no.__file__).parents[1]
    # An installed package is found by itself, one beside the interpreter is not.
    beside = {} if package.name == "site-packages" else {"MYPYPATH": str(package)}
    words = [sys.executable, "-m", tool, *(["--strict"] if tool == "mypy" else []), *arguments]
    return subprocess.run(words, cwd=folder, env={**os.environ, **beside}, capture_output=True, text=True, check=False)


def test_types(tmp_path: Path) -> None:
    """The package and a user's script pass `mypy --strict`; what is not there is an error."""
    checked = mypy(tmp_path, "-p", "northing")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    (tmp_path / "user.py").write_text("""\
import numpy as np
import northing as no

r = no.attitude(np.zeros((9, 3)), [[0.0, 0.0, 9.81]] * 9, rate=100.0)
q: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = r.quat
nis: float = no.Mekf(no.AttitudeConfig.lab()).accelerometer(0, [0.0, 0.0, 9.81]).nis
r.no_such_name
""")
    errors = [line for line in mypy(tmp_path, "user.py").stdout.splitlines() if "error:" in line]
    assert len(errors) == 1 and '"Attitude" has no attribute "no_such_name"' in errors[0], errors


def test_stubs_say_what_is_there(tmp_path: Path) -> None:
    """Names, parameters and defaults of the compiled part are those of its stubs."""
    checked = mypy(tmp_path, "--concise", "northing", tool="mypy.stubtest")
    assert checked.returncode == 0, checked.stdout + checked.stderr
