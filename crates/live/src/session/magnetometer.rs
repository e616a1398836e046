//! A magnetometer calibration under way: what was seen of the sphere, where to turn next, the fit.

use nalgebra::{Matrix3, Vector3};
use northing_core::calibration::RestCalibration;
use northing_core::calibration::magnetometer::{
    MagnetometerCalibration, MagnetometerCalibrator, MagnetometerLimits, MagnetometerModel,
    calibrate, coverage,
};
use northing_evaluation::statistics::thinned::Thinned;
use serde::{Deserialize, Serialize};

use crate::to_page::{Coverage, Magnetometer, MagnetometerFit, MagnetometerState};
use northing_evaluation::statistics::lamp::{Remark, Tone};

/// Samples kept for the fit; of longer turns every second one, and so on. A fit over all of them
/// takes a few milliseconds.
const MOST_SAMPLES: usize = 6000;
/// Points that a page draws.
const DRAWN_POINTS: usize = 300;
/// Share of the sphere from which on there is little to gain.
const ENOUGH: f64 = 0.85;
/// A component of a direction beyond this, of a unit vector, is worth a word.
const WORTH_A_WORD: f64 = 0.45;

/// What is to be done about a magnetometer's calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum MagnetometerAction {
    /// Begin gathering samples.
    Start,
    /// Fit, and apply the result from now on.
    Finish,
    /// Forget the samples.
    Cancel,
    /// No longer apply the calibration in force.
    Discard,
}

/// A calibration under way. Its memory is bounded, however long somebody turns.
#[derive(Debug)]
pub struct MagnetometerRun {
    calibrator: MagnetometerCalibrator<f64>,
    samples: Thinned<Vector3<f64>>,
    /// The last specific force: which way is up.
    force: Option<Vector3<f64>>,
}

impl Default for MagnetometerRun {
    fn default() -> Self {
        Self {
            calibrator: MagnetometerCalibrator::new(),
            samples: Thinned::new(MOST_SAMPLES),
            force: None,
        }
    }
}

impl MagnetometerRun {
    /// Takes a field as measured, microtesla.
    pub fn add_field(&mut self, field: &Vector3<f64>) {
        if self.calibrator.add(field) {
            self.samples.push(|| *field);
        }
    }

    /// Takes a specific force, m/s^2: it says which way is up.
    pub fn add_force(&mut self, force: &Vector3<f64>) {
        self.force = Some(*force);
    }

    /// The calibration; more samples can be added when it is refused.
    ///
    /// # Errors
    /// Why there is none, in a sentence that ends with what to do.
    pub fn finish(&self) -> Result<MagnetometerCalibration<f64>, String> {
        let samples = self.samples.items().iter().copied();
        calibrate(&samples, &MagnetometerLimits::default()).map_err(|error| error.to_string())
    }

    /// What a page draws while the device is turned.
    #[must_use]
    pub fn progress(&self, device: &str) -> Magnetometer {
        let fit = self.calibrator.finish(&MagnetometerLimits::default());
        let coverage = self.calibrator.coverage();
        Magnetometer {
            device: device.to_owned(),
            state: MagnetometerState::Running,
            verdict: Some(match &fit {
                Ok(fit) => judged(fit),
                Err(error) => Remark::new(Tone::Info, capitalised(&error.to_string())),
            }),
            fit: match &fit {
                Ok(fit) => Some(fit.into()),
                Err(_) => self.provisional(),
            },
            coverage: Some(Coverage {
                cells: coverage.counts().iter().map(|n| *n > 0).collect(),
                slices: coverage::SLICES,
                sectors: coverage::SECTORS,
                fraction: coverage.share(),
            }),
            points: Some(self.points()),
            samples: Some(self.calibrator.samples()),
            hint: Some(self.hint()),
        }
    }

    /// The sphere as it is known before a fit is good enough.
    fn provisional(&self) -> Option<MagnetometerFit> {
        let (centre, radius) = self.calibrator.sphere_ut()?;
        Some(MagnetometerFit {
            model: MagnetometerModel::Sphere,
            hard_iron_ut: centre.into(),
            soft_iron: Matrix3::identity().into(),
            field_strength_ut: radius,
            radius_ut: radius,
            residual_std_ut: None,
            uncalibrated_norm_std_ut: None,
        })
    }

    fn points(&self) -> Vec<[f64; 3]> {
        let items = self.samples.items();
        let step = items.len().div_ceil(DRAWN_POINTS).max(1);
        // The newest is always among them: that is where the device points now.
        let drawn = items.iter().rev().step_by(step);
        drawn
            .map(|p| p.map(|v| (v * 10.0).round() / 10.0).into())
            .collect()
    }

    /// Where to turn next, in words.
    fn hint(&self) -> String {
        let coverage = self.calibrator.coverage();
        if self.calibrator.samples() == 0 {
            return "Turn it slowly about all of its axes, on the spot.".to_owned();
        }
        if coverage.share() >= ENOUGH {
            return "Enough has been seen: press Finish.".to_owned();
        }
        let Some(gap) = coverage.widest_gap() else {
            return "Every direction has been seen: press Finish.".to_owned();
        };
        format!(
            "Turn it so that its {} {}.",
            side(&gap),
            self.where_the_field_points()
        )
    }

    /// The field points down in the north of the Earth and up in the south: the sensors say which.
    fn where_the_field_points(&self) -> &'static str {
        let newest = self.samples.items().last();
        let sphere = self.calibrator.sphere_ut();
        let (Some(force), Some(newest), Some((centre, _))) = (self.force, newest, sphere) else {
            return "down";
        };
        if (newest - centre).dot(&force) > 0.0 {
            "up"
        } else {
            "down"
        }
    }
}

fn judged(fit: &MagnetometerCalibration<f64>) -> Remark {
    let (seen, residual) = (fit.coverage * 100.0, fit.residual_std_ut);
    match fit.model {
        MagnetometerModel::Ellipsoid => Remark::new(
            Tone::Good,
            format!(
                "Good: {seen:.0} % of the sphere seen, hard and soft iron found, residual {residual:.2} uT."
            ),
        ),
        MagnetometerModel::Sphere => Remark::new(
            Tone::Warn,
            format!(
                "Usable: {seen:.0} % of the sphere seen, which gives the hard iron alone; turn it further \
                 for the soft iron."
            ),
        ),
    }
}

/// The sides of a phone that a direction in its axes leaves through, with their verb.
fn side(direction: &Vector3<f64>) -> String {
    let names = [
        ("left edge", "right edge"),
        ("bottom edge", "top edge"),
        ("back", "screen"),
    ];
    let mut sides: Vec<(f64, &str)> = direction
        .iter()
        .zip(names)
        .map(|(v, (negative, positive))| (v.abs(), if *v < 0.0 { negative } else { positive }))
        .collect();
    sides.sort_by(|a, b| b.0.total_cmp(&a.0));
    match sides.as_slice() {
        [(_, first), (size, second), ..] if *size > WORTH_A_WORD => {
            format!("{first} and its {second} point")
        }
        [(_, first), ..] => format!("{first} points"),
        [] => String::new(),
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// A rest calibration whose field was measured with one magnetometer calibration, as it would be
/// with another: both are linear, so that nothing need be measured again.
#[must_use]
pub fn recalibrated(
    rest: &RestCalibration<f64>,
    before: Option<&MagnetometerCalibration<f64>>,
    after: Option<&MagnetometerCalibration<f64>>,
) -> RestCalibration<f64> {
    let unit = || (Matrix3::identity(), Vector3::zeros());
    let parts = |c: &MagnetometerCalibration<f64>| (c.soft_iron(), c.hard_iron());
    let (old, old_centre) = before.map_or_else(unit, parts);
    let (new, new_centre) = after.map_or_else(unit, parts);
    let mut rest = *rest;
    let Some(back) = old.try_inverse() else {
        return rest;
    };
    let turn = new * back;
    if let Some(field) = &mut rest.magnetic_field_ut {
        *field = (new * (back * Vector3::from(*field) + old_centre - new_centre)).into();
    }
    if let Some(covariance) = &mut rest.magnetometer_covariance_ut2 {
        let scatter = turn * Matrix3::from(*covariance) * turn.transpose();
        *covariance = scatter.into();
        rest.magnetometer_std_ut = Some(scatter.diagonal().map(|v| v.max(0.0).sqrt()).into());
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_recording::Sample;
    use northing_simulation::virtual_phone::Motion;
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

    const HARD_IRON: Vector3<f64> = Vector3::new(25.0, -14.0, 30.0);

    fn tumbling(seed: u64, seconds: f64) -> MagnetometerRun {
        let mut config = VirtualPhoneConfig {
            seed,
            motion: Motion::Tumble,
            rest_before_s: 0.0,
            motion_s: seconds,
            rest_after_s: 0.0,
            ..VirtualPhoneConfig::default()
        };
        config.magnetometer.bias_ut = HARD_IRON.into();
        let mut run = MagnetometerRun::default();
        for event in VirtualPhone::new(config).unwrap().events() {
            match event.sample {
                Sample::MagneticField(field) => run.add_field(&field),
                Sample::SpecificForce(force) => run.add_force(&force),
                _ => {}
            }
        }
        run
    }

    #[test]
    fn a_phone_turned_all_over_gives_its_hard_iron() {
        for seed in 1..=4 {
            let run = tumbling(seed, 60.0);
            let found = run.finish().unwrap();
            let error = (found.hard_iron() - HARD_IRON).norm();
            assert!(error < 0.5, "seed {seed}: {error} microtesla");
            assert!(found.coverage > 0.7, "seed {seed}: {}", found.coverage);
            let progress = run.progress("d");
            assert_eq!(progress.verdict.unwrap().tone, Tone::Good);
            assert!(progress.points.unwrap().len() <= DRAWN_POINTS);
        }
    }

    #[test]
    fn too_little_turning_is_refused_with_what_to_do() {
        let run = tumbling(1, 2.5);
        let refused = run.finish().unwrap_err();
        assert!(refused.contains("more directions"), "{refused}");
        let hint = run.progress("d").hint.unwrap();
        assert!(
            hint.starts_with("Turn it so that its ") && hint.contains(" point"),
            "{hint}"
        );
        assert!(MagnetometerRun::default().progress("d").fit.is_none());
    }

    #[test]
    fn hours_of_turning_take_no_more_memory() {
        let mut run = MagnetometerRun::default();
        for k in 0..200_000 {
            let angle = f64::from(k) * 0.01;
            run.add_field(&Vector3::new(
                40.0 * angle.sin(),
                40.0 * angle.cos(),
                angle.fract(),
            ));
        }
        assert!(run.samples.items().len() <= MOST_SAMPLES);
        assert!(run.progress("d").points.unwrap().len() <= DRAWN_POINTS);
    }

    #[test]
    fn sides_have_names() {
        assert_eq!(side(&Vector3::new(0.1, -0.95, 0.2)), "bottom edge points");
        assert_eq!(
            side(&Vector3::new(0.7, 0.0, 0.7)),
            "right edge and its screen point"
        );
    }

    /// What was measured raw and recalibrated is what would have been measured calibrated; and back.
    #[test]
    fn a_rest_follows_the_magnetometer() {
        let calibration = tumbling(1, 60.0).finish().unwrap();
        let raw = Vector3::new(10.0, 35.0, -20.0);
        let mut rest = RestCalibration {
            magnetic_field_ut: Some(raw.into()),
            magnetometer_covariance_ut2: Some(Matrix3::identity().into()),
            ..some_rest()
        };
        rest.magnetometer_std_ut = Some([1.0; 3]);
        let applied = recalibrated(&rest, None, Some(&calibration));
        let field = applied.magnetic_field_ut().unwrap();
        assert!((field - calibration.apply(&raw)).norm() < 1e-9);
        let discarded = recalibrated(&applied, Some(&calibration), None);
        assert!((discarded.magnetic_field_ut().unwrap() - raw).norm() < 1e-9);
        assert!((discarded.magnetometer_std_ut.unwrap()[0] - 1.0).abs() < 1e-9);
    }

    fn some_rest() -> RestCalibration<f64> {
        let mut calibrator = northing_core::calibration::RestCalibrator::<f64>::new();
        for k in 0..200 {
            let wobble = 1e-3 * f64::from(k % 7);
            calibrator.add_gyroscope(&Vector3::new(wobble, -wobble, 0.0), Some(0.01));
        }
        calibrator
            .finish(&northing_core::calibration::RestLimits::default())
            .unwrap()
    }
}
