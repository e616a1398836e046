//! Checks about how the experiment was run: calibration, Q and R, sensors in use.

use northing_recording::SensorKind;

use super::{Found, answered, calibration, chosen, demand, moved, summary};
use crate::RunObserver;
use crate::attitude::EstimateRecord;
use crate::attitude::options::CompassUse;
use crate::exercises::cards::Card;
use crate::exercises::judgement::{Judgement, decimals};
use crate::exercises::work::Work;
use crate::statistics::consistency::NoiseVerdict;

/// Answers may be so far from the calibration, deg/s.
pub(in crate::exercises) const BIAS_DEG_S: f64 = 0.02;
/// Answers that repeat a number of the page may be rounded by so much, deg.
pub(in crate::exercises) const READ_DEG: f64 = 0.06;
/// Without magnetometer the yaw is at least this many times less certain than the tilt.
pub(in crate::exercises) const UNCERTAIN: f64 = 3.0;

pub(in crate::exercises) fn experiment(work: &Work<'_>, judgement: &mut Judgement) -> Found {
    calibration(work, judgement)?;
    moved(work, judgement)?;
    let summary = summary(work, work.events, judgement)?;
    let returned = summary.final_test.as_ref();
    demand(judgement, returned.is_some(), "reason.returned", [])?;
    let test = returned?;
    // As the pages show them: of the tilt alone where that is judged.
    let (calculated, estimated) = test.judged_deg();
    for (name, ours) in [("calculated", Some(calculated)), ("estimated", estimated)] {
        let Some(ours) = ours else {
            demand(judgement, false, "reason.noCovariance", [])?;
            continue;
        };
        let theirs = answered(work, judgement, Card::Experiment, name)?;
        let key = format!("reason.{name}");
        demand(
            judgement,
            (theirs - ours).abs() <= READ_DEG,
            &key,
            [("answer", decimals(theirs, 2)), ("run", decimals(ours, 2))],
        )?;
    }
    let verdict = test.verdict.map_or("", |verdict| verdict.name());
    let chosen = chosen(work, judgement, Card::Experiment, "verdict")?;
    demand(
        judgement,
        chosen == verdict,
        "reason.verdict",
        [("answer", chosen.to_owned()), ("run", verdict.to_owned())],
    )
}

pub(in crate::exercises) fn bias(work: &Work<'_>, judgement: &mut Judgement) -> Found {
    let calibration = calibration(work, judgement)?;
    let ours = calibration.gyroscope_bias_rad_s.map(f64::to_degrees);
    let mut theirs = [0.0; 3];
    for (value, axis) in theirs.iter_mut().zip(["x", "y", "z"]) {
        *value = answered(work, judgement, Card::Bias, axis)?;
    }
    let off = |theirs: [f64; 3]| {
        (0..3)
            .map(|i| (theirs[i] - ours[i]).abs())
            .fold(0.0, f64::max)
    };
    // The two mistakes that can be told from their numbers are told.
    if off(theirs) > BIAS_DEG_S {
        if off(theirs.map(f64::to_degrees)) <= BIAS_DEG_S {
            demand(judgement, false, "reason.biasUnit", [])?;
        }
        if off(theirs.map(|v| -v)) <= BIAS_DEG_S {
            demand(judgement, false, "reason.biasSign", [])?;
        }
    }
    for ((axis, theirs), ours) in ["x", "y", "z"].into_iter().zip(theirs).zip(ours) {
        let values = [
            ("axis", axis.to_owned()),
            ("answer", decimals(theirs, 3)),
            ("calibration", decimals(ours, 3)),
            ("most", decimals(BIAS_DEG_S, 2)),
        ];
        demand(
            judgement,
            (theirs - ours).abs() <= BIAS_DEG_S,
            "reason.bias",
            values,
        )?;
    }
    Some(())
}

pub(in crate::exercises) fn consistent(work: &Work<'_>, judgement: &mut Judgement) -> Found {
    moved(work, judgement)?;
    let sensors = &work.options.sensors;
    demand(
        judgement,
        sensors.accelerometer,
        "reason.accelerometerUsed",
        [],
    )?;
    let has_field = work
        .events
        .iter()
        .any(|e| e.sample.kind() == SensorKind::Magnetometer);
    demand(
        judgement,
        sensors.magnetometer || !has_field,
        "reason.magnetometerUsed",
        [],
    )?;
    let events = work.altered();
    let summary = summary(work, &events, judgement)?;
    demand(
        judgement,
        !summary.verdicts.is_empty(),
        "reason.noCovariance",
        [],
    )?;
    for verdict in &summary.verdicts {
        let factor = verdict.variance_factor.unwrap_or(1.0);
        let key = match verdict.verdict {
            NoiseVerdict::Consistent => "reason.consistent",
            NoiseVerdict::TooSmall => "reason.tooSmall",
            NoiseVerdict::TooLarge => "reason.tooLarge",
            NoiseVerdict::Outliers => "reason.outliers",
            NoiseVerdict::Undetermined => "reason.undetermined",
            NoiseVerdict::TooFew => "reason.tooFew",
        };
        // Where the data cannot tell, nobody is marked down.
        let holds = matches!(
            verdict.verdict,
            NoiseVerdict::Consistent | NoiseVerdict::Undetermined
        );
        let factor = if factor < 1.0 { 1.0 / factor } else { factor };
        let values = [
            ("sensor", verdict.sensor.name().to_owned()),
            ("nis", decimals(verdict.mean_nis, 2)),
            ("factor", decimals(factor, 1)),
        ];
        demand(judgement, holds, key, values)?;
    }
    Some(())
}

/// Standard deviations at the end of a run, deg: about the vertical, and of the tilt.
#[derive(Default)]
struct Last(Option<[f64; 2]>);

impl RunObserver for Last {
    fn estimate(&mut self, record: &EstimateRecord) {
        let Some(body) = record.attitude_covariance else {
            return;
        };
        let rotation = record.attitude.to_rotation_matrix();
        let level = rotation.matrix() * body * rotation.matrix().transpose();
        let std = |v: f64| v.max(0.0).sqrt().to_degrees();
        self.0 = Some([std(level[(2, 2)]), std(level[(0, 0)].max(level[(1, 1)]))]);
    }
}

pub(in crate::exercises) fn no_magnetometer(work: &Work<'_>, judgement: &mut Judgement) -> Found {
    let sensors = &work.options.sensors;
    let mut kinds = work.events.iter().map(|event| event.sample.kind());
    let has_compass = kinds.any(|kind| kind == SensorKind::CompassHeading);
    let is_off = !sensors.magnetometer && (sensors.compass == CompassUse::Never || !has_compass);
    demand(judgement, is_off, "reason.magnetometerOff", [])?;
    demand(
        judgement,
        sensors.accelerometer,
        "reason.accelerometerUsed",
        [],
    )?;
    let mut last = Last::default();
    let run = work.run(work.events, work.options.estimator, &mut last);
    if let Err(error) = run {
        return demand(
            judgement,
            false,
            "reason.noRun",
            [("error", error.to_string())],
        );
    }
    demand(judgement, last.0.is_some(), "reason.noCovariance", [])?;
    let [yaw, tilt] = last.0?;
    let values = [("yaw", decimals(yaw, 2)), ("tilt", decimals(tilt, 2))];
    demand(judgement, yaw >= UNCERTAIN * tilt, "reason.grown", values)?;
    let axis = chosen(work, judgement, Card::NoMagnetometer, "axis")?;
    demand(
        judgement,
        axis == "yaw",
        "reason.axis",
        [("answer", axis.to_owned())],
    )?;
    let why = chosen(work, judgement, Card::NoMagnetometer, "why")?;
    demand(
        judgement,
        why == "gravity",
        "reason.why",
        [("answer", why.to_owned())],
    )
}
