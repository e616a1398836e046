"""A long stream in flat memory: feeds a filter so many inertial samples, one call each, and prints time and memory.

    python crates/python/tests/flat_memory.py 100000000 [bounded-velocity|mekf|gnss-ins]
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable

import northing as no

# Samples of a turn that comes back to where it began, again and again.
PERIOD = 1000
TURN = [0.5 * math.sin(2 * math.pi * k / PERIOD) for k in range(PERIOD)]
ANGLE = [0.5 * PERIOD / (2 * math.pi) * 0.01 * (1 - math.cos(2 * math.pi * k / PERIOD)) for k in range(PERIOD)]
UP = [(0.0, 9.81 * math.sin(a), 9.81 * math.cos(a)) for a in ANGLE]
DOWN = [(0.0, -y, -z) for _, y, z in UP]
RATE = [(w, 0.0, 0.0) for w in TURN]


def resident_mb() -> float:
    """Memory of this process that is in RAM, MB."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


def feeder(name: str) -> Callable[[int], None]:
    """What hands sample k to the filter of that name."""
    if name == "gnss-ins":
        ins = no.GnssIns()

        def feed(k: int) -> None:
            ins.imu(k * 10_000_000, RATE[k % PERIOD], DOWN[k % PERIOD])
            if k % 100 == 0:
                ins.gnss_position(k * 10_000_000, 48.0, 9.0, 300.0, std=2.0)

        return feed
    stream = no.Mekf() if name == "mekf" else no.BoundedVelocity()

    def feed_attitude(k: int) -> None:
        stream.gyroscope(k * 10_000_000, RATE[k % PERIOD])
        stream.accelerometer(k * 10_000_000, UP[k % PERIOD])

    return feed_attitude


def run(samples: int, name: str, told: bool = False) -> tuple[float, float]:
    """Memory after the first hundredth and at the end, MB."""
    feed, began, first = feeder(name), time.perf_counter(), 0.0
    for k in range(samples):
        feed(k)
        if k == samples // 100:
            first = resident_mb()
        if told and k and k % (samples // 10) == 0:
            print(f"{k} samples, {time.perf_counter() - began:.0f} s, {resident_mb():.1f} MB", flush=True)
    return first, resident_mb()


if __name__ == "__main__":
    count, which = int(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "mekf"
    start = time.perf_counter()
    early, late = run(count, which, told=True)
    print(f"{which}: {count} samples in {time.perf_counter() - start:.0f} s; {early:.1f} MB early, {late:.1f} MB at the end")
    sys.exit(late > early + 4.0)
