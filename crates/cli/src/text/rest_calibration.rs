//! A calibration at rest for people: bias, noise and references.

use northing_core::calibration::RestCalibration;

/// Bias, noise and references, a line each, after `indent`.
pub(crate) fn values(c: &RestCalibration<f64>, indent: &str) -> String {
    let mut lines = Vec::new();
    let degrees = c.gyroscope_bias_rad_s.map(f64::to_degrees);
    let known = c.gyroscope_bias_std().to_degrees();
    let density = c.gyroscope_noise_density();
    let density = density
        .map(|d| format!(", {d:.2e} rad/s/sqrt(Hz)"))
        .unwrap_or_default();
    let std = c.gyroscope_std();
    lines.push(format!("gyroscope      {} samples", c.gyroscope_samples));
    lines.push(format!(
        "  bias         {} deg/s, each known to {known:.4}",
        vector(&degrees, 3)
    ));
    lines.push(format!("  noise        {std:.5} rad/s a sample{density}"));
    match (c.gravity(), c.accelerometer_std()) {
        (Some(gravity), Some(std)) => {
            lines.push(format!(
                "accelerometer  {} samples",
                c.accelerometer_samples
            ));
            lines.push(format!("  gravity      {gravity:.3} m/s^2"));
            lines.push(format!("  noise        {std:.4} m/s^2 a sample"));
        }
        _ => lines.push("accelerometer  none: the tilt has no reference".to_owned()),
    }
    match (c.magnetic_field_ut(), c.magnetometer_std_ut()) {
        (Some(field), Some(std)) => {
            let dip = c
                .dip()
                .map(|dip| format!(", {:.1} deg below the horizon", dip.to_degrees()));
            let dip = dip.unwrap_or_default();
            lines.push(format!("magnetometer   {} samples", c.magnetometer_samples));
            lines.push(format!(
                "  field        {:.2} microtesla{dip}",
                field.norm()
            ));
            lines.push(format!("  noise        {std:.3} microtesla a sample"));
        }
        _ => lines.push("magnetometer   none: the heading has no reference".to_owned()),
    }
    lines
        .iter()
        .map(|line| format!("{indent}{line}\n"))
        .collect()
}

fn vector(v: &[f64; 3], decimals: usize) -> String {
    let [x, y, z] = v;
    format!("{x:+.decimals$} {y:+.decimals$} {z:+.decimals$}")
}
