//! What a world has, in words.

use std::fmt;

use super::{AttitudeWorldDescription, HeadingSource, WorldFault};

impl AttitudeWorldDescription {
    /// The angle between gyroscope and accelerometer, deg.
    #[must_use]
    pub fn misalignment_deg(&self) -> f64 {
        self.board.gyroscope.turn().angle().to_degrees()
    }

    /// The fault with its size; `no fault`.
    #[must_use]
    pub fn fault_in_words(&self) -> String {
        let (gyroscope, accelerometer) = (&self.board.gyroscope, &self.board.accelerometer);
        match self.fault {
            WorldFault::None => "no fault".to_owned(),
            WorldFault::GyroscopeNoise => {
                format!(
                    "gyroscope noise {:.1e} rad/s/sqrt(Hz)",
                    gyroscope.noise_density
                )
            }
            WorldFault::AccelerometerNoise => {
                let std = accelerometer.noise_std();
                format!("accelerometer noise {std:.2} m/s^2 a sample")
            }
            WorldFault::MagnetometerNoise => match &self.board.heading {
                HeadingSource::Magnetometer(triad) => {
                    format!("magnetometer noise {:.1} uT a sample", triad.noise_std())
                }
                _ => "magnetometer noise".to_owned(),
            },
            WorldFault::Rounding => format!(
                "rounding to {:.2} m/s^2 and {:.2} deg/s",
                accelerometer.step,
                gyroscope.step.to_degrees()
            ),
            WorldFault::Hole => {
                let hole =
                    |[from, until]: &[f64; 2]| format!("{:.2} s at {from:.1} s", until - from);
                let holes: Vec<_> = self.delivery.holes.iter().map(hole).collect();
                format!("holes of {}", holes.join(", "))
            }
            WorldFault::Jitter => {
                format!(
                    "jitter of {:.0} % of an interval",
                    100.0 * self.delivery.jitter
                )
            }
            WorldFault::Bursts => self.delivery.bursts.map_or_else(String::new, |bursts| {
                let stamps = if bursts.one_stamp {
                    "one stamp"
                } else {
                    "stamps of arrival"
                };
                format!("bursts of {} with {stamps}", bursts.samples)
            }),
            WorldFault::Saturation => format!(
                "full scale {:.0} deg/s and {:.0} m/s^2",
                gyroscope.full_scale.to_degrees(),
                accelerometer.full_scale
            ),
            WorldFault::MagneticDisturbance => {
                self.disturbance.map_or_else(String::new, |magnet| {
                    let goes = magnet
                        .until_s
                        .map_or_else(|| "stays".to_owned(), |t| format!("goes at {t:.0} s"));
                    let strength = norm(&magnet.field_ut);
                    format!(
                        "magnet of {strength:.0} uT from {:.0} s, {goes}",
                        magnet.from_s
                    )
                })
            }
            WorldFault::HardIron => match &self.board.heading {
                HeadingSource::Magnetometer(triad) => {
                    format!("hard iron {:.0} uT", norm(&triad.bias))
                }
                _ => "hard iron".to_owned(),
            },
            WorldFault::Misalignment => format!("misalignment {:.1} deg", self.misalignment_deg()),
            WorldFault::AccelerometerScale => {
                let [x, y, z] = accelerometer.scale_error.map(|s| 100.0 * s);
                format!("accelerometer scale {x:+.1}, {y:+.1}, {z:+.1} %")
            }
            WorldFault::BiasJump => self.bias_jump.map_or_else(String::new, |jump| {
                let size = norm(&jump.gyroscope_rad_s).to_degrees();
                format!("bias jump of {size:.1} deg/s at {:.0} s", jump.time_s)
            }),
        }
    }
}

impl fmt::Display for AttitudeWorldDescription {
    /// Several lines.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (gyroscope, accelerometer) = (&self.board.gyroscope, &self.board.accelerometer);
        writeln!(
            f,
            "World {}: {}, {:.0} s, {}",
            self.number,
            self.motion.name(),
            self.duration_s,
            self.fault_in_words()
        )?;
        writeln!(
            f,
            "Gyroscope: {:.0} Hz, noise {:.1e} rad/s/sqrt(Hz), bias {:.3} deg/s, {:.2} deg from the accelerometer",
            gyroscope.rate_hz,
            gyroscope.noise_density,
            norm(&gyroscope.bias).to_degrees(),
            self.misalignment_deg()
        )?;
        writeln!(
            f,
            "Accelerometer: {:.0} Hz, noise {:.1e} m/s^2/sqrt(Hz), bias {:.3} m/s^2",
            accelerometer.rate_hz,
            accelerometer.noise_density,
            norm(&accelerometer.bias)
        )?;
        match &self.board.heading {
            HeadingSource::Magnetometer(triad) => writeln!(
                f,
                "Magnetometer: {:.0} Hz, noise {:.2} uT a sample, hard iron {:.1} uT, field {:.0} uT",
                triad.rate_hz,
                triad.noise_std(),
                norm(&triad.bias),
                norm(&self.field_ut)
            ),
            HeadingSource::Compass(compass) => writeln!(
                f,
                "Compass: {:.0} Hz, {:.0} deg, stated {:.0} deg, lag {:.2} s",
                compass.rate_hz,
                compass.std_rad.to_degrees(),
                compass.stated_std_rad.to_degrees(),
                compass.lag_s
            ),
            HeadingSource::None => writeln!(f, "Nothing says where north is"),
        }
    }
}

fn norm(vector: &[f64; 3]) -> f64 {
    vector.iter().map(|v| v * v).sum::<f64>().sqrt()
}
