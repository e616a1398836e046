//! The GNSS/INS of core behind the interface of all navigation estimators.

use nalgebra::Vector3;
use northing_core::ConfigError;
use northing_core::earth::{FrameChange, LocalFrame};
use northing_core::faults::Fault;
use northing_core::kalman::covariance::part;
use northing_core::kalman::{Innovation, Outcome, SkipReason};
use northing_core::navigation::aiding::barometer::pressure_height;
use northing_core::navigation::aiding::gnss_position::GnssPosition;
use northing_core::navigation::aiding::gnss_velocity::GnssVelocity;
use northing_core::navigation::augmented_states::MAGNETIC_OFFSET;
use northing_core::navigation::gnss_ins::{Aid as Aided, ErrorShares};
use northing_core::navigation::{
    ATTITUDE, GnssIns, GnssInsConfig, VELOCITY, Validity, ValidityLimits,
};

use super::magnetic_model;
use super::navigator::{Aid, AidKind, NavigationEstimate, Navigator, Told, no_frame};
use crate::navigation::batch_smoother::{
    BatchRecorder, Measured, Part, SmoothedNavigation, SmoothingSummary,
};
use crate::statistics::nis::UpdateCounts;

/// Inertial samples kept for late fixes: 0.6 s at 200 Hz.
const HISTORY: usize = 128;
/// Where a receiver states no standard deviation it is that of a code solution by itself: orbits, clocks and the
/// air last minutes, and a third is noise and reflections that change from fix to fix.
const UNSTATED: ErrorShares<f64> = ErrorShares {
    white: 0.3,
    slow: 0.9,
};
/// A heading with a larger standard deviation is not known, rad.
const KNOWN_HEADING_STD: f64 = 0.15;
/// Standard deviation of a wheel speed, m/s.
const SPEED_STD: f64 = 0.2;

/// The GNSS/INS.
pub(crate) struct InsNavigator {
    ins: Box<GnssIns<f64, HISTORY>>,
    arm: Vector3<f64>,
    /// The local frame of now; where all is remembered, those of before in front of it.
    frames: Vec<(i64, LocalFrame)>,
    /// Whether a compass is of no use here, and whether it was anywhere.
    is_near_pole: bool,
    was_near_pole: bool,
    /// Angular rate of the last sample: the antenna moves with it.
    rate: Vector3<f64>,
    /// Magnetic declination of the place, rad.
    declination: f64,
    /// What it was given, for the batch smoother.
    recorder: Option<BatchRecorder>,
}

impl InsNavigator {
    /// `remembers`: for [`Navigator::smoothed`].
    pub(crate) fn new(config: GnssInsConfig<f64>, remembers: bool) -> Result<Self, ConfigError> {
        Ok(Self {
            recorder: remembers.then(BatchRecorder::default),
            declination: config.declination.unwrap_or_default(),
            ins: Box::new(GnssIns::new(config)?),
            arm: config.lever_arm_m.into(),
            frames: vec![(i64::MIN, no_frame())],
            is_near_pole: false,
            was_near_pole: false,
            rate: Vector3::zeros(),
        })
    }

    /// The iron around the magnetometer in words, where it was found and is worth a calibration.
    fn iron(&self) -> Option<String> {
        let side = self.ins.augmented_states();
        let [x, y] = [0, 1].map(|i| side.values[MAGNETIC_OFFSET + i]);
        let variance = |i: usize| side.covariance[(MAGNETIC_OFFSET + i, MAGNETIC_OFFSET + i)];
        let known = side.is_used(MAGNETIC_OFFSET) && variance(0).max(variance(1)) < 25.0;
        (known && x.hypot(y) > 5.0).then(|| {
            format!(
                "The magnetometer carries iron: {x:.0} uT forward, {y:.0} uT to the right, found on the \
                 way and taken out. A calibration of it in situ tells the heading from the start."
            )
        })
    }

    fn learn_declination(&mut self, frame: &LocalFrame, time_ns: i64) -> Option<f64> {
        // A declination that was set stands above the model's.
        if self.ins.config().declination.is_some() {
            return None;
        }
        let declination = magnetic_model::declination(frame.origin(), time_ns);
        self.is_near_pole = declination.is_none();
        self.was_near_pole |= self.is_near_pole;
        if let Some(declination) = declination {
            self.ins.set_declination(declination);
            self.declination = declination;
        }
        declination
    }

    /// Keeps a measurement for the batch smoother, unless it was refused whatever the state.
    fn record(&mut self, time_ns: i64, aid: &Aid, told: &[Told]) {
        let Some(recorder) = &mut self.recorder else {
            return;
        };
        let config = self.ins.config();
        for (kind, innovation) in told {
            let squared = match innovation.outcome {
                Outcome::Fused | Outcome::Inflated | Outcome::Gated => {
                    Some((innovation.nis, innovation.degrees_of_freedom))
                }
                Outcome::Skipped(SkipReason::NotInitialized | SkipReason::Accumulated) => None,
                Outcome::Skipped(_) => continue,
            };
            if let Some(measured) = measured(aid, *kind, config, self.declination) {
                recorder.measurement(time_ns, measured, squared, config);
            }
        }
    }

    /// Keeps what the filter used of the samples of an instant: not a spike, nor what a stuck sensor repeats.
    fn moved(&mut self, time_ns: i64) {
        let Some((rate, force)) = self.ins.last_sample() else {
            return;
        };
        self.rate = rate;
        if let Some(recorder) = &mut self.recorder {
            recorder.imu(time_ns, &rate, &force, &self.ins);
        }
    }

    fn fuse(&mut self, time_ns: i64, aid: &Aid) -> Innovation<f64> {
        match *aid {
            Aid::Velocity { ned, std, vertical } => {
                let fix = GnssVelocity {
                    ned,
                    std,
                    has_vertical: vertical,
                };
                self.ins.gnss_velocity(time_ns, &fix)
            }
            Aid::MagneticField(_) if self.is_near_pole => {
                Innovation::skipped(SkipReason::Unobservable)
            }
            Aid::MagneticField(field) => self.ins.magnetometer(time_ns, &field),
            Aid::Heading { heading, std } => self.ins.heading(time_ns, heading, std),
            Aid::Pressure(pressure) => match pressure_height(pressure) {
                Some(height) => self.ins.barometer(time_ns, height),
                None => Innovation::skipped(SkipReason::OutOfRange),
            },
            Aid::ForwardSpeed(speed) => self.ins.speed(time_ns, speed, SPEED_STD),
            Aid::Position { .. } | Aid::WaterVelocity(_) => {
                Innovation::skipped(SkipReason::NotUsed)
            }
        }
    }
}

/// An aid as the batch smoother takes it.
fn measured(
    aid: &Aid,
    kind: AidKind,
    config: &GnssInsConfig<f64>,
    declination: f64,
) -> Option<Measured> {
    Some(match *aid {
        Aid::Position {
            ned,
            std,
            vertical,
            stated,
        } => {
            let fix = GnssPosition {
                ned,
                std,
                has_height: vertical,
            };
            let own = ErrorShares {
                white: config.position_uncorrelated_fraction,
                slow: config.position_correlated_fraction,
            };
            let part = if kind == AidKind::GnssHeight {
                Part::Vertical
            } else {
                Part::Horizontal
            };
            Measured::Position(fix, if stated { own } else { UNSTATED }, part)
        }
        Aid::Velocity { ned, std, vertical } => Measured::Velocity(GnssVelocity {
            ned,
            std,
            has_vertical: vertical,
        }),
        Aid::MagneticField(field) => Measured::MagneticField(field, declination),
        Aid::Heading { heading, std } => Measured::Heading(heading, std),
        Aid::Pressure(pressure) => Measured::Height(pressure_height(pressure)?),
        Aid::ForwardSpeed(speed) => Measured::Speed(speed, SPEED_STD),
        Aid::WaterVelocity(_) => return None,
    })
}

/// A smoothed node as every estimator says it.
fn estimate_of(node: &SmoothedNavigation, limits: &ValidityLimits<f64>) -> NavigationEstimate {
    let attitude = node.ned_from_body;
    let p = &node.covariance;
    let position_covariance = node.antenna_covariance;
    let variance = position_covariance.m11.max(position_covariance.m22);
    let heading_std = p[(ATTITUDE + 2, ATTITUDE + 2)].max(0.0).sqrt();
    // The smoother knows the fix after as well as the one before.
    let validity = match limits.judge(node.since_fix_s, variance) {
        Validity::Aided if heading_std > KNOWN_HEADING_STD => Validity::HeadingUnknown,
        validity => validity,
    };
    NavigationEstimate {
        time_ns: node.time_ns,
        frame: node.frame,
        ned_from_body: Some(attitude),
        heading_std: Some(heading_std),
        attitude_covariance: Some(part(p, ATTITUDE, ATTITUDE)),
        position: node.antenna,
        position_covariance,
        velocity: node.velocity + attitude * node.angular_rate.cross(&node.lever_arm),
        velocity_covariance: Some(part(p, VELOCITY, VELOCITY)),
        validity,
    }
}

impl Navigator for InsNavigator {
    fn inertial(
        &mut self,
        time_ns: i64,
        rate: &Vector3<f64>,
        force: &Vector3<f64>,
        _: &mut Vec<Told>,
    ) {
        // What is refused is counted inside, and told at the end.
        if self.ins.imu(time_ns, rate, force).is_ok() {
            self.moved(time_ns);
        }
    }

    fn force_without_rate(&mut self, time_ns: i64, force: &Vector3<f64>) {
        if self.ins.imu_without_rate(time_ns, force).is_ok() {
            self.moved(time_ns);
        }
    }

    fn take_fault(&mut self) -> Option<Fault<f64>> {
        self.ins.take_fault()
    }

    fn origin(&mut self, frame: &LocalFrame, time_ns: i64) -> Option<f64> {
        self.frames = vec![(i64::MIN, *frame)];
        if let Some(recorder) = &mut self.recorder {
            recorder.frame(frame);
        }
        self.learn_declination(frame, time_ns)
    }

    fn move_origin(&mut self, frame: &LocalFrame, change: &FrameChange<f64>, time_ns: i64) {
        if let Some(recorder) = &mut self.recorder {
            recorder.frame(frame);
        } else {
            self.frames.clear();
        }
        self.ins.move_origin(change);
        self.frames.push((time_ns, *frame));
        self.learn_declination(frame, time_ns);
    }

    fn aid(&mut self, time_ns: i64, aid: &Aid, told: &mut Vec<Told>) {
        let before = told.len();
        if let Aid::Position {
            ned,
            std,
            vertical,
            stated,
        } = *aid
        {
            let fix = GnssPosition {
                ned,
                std,
                has_height: vertical,
            };
            let update = if stated {
                self.ins.gnss_position(time_ns, &fix)
            } else {
                self.ins.gnss_position_with(time_ns, &fix, UNSTATED)
            };
            told.push((AidKind::GnssPosition, update.horizontal));
            told.push((AidKind::GnssHeight, update.vertical));
        } else {
            told.push((aid.kind(), self.fuse(time_ns, aid)));
        }
        let news = told.get(before..).unwrap_or_default();
        self.record(time_ns, aid, news);
    }

    fn estimate(&mut self) -> Option<NavigationEstimate> {
        let state = self.ins.state()?;
        let attitude = state.ned_from_body;
        let spin = self.rate - state.gyroscope_bias;
        let p = &state.covariance;
        let heading_variance = p[(ATTITUDE + 2, ATTITUDE + 2)];
        let (position, position_covariance) = self.ins.antenna_position()?;
        Some(NavigationEstimate {
            time_ns: self.ins.time_ns()?,
            frame: self.frames.last()?.1,
            ned_from_body: Some(attitude),
            heading_std: Some(heading_variance.max(0.0).sqrt()),
            attitude_covariance: Some(part(p, ATTITUDE, ATTITUDE)),
            position,
            position_covariance,
            velocity: state.velocity + attitude * spin.cross(&self.arm),
            velocity_covariance: Some(part(p, VELOCITY, VELOCITY)),
            validity: self.ins.validity(),
        })
    }

    fn validity(&self) -> Validity {
        self.ins.validity()
    }

    fn smoothed(&mut self) -> (Vec<NavigationEstimate>, Option<SmoothingSummary>) {
        let Some(recorder) = self.recorder.take() else {
            return (Vec::new(), None);
        };
        let config = self.ins.config();
        let solution = recorder.smooth(config);
        let nodes = solution.nodes.iter();
        let estimates = nodes.map(|node| {
            let moved = self
                .frames
                .partition_point(|(since, _)| *since <= node.time_ns);
            let frame = self.frames.get(moved.saturating_sub(1));
            let estimate = estimate_of(node, &config.validity);
            frame.map_or(estimate, |(_, frame)| estimate.in_frame(frame))
        });
        (estimates.collect(), solution.summary)
    }

    fn own_counts(&self) -> Vec<(AidKind, UpdateCounts)> {
        let own = [
            (Aided::ZeroVelocity, AidKind::ZeroVelocity),
            (Aided::NonHolonomic, AidKind::NonHolonomic),
        ];
        let counted = own.map(|(aid, kind)| {
            let counts = self.ins.counts(aid);
            let updates = UpdateCounts {
                fused: u64::from(counts.fused + counts.inflated),
                gated: u64::from(counts.gated),
                skipped: u64::from(counts.skipped),
                inflated: u64::from(counts.inflated),
                ..UpdateCounts::default()
            };
            (kind, updates)
        });
        let happened = |c: &UpdateCounts| c.fused + c.gated + c.skipped > 0;
        counted.into_iter().filter(|(_, c)| happened(c)).collect()
    }

    fn issues(&self) -> Vec<String> {
        let mut issues: Vec<String> = self.iron().into_iter().collect();
        if self.was_near_pole {
            issues.push(
                "So near a magnetic pole a compass tells nothing: a magnetometer is left out, unless --set \
                 declination=RADIANS says where its north is."
                    .to_owned(),
            );
        }
        let mut say = |count: u32, what: &str| {
            if count > 0 {
                issues.push(format!("{count} {what}"));
            }
        };
        say(
            self.ins.imu_skipped(),
            "inertial samples refused: not finite, not newer, or beyond any sensor.",
        );
        say(
            self.ins.gaps(),
            "gaps of more than 0.5 s between inertial samples; the velocity was held over them.",
        );
        say(
            self.ins.realignments(),
            "realignments: fixes disagreed with the solution for long, and the filter aligned again from them.",
        );
        say(
            self.ins.restarts(),
            "restarts: after a gap of more than 10 s, or a clock that went back, the filter aligns anew.",
        );
        issues
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A turntable that turns after 5 s, with the antenna 2 m ahead of its axis, and no fixes from 20 s to 30 s.
    #[test]
    fn smoothing_is_of_the_antenna_and_knows_how_far_the_next_fix_is() {
        let arm = Vector3::new(2.0, 0.0, 0.0);
        let config = GnssInsConfig {
            lever_arm_m: arm.into(),
            initial_heading: Some([0.0, 0.02]),
            // What turns on the spot does not show its heading.
            gyroscope_bias_std: 1e-3,
            gyroscope_gauss_markov_std: 0.0,
            ..GnssInsConfig::default()
        };
        let mut navigator = InsNavigator::new(config, true).unwrap();
        let mut told = Vec::new();
        let (spin, force) = (0.5, Vector3::new(0.0, 0.0, -9.806_65));
        let velocity = |t: f64| {
            let turned = spin * (t - 5.0).max(0.0);
            let speed = if t > 5.0 { 2.0 * spin } else { 0.0 };
            Vector3::new(-turned.sin(), turned.cos(), 0.0) * speed
        };
        for k in 1..=4000_i64 {
            let (t, time_ns) = (k as f64 * 0.01, k * 10_000_000);
            let rate = Vector3::z() * if t > 5.0 { spin } else { 0.0 };
            navigator.inertial(time_ns, &rate, &force, &mut told);
            if k % 100 == 0 && !(20.0..30.0).contains(&t) {
                let turned = spin * (t - 5.0).max(0.0);
                let aid = Aid::Position {
                    ned: Vector3::new(turned.cos(), turned.sin(), 0.0) * 2.0,
                    std: Vector3::repeat(0.05),
                    vertical: true,
                    stated: true,
                };
                navigator.aid(time_ns, &aid, &mut told);
            }
        }
        let now = navigator.estimate().unwrap();
        let (smoothed, summary) = navigator.smoothed();
        assert!(summary.unwrap().converged);
        let last = smoothed.last().unwrap();
        assert_eq!((last.time_ns, last.validity), (now.time_ns, now.validity));
        assert!((last.velocity - now.velocity).norm() < 0.1);
        let at = |t: f64| {
            let near = |e: &&NavigationEstimate| (e.time_ns as f64 * 1e-9 - t).abs() < 0.051;
            smoothed.iter().find(near).unwrap()
        };
        for (t, validity) in [
            (15.0, Validity::Aided),
            (20.5, Validity::Aided),
            (24.5, Validity::DeadReckoning),
            (29.0, Validity::Aided),
            (35.0, Validity::Aided),
        ] {
            let node = at(t);
            assert_eq!(node.validity, validity, "{t}");
            let off = (node.velocity - velocity(node.time_ns as f64 * 1e-9)).norm();
            assert!(off < 0.15, "{off} at {t}");
        }
    }
}
