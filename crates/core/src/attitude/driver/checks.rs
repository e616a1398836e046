//! What the checks of the samples remember and find: which samples may be used, and which faults are told.

use nalgebra::Vector3;

use super::holes::{LOST_RAD, NOTABLE_RAD};
use super::{AttitudeDriver, AttitudeEstimator};
use crate::faults::bias_step::BiasWatch;
use crate::faults::clipping::{Clipped, Clipping};
use crate::faults::rate_noise::RateNoise;
use crate::faults::sample_check::{Checked, SampleCheck};
use crate::faults::unseen_rotation::UnseenRotation;
use crate::faults::{Fault, FaultKind, FaultLog, FaultySensor};
use crate::kalman::SkipReason;
use crate::scalar::{Scalar, lit, seconds};

/// Longer samples are no measurements (m/s^2, microtesla).
const LONGEST_SAMPLE: f64 = 1e6;
/// A field that repeats itself counts as measured again after this time: loggers tell a slow magnetometer's last value again for less.
const HELD_FIELD_NS: i64 = 1_000_000_000;
/// A spike of the accelerometer is one from here on, m/s^2; one of the magnetometer, as a share of the field.
const NOTABLE_FORCE: f64 = 40.0;
const NOTABLE_FIELD_SHARE: f64 = 0.5;

/// Whether a field is the one before, told again: many a table repeats the last one until the next comes. One that stays the same for
/// longer, as coarse values do at rest, counts once in [`HELD_FIELD_NS`].
fn is_told_again<T: Scalar>(
    check: &SampleCheck<T>,
    sensor: FaultySensor,
    time_ns: i64,
    before_ns: Option<i64>,
) -> bool {
    let (Some(since_ns), Some(before_ns)) = (check.repeats_since_ns(), before_ns) else {
        return false;
    };
    let times = |ns: i64| ns.saturating_sub(since_ns) / HELD_FIELD_NS;
    sensor == FaultySensor::Magnetometer && times(time_ns) == times(before_ns)
}

/// What the checks remember, and the hole or the fault under way.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Checks<T: Scalar> {
    pub(super) gyroscope: SampleCheck<T>,
    pub(super) accelerometer: SampleCheck<T>,
    pub(super) magnetometer: SampleCheck<T>,
    /// Of the gyroscope.
    clipping: Clipping<T>,
    pub(super) noise: RateNoise<T>,
    pub(super) motion: UnseenRotation<T>,
    pub(super) bias: BiasWatch<T>,
    pub(super) log: FaultLog<T>,
    /// Turn (rad) since the last rate, and the variance that was added for what was not seen (rad^2).
    pub(super) turned: Vector3<T>,
    pub(super) hole_variance: T,
    /// The gyroscope is at the end of its range.
    saturation: Option<Saturation<T>>,
}

/// Time at the end of the range, and the variance that was added for what was not seen (rad^2).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Saturation<T: Scalar> {
    since_ns: i64,
    variance: T,
}

impl<T: Scalar> Checks<T> {
    pub(super) fn new(angle_random_walk: T) -> Self {
        Self {
            gyroscope: SampleCheck::of_gyroscope(),
            accelerometer: SampleCheck::of_accelerometer(),
            magnetometer: SampleCheck::default(),
            clipping: Clipping::default(),
            noise: RateNoise::default(),
            motion: UnseenRotation::new(angle_random_walk),
            bias: BiasWatch::default(),
            log: FaultLog::default(),
            turned: Vector3::zeros(),
            hole_variance: T::zero(),
            saturation: None,
        }
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let checks = [&self.gyroscope, &self.accelerometer, &self.magnetometer];
        let checks = checks.into_iter().flat_map(SampleCheck::numbers);
        let saturation = self
            .saturation
            .iter()
            .map(|saturation| &saturation.variance);
        let own = self
            .turned
            .iter()
            .chain([&self.hole_variance])
            .chain(saturation)
            .chain(self.clipping.numbers());
        let motion = self.motion.numbers().chain(self.bias.numbers());
        let motion = motion.chain(self.noise.numbers());
        checks.chain(motion).chain(self.log.numbers()).chain(own)
    }

    /// Whether the gyroscope is at the end of its range.
    pub(super) const fn is_saturated(&self) -> bool {
        self.saturation.is_some()
    }

    /// Whether a sample of a vector sensor may be used; `NotNewer` is found before.
    pub(super) fn permits(
        &mut self,
        sensor: FaultySensor,
        time_ns: i64,
        sample: &Vector3<T>,
    ) -> Result<(), SkipReason> {
        // What no sensor measures is the estimator's to refuse, and no neighbour of a sample.
        let is_measured = sample.norm_squared() <= lit(LONGEST_SAMPLE * LONGEST_SAMPLE);
        if !is_measured {
            return Ok(());
        }
        let check = match sensor {
            FaultySensor::Magnetometer => &mut self.magnetometer,
            _ => &mut self.accelerometer,
        };
        let fault = |kind, from_ns, size| Fault {
            sensor,
            kind,
            from_ns,
            until_ns: time_ns,
            is_over: false,
            size,
        };
        let before_ns = check.last_ns();
        match check.check(time_ns, sample) {
            Checked::Good if is_told_again(check, sensor, time_ns, before_ns) => {
                return Err(SkipReason::Repeated);
            }
            Checked::Good | Checked::Step(_) => self.log.ends(sensor, time_ns),
            Checked::Suspect => return Err(SkipReason::Suspect),
            Checked::Spike { from_ns, size } => {
                self.log.ends(sensor, time_ns);
                let notable = match sensor {
                    FaultySensor::Magnetometer => sample.norm() * lit(NOTABLE_FIELD_SHARE),
                    _ => lit(NOTABLE_FORCE),
                };
                if size > notable {
                    self.log.happened(fault(FaultKind::Spike, from_ns, size));
                }
            }
            Checked::Stuck { from_ns } => {
                let size = seconds(from_ns, time_ns);
                self.log.lasts(fault(FaultKind::Stuck, from_ns, size));
                return Err(SkipReason::Repeated);
            }
            Checked::Noise { from_ns } => {
                let size = seconds(from_ns, time_ns);
                self.log.lasts(fault(FaultKind::Noise, from_ns, size));
                return Err(SkipReason::Suspect);
            }
            // It still shows where up is better than nothing does; gates and weights of the filter see the rest.
            Checked::Saturated { full_scale } => {
                let open = self.log.now(sensor);
                let open = open.filter(|open| open.kind == FaultKind::Saturated);
                let from_ns = open.map_or(time_ns, |open| open.from_ns);
                self.log
                    .lasts(fault(FaultKind::Saturated, from_ns, full_scale));
            }
        }
        Ok(())
    }
}

impl<T: Scalar, E: AttitudeEstimator<T>> AttitudeDriver<T, E> {
    /// The oldest fault of the samples that was not taken yet. A fault that lasts comes twice: when it is found, and when
    /// it is over.
    pub fn take_fault(&mut self) -> Option<Fault<T>> {
        self.memory.checks.log.take()
    }

    /// The fault of a sensor under way.
    pub fn fault_now(&self, sensor: FaultySensor) -> Option<&Fault<T>> {
        self.memory.checks.log.now(sensor)
    }

    /// Takes what the check says of a gyroscope sample; whether the sample is a measurement.
    pub(super) fn heed(&mut self, time_ns: i64, sample: &Vector3<T>, checked: &Checked<T>) -> bool {
        let sensor = FaultySensor::Gyroscope;
        let interval = self.memory.checks.gyroscope.interval_s();
        match *checked {
            Checked::Good => {
                let checks = &mut self.memory.checks;
                let clipped = checks.clipping.look(&checks.gyroscope, time_ns, sample);
                if let Some(Clipped { level, from_ns }) = clipped {
                    self.saturated(time_ns, from_ns, level);
                    return true;
                }
            }
            Checked::Suspect => return false,
            Checked::Step(integral) => {
                if let Some((last_ns, last)) = self.memory.last_rate {
                    let whole: T = seconds(last_ns, time_ns);
                    let direct = (last + sample) * (whole * lit(0.5));
                    self.memory.passed_on += integral - direct;
                }
            }
            Checked::Spike { from_ns, size } => {
                if interval.is_some_and(|dt| size * dt > lit(NOTABLE_RAD)) {
                    self.memory.checks.log.happened(Fault {
                        sensor,
                        kind: FaultKind::Spike,
                        from_ns,
                        until_ns: time_ns,
                        is_over: true,
                        size,
                    });
                }
            }
            Checked::Stuck { from_ns } | Checked::Noise { from_ns } => {
                if let Some((last_ns, _)) = &mut self.memory.last_rate {
                    *last_ns = from_ns.min(*last_ns);
                }
                let size = seconds(from_ns, time_ns);
                let is_noise = matches!(checked, Checked::Noise { .. });
                self.memory.checks.log.lasts(Fault {
                    sensor,
                    kind: if is_noise {
                        FaultKind::Noise
                    } else {
                        FaultKind::Stuck
                    },
                    from_ns,
                    until_ns: time_ns,
                    is_over: false,
                    size,
                });
                return false;
            }
            Checked::Saturated { full_scale } => {
                let last = self.memory.last_rate;
                let from_ns = last.map_or(time_ns, |(last_ns, _)| last_ns);
                self.saturated(time_ns, from_ns, full_scale);
                return true;
            }
        }
        self.leave_saturation(time_ns);
        true
    }

    /// Back from the end of the range: where it may have turned too far for a linear update it is aligned again.
    fn leave_saturation(&mut self, time_ns: i64) {
        let checks = &mut self.memory.checks;
        let Some(saturation) = checks.saturation.take() else {
            return;
        };
        if saturation.variance > lit(LOST_RAD * LOST_RAD) {
            self.realign(time_ns, seconds(saturation.since_ns, time_ns));
        }
    }

    /// At the end of the range: what lies beyond is unknown, and as large as the range may be (F6).
    fn saturated(&mut self, time_ns: i64, from_ns: i64, full_scale: T) {
        let checks = &mut self.memory.checks;
        checks.bias.interrupt();
        let saturation = checks.saturation.get_or_insert(Saturation {
            since_ns: from_ns,
            variance: T::zero(),
        });
        let since_ns = saturation.since_ns;
        checks.log.lasts(Fault {
            sensor: FaultySensor::Gyroscope,
            kind: FaultKind::Saturated,
            from_ns: since_ns,
            until_ns: time_ns,
            is_over: false,
            size: full_scale,
        });
        let end = Vector3::repeat(full_scale);
        let unseen = (checks.motion).between(&end, &end, seconds(since_ns, time_ns));
        let more = unseen.variance - saturation.variance;
        saturation.variance = unseen.variance;
        self.widen(more);
    }
}
