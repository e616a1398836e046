//! An Allan curve explained to somebody who sees one for the first time.

use northing_recording::SensorKind;

use super::samples::Regular;
use super::{AllanReport, Coefficient};

/// A factor between curve and model beyond which the model is called in question.
const MISFIT: f64 = 1.3;

/// A floor before this time, s, is earlier than the bias of any usual sensor moves.
const EARLY_S: f64 = 3.0;

/// The explanation, the most important first.
pub(super) fn sentences(report: &AllanReport, regular: &Regular) -> Vec<String> {
    let mut sentences = vec![white_noise(report)];
    sentences.extend(quantisation(report));
    sentences.push(floor(report));
    sentences.extend(walk(report));
    sentences.push(end_of_the_record(report));
    sentences.extend(doubts(report));
    sentences.extend(gaps(report, regular));
    sentences
}

fn white_noise(report: &AllanReport) -> String {
    let unit = report.unit;
    let Some(n) = report.coefficients.noise_density else {
        return "No white noise is seen: the curve falls nowhere with the slope -1/2.".to_owned();
    };
    let per_hour = if report.sensor == SensorKind::Gyroscope {
        let angle = n.value.to_degrees() * 60.0;
        format!(" ({} deg/sqrt(h))", significant(angle))
    } else {
        String::new()
    };
    format!(
        "White noise: {} {unit}/sqrt(Hz){per_hour} {}, where the falling line of slope -1/2 passes tau = 1 s; \
         averaging four times as long halves it.",
        significant(n.value),
        precision(&n)
    )
}

fn quantisation(report: &AllanReport) -> Option<String> {
    let q = report.coefficients.quantisation?;
    let unit = match report.sensor {
        SensorKind::Gyroscope => "rad",
        SensorKind::Accelerometer => "m/s",
        _ => "uT s",
    };
    Some(format!(
        "At the shortest times the curve falls more steeply (slope -1): {} {unit} {} of quantisation, or a vibration, \
         whose mean falls as fast.",
        significant(q.value),
        precision(&q)
    ))
}

fn floor(report: &AllanReport) -> String {
    let (floor, unit) = (&report.floor, report.unit);
    let value = format!(
        "{} {unit}{}",
        significant(floor.deviation),
        per_hour(report, floor.deviation)
    );
    let tau = significant(floor.tau_s);
    match report.coefficients.bias_instability {
        Some(b) if floor.is_reached => format!(
            "The floor, {value}, is reached at tau = {tau} s: averaging longer does not help. It is the bias \
             instability, {} {unit} {} after division by 0.664.",
            significant(b.value),
            precision(&b)
        ),
        _ if floor.is_reached => format!(
            "The curve is lowest, {value}, at tau = {tau} s: averaging longer does not help, because the bias \
             has moved by then."
        ),
        _ => format!(
            "The curve still falls where the record ends, {value} at tau = {tau} s: the bias is steadier than \
             that, and how it drifts cannot be seen."
        ),
    }
}

fn walk(report: &AllanReport) -> Option<String> {
    let k = report.coefficients.random_walk?;
    let unit = report.unit;
    let doubt = if report.floor.tau_s < EARLY_S {
        " So early a rise is rarely the sensor: make sure that the device lay still and was warm."
    } else {
        ""
    };
    Some(format!(
        "For long times the curve rises with the slope +1/2: the bias walks by {} {unit}/sqrt(s) {}.{doubt}",
        significant(k.value),
        precision(&k)
    ))
}

fn end_of_the_record(report: &AllanReport) -> String {
    format!(
        "Beyond tau = {} s the record of {} is too short to say anything: a point there is the mean of a few \
         differences only.",
        significant(report.trusted_tau_s),
        duration(report.duration_s)
    )
}

fn doubts(report: &AllanReport) -> Option<String> {
    (report.worst_misfit > MISFIT).then(|| {
        format!(
            "The curve departs from the four noises by up to a factor of {:.1}: a vibration, a filter in the \
             sensor or a change of temperature; look at the plot before using the numbers.",
            report.worst_misfit
        )
    })
}

fn gaps(report: &AllanReport, regular: &Regular) -> Vec<String> {
    let mut sentences = Vec::new();
    if regular.filled > 0 {
        sentences.push(format!(
            "{} of {} samples were missing and are filled in on a straight line.",
            regular.filled, report.samples
        ));
    }
    if regular.pieces > 1 {
        sentences.push(format!(
            "Gaps cut the record into {} pieces; the longest, {:.1} s to {:.1} s after its start, is used.",
            regular.pieces, regular.span_s[0], regular.span_s[1]
        ));
    }
    if report.ignored_samples > 0 {
        sentences.push(format!(
            "{} samples were not finite or not later than the one before and are ignored.",
            report.ignored_samples
        ));
    }
    sentences
}

/// A gyroscope's value as data sheets have it.
fn per_hour(report: &AllanReport, value: f64) -> String {
    if report.sensor == SensorKind::Gyroscope {
        format!(" ({} deg/h)", significant(value.to_degrees() * 3600.0))
    } else {
        String::new()
    }
}

fn precision(coefficient: &Coefficient) -> String {
    let percent = 100.0 * coefficient.std / coefficient.value;
    format!("+- {} %", significant(percent))
}

fn duration(seconds: f64) -> String {
    if seconds < 600.0 {
        format!("{seconds:.0} s")
    } else if seconds < 7200.0 {
        format!("{:.0} minutes", seconds / 60.0)
    } else {
        format!("{:.1} hours", seconds / 3600.0)
    }
}

/// Two significant digits, without an exponent where that is readable.
fn significant(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 || !magnitude.is_finite() {
        return format!("{value}");
    }
    let exponent = magnitude.log10().floor();
    if !(-4.0..4.0).contains(&exponent) {
        return format!("{value:.1e}");
    }
    let unit = 10_f64.powf(exponent - 1.0);
    let decimals = (1.0 - exponent).max(0.0) as usize;
    format!("{:.decimals$}", (value / unit).round() * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_digits_are_kept() {
        let pairs = [
            (0.00512, "0.0051"),
            (1.0, "1.0"),
            (12.7, "13"),
            (268.0, "270"),
            (2.26e-5, "2.3e-5"),
            (0.0, "0"),
            (45_678.0, "4.6e4"),
            (0.0996, "0.100"),
        ];
        for (value, text) in pairs {
            assert_eq!(significant(value), text);
        }
    }

    #[test]
    fn durations_are_readable() {
        assert_eq!(duration(59.6), "60 s");
        assert_eq!(duration(1800.0), "30 minutes");
        assert_eq!(duration(9000.0), "2.5 hours");
    }
}
