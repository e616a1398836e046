//! What a world has, in words.

use std::fmt;

use super::receiver::FaultKind;
use super::{Fault, WorldDescription};

/// A length that may be of centimetres or of thousands of kilometres.
fn length(metres: f64) -> String {
    match metres {
        m if m >= 1e4 => format!("{:.0} km", m / 1e3),
        m if m >= 10.0 => format!("{m:.0} m"),
        m if m >= 1.0 => format!("{m:.1} m"),
        m => format!("{m:.2} m"),
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (from, until, size) = (self.from_s, self.until_s, length(self.size_m));
        match self.kind {
            FaultKind::Outlier => write!(f, "outlier of {size} at {from:.0} s"),
            FaultKind::Drift => write!(f, "drift of {size} from {from:.0} to {until:.0} s"),
            FaultKind::Frozen => write!(f, "frozen from {from:.0} to {until:.0} s"),
            FaultKind::Outage => write!(f, "outage from {from:.0} to {until:.0} s"),
            FaultKind::Stale => write!(f, "stale first fix, {size} off"),
        }
    }
}

impl WorldDescription {
    /// What makes it hard, item by item: for tables.
    #[must_use]
    pub fn features(&self) -> Vec<String> {
        let (unit, receiver) = (&self.inertial, &self.receiver);
        let mut features = vec![format!(
            "receiver {} at {} Hz, stated {:.2} times",
            length(receiver.position_std_m),
            receiver.rate_hz,
            receiver.position_stated
        )];
        if receiver.velocity_std_m_s.is_some() {
            features.push(format!(
                "velocity, stated {:.2} times",
                receiver.velocity_stated
            ));
        }
        if receiver.latency_s > 0.02 {
            features.push(format!("latency {:.2} s", receiver.latency_s));
        }
        let arm = receiver
            .lever_arm_m
            .iter()
            .map(|v| v * v)
            .sum::<f64>()
            .sqrt();
        if arm > 0.05 {
            features.push(format!("lever arm {arm:.2} m"));
        }
        features.extend(receiver.faults.iter().map(ToString::to_string));
        if unit.any_mount {
            features.push("any mount".to_owned());
        }
        if unit.vibration_m_s2 > 0.3 {
            features.push(format!("vibration {:.1} m/s^2", unit.vibration_m_s2));
        }
        features.extend(
            unit.bias_jumps
                .iter()
                .map(|jump| format!("bias jump at {:.0} s", jump.time_s)),
        );
        if unit.saturation.is_some() {
            features.push("saturation".to_owned());
        }
        features
    }
}

impl fmt::Display for WorldDescription {
    /// Several lines.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (unit, receiver) = (&self.inertial, &self.receiver);
        let class = self.class.name();
        let (first, top) = (self.first_speed_m_s, self.top_speed_m_s);
        writeln!(
            f,
            "World {}: {class}, {:.0} s, {first:.1} m/s at the first sample, {top:.1} m/s at most",
            self.number, self.duration_s
        )?;
        writeln!(
            f,
            "Inertial unit: {:.0} Hz, noise {:.1e} rad/s/sqrt(Hz), {:.1e} m/s^2/sqrt(Hz), bias {:.4} rad/s, {:.3} m/s^2, \
             vibration {:.2} m/s^2 and {:.3} rad/s at {:.0} Hz, {}",
            unit.rate_hz,
            unit.gyroscope_noise_density,
            unit.accelerometer_noise_density,
            norm(&unit.gyroscope_bias_rad_s),
            norm(&unit.accelerometer_bias_m_s2),
            unit.vibration_m_s2,
            unit.vibration_rad_s,
            unit.vibration_hz,
            if unit.any_mount {
                "any mount"
            } else {
                "along the vehicle"
            },
        )?;
        for jump in &unit.bias_jumps {
            let (rate, force) = (norm(&jump.gyroscope_rad_s), norm(&jump.accelerometer_m_s2));
            writeln!(
                f,
                "  bias jump at {:.0} s: {rate:.4} rad/s, {force:.3} m/s^2",
                jump.time_s
            )?;
        }
        if let Some([rate, force]) = unit.saturation {
            writeln!(f, "  saturation at {rate:.2} rad/s and {force:.1} m/s^2")?;
        }
        writeln!(
            f,
            "Receiver: {} Hz, {}, {:.0} % correlated, stated {:.2} times; latency {:.3} s, lever arm {}",
            receiver.rate_hz,
            length(receiver.position_std_m),
            100.0 * receiver.correlated_fraction,
            receiver.position_stated,
            receiver.latency_s,
            length(norm(&receiver.lever_arm_m)),
        )?;
        match receiver.velocity_std_m_s {
            Some(std) => writeln!(
                f,
                "  velocity {std:.2} m/s, stated {:.2} times",
                receiver.velocity_stated
            )?,
            None => writeln!(f, "  no velocity")?,
        }
        receiver
            .faults
            .iter()
            .try_for_each(|fault| writeln!(f, "  {fault}"))
    }
}

fn norm(vector: &[f64; 3]) -> f64 {
    vector.iter().map(|v| v * v).sum::<f64>().sqrt()
}
