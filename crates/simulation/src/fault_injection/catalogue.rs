//! The catalogue of faults that are injected: kind, size, duration and sensor of each.

use super::Effect::{BiasStep, FixOff, Frozen, Garbage, Missing, StampAhead, Zeros};
use super::{Effect, InjectedFault, InjectionTarget};

/// 2000 deg/s.
const GYROSCOPE_FULL_SCALE: f64 = 34.9;
/// 16 g.
const ACCELEROMETER_FULL_SCALE: f64 = 156.9;
/// Several times the Earth's field.
const FIELD_SPIKE_UT: f64 = 500.0;
/// What a broken bus delivers: rad/s, m/s^2, microtesla.
const GARBAGE: [f64; 3] = [5.0, 20.0, 50.0];

/// No axis beyond half of what the motion has.
const HALF_CLIPPED: Effect = Effect::ClippedShare { share: 0.5 };
/// Faster than the gyroscope's range.
const CLIPPED_SPIN: Effect = Effect::ClippedSpin {
    rate_rad_s: 60.0,
    full_scale: GYROSCOPE_FULL_SCALE,
};

/// Every fault, in the order of tables.
pub const CATALOGUE: [InjectedFault; 24] = [
    gyroscope("gyroscope-spike", spike(GYROSCOPE_FULL_SCALE)),
    gyroscope("gyroscope-spike-all-axes", spikes(GYROSCOPE_FULL_SCALE)),
    accelerometer("accelerometer-spike", spike(ACCELEROMETER_FULL_SCALE)),
    magnetometer("magnetometer-spike", spike(FIELD_SPIKE_UT)),
    gyroscope("gyroscope-stamp-ahead", StampAhead { by_s: 3600.0 }),
    gyroscope("gyroscope-frozen-3s", Frozen).for_seconds(3.0),
    gyroscope("gyroscope-frozen-10s", Frozen).for_seconds(10.0),
    gyroscope("gyroscope-zeros-3s", Zeros).for_seconds(3.0),
    gyroscope("gyroscope-zeros-10s", Zeros).for_seconds(10.0),
    gyroscope("gyroscope-clipped-3s", HALF_CLIPPED).for_seconds(3.0),
    gyroscope("gyroscope-clipped-spin-3s", CLIPPED_SPIN).for_seconds(3.0),
    gyroscope("gyroscope-bias-0.05", BiasStep { size: 0.05 }),
    gyroscope("gyroscope-bias-0.1", BiasStep { size: 0.1 }),
    gyroscope("gyroscope-missing-3s", Missing).for_seconds(3.0),
    all("all-missing-3s", Missing).for_seconds(3.0),
    accelerometer("accelerometer-frozen-3s", Frozen).for_seconds(3.0),
    accelerometer("accelerometer-clipped-3s", HALF_CLIPPED).for_seconds(3.0),
    accelerometer("accelerometer-bias-0.5", BiasStep { size: 0.5 }),
    accelerometer("accelerometer-missing-3s", Missing).for_seconds(3.0),
    magnetometer("magnetometer-frozen-10s", Frozen).for_seconds(10.0),
    all("all-garbage-20s", Garbage { std: GARBAGE }).for_seconds(20.0),
    receiver("fix-10km-off", FixOff { north_m: 1e4 }),
    receiver("receiver-frozen-30s", Frozen).for_seconds(30.0),
    receiver("receiver-missing-30s", Missing).for_seconds(30.0),
];

const fn gyroscope(name: &'static str, effect: Effect) -> InjectedFault {
    InjectedFault::once(name, InjectionTarget::Gyroscope, effect)
}

const fn accelerometer(name: &'static str, effect: Effect) -> InjectedFault {
    InjectedFault::once(name, InjectionTarget::Accelerometer, effect)
}

const fn magnetometer(name: &'static str, effect: Effect) -> InjectedFault {
    InjectedFault::once(name, InjectionTarget::Magnetometer, effect)
}

const fn all(name: &'static str, effect: Effect) -> InjectedFault {
    InjectedFault::once(name, InjectionTarget::All, effect)
}

const fn receiver(name: &'static str, effect: Effect) -> InjectedFault {
    InjectedFault::once(name, InjectionTarget::Receiver, effect)
}

/// On one axis.
const fn spike(value: f64) -> Effect {
    Effect::Spike {
        value,
        all_axes: false,
    }
}

/// On all axes.
const fn spikes(value: f64) -> Effect {
    Effect::Spike {
        value,
        all_axes: true,
    }
}

impl InjectedFault {
    /// Of one sample, or for good.
    const fn once(name: &'static str, target: InjectionTarget, effect: Effect) -> Self {
        Self {
            name,
            target,
            effect,
            duration_s: 0.0,
        }
    }

    const fn for_seconds(self, duration_s: f64) -> Self {
        Self { duration_s, ..self }
    }
}
