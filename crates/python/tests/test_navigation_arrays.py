"""Navigation over arrays: equal to the run over the file that holds them, and what it refuses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import northing as no


@pytest.fixture(scope="module")
def car() -> Any:
    return no.virtual_vehicle("car-smooth", seed=4, duration=90.0)


def given(car: Any, **changes: Any) -> dict[str, Any]:
    """What a run over the vehicle's arrays takes."""
    all_of_it = {
        "gyr": car["gyr"],
        "acc": car["acc"],
        "gnss": car["gnss_geodetic"],
        "t": car["gyr_time_ns"],
        "gnss_t": car["gnss_time_ns"],
        "gnss_std": car["gnss_std"],
    }
    return {**all_of_it, **changes}


def test_arrays_give_the_digits_of_the_file_that_holds_them(car: Any, tmp_path: Path) -> None:
    of_file = car.save(tmp_path / "car.csv").run("error-state", gnss_every=4)
    velocity = {}
    if "gnss_velocity" in car:
        velocity = {
            "velocity": car["gnss_velocity"],
            "velocity_t": car["gnss_velocity_time_ns"],
            "velocity_std": car["gnss_velocity_std"],
        }
    track = no.navigation(**given(car, **velocity), gnss_every=4)
    np.testing.assert_array_equal(track.time_ns, of_file.time_ns)
    # Degrees are written to the last digit of a metre, not of a number.
    np.testing.assert_allclose(track.ned, of_file.ned, atol=1e-6)
    np.testing.assert_allclose(track.covariance, of_file.covariance, rtol=1e-6, atol=1e-9)
    assert track.validity == of_file.validity
    assert track.summary["position"]["horizontal_rmse_m"] < 5.0
    track.report(tmp_path / "car.html")
    track.save(tmp_path / "car.kml")
    assert (tmp_path / "car.html").stat().st_size > 10_000


def test_it_is_near_the_truth_and_its_smoother_nearer(car: Any) -> None:
    every_fourth = {"gnss_every": 4}
    filtered, smoothed = (no.navigation(**given(car), smooth=smooth, **every_fourth) for smooth in (False, True))
    truth = car["true_ned"]

    def rms(track: no.Track) -> float:
        rows = np.searchsorted(car["true_time_ns"], track.time_ns).clip(0, len(truth) - 1)
        late = track.time_ns > track.time_ns[0] + 20_000_000_000
        # Of the first fix, and of the unit: both constant.
        off = (track.ned - truth[rows])[late, :2]
        return float(np.sqrt((np.square(off - off.mean(axis=0))).sum(axis=1).mean()))

    assert rms(smoothed) < rms(filtered) < 4.0


def test_one_number_states_all_standard_deviations_and_seconds_are_taken(car: Any) -> None:
    start = car["gyr_time_ns"][0]
    seconds = {"t": (car["gyr_time_ns"] - start) * 1e-9, "gnss_t": (car["gnss_time_ns"] - start) * 1e-9}
    track = no.navigation(**given(car, gnss_std=0.5, **seconds))
    assert len(track) > 1000 and track.summary["fixes_used"] > 10
    none_stated = no.navigation(**given(car, gnss_std=None))
    assert none_stated.summary["fixes_used"] > 10


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"gnss": np.zeros((3, 2))}, r"gnss: shape \(3, 2\); expected latitude and longitude"),
        ({"gnss_t": [0.0]}, "gnss_t: shape"),
        ({"acc": None}, "acc is missing"),
        ({"gnss_std": -1.0}, "gnss_std: row 0"),
        ({"gnss_std": [1.0, 2.0]}, "gnss_std: shape"),
        ({"velocity_std": 0.1}, "given without velocity"),
        ({"estimator": "mekf"}, "mekf"),
        ({"lever_arm": 1.0}, "lever_arm"),
    ],
)
def test_what_cannot_be_is_refused(car: Any, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        no.navigation(**given(car, **changes))


def test_a_fix_that_is_not_finite_and_radians_are_refused_with_the_place(car: Any) -> None:
    broken = car["gnss_geodetic"].copy()
    broken[7, 1] = np.nan
    with pytest.raises(ValueError, match="gnss: row 7"):
        no.navigation(**given(car, gnss=broken))
    without_height = car["gnss_geodetic"].copy()
    without_height[3:, 2] = np.nan
    std = car["gnss_std"].copy()
    std[3:, 2] = np.nan
    assert len(no.navigation(**given(car, gnss=without_height, gnss_std=std))) > 1000
