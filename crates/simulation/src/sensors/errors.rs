//! Error model of a three-axis sensor, what it makes of the true vector:
//! `measured = quantise(clip((1 + scale error) * true + bias + noise))`.

use nalgebra::Vector3;

use crate::random::{Stream, normal_vector, stream};

/// The errors of a three-axis sensor, in the sensor's own unit. Zero switches an error off; so the
/// default is a perfect sensor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ErrorModel {
    /// White noise of each sample, per axis: standard deviation.
    pub noise_std: f64,
    /// White noise given as a density, unit/sqrt(Hz); adds `noise_density * sqrt(rate)` to each
    /// sample's standard deviation, in quadrature.
    pub noise_density: f64,
    /// Constant bias that is the same in every run.
    pub bias: [f64; 3],
    /// Standard deviation, per axis, of a constant bias drawn once per run and added to `bias`.
    pub bias_std: f64,
    /// Random walk of the bias, unit/sqrt(s).
    pub bias_random_walk: f64,
    /// Standard deviation, per axis, of the relative scale error drawn once per run.
    pub scale_error_std: f64,
    /// Size of one step of the digital output.
    pub resolution: f64,
    /// Largest magnitude an axis can show; zero means no limit.
    pub range: f64,
}

/// The errors of one sensor in one run: constants drawn, bias walking, noise ready.
#[derive(Debug, Clone)]
pub struct SensorErrors {
    scale: Vector3<f64>,
    bias: Vector3<f64>,
    noise_std: f64,
    bias_step_std: f64,
    resolution: f64,
    range: f64,
    noise: Stream,
    bias_steps: Stream,
}

impl SensorErrors {
    /// Draws the constants of the sensor called `name`, which samples at `rate_hz`.
    #[must_use]
    pub fn new(seed: u64, name: &str, model: &ErrorModel, rate_hz: f64) -> Self {
        let mut constants = stream(seed, &format!("{name}/errors"));
        let drawn_bias = normal_vector(&mut constants, model.bias_std);
        let scale_error = normal_vector(&mut constants, model.scale_error_std);
        Self {
            scale: Vector3::repeat(1.0) + scale_error,
            bias: Vector3::from(model.bias) + drawn_bias,
            noise_std: (model.noise_std.powi(2) + model.noise_density.powi(2) * rate_hz).sqrt(),
            bias_step_std: model.bias_random_walk / rate_hz.sqrt(),
            resolution: model.resolution,
            range: model.range,
            noise: stream(seed, name),
            bias_steps: stream(seed, &format!("{name}/bias")),
        }
    }

    /// The bias that the next sample will carry.
    #[must_use]
    pub fn bias(&self) -> Vector3<f64> {
        self.bias
    }

    /// The next sample, given the true value. Each call is one sampling interval of the bias walk.
    pub fn measure(&mut self, truth: &Vector3<f64>) -> Vector3<f64> {
        let mut measured = truth.component_mul(&self.scale) + self.bias;
        if self.noise_std > 0.0 {
            measured += normal_vector(&mut self.noise, self.noise_std);
        }
        if self.bias_step_std > 0.0 {
            self.bias += normal_vector(&mut self.bias_steps, self.bias_step_std);
        }
        if self.range > 0.0 {
            measured.apply(|x| *x = x.clamp(-self.range, self.range));
        }
        if self.resolution > 0.0 {
            measured.apply(|x| *x = (*x / self.resolution).round() * self.resolution);
        }
        measured
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(model: &ErrorModel, truth: Vector3<f64>, n: usize) -> Vec<Vector3<f64>> {
        let mut errors = SensorErrors::new(1, "gyroscope", model, 100.0);
        (0..n).map(|_| errors.measure(&truth)).collect()
    }

    /// Mean square per axis.
    fn mean_square(values: impl ExactSizeIterator<Item = Vector3<f64>>) -> f64 {
        let n = values.len() as f64;
        values.map(|v| v.norm_squared()).sum::<f64>() / (3.0 * n)
    }

    #[test]
    fn a_perfect_sensor_changes_nothing() {
        let truth = Vector3::new(0.1, -2.0, 9.7);
        assert_eq!(samples(&ErrorModel::default(), truth, 3), vec![truth; 3]);
    }

    #[test]
    fn white_noise_has_its_variance_per_sample_and_per_density() {
        for (noise_std, noise_density, expected) in
            [(0.02, 0.0, 0.02), (0.0, 0.002, 0.02), (0.03, 0.004, 0.05)]
        {
            let model = ErrorModel {
                noise_std,
                noise_density,
                ..ErrorModel::default()
            };
            let noise = samples(&model, Vector3::zeros(), 50_000);
            let std = mean_square(noise.iter().copied()).sqrt();
            assert!((std / expected - 1.0).abs() < 0.01, "{std} for {expected}");
            // White: neighbours are uncorrelated.
            let neighbours: f64 = noise.windows(2).map(|w| w[0].dot(&w[1])).sum();
            assert!((neighbours / (150_000.0 * expected * expected)).abs() < 0.01);
        }
    }

    #[test]
    fn the_allan_variance_is_that_of_white_noise_and_a_random_walk() {
        // Allan variance of the sum: N^2/tau + K^2 tau/3.
        let (density, walk) = (1e-3, 1e-3);
        let model = ErrorModel {
            noise_density: density,
            bias_random_walk: walk,
            ..ErrorModel::default()
        };
        let values = samples(&model, Vector3::zeros(), 1_000_000);
        for (cluster, tolerance) in [(10, 0.03), (100, 0.06), (2000, 0.25)] {
            let means: Vec<Vector3<f64>> = values
                .chunks_exact(cluster)
                .map(|chunk| chunk.iter().sum::<Vector3<f64>>() / cluster as f64)
                .collect();
            let allan = 0.5 * mean_square(means.windows(2).map(|w| w[1] - w[0]));
            let tau = cluster as f64 / 100.0;
            let expected = density * density / tau + walk * walk * tau / 3.0;
            assert!(
                (allan / expected - 1.0).abs() < tolerance,
                "{tau} s: {}",
                allan / expected
            );
        }
    }

    #[test]
    fn the_bias_is_the_fixed_part_plus_a_draw_per_run() {
        let model = ErrorModel {
            bias: [1.0, -2.0, 3.0],
            bias_std: 0.1,
            ..ErrorModel::default()
        };
        let fixed = Vector3::new(1.0, -2.0, 3.0);
        let draws: Vec<Vector3<f64>> = (0..2000)
            .map(|seed| SensorErrors::new(seed, "gyroscope", &model, 100.0).bias() - fixed)
            .collect();
        let std = mean_square(draws.iter().copied()).sqrt();
        assert!((std / 0.1 - 1.0).abs() < 0.04, "{std}");
        let mean = draws.iter().sum::<Vector3<f64>>() / 2000.0;
        assert!(mean.norm() < 0.015, "{mean}");
        // Without a walk it stays.
        let measured = samples(&model, Vector3::zeros(), 10);
        assert_eq!(measured[0], measured[9]);
        assert_eq!(
            measured[0],
            SensorErrors::new(1, "gyroscope", &model, 1.0).bias()
        );
    }

    #[test]
    fn scale_errors_multiply() {
        let model = ErrorModel {
            scale_error_std: 0.01,
            ..ErrorModel::default()
        };
        let one = samples(&model, Vector3::repeat(1.0), 1)[0];
        let ten = samples(&model, Vector3::repeat(10.0), 1)[0];
        assert!((one * 10.0 - ten).norm() < 1e-12);
        assert!((0.001..0.05).contains(&(one - Vector3::repeat(1.0)).norm()));
    }

    #[test]
    fn output_is_a_whole_number_of_steps_within_the_range() {
        let model = ErrorModel {
            noise_std: 3.0,
            resolution: 0.25,
            range: 4.0,
            ..ErrorModel::default()
        };
        let values = samples(&model, Vector3::zeros(), 10_000);
        let axes = || values.iter().flat_map(|v| v.iter().copied());
        assert!(axes().all(|x| x.abs() <= 4.0 && (x / 0.25).fract() == 0.0));
        // 18 % of the draws lie beyond the range.
        let clipped = axes().filter(|x| x.abs() > 3.99).count() as f64 / 30_000.0;
        assert!((clipped - 0.19).abs() < 0.02, "{clipped}");
        // Rounding, not truncation: an error of at most half a step, of variance step^2/12.
        let fine = ErrorModel {
            resolution: 0.25,
            ..ErrorModel::default()
        };
        let error = samples(&fine, Vector3::new(0.13, -0.13, 0.12), 1)[0];
        assert_eq!(error, Vector3::new(0.25, -0.25, 0.0));
    }

    #[test]
    fn one_error_more_leaves_the_noise_as_it_was() {
        let noise = ErrorModel {
            noise_std: 0.1,
            ..ErrorModel::default()
        };
        let more = ErrorModel {
            bias_std: 0.5,
            bias_random_walk: 0.1,
            ..noise
        };
        let (a, b) = (
            samples(&noise, Vector3::zeros(), 100),
            samples(&more, Vector3::zeros(), 100),
        );
        let only_bias = samples(
            &ErrorModel {
                noise_std: 0.0,
                ..more
            },
            Vector3::zeros(),
            100,
        );
        for k in 0..100 {
            assert!((a[k] + only_bias[k] - b[k]).norm() < 1e-12);
        }
    }
}
