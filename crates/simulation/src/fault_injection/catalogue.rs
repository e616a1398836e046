//! The catalogue of faults that are injected: kind, size, duration and sensor of each.

use super::{Effect, FaultySensor, InjectedFault};
use FaultySensor::{Accelerometer, All, Gyroscope, Magnetometer, Receiver};

/// 2000 deg/s.
const GYROSCOPE_FULL_SCALE: f64 = 34.9;
/// 16 g.
const ACCELEROMETER_FULL_SCALE: f64 = 156.9;
/// Several times the Earth's field.
const FIELD_SPIKE_UT: f64 = 500.0;
/// What a broken bus delivers: rad/s, m/s^2, microtesla.
const GARBAGE: [f64; 3] = [5.0, 20.0, 50.0];

const fn row(
    name: &'static str,
    sensor: FaultySensor,
    effect: Effect,
    duration_s: f64,
) -> InjectedFault {
    InjectedFault {
        name,
        sensor,
        effect,
        duration_s,
    }
}

const fn spike(value: f64, all_axes: bool) -> Effect {
    Effect::Spike { value, all_axes }
}

const fn step(size: f64) -> Effect {
    Effect::BiasStep { size }
}

/// Every fault, in the order of tables.
pub const CATALOGUE: [InjectedFault; 24] = [
    row(
        "gyroscope-spike",
        Gyroscope,
        spike(GYROSCOPE_FULL_SCALE, false),
        0.0,
    ),
    row(
        "gyroscope-spike-all-axes",
        Gyroscope,
        spike(GYROSCOPE_FULL_SCALE, true),
        0.0,
    ),
    row(
        "accelerometer-spike",
        Accelerometer,
        spike(ACCELEROMETER_FULL_SCALE, false),
        0.0,
    ),
    row(
        "magnetometer-spike",
        Magnetometer,
        spike(FIELD_SPIKE_UT, false),
        0.0,
    ),
    row(
        "gyroscope-stamp-ahead",
        Gyroscope,
        Effect::StampAhead { by_s: 3600.0 },
        0.0,
    ),
    row("gyroscope-frozen-3s", Gyroscope, Effect::Frozen, 3.0),
    row("gyroscope-frozen-10s", Gyroscope, Effect::Frozen, 10.0),
    row("gyroscope-zeros-3s", Gyroscope, Effect::Zeros, 3.0),
    row("gyroscope-zeros-10s", Gyroscope, Effect::Zeros, 10.0),
    row(
        "gyroscope-clipped-3s",
        Gyroscope,
        Effect::ClippedShare { share: 0.5 },
        3.0,
    ),
    row(
        "gyroscope-clipped-spin-3s",
        Gyroscope,
        Effect::ClippedSpin {
            rate_rad_s: 60.0,
            full_scale: GYROSCOPE_FULL_SCALE,
        },
        3.0,
    ),
    row("gyroscope-bias-0.05", Gyroscope, step(0.05), 0.0),
    row("gyroscope-bias-0.1", Gyroscope, step(0.1), 0.0),
    row("gyroscope-missing-3s", Gyroscope, Effect::Missing, 3.0),
    row("all-missing-3s", All, Effect::Missing, 3.0),
    row(
        "accelerometer-frozen-3s",
        Accelerometer,
        Effect::Frozen,
        3.0,
    ),
    row(
        "accelerometer-clipped-3s",
        Accelerometer,
        Effect::ClippedShare { share: 0.5 },
        3.0,
    ),
    row("accelerometer-bias-0.5", Accelerometer, step(0.5), 0.0),
    row(
        "accelerometer-missing-3s",
        Accelerometer,
        Effect::Missing,
        3.0,
    ),
    row(
        "magnetometer-frozen-10s",
        Magnetometer,
        Effect::Frozen,
        10.0,
    ),
    row(
        "all-garbage-20s",
        All,
        Effect::Garbage { std: GARBAGE },
        20.0,
    ),
    row(
        "fix-10km-off",
        Receiver,
        Effect::FixOff { north_m: 1e4 },
        0.0,
    ),
    row("receiver-frozen-30s", Receiver, Effect::Frozen, 30.0),
    row("receiver-missing-30s", Receiver, Effect::Missing, 30.0),
];
