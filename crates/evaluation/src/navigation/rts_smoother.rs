//! The smoother of the GNSS/INS: where was it, now that all fixes are known.
//!
//! *Read first:* Rauch, Tung & Striebel (1965); `docs/derivations/error_state.md`, section 11 (E33-E35).
//!
//! A [`NavigationRecorder`] looks at a [`GnssIns`] before each sample and each measurement and keeps, for each step of its
//! covariance, the state before and after and how the errors went on. [`NavigationRecorder::smooth`] walks back. Steps
//! are at most 0.1 s long, 9 KB each: 340 MB an hour.
//!
//! ```
//! use northing_core::navigation::gnss_ins::{GnssIns, GnssInsConfig};
//! use northing_core::nalgebra::Vector3;
//! use northing_evaluation::navigation::rts_smoother::NavigationRecorder;
//!
//! let mut ins = GnssIns::<f64>::new(GnssInsConfig::default()).unwrap();
//! let mut recorder = NavigationRecorder::default();
//! for k in 0..10_i64 {
//!     recorder.before_imu(&mut ins);
//!     ins.imu(k * 10_000_000, &Vector3::zeros(), &Vector3::new(0.0, 0.0, -9.8)).unwrap();
//!     recorder.before_measurement(&mut ins);
//!     ins.barometer(k * 10_000_000, 12.0);
//! }
//! assert!(recorder.smooth(&mut ins).is_empty(), "it is still aligning");
//! ```
//!
//! A restart of the filter, a gap between its samples, and a state taken over from the alignment end the chain: nothing is
//! carried back across them. While the heading is not known the smoother therefore says what the filter did.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use northing_core::earth::FrameChange;
use northing_core::geometry::{rotation, so3};
use northing_core::kalman::ErrorPropagation as _;
use northing_core::navigation::augmented_states::AUGMENTED_STATES;
use northing_core::navigation::gnss_ins::{CovarianceStep, GnssIns};
use northing_core::navigation::{AugmentedStates, NavigationState, STATES};

use crate::statistics::rts_step::Link;

/// The 15 errors and the augmented states.
const ALL: usize = STATES + AUGMENTED_STATES;
type Joint = SMatrix<f64, ALL, ALL>;

/// State and covariance at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Snapshot {
    time_ns: i64,
    state: NavigationState<f64>,
    side: AugmentedStates<f64>,
    /// Angular rate as measured, rad/s.
    rate: Vector3<f64>,
    last_fix_ns: Option<i64>,
}

/// One step of the covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    filtered: Snapshot,
    predicted: Snapshot,
    step: CovarianceStep<f64>,
    /// Steps of one chain follow one another.
    chain: u32,
    /// How often the origin had moved.
    moves: usize,
}

/// What the smoother says about an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothedNavigation {
    /// When, ns.
    pub time_ns: i64,
    /// How often the origin had moved before: the local frame of all that follows.
    pub moves: usize,
    /// Position, m, NED.
    pub position: Vector3<f64>,
    /// Velocity, m/s, NED.
    pub velocity: Vector3<f64>,
    /// Attitude.
    pub ned_from_body: UnitQuaternion<f64>,
    /// Angular rate less the bias, rad/s, body axes.
    pub angular_rate: Vector3<f64>,
    /// Position of the antenna as the receiver dates it, m, NED.
    pub antenna: Vector3<f64>,
    /// Covariance of that, m^2.
    pub antenna_covariance: Matrix3<f64>,
    /// Covariance of the 15 errors.
    pub covariance: SMatrix<f64, STATES, STATES>,
    /// Time to the nearest fix that was fused, before or after, s; `None` without any.
    pub since_fix_s: Option<f64>,
}

/// Keeps what a GNSS/INS does, for RTS smoothing.
#[derive(Debug, Clone, Default)]
pub struct NavigationRecorder {
    steps: Vec<Step>,
    open: Option<Snapshot>,
    chain: u32,
    /// Gaps, restarts and states taken over from the alignment.
    broken: [u32; 3],
    /// From each local frame to the next.
    moves: Vec<FrameChange<f64>>,
}

impl NavigationRecorder {
    /// To be called before each inertial sample.
    pub fn before_imu<const H: usize>(&mut self, ins: &mut GnssIns<f64, H>) {
        if ins.is_due() {
            self.close(ins);
            ins.settle();
        }
        self.note_breaks(ins);
        if self.open.is_none() {
            self.open = snapshot(ins);
        }
    }

    /// To be called before each measurement.
    pub fn before_measurement<const H: usize>(&mut self, ins: &mut GnssIns<f64, H>) {
        self.close(ins);
    }

    /// To be called between [`Self::before_measurement`] and [`GnssIns::move_origin`].
    pub fn moved(&mut self, change: &FrameChange<f64>) {
        self.moves.push(*change);
    }

    /// Steps kept.
    #[must_use]
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether nothing has been kept.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    fn note_breaks<const H: usize>(&mut self, ins: &GnssIns<f64, H>) {
        let now = [ins.gaps(), ins.restarts(), ins.take_overs()];
        if now != self.broken {
            self.broken = now;
            self.open = None;
            self.chain += 1;
        }
    }

    /// Ends the step under way, if any time has passed.
    fn close<const H: usize>(&mut self, ins: &mut GnssIns<f64, H>) {
        self.note_breaks(ins);
        if ins.pending_s() <= 0.0 {
            // A measurement has changed the state at the instant where a step would begin.
            self.open = None;
            return;
        }
        ins.catch_up();
        let opened = self.open.take();
        if let Some((filtered, predicted)) = opened.zip(snapshot(ins)) {
            self.steps.push(Step {
                filtered,
                predicted,
                step: *ins.last_step(),
                chain: self.chain,
                moves: self.moves.len(),
            });
        }
        self.note_breaks(ins);
    }

    /// Every smoothed instant, the first to the last, which is the filter's own present.
    pub fn smooth<const H: usize>(&mut self, ins: &mut GnssIns<f64, H>) -> Vec<SmoothedNavigation> {
        self.close(ins);
        let mut smoothed = Vec::with_capacity(self.steps.len() + 1);
        let Some(end) = snapshot(ins) else {
            return smoothed;
        };
        let arm = Vector3::from(ins.config().lever_arm_m);
        let mut next = (end, joint(&end));
        let mut chain = self.chain;
        // The first fix after the instant at hand: what later instants call their last one.
        let mut later_fix_ns = None;
        let mut moves = self.moves.len();
        smoothed.push(in_words(&next, moves, later_fix_ns, &arm));
        for step in self.steps.iter().rev() {
            if step.chain != chain {
                // What comes after is no continuation: the filter's own end of this chain stands.
                chain = step.chain;
                later_fix_ns = None;
                next = (step.predicted, joint(&step.predicted));
                moves = step.moves;
                smoothed.push(in_words(&next, moves, later_fix_ns, &arm));
            }
            while moves > step.moves {
                moves -= 1;
                next = seen_from_before(next, &self.moves[moves]);
            }
            let last = next.0.last_fix_ns;
            later_fix_ns = last
                .filter(|fix| *fix > step.filtered.time_ns)
                .or(later_fix_ns);
            next = step.back(&next);
            smoothed.push(in_words(&next, moves, later_fix_ns, &arm));
        }
        smoothed.reverse();
        smoothed
    }
}

impl Step {
    /// One step back (E34, E35); where the prediction has no inverse, the filter's own state stands.
    fn back(&self, (next, covariance): &(Snapshot, Joint)) -> (Snapshot, Joint) {
        let filtered = joint(&self.filtered);
        let difference = difference(next, &self.predicted);
        let link = Link {
            filtered: &filtered,
            transition: &self.transition(),
            predicted: &joint(&self.predicted),
        };
        match link.back(&difference, covariance) {
            Some((x, covariance)) => (corrected(&self.filtered, &x), covariance),
            None => (self.filtered, filtered),
        }
    }

    /// The transition of all errors (E33).
    fn transition(&self) -> Joint {
        let mut phi = Joint::identity();
        let mut errors = SMatrix::<f64, STATES, STATES>::identity();
        self.step.transition.map_rows(&mut errors);
        phi.fixed_view_mut::<STATES, STATES>(0, 0)
            .copy_from(&errors);
        let [force, rate] = self.step.bias_kept;
        for i in 9..STATES {
            phi[(i, i)] *= if i < 12 { force } else { rate };
        }
        for (i, kept) in self.step.side_kept.iter().enumerate() {
            phi[(STATES + i, STATES + i)] = *kept;
        }
        phi
    }
}

fn snapshot<const H: usize>(ins: &GnssIns<f64, H>) -> Option<Snapshot> {
    Some(Snapshot {
        time_ns: ins.time_ns()?,
        state: *ins.state()?,
        side: *ins.augmented_states(),
        rate: ins.angular_rate().copied().unwrap_or_default(),
        last_fix_ns: ins.last_fix_ns(),
    })
}

fn joint(snapshot: &Snapshot) -> Joint {
    let mut joint = Joint::zeros();
    let side = &snapshot.side;
    joint
        .fixed_view_mut::<STATES, STATES>(0, 0)
        .copy_from(&snapshot.state.covariance);
    joint
        .fixed_view_mut::<STATES, AUGMENTED_STATES>(0, STATES)
        .copy_from(&side.cross);
    joint
        .fixed_view_mut::<AUGMENTED_STATES, STATES>(STATES, 0)
        .copy_from(&side.cross.transpose());
    joint
        .fixed_view_mut::<AUGMENTED_STATES, AUGMENTED_STATES>(STATES, STATES)
        .copy_from(&side.covariance);
    joint
}

/// What `to` has more than `from`, as an error (E1).
fn difference(to: &Snapshot, from: &Snapshot) -> SVector<f64, ALL> {
    let (a, b) = (&to.state, &from.state);
    let mut d = SVector::<f64, ALL>::zeros();
    let turn = so3::log(&(a.ned_from_body * b.ned_from_body.inverse()));
    let parts = [
        turn,
        a.velocity - b.velocity,
        a.position - b.position,
        a.accelerometer_bias - b.accelerometer_bias,
        a.gyroscope_bias - b.gyroscope_bias,
    ];
    for (i, part) in parts.iter().enumerate() {
        d.fixed_rows_mut::<3>(3 * i).copy_from(part);
    }
    d.fixed_rows_mut::<AUGMENTED_STATES>(STATES)
        .copy_from(&(to.side.values - from.side.values));
    d
}

fn corrected(snapshot: &Snapshot, x: &SVector<f64, ALL>) -> Snapshot {
    let part = |i: usize| x.fixed_rows::<3>(i).into_owned();
    let mut corrected = *snapshot;
    let state = &mut corrected.state;
    state.ned_from_body = rotation::renormalize(&(so3::exp(&part(0)) * state.ned_from_body));
    state.velocity += part(3);
    state.position += part(6);
    state.accelerometer_bias += part(9);
    state.gyroscope_bias += part(12);
    corrected.side.values += x.fixed_rows::<AUGMENTED_STATES>(STATES);
    corrected
}

/// The same in the local frame before the origin moved.
fn seen_from_before(
    (mut snapshot, mut covariance): (Snapshot, Joint),
    moved: &FrameChange<f64>,
) -> (Snapshot, Joint) {
    let back = moved.inverse();
    snapshot.state.move_origin(&back);
    snapshot.side.move_origin(&back);
    for _ in 0..2 {
        back.map_rows(&mut covariance);
        covariance.transpose_mut();
    }
    (snapshot, covariance)
}

fn in_words(
    (snapshot, covariance): &(Snapshot, Joint),
    moves: usize,
    later_fix_ns: Option<i64>,
    arm: &Vector3<f64>,
) -> SmoothedNavigation {
    let fixes = snapshot.last_fix_ns.into_iter().chain(later_fix_ns);
    let mut state = snapshot.state;
    state.covariance = covariance.fixed_view::<STATES, STATES>(0, 0).into_owned();
    let mut side = snapshot.side;
    let beside = covariance.fixed_view::<STATES, AUGMENTED_STATES>(0, STATES);
    side.cross.copy_from(&beside);
    let own = covariance.fixed_view::<AUGMENTED_STATES, AUGMENTED_STATES>(STATES, STATES);
    side.covariance.copy_from(&own);
    let (antenna, antenna_covariance) = state.antenna_position(&side, arm);
    let nearest_ns = fixes.map(|fix| snapshot.time_ns.abs_diff(fix)).min();
    SmoothedNavigation {
        time_ns: snapshot.time_ns,
        moves,
        position: snapshot.state.position,
        velocity: snapshot.state.velocity,
        ned_from_body: snapshot.state.ned_from_body,
        angular_rate: snapshot.rate - snapshot.state.gyroscope_bias,
        since_fix_s: nearest_ns.map(|ns| ns as f64 * 1e-9),
        antenna,
        antenna_covariance,
        covariance: state.covariance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_core::navigation::aiding::gnss_position::GnssPosition;
    use northing_core::navigation::gnss_ins::{GnssInsConfig, ImuSamples};
    use northing_simulation::ground::{Ground, GroundSensors, simulate};

    /// Squared horizontal errors of filter and smoother, of the largest in an outage, and of error squared over the
    /// smoother's variance.
    struct Scores {
        filter: f64,
        smoother: f64,
        worst: [f64; 2],
        over_variance: f64,
    }

    fn run(seed: u64) -> Scores {
        let sensors = GroundSensors::default();
        let way = simulate(Ground::Drive, &sensors, 180.0, seed);
        let root = 0.02_f64.sqrt();
        let config = GnssInsConfig {
            imu_samples: ImuSamples::Means,
            accelerometer_noise_density: sensors.accelerometer_std * root,
            gyroscope_noise_density: sensors.gyroscope_std * root,
            accelerometer_gauss_markov_std: 0.0,
            gyroscope_gauss_markov_std: 0.0,
            position_uncorrelated_fraction: 1.0,
            position_correlated_fraction: 0.0,
            magnetic_heading_std: 0.031,
            // Calibrated, and white.
            magnetic_interval_s: 0.0,
            magnetic_offset_std_ut: 0.0,
            damping_speed_m_s: 0.0,
            earth_curvature: false,
            ..GnssInsConfig::default()
        };
        let mut ins = GnssIns::<f64>::new(config).unwrap();
        let mut recorder = NavigationRecorder::default();
        let mut filtered = std::collections::HashMap::new();
        let out = |t: f64| (100.0..130.0).contains(&t);
        for (k, sample) in way.iter().enumerate() {
            let time_ns = (sample.time_s * 1e9).round() as i64;
            recorder.before_imu(&mut ins);
            ins.imu(time_ns, &sample.angular_rate, &sample.specific_force)
                .unwrap();
            if k % 10 == 0 {
                recorder.before_measurement(&mut ins);
                ins.magnetometer(time_ns, &sample.magnetic_field);
            }
            if let Some([ned, _]) = sample.fix.filter(|_| !out(sample.time_s)) {
                recorder.before_measurement(&mut ins);
                let [h, v] = sensors.position_std;
                let std = Vector3::new(h, h, v);
                let fix = GnssPosition {
                    ned,
                    std,
                    has_height: true,
                };
                ins.gnss_position(time_ns, &fix);
            }
            if let Some(state) = ins.state() {
                filtered.insert(time_ns, (sample, state.position));
            }
        }
        let smoothed = recorder.smooth(&mut ins);
        // Each state that is taken over from the alignment ends a chain, whose end is one more.
        assert!(smoothed.len() > recorder.len());
        assert!(smoothed.is_sorted_by_key(|s| s.time_ns));
        let last = smoothed.last().unwrap();
        assert_eq!(last.position, ins.state().unwrap().position);
        let mut scores = Scores {
            filter: 0.0,
            smoother: 0.0,
            worst: [0.0; 2],
            over_variance: 0.0,
        };
        let mut n = 0.0;
        for node in &smoothed {
            let (truth, position) = filtered[&node.time_ns];
            let errors = [position, node.position].map(|p| (p - truth.position).xy().norm());
            if out(truth.time_s) {
                for (worst, error) in scores.worst.iter_mut().zip(errors) {
                    *worst = worst.max(error);
                }
            } else if (40.0..160.0).contains(&truth.time_s) {
                let [filter, smoother] = errors.map(|e| e * e);
                scores.filter += filter;
                scores.smoother += smoother;
                let p = &node.covariance;
                scores.over_variance += smoother / (p[(6, 6)] + p[(7, 7)]);
                n += 1.0;
            }
        }
        scores.filter /= n;
        scores.smoother /= n;
        scores.over_variance /= n;
        scores
    }

    #[test]
    fn smoothing_is_nearer_bridges_an_outage_and_knows_how_near_it_is() {
        let runs: Vec<Scores> = (1..=8).map(run).collect();
        let n = runs.len() as f64;
        let mean = |of: fn(&Scores) -> f64| runs.iter().map(of).sum::<f64>() / n;
        let ratio = (mean(|s| s.smoother) / mean(|s| s.filter)).sqrt();
        assert!(ratio < 0.75, "smoother to filter: {ratio}");
        let [filter, smoother] = [mean(|s| s.worst[0]), mean(|s| s.worst[1])];
        assert!(
            smoother < 0.35 * filter,
            "in the outage {smoother} of {filter} m"
        );
        let share = mean(|s| s.over_variance);
        assert!(
            (0.6..1.4).contains(&share),
            "error squared over variance: {share}"
        );
    }
}
