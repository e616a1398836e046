//! What a calibration mends: bias, axes and scale of the inertial sensors, hard iron; and magnets, which none does.

use northing_recording::SensorKind;

use super::super::Diagnosis;
use super::super::axes::AxesFit;
use super::super::bias::{Witness, largest_jump};
use super::super::excursions::Condition;
use super::super::iron::FieldFit;
use super::{Cause, EXPLAINS, Finding, beyond_chance};

/// What is named is so many standard deviations from nothing. By chance alone three numbers together are so in one fit of ten
/// million; what else a fit of real samples is off by, nobody knows.
const SIGMAS: f64 = 6.0;
/// A field whose strength varies by less than this share of what the turn leaves is not changed by a magnet that comes near.
const STRENGTH_SHARE: f64 = 0.1;
/// An offset that makes the strength of the field vary so many times more than it was measured is none.
const NO_IRON: f64 = 2.0;
/// A field that turns with the gyroscope leaves residuals of less than this share of its strength.
const NOT_TURNING: f64 = 0.4;
/// A jump is the best of a hundred instants where it may have been.
const JUMP_SIGMAS: f64 = 6.5;
/// A bias that jumps by less (rad/s) is learned unnoticed: 0.1 deg/s.
const LEAST_JUMP_RAD_S: f64 = 0.001_75;
/// Axes less than this apart (rad) are those of one chip as it is sold, ...
const ONE_CHIP_RAD: f64 = 0.006;
/// ... and no board is soldered so far off, rad (4 degrees).
const NO_BOARD_RAD: f64 = 0.07;
/// A scale less than this off is that of an accelerometer as it is sold, ...
const AS_SOLD: f64 = 0.008;
/// ... and one that is more off belongs to none: the device was accelerated wherever it looked calm.
const NO_SCALE: f64 = 0.06;
/// The same where residuals are so many times larger than the moments themselves say.
const ACCELERATED: f64 = 2.0;
/// An accelerometer's bias that tilts by less (m/s^2) is that of one as it is sold: 1.7 degrees.
const LEAST_BIAS_M_S2: f64 = 0.3;
/// Less hard iron is left by a good calibration, microtesla: it turns the heading by up to a sixth of a right angle.
const LEAST_IRON_UT: f64 = 5.0;

impl Diagnosis {
    /// Everything of this file.
    pub(super) fn calibration(&self, findings: &mut Vec<Finding>) {
        let axes = self.axes.fit();
        let field = self.iron.fit();
        findings.extend(self.bias_change(axes.as_ref(), field.as_ref()));
        let calm = |fit: &AxesFit| {
            fit.residual_factor < ACCELERATED
                && fit.scale.value.amax() < NO_SCALE
                && fit.misalignment.value.norm() < NO_BOARD_RAD
        };
        let gyroscope_is_right = axes.as_ref().is_some_and(calm);
        if let Some(fit) = axes.filter(calm) {
            // Half a step of the values is no bias, scale or angle.
            let step = (self.accelerometer.resolution).step(SensorKind::Accelerometer);
            let least = 0.5 * step.unwrap_or_default();
            let least_share = least / self.gravity.mean.max(1.0);
            findings.extend(misalignment(&fit, least_share));
            findings.extend(scale(&fit, least_share, least));
        }
        if let Some(fit) = &field {
            let not_turning = fit.residual_std_ut > NOT_TURNING * self.strength.mean;
            // Iron that turns with the device changes the strength of the field by as much as its offset says: along the axis that
            // is turned about, hardly. An offset that is none makes a strength vary that did not.
            let [measured_ut, without_ut] = fit.strength_std_ut;
            let offset = fit.iron.offset_ut.norm();
            let no_iron = without_ut > NO_IRON * measured_ut && self.is_iron(fit, offset);
            if self.keeps_its_strength(fit.residual_std_ut) && (not_turning && gyroscope_is_right)
                || no_iron
            {
                return findings.push(self.other_axes(gyroscope_is_right));
            }
        }
        let iron = field.as_ref().and_then(|fit| self.hard_iron(fit));
        let change = field.as_ref().and_then(|fit| self.field_change(fit));
        // Hard iron makes the strength of the field depend on the pose.
        let disturbance = change.or_else(|| match iron {
            Some(_) => None,
            None => self.disturbance(),
        });
        findings.extend(iron);
        findings.extend(disturbance);
    }

    fn bias_change(&self, axes: Option<&AxesFit>, field: Option<&FieldFit>) -> Option<Finding> {
        let by_force = axes.map(|fit| (self.axes.pairs(), &fit.residuals));
        let by_field = field.map(|fit| (self.iron.pairs(), &fit.residuals));
        let witnesses = [by_force, by_field].into_iter().flatten();
        let witnesses = witnesses.flat_map(|(pairs, residuals)| {
            let each = pairs.iter().zip(residuals);
            each.map(|(pair, (residual, variance))| Witness::of(pair, residual, *variance))
        });
        let jump = largest_jump(witnesses.collect()).filter(|jump| {
            jump.sigmas > JUMP_SIGMAS && jump.rad_s - 2.0 * jump.std_rad_s > LEAST_JUMP_RAD_S
        });
        let rests = self.rests.bias_change();
        let (between_ns, rad_s, sigmas, what) = match (rests, jump) {
            (Some(rest), _) => (
                [rest.before_ns, rest.after_ns],
                rest.rad_s,
                rest.sigmas,
                "the rests at",
            ),
            (None, Some(jump)) => (jump.between_ns, jump.rad_s, jump.sigmas, "the turns at"),
            (None, None) => return None,
        };
        let [before_s, after_s] = between_ns.map(|time_ns| self.time_s(time_ns));
        Some(Finding {
            cause: Cause::BiasChange,
            sensor: SensorKind::Gyroscope,
            confidence: beyond_chance(sigmas),
            sentence: format!(
                "The gyroscope's bias changed by {:.2} deg/s between {what} {before_s:.1} s and {after_s:.1} s: a filter has to \
                 learn it anew, and the heading is off until it has. Let it warm up, or rest more often.",
                rad_s.to_degrees(),
            ),
        })
    }

    /// Whether an offset of this size, microtesla, is none by chance and more than what is expected of the magnetometer.
    fn is_iron(&self, fit: &FieldFit, size: f64) -> bool {
        let expected = self.stated.hard_iron_std_ut.unwrap_or(0.0);
        size > SIGMAS * fit.iron.std_ut && size > LEAST_IRON_UT.max(3.0 * expected)
    }

    fn hard_iron(&self, fit: &FieldFit) -> Option<Finding> {
        let iron = fit.iron;
        let size = iron.offset_ut.norm();
        self.is_iron(fit, size).then(|| Finding {
            cause: Cause::HardIron,
            sensor: SensorKind::Magnetometer,
            confidence: beyond_chance(size / iron.std_ut),
            sentence: format!(
                "The magnetometer has a hard iron of {size:.1} \u{00b5}T (\u{00b1} {:.1}): something magnetic turns with the device, and until \
                 it is known the heading's error depends on where it points. Calibrate the magnetometer where it is built in.",
                iron.std_ut,
            ),
        })
    }

    /// Whether the field kept its strength where the turns leave this much, microtesla.
    fn keeps_its_strength(&self, left_ut: f64) -> bool {
        STRENGTH_SHARE * left_ut > self.strength.std()
    }

    /// Of a gyroscope that gravity bears out, or of one that nothing does.
    fn other_axes(&self, gyroscope_is_right: bool) -> Finding {
        let whose = match gyroscope_is_right {
            true => {
                "its axes are not the gyroscope's (exchanged, or of other signs), or its samples are of another time"
            }
            false => {
                "axes of one of the two are exchanged or have other signs, the gyroscope's scale is off, or samples of one are of \
                      another time"
            }
        };
        Finding {
            cause: Cause::Misalignment,
            sensor: SensorKind::Magnetometer,
            confidence: 0.97,
            sentence: format!(
                "The magnetometer does not turn as the gyroscope says, and its field keeps its strength ({:.1} \u{00b5}T \u{00b1} {:.1}), which \
                 iron would change: {whose}. Put them right in a manifest (`axes`), or leave the magnetometer out.",
                self.strength.mean,
                self.strength.std(),
            ),
        }
    }

    fn field_change(&self, fit: &FieldFit) -> Option<Finding> {
        // A field of some strength cannot change by more than twice that.
        let is_possible = |change: f64| change < 2.0 * (self.strength.mean + self.strength.std());
        let change = fit.change.filter(|change| is_possible(change.change_ut));
        change.map(|change| Finding {
            cause: Cause::MagneticDisturbance,
            sensor: SensorKind::Magnetometer,
            confidence: beyond_chance(change.sigmas),
            sentence: format!(
                "The magnetic field changed by {:.0} \u{00b5}T at {:.1} s, which no turn of the device explains: iron or a magnet \
                 was near, or the system calibrated anew. Keep away from both, or leave the magnetometer out.",
                change.change_ut,
                self.time_s(change.time_ns),
            ),
        })
    }

    fn disturbance(&self) -> Option<Finding> {
        let explains = self.explained(Condition::Disturbed);
        let explained = self
            .by_magnetometer
            .excursions
            .explained_by(Condition::Disturbed);
        (explains > EXPLAINS).then(|| Finding {
            cause: Cause::MagneticDisturbance,
            sensor: SensorKind::Magnetometer,
            confidence: explains,
            sentence: format!(
                "The strength of the magnetic field leaves its usual {:.0} \u{00b5}T{}: {} samples are off for that reason, and R has \
                 nothing to do with it. Keep away from iron and magnets, or leave the magnetometer out.",
                self.strength.mean,
                self.from(explained.first_ns),
                explained.beyond,
            ),
        })
    }
}

/// Misalignment beyond one chip and `least`, rad.
fn misalignment(fit: &AxesFit, least: f64) -> Option<Finding> {
    let axes = &fit.misalignment;
    let (angle, std) = (axes.value.norm(), axes.std());
    (axes.sigmas() > SIGMAS && angle - 2.0 * std > ONE_CHIP_RAD.max(least)).then(|| Finding {
        cause: Cause::Misalignment,
        sensor: SensorKind::Accelerometer,
        confidence: beyond_chance(axes.sigmas()),
        sentence: format!(
            "The accelerometer's axes are {:.1} deg (\u{00b1} {:.1}) off those of the gyroscope ({} turns say so), as on boards \
             with two chips. Calibrate the board.",
            angle.to_degrees(),
            std.to_degrees(),
            fit.turns,
        ),
    })
}

/// A scale beyond what is sold and `least`, or a bias beyond that and `least_bias`, m/s^2.
fn scale(fit: &AxesFit, least: f64, least_bias: f64) -> Option<Finding> {
    let (scale, bias) = (&fit.scale, &fit.bias);
    let largest = scale.value.amax();
    let of_scale = scale.sigmas() > SIGMAS && largest > AS_SOLD.max(least);
    let of_bias = bias.sigmas() > SIGMAS && bias.value.norm() > LEAST_BIAS_M_S2.max(least_bias);
    let (what, sigmas) = match (of_scale, of_bias) {
        (true, _) => {
            let [x, y, z] = scale.value.map(|s| 100.0 * s).into();
            let std = 100.0 * scale.std();
            let what = format!(
                "scale of its axes is off by {x:+.1}, {y:+.1}, {z:+.1} % (\u{00b1} {std:.1})"
            );
            (what, scale.sigmas())
        }
        (false, true) => {
            let (size, std) = (bias.value.norm(), bias.std());
            let what = format!("bias is {size:.2} m/s\u{00b2} (\u{00b1} {std:.2})");
            (what, bias.sigmas())
        }
        (false, false) => return None,
    };
    Some(Finding {
        cause: Cause::Scale,
        sensor: SensorKind::Accelerometer,
        confidence: beyond_chance(sigmas),
        sentence: format!(
            "The gravity that the accelerometer measures depends on the pose: the {what}. Calibrate it in six poses."
        ),
    })
}
