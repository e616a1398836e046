"""Estimators sample by sample: equal to the batch, pickled in the middle, on two threads at once."""

from __future__ import annotations

import copy
import pickle
import threading
import time
from typing import Any

import numpy as np
import pytest

import flat_memory
import northing as no

Arrays = dict[str, np.ndarray]
FILTERS = [(no.BoundedVelocity, no.BoundedVelocityConfig, "bounded-velocity"), (no.Mekf, no.AttitudeConfig, "mekf")]


def feed(stream: Any, phone: Arrays, rows: range) -> None:
    for k in rows:
        time_ns = k * 10_000_000
        stream.gyroscope(time_ns, phone["gyr"][k])
        stream.accelerometer(time_ns, phone["acc"][k])
        stream.magnetometer(time_ns, phone["mag"][k])


@pytest.mark.parametrize(("stream_type", "config_type", "name"), FILTERS)
def test_a_stream_is_the_batch_to_the_bit_and_goes_on_from_a_pickle(
    phone: Arrays, stream_type: Any, config_type: Any, name: str
) -> None:
    batch = no.attitude(phone["gyr"], phone["acc"], phone["mag"], rate=100.0, estimator=name)
    stream = stream_type(config_type.hand_held())
    assert stream.quat is None and stream.covariance is None and not stream.is_started
    for start in (0, 20, 100, 1500):  # before, within and after the alignment
        stop = {0: 20, 20: 100, 100: 1500, 1500: 3000}[start]
        again = pickle.loads(pickle.dumps(stream))
        assert again.config == stream.config and again.state == stream.state
        state = stream.state
        feed(stream, phone, range(start, stop))
        feed(again, phone, range(start, stop))
        np.testing.assert_array_equal(again.covariance if again.is_started else 0, stream.covariance if stream.is_started else 0)
        other = stream_type(config_type.hand_held())
        other.state = state
        feed(other, phone, range(start, stop))
        assert other.state == stream.state == again.state
    np.testing.assert_array_equal(stream.quat, batch.quat[-1])
    np.testing.assert_array_equal(stream.covariance, batch.covariance[-1])
    np.testing.assert_array_equal(stream.gyro_bias, batch.gyro_bias[-1])
    assert copy.deepcopy(stream).state == stream.state


def test_every_update_returns_its_innovation(phone: Arrays) -> None:
    mekf = no.Mekf(no.AttitudeConfig.lab())
    assert mekf.gyroscope(0, phone["gyr"][0]) is None
    told = mekf.accelerometer(0, phone["acc"][0])
    assert (told.outcome, told.reason) == ("skipped", "not initialised")
    feed(mekf, phone, range(1, 200))
    told = mekf.accelerometer(2_000_000_000, phone["acc"][200])
    assert told.outcome == "fused" and told.degrees_of_freedom == 3 and told.reason is None
    expected = told.residual @ np.linalg.solve(told.covariance, told.residual)
    assert told.nis == pytest.approx(expected, rel=1e-6)
    assert mekf.accelerometer(2_000_000_000, phone["acc"][200]).reason == "time stamp repeated or going back"
    assert mekf.accelerometer(2_010_000_000, [np.nan, 0.0, 9.81]).reason == "not a finite number"


def test_configurations() -> None:
    config = no.BoundedVelocityConfig.hand_held(velocity_psd=0.03)
    assert config.velocity_psd == 0.03 and config.to_dict()["velocity_psd"] == 0.03
    assert pickle.loads(pickle.dumps(config)) == config != no.BoundedVelocityConfig.hand_held()
    assert no.AttitudeConfig.lab() == no.AttitudeConfig("lab")
    assert "accelerometer_std" in dir(no.AttitudeConfig.lab())
    config.velocity_psd = 0.04
    assert no.BoundedVelocity(config).config.velocity_psd == 0.04
    with pytest.raises(AttributeError, match="no parameter `speed`; there are"):
        config.speed = 1.0
    with pytest.raises(AttributeError, match="no parameter `speed`"):
        config.speed
    with pytest.raises(ValueError, match="velocity_psd=-1.0: expected"):
        config.velocity_psd = -1.0
    with pytest.raises(TypeError, match="velocity_psd=much: expected"):
        config.velocity_psd = "much"
    with pytest.raises(ValueError, match='no profile "car"'):
        no.AttitudeConfig("car")
    with pytest.raises(ValueError, match="state: "):
        no.Mekf().state = "{}"


def test_two_threads_run_at_the_same_time(phone: Arrays) -> None:
    """While one thread estimates, another one runs: the interpreter is free."""
    long = {name: np.concatenate([phone[name]] * 40) for name in ("gyr", "acc", "mag")}
    expected = no.attitude(long["gyr"], long["acc"], long["mag"], rate=100.0).quat
    results: list[np.ndarray] = []
    spans: list[tuple[float, float]] = []

    def estimate() -> None:
        began = time.perf_counter()
        results.append(no.attitude(long["gyr"], long["acc"], long["mag"], rate=100.0).quat)
        spans.append((began, time.perf_counter()))

    threads = [threading.Thread(target=estimate) for _ in range(2)]
    for thread in threads:
        thread.start()
    counted = 0
    while any(thread.is_alive() for thread in threads):
        counted += 1
        time.sleep(0.001)
    for thread in threads:
        thread.join()
    for result in results:
        np.testing.assert_array_equal(result, expected)
    (a, b), (c, d) = spans
    assert max(a, c) < min(b, d), spans
    # Held for the whole run the interpreter would not have come here more than a few times.
    assert counted > 20, (counted, spans)


@pytest.mark.parametrize("name", ["mekf", "bounded-velocity", "gnss-ins"])
def test_a_long_stream_stays_in_flat_memory(name: str) -> None:
    """A sample of the command in flat_memory.py, which takes 100 million."""
    early, late = flat_memory.run(200_000, name)
    assert late < early + 4.0, (early, late)


def test_inputs_of_streams_may_be_lists_tuples_single_precision_and_strided(phone: Arrays) -> None:
    expected = no.Mekf()
    expected.gyroscope(0, phone["gyr"][0])
    wide = np.zeros((3, 6), dtype=np.float32)
    wide[0, ::2] = phone["gyr"][0]
    for rate in (list(phone["gyr"][0]), tuple(phone["gyr"][0]), phone["gyr"].astype(np.float32)[0], wide[0, ::2]):
        stream = no.Mekf()
        assert stream.gyroscope(0, rate) is None
    with pytest.raises((TypeError, ValueError)):
        no.Mekf().gyroscope(0, [1.0, 2.0])
    with pytest.raises(TypeError):
        no.Mekf().gyroscope(0.5, [1.0, 2.0, 3.0])
