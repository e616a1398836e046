//! The subject: the one estimator of a device that lamps, innovations, NIS, result and report judge.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::AttitudeEstimator;
use northing_core::faults::FaultySensor;
use northing_core::geometry::so3;
use northing_core::kalman::Innovation;
use northing_core::kalman::covariance::normalized_square;
use northing_evaluation::attitude::kinds::EstimatorKind;
use northing_evaluation::attitude::parameters::Parameters;
use northing_evaluation::statistics::faults::sentence_now;
use northing_recording::{Event, Sample, SensorKind};
use serde::Serialize;

use super::aids::{AIDS, Aid, Delivery};
use super::frame::InnovationPoint;
use super::track::Track;
use super::{DeviceSession, seconds_since};
use northing_evaluation::statistics::lamp::{Lamp, LampWindow, Tone};

/// Innovations kept for the page between two frames: two seconds of fast sensors.
const MOST_INNOVATIONS: usize = 1000;
/// No lamp is green while the known truth is further away than this, standard deviations.
pub const FAR_SIGMAS: f64 = 5.0;
/// From here on the distance to the truth is worth a look, standard deviations.
const DOUBTFUL_SIGMAS: f64 = 3.0;
/// A truth further than this from the time of the estimate is not compared with it, s.
const LONGEST_STEP_S: f64 = 0.1;

/// The subject among those that run, in order, each with whether it states a covariance: the chosen one,
/// else `mekf`, else the first that states a covariance, else the first.
fn subject_of(
    running: &[(EstimatorKind, bool)],
    chosen: Option<EstimatorKind>,
) -> Option<EstimatorKind> {
    let is = |wanted: EstimatorKind| running.iter().find(move |(kind, _)| *kind == wanted);
    let stating = || {
        running
            .iter()
            .find(|(_, states_covariance)| *states_covariance)
    };
    chosen
        .and_then(is)
        .or_else(|| is(EstimatorKind::Mekf))
        .or_else(stating)
        .or_else(|| running.first())
        .map(|(kind, _)| *kind)
}

/// How far the subject is from a truth that is known.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct TruthError {
    /// Angle between the two, deg; without a heading reference that of the tilt alone.
    pub angle_deg: f64,
    /// The same in standard deviations of the subject, `sqrt(NEES)`; `None` without a covariance.
    pub sigmas: Option<f64>,
    /// Normalised estimation error squared.
    pub nees: Option<f64>,
    /// Its mean when the covariance is consistent: the degrees of freedom.
    pub degrees_of_freedom: u8,
    /// The colour of its lamp.
    pub tone: Tone,
    /// In a sentence.
    pub text: String,
}

impl TruthError {
    fn new(angle_deg: f64, nees: Option<f64>, degrees_of_freedom: u8) -> Self {
        let sigmas = nees.map(f64::sqrt);
        let tone = match sigmas {
            None => Tone::Idle,
            Some(far) if far > FAR_SIGMAS => Tone::Bad,
            Some(far) if far > DOUBTFUL_SIGMAS => Tone::Warn,
            Some(_) => Tone::Good,
        };
        let what = if degrees_of_freedom == 2 { "Tilt " } else { "" };
        let text = match sigmas {
            Some(far) => format!(
                "{what}{} deg from the truth, {} sigma.",
                figures(angle_deg),
                figures(far)
            ),
            None => format!("{what}{} deg from the truth.", figures(angle_deg)),
        };
        Self {
            angle_deg,
            sigmas,
            nees,
            degrees_of_freedom,
            tone,
            text,
        }
    }

    /// Whether no lamp may be green.
    fn is_far(&self) -> bool {
        self.tone == Tone::Bad
    }
}

/// Two figures of small numbers; large ones without digits behind the point.
fn figures(value: f64) -> String {
    let digits = match value {
        v if v < 0.95 => 2,
        v if v < 9.95 => 1,
        _ => 0,
    };
    format!("{value:.digits$}")
}

/// What is gathered about the subject.
#[derive(Debug)]
pub(super) struct Judged {
    /// What the user chose; `None` leaves it to what runs.
    chosen: Option<EstimatorKind>,
    /// The subject.
    subject: Option<EstimatorKind>,
    windows: Vec<LampWindow>,
    innovations: Vec<InnovationPoint>,
    pub(super) truth: Option<TruthError>,
}

impl Judged {
    pub(super) fn new(config: &Parameters) -> Self {
        Self {
            chosen: None,
            subject: None,
            windows: windows(config),
            innovations: Vec::new(),
            truth: None,
        }
    }

    /// Forgets what was gathered: it is of another estimator, or of other noise.
    pub(super) fn reset(&mut self, config: &Parameters) {
        *self = Self {
            chosen: self.chosen,
            subject: self.subject,
            ..Self::new(config)
        };
    }

    fn add(&mut self, step: Option<f64>, point: InnovationPoint, innovation: &Innovation<f64>) {
        let sensor = point.sensor;
        if let Some(index) = AIDS.iter().position(|aid| aid.sensor == sensor) {
            self.windows[index].add(innovation, step);
        }
        if self.innovations.len() >= MOST_INNOVATIONS {
            // Nobody looks: the newest are worth more when somebody does.
            self.innovations.drain(..MOST_INNOVATIONS / 2);
        }
        self.innovations.push(point);
    }

    /// The innovations since they were last asked for.
    pub(super) fn take_innovations(&mut self) -> Vec<InnovationPoint> {
        std::mem::take(&mut self.innovations)
    }
}

fn windows(config: &Parameters) -> Vec<LampWindow> {
    let window =
        |aid: &Aid| LampWindow::new(aid.sensor, (aid.correlation_time_s)(&config.attitude));
    AIDS.iter().map(window).collect()
}

impl DeviceSession {
    /// The estimator that lamps, innovations, result and report are about; `None` while none runs.
    #[must_use]
    pub fn subject(&self) -> Option<EstimatorKind> {
        self.judged.subject
    }

    /// Finds the subject among the estimators of now and forgets what was gathered about the one before.
    pub(super) fn renew_subject(&mut self) {
        let of = |track: &Track| {
            let estimator = track.driver.estimator();
            (track.kind, estimator.attitude_covariance().is_some())
        };
        let running: Vec<_> = self.tracks.iter().map(of).collect();
        let judged = &mut self.judged;
        // A choice ends with the estimator that was chosen.
        judged.chosen = judged
            .chosen
            .filter(|chosen| running.iter().any(|(kind, _)| kind == chosen));
        judged.subject = subject_of(&running, judged.chosen);
        self.judged.reset(&self.config());
    }

    /// The subject that was chosen; `None` while nobody has chosen.
    #[must_use]
    pub fn chosen(&self) -> Option<EstimatorKind> {
        self.judged.chosen
    }

    /// Chooses the subject among the estimators that run. What was gathered about the one before is
    /// forgotten.
    ///
    /// # Errors
    /// It does not run, in a sentence.
    pub fn use_subject(&mut self, kind: EstimatorKind) -> Result<(), String> {
        if !self.estimators().contains(&kind) {
            return Err(format!(
                "`{kind}` does not run on this device; choose it among the estimators first"
            ));
        }
        self.judged.chosen = Some(kind);
        self.renew_subject();
        Ok(())
    }

    /// Takes an innovation of the subject.
    pub(super) fn judge(&mut self, event: &Event, innovation: &Innovation<f64>) {
        let sensor = event.sample.kind();
        let t_s = seconds_since(self.first_ns, event.time_ns);
        let step = self.intake.resolution_of(sensor);
        let point = InnovationPoint {
            gain: gain(self.subject(), &event.sample, innovation),
            ..InnovationPoint::new(sensor, t_s, innovation)
        };
        self.judged.add(step, point, innovation);
    }

    fn subject_track(&self) -> Option<&Track> {
        let subject = self.subject()?;
        self.tracks.iter().find(|track| track.kind == subject)
    }

    /// Compares the subject with a truth of this time, the device's rate carrying it over what lies between.
    pub(super) fn compare_with_truth(&mut self, time_ns: i64, truth: &UnitQuaternion<f64>) {
        let step_s = time_ns.saturating_sub(self.estimate_ns) as f64 * 1e-9;
        if !(0.0..=LONGEST_STEP_S).contains(&step_s) {
            return;
        }
        let Some((track, estimate)) = self
            .subject_track()
            .and_then(|track| Some((track, track.driver.attitude()?)))
        else {
            self.judged.truth = None;
            return;
        };
        let estimate = estimate * so3::exp(&(self.rate_rad_s * step_s));
        let covariance = track.driver.attitude_covariance();
        let knows_north = track.knows_north();
        self.judged.truth = Some(error(&estimate, covariance, truth, knows_north));
    }

    /// The lamp of each sensor that there is to judge.
    pub(crate) fn lamps(&self) -> Vec<Lamp> {
        let has = |sensor| self.delivery(sensor) != Delivery::Missing;
        let (magnetometer, compass) = (SensorKind::Magnetometer, SensorKind::CompassHeading);
        // Of the two that give the heading one is enough, unless both are used.
        let is_replaced = |aid: &Aid| {
            (aid.sensor == magnetometer && !has(magnetometer) && has(compass))
                || (aid.sensor == compass && has(magnetometer) && !self.uses(aid))
        };
        let is_shown = |aid: &Aid| (aid.is_usual || has(aid.sensor)) && !is_replaced(aid);
        let shown = AIDS.iter().zip(&self.judged.windows);
        shown
            .filter(|(aid, _)| is_shown(aid))
            .map(|(aid, window)| self.lamp(aid, window))
            .collect()
    }

    fn lamp(&self, aid: &Aid, window: &LampWindow) -> Lamp {
        let idle = |text: &str| Lamp::idle(aid.sensor, text);
        match self.delivery(aid.sensor) {
            Delivery::Missing => return idle("No samples: nothing to judge."),
            Delivery::Stopped => {
                let seconds = self.silence_s(aid.sensor);
                return idle(&format!("No sample for {seconds:.0} s: nothing to judge."));
            }
            Delivery::Delivers if !self.uses(aid) => {
                return idle("Switched off: nothing to judge.");
            }
            Delivery::Delivers => {}
        }
        let Some(track) = self.subject_track() else {
            return idle("No estimator runs: nothing to judge.");
        };
        if track.driver.estimator().attitude_covariance().is_none() {
            return idle("No covariance: nothing to judge.");
        }
        let Some(mut lamp) = window.lamp().cloned() else {
            return idle("No innovations yet: nothing to judge.");
        };
        let truth = self.judged.truth.as_ref();
        if let Some(truth) = truth.filter(|truth| truth.is_far() && lamp.tone == Tone::Good) {
            // Innovations cannot show every error.
            lamp.tone = Tone::Bad;
            lamp.text = format!("{} {}", truth.text, lamp.text);
        }
        let own = match aid.sensor {
            SensorKind::Accelerometer => Some(FaultySensor::Accelerometer),
            SensorKind::Magnetometer => Some(FaultySensor::Magnetometer),
            _ => None,
        };
        // Without a rate nothing that the filter expects is worth judging.
        let sensors = own.into_iter().chain([FaultySensor::Gyroscope]);
        if let Some(fault) = sensors
            .filter_map(|sensor| track.driver.fault_now(sensor))
            .next()
        {
            lamp.tone = Tone::Bad;
            lamp.text = format!("{} {}", sentence_now(fault), lamp.text);
        }
        lamp
    }
}

/// Kalman gain in the space of the measurement, `H P H^T S^-1 = I - R S^-1`, mean over the two directions that a vector
/// shows. The multiplicative filters measure `H = [v x]` with `R = r I`: along the predicted vector `v` nothing is learnt, so
/// that `r` is the variance of the innovation there.
fn gain(
    subject: Option<EstimatorKind>,
    sample: &Sample,
    innovation: &Innovation<f64>,
) -> Option<f64> {
    let is_vector = innovation.degrees_of_freedom == 3;
    if !is_vector || !matches!(subject?, EstimatorKind::Mekf | EstimatorKind::Mekf3) {
        return None;
    }
    let (Sample::SpecificForce(measured) | Sample::MagneticField(measured)) = sample else {
        return None;
    };
    let along = (measured - innovation.residual).try_normalize(f64::MIN_POSITIVE)?;
    let variance = along.dot(&(innovation.covariance * along));
    let inverse = innovation.covariance.try_inverse()?;
    Some((3.0 - variance * inverse.trace()) / 2.0).filter(|gain| gain.is_finite())
}

/// The error of an estimate; where north is unknown that of the tilt alone, for any heading is as good.
fn error(
    estimate: &UnitQuaternion<f64>,
    covariance: Option<Matrix3<f64>>,
    truth: &UnitQuaternion<f64>,
    knows_north: bool,
) -> TruthError {
    let local = so3::log(&(estimate.inverse() * truth));
    if knows_north {
        let nees = covariance.and_then(|p| normalized_square(&local, &p));
        return TruthError::new(local.norm().to_degrees(), nees, 3);
    }
    // The turn between the two verticals, in level axes.
    let up = Vector3::z();
    let seen = estimate * (truth.inverse() * up);
    let tilt = up.cross(&seen).xy();
    let tilt = tilt * (tilt.norm().atan2(up.dot(&seen)) / tilt.norm().max(f64::MIN_POSITIVE));
    let rotation = estimate.to_rotation_matrix();
    let nees = covariance.and_then(|p| {
        let level = rotation.matrix() * p * rotation.matrix().transpose();
        normalized_square(&tilt, &level.fixed_view::<2, 2>(0, 0).into_owned())
    });
    TruthError::new(tilt.norm().to_degrees(), nees, 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(x: f64, y: f64, z: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z))
    }

    #[test]
    fn the_distance_from_the_truth_is_in_standard_deviations_of_the_estimate() {
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 4e-4));
        let estimate = turn(0.3, -0.2, 1.0);
        let truth = estimate * turn(0.0, 0.0, 0.08);
        let off = error(&estimate, Some(covariance), &truth, true);
        assert!((off.sigmas.unwrap() - 4.0).abs() < 1e-9, "{off:?}");
        assert!((off.angle_deg - 0.08_f64.to_degrees()).abs() < 1e-9);
        assert_eq!((off.tone, off.degrees_of_freedom), (Tone::Warn, 3));
        let far = error(&estimate, Some(covariance * 0.01), &truth, true);
        assert_eq!(far.tone, Tone::Bad);
        assert_eq!(far.text, "4.6 deg from the truth, 40 sigma.");
        let none = error(&estimate, None, &truth, true);
        assert_eq!((none.tone, none.nees), (Tone::Idle, None));
    }

    /// A turn about the vertical is no error where north is unknown; a tilt is the same as ever.
    #[test]
    fn without_north_the_tilt_alone_is_judged() {
        let covariance = Matrix3::identity() * 1e-4;
        let truth = turn(0.4, 0.3, -0.8);
        let headed = turn(0.0, 0.0, 1.3) * truth;
        let off = error(&headed, Some(covariance), &truth, false);
        assert!(off.sigmas.unwrap() < 1e-6, "{off:?}");
        let tilted = turn(0.03, 0.04, 0.0) * headed;
        let off = error(&tilted, Some(covariance), &truth, false);
        assert!((off.sigmas.unwrap() - 5.0).abs() < 1e-6, "{off:?}");
        assert!((off.angle_deg - 0.05_f64.to_degrees()).abs() < 1e-9);
        assert_eq!(off.degrees_of_freedom, 2);
    }

    #[test]
    fn the_subject_is_the_chosen_one_else_mekf_else_the_first_with_a_covariance() {
        use EstimatorKind::{Complementary, Integration, Mekf, Mekf3, Usque};
        let of = |kinds: &[EstimatorKind], chosen| {
            let states =
                |kind: &EstimatorKind| (*kind, ![Integration, Complementary].contains(kind));
            subject_of(&kinds.iter().map(states).collect::<Vec<_>>(), chosen)
        };
        assert_eq!(of(&[Integration, Usque, Mekf], None), Some(Mekf));
        assert_eq!(of(&[Integration, Usque, Mekf], Some(Usque)), Some(Usque));
        assert_eq!(of(&[Integration, Complementary, Mekf3], None), Some(Mekf3));
        assert_eq!(
            of(&[Integration, Complementary], Some(Mekf)),
            Some(Integration)
        );
        assert_eq!(of(&[], Some(Mekf)), None);
    }
}
