"""How long an estimate takes from its sample over DDS and back, and whether one is lost.

    python ros_latency.py PROGRAM [SECONDS]      60 s by default, on a machine that does nothing else

100 samples of an inertial sensor and 5 fixes in a second; the estimator is error-state. The time runs from the peer's call
of its writer to its call of its reader, which looks every half millisecond.
"""

from __future__ import annotations

import math
import sys
import time

import ros_peer as ros


def main(program: str, seconds: float = 60.0) -> None:
    with ros.Node(program, "--domain", 99, "--estimator", "error-state", "--rate", 10000) as running:
        peer = ros.Peer(99)
        imu = peer.writer("imu/data_raw", ros.Imu, ros.BEST_EFFORT)
        fix = peer.writer("fix", ros.NavSatFix, ros.BEST_EFFORT)
        reader = peer.reader("imu/data", ros.Imu)
        ros.matched(running, peer)
        sent: dict[int, float] = {}
        took: dict[int, float] = {}

        def take() -> None:
            for message in reader.take(500):
                took.setdefault(ros.stamp(message), time.perf_counter() - sent[ros.stamp(message)])

        begin, first = time.monotonic(), time.time_ns()
        for step in range(int(seconds * 100)):
            while time.monotonic() < begin + 0.01 * step:
                take()
                time.sleep(0.0005)
            time_ns = first + step * 10_000_000
            turn = 0.1 if step > 300 else 0.0
            sent[time_ns] = time.perf_counter()
            imu.write(ros.imu(time_ns, [0.0, 0.0, turn], [0.0, 0.0, 9.81]))
            if step % 20 == 0:
                fix.write(ros.fix(time_ns, 48.0 + 1e-6 * math.sin(step), 9.0, 300.0, std=1.0))
        time.sleep(0.5)
        take()
        told = running.stop()
    print("\n".join(line for line in told.splitlines() if "messages taken" in line))
    milliseconds = sorted(1e3 * one for one in took.values())
    at = {share: milliseconds[min(int(share * len(milliseconds)), len(milliseconds) - 1)] for share in (0.5, 0.99, 1.0)}
    print(f"{len(took)} estimates of {len(sent)} samples; latency median {at[0.5]:.2f} ms, 99 % {at[0.99]:.2f} ms, most {at[1.0]:.2f} ms")


if __name__ == "__main__":
    main(sys.argv[1], *map(float, sys.argv[2:]))
