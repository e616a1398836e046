//! How well a device delivers, in words.

use northing_evaluation::attitude::options::CompassUse;
use northing_recording::SensorKind;

use super::intake::Intake;
use northing_evaluation::statistics::lamp::{Remark, Tone};

/// Below this rate fast turns are missed, Hz.
const SLOW_HZ: f64 = 20.0;

/// What there is to say about a device; the worst comes first.
#[must_use]
pub fn remarks(
    intake: &Intake,
    stopped: &[SensorKind],
    compass: CompassUse,
    lost_batches: u64,
) -> Vec<Remark> {
    let mut remarks = Vec::new();
    if intake.received() == 0 {
        // That there is neither gyroscope nor anything else would be three sentences for one.
        let text = "Nothing received: no sensor has delivered a sample.";
        remarks.push(Remark::new(Tone::Bad, text));
        counted(&mut remarks, intake, lost_batches);
        return remarks;
    }
    if intake.received_of(SensorKind::Gyroscope) == 0 {
        remarks.push(Remark::new(
            Tone::Bad,
            "No gyroscope: nothing can be estimated. Allow motion sensors on the phone, or choose a device that has one.",
        ));
    }
    if intake.received_of(SensorKind::Accelerometer) == 0 {
        remarks.push(Remark::new(
            Tone::Bad,
            "No accelerometer: which way is up cannot be told.",
        ));
    }
    // Others tell only what has changed, and are silent at rest.
    let measures = |kind: &&SensorKind| {
        matches!(
            kind,
            SensorKind::Gyroscope | SensorKind::Accelerometer | SensorKind::Magnetometer
        )
    };
    for kind in stopped.iter().filter(measures) {
        let text = format!("The {} has stopped delivering.", kind.name());
        remarks.push(Remark::new(Tone::Bad, text));
    }
    for (kind, rate) in intake.rates_hz() {
        if kind == SensorKind::Gyroscope && rate < SLOW_HZ {
            remarks.push(Remark::new(
                Tone::Warn,
                format!(
                    "Only {rate:.1} gyroscope samples a second: fast turns are missed. Set a sampling \
                     interval of 10 ms in the app, or turn power saving off."
                ),
            ));
        }
    }
    if intake.received_of(SensorKind::Magnetometer) == 0 {
        let text = if intake.received_of(SensorKind::CompassHeading) > 0 {
            match compass.applies(false) {
                true => {
                    "No magnetometer: the phone's own compass gives the heading; it is slow, and off by \
                     5 to 20 deg."
                }
                false => {
                    "No magnetometer, and the compass is switched off: the heading is not observed and \
                     drifts slowly."
                }
            }
        } else {
            "No magnetometer: the heading cannot be observed and drifts slowly."
        };
        remarks.push(Remark::new(Tone::Warn, text));
    }
    for (kind, step) in intake.resolutions() {
        let (step, unit) = match kind {
            SensorKind::Gyroscope => (step.to_degrees(), "deg/s"),
            SensorKind::Accelerometer => (step, "m/s^2"),
            _ => (step, "microtesla"),
        };
        remarks.push(Remark::new(
            Tone::Info,
            format!(
                "Coarse values: the {} comes in steps of {step:.3} {unit}. A calibration takes at \
                 least step/sqrt(12) as its noise.",
                kind.name()
            ),
        ));
    }
    if let Some(text) = intake.timing_of(SensorKind::Gyroscope).in_words() {
        remarks.push(Remark::new(Tone::Info, text));
    }
    counted(&mut remarks, intake, lost_batches);
    if remarks
        .iter()
        .all(|r| matches!(r.tone, Tone::Good | Tone::Info))
    {
        remarks.push(Remark::new(Tone::Good, "All sensors deliver."));
    }
    remarks
}

fn counted(remarks: &mut Vec<Remark>, intake: &Intake, lost_batches: u64) {
    let mut warn = |count: u64, text: &str| {
        if count > 0 {
            remarks.push(Remark::new(Tone::Warn, format!("{count} {text}")));
        }
    };
    warn(
        lost_batches,
        "batches never arrived: the network loses data.",
    );
    warn(
        intake.refused(),
        "samples were refused: not finite, or larger than any sensor measures.",
    );
    warn(
        intake.late(),
        "samples came too late for the live estimate.",
    );
}
