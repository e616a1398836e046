//! What the rests of a recording say of its sensors: a gyroscope bias that changed, accelerometer axes that are not
//! those of the gyroscope (two chips on one board), and an accelerometer whose scale is off.
//!
//! While a device rests the gyroscope shows its bias and the accelerometer the vertical. From one rest to the next
//! the gyroscope, less that bias, says how the device was turned (rotation vector `r`), so it carries the first
//! vertical `u1` to the second pose, where `u2` is measured. Where a small rotation `m` takes the accelerometer's
//! axes to the gyroscope's, `u_true = u + m x u`, and the gyroscope's scale is off by a share `s`,
//!
//! ```text
//! u2 - C u1  =  ([u2]x - C [u1]x) m  -  (r x C u1) s,      C = Exp(-r)
//! ```
//!
//! which is linear. Turns about two axes make all of `m` observable.

use nalgebra::{Matrix3x4, Matrix4, UnitQuaternion, Vector3, Vector4};
use northing_core::geometry::so3;

/// Means are made over windows of this length, s, ...
const WINDOW_S: f64 = 0.5;
/// ... and so many in a row that agree are a rest: a hand that is steady for a moment, or pans, does not agree.
const WINDOWS: u32 = 4;
/// Means agree within so many standard deviations.
const AGREE: f64 = 3.5;
/// Fewer samples are no window.
const FEWEST: u32 = 10;
/// A window rests when its rates and forces vary by less than so many times the least that any window showed, ...
const QUIET: f64 = 3.0;
/// ... and turns by less than this (rad/s): no gyroscope of a device has a larger bias.
pub(super) const SLOWEST_RAD_S: f64 = 0.15;
/// Turns that take longer are not used: the bias may have changed meanwhile, s.
const LONGEST_TURN_S: f64 = 20.0;
/// Turns smaller than this (rad) say nothing of the axes.
const LEAST_TURN_RAD: f64 = 0.3;
/// Forces vary by less than this share of gravity in a rest: a hand is quieter.
const QUIET_SHARE: f64 = 0.03;
/// Standard deviation of a gyroscope's scale, before the turns say more.
const SCALE_STD: f64 = 0.02;
/// A change is named when it is so many times its standard deviation.
const SIGMAS: f64 = 6.0;

/// The mean of windows at rest.
#[derive(Debug, Clone, Copy)]
struct Rest {
    windows: u32,
    end_ns: i64,
    rate: Vector3<f64>,
    /// Variance of that mean, per axis.
    rate_variance: f64,
    force: Vector3<f64>,
    /// Variance of that mean, per axis.
    force_variance: f64,
}

impl Rest {
    /// Whether a window is of the same rest.
    fn agrees(&self, window: &Self) -> bool {
        let far = |difference: Vector3<f64>, a: f64, b: f64| {
            difference.norm_squared() > 3.0 * AGREE * AGREE * (a + b)
        };
        !far(
            self.rate - window.rate,
            self.rate_variance,
            window.rate_variance,
        ) && !far(
            self.force - window.force,
            self.force_variance,
            window.force_variance,
        )
    }

    fn and(&self, window: &Self) -> Self {
        let n = f64::from(self.windows);
        let mean = |a: Vector3<f64>, b: Vector3<f64>| (a * n + b) / (n + 1.0);
        let variance = |a: f64, b: f64| (a * n * n + b) / ((n + 1.0) * (n + 1.0));
        Self {
            windows: self.windows + 1,
            end_ns: window.end_ns,
            rate: mean(self.rate, window.rate),
            rate_variance: variance(self.rate_variance, window.rate_variance),
            force: mean(self.force, window.force),
            force_variance: variance(self.force_variance, window.force_variance),
        }
    }
}

/// A bias that changed from one rest to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasChange {
    /// The end of the rest before, ns.
    pub before_ns: i64,
    /// The end of the rest after, ns.
    pub after_ns: i64,
    /// By how much, rad/s.
    pub rad_s: f64,
    /// In its standard deviations.
    pub sigmas: f64,
}

/// Accelerometer axes that are not those of the gyroscope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misalignment {
    /// Rotation vector, rad.
    pub rotation: Vector3<f64>,
    /// Its length in standard deviations.
    pub sigmas: f64,
    /// Turns it was found by.
    pub turns: u32,
}

/// An accelerometer whose measured gravity depends on the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleError {
    /// Largest minus smallest, as a share of the mean.
    pub share: f64,
    /// In its standard deviations.
    pub sigmas: f64,
}

/// Mean and spread of the samples of a window.
#[derive(Debug, Clone, Copy, Default)]
struct Window {
    count: u32,
    mean: Vector3<f64>,
    squares: f64,
}

impl Window {
    fn add(&mut self, v: &Vector3<f64>) {
        self.count += 1;
        let before = v - self.mean;
        self.mean += before / f64::from(self.count);
        self.squares += before.dot(&(v - self.mean));
    }

    /// Variance of a sample, per axis.
    fn variance(&self) -> f64 {
        self.squares / (3.0 * f64::from(self.count.max(2) - 1))
    }
}

/// Watches gyroscope and accelerometer. See the [module](self).
#[derive(Debug, Clone, Default)]
pub struct Rests {
    since_ns: Option<i64>,
    last_rate: Option<(i64, Vector3<f64>)>,
    rates: Window,
    forces: Window,
    /// Least variances of any window.
    least: Option<[f64; 2]>,
    /// Windows that agree so far.
    quiet: Option<Rest>,
    /// The last rest.
    rest: Option<Rest>,
    /// Turn of the body since the last rest, `last_from_now`.
    turn: UnitQuaternion<f64>,
    bias_change: Option<BiasChange>,
    information: Matrix4<f64>,
    weighted: Vector4<f64>,
    turns: u32,
    /// Squared differences of the means of neighbouring windows of one rest, per axis, and how many: a hand's
    /// slow motion is in none of the windows' own variances.
    repeated: [f64; 2],
    repeats: u32,
    lengths: Option<[(f64, f64); 2]>,
}

impl Rests {
    /// Takes an angular rate, rad/s.
    pub fn rate(&mut self, time_ns: i64, rate: &Vector3<f64>) {
        if let Some((last_ns, last)) = self.last_rate.replace((time_ns, *rate)) {
            let dt = time_ns.saturating_sub(last_ns) as f64 * 1e-9;
            if (0.0..1.0).contains(&dt) {
                let bias = self.rest.map_or(Vector3::zeros(), |rest| rest.rate);
                self.turn *= so3::exp(&(((rate + last) * 0.5 - bias) * dt));
            } else {
                self.rest = None;
            }
        }
        let since = *self.since_ns.get_or_insert(time_ns);
        self.rates.add(rate);
        if time_ns.saturating_sub(since) as f64 * 1e-9 >= WINDOW_S {
            self.end_window(time_ns);
        }
    }

    /// Takes a specific force, m/s^2.
    pub fn force(&mut self, force: &Vector3<f64>) {
        if self.since_ns.is_some() {
            self.forces.add(force);
        }
    }

    fn end_window(&mut self, time_ns: i64) {
        let (rates, forces) = (self.rates, self.forces);
        self.since_ns = None;
        (self.rates, self.forces) = Default::default();
        if rates.count < FEWEST || forces.count < FEWEST {
            return;
        }
        let spread = [rates.variance(), forces.variance()];
        let least = self
            .least
            .map_or(spread, |least| [0, 1].map(|i| spread[i].min(least[i])));
        self.least = Some(least);
        // A sensor that is rounded so coarsely that it does not move at all has still half a step of noise.
        let quiet = [0, 1]
            .iter()
            .all(|i| spread[*i] <= QUIET * QUIET * least[*i].max(1e-12))
            && spread[1] < (QUIET_SHARE * forces.mean.norm()).powi(2)
            && spread[0] < SLOWEST_RAD_S * SLOWEST_RAD_S;
        if !quiet || rates.mean.norm() > SLOWEST_RAD_S {
            self.quiet = None;
            return;
        }
        let now = Rest {
            windows: 1,
            end_ns: time_ns,
            rate: rates.mean,
            rate_variance: (spread[0] / f64::from(rates.count)).max(1e-10),
            force: forces.mean,
            force_variance: (spread[1] / f64::from(forces.count)).max(1e-8),
        };
        let chain = self.quiet.filter(|chain| chain.agrees(&now));
        let Some(before) = chain else {
            self.quiet = Some(now);
            return;
        };
        self.repeats += 1;
        self.repeated[0] += (now.rate - before.rate).norm_squared() / 3.0;
        self.repeated[1] += (now.force - before.force).norm_squared() / 3.0;
        let longer = before.and(&now);
        self.quiet = Some(longer);
        if longer.windows < WINDOWS {
            return;
        }
        if let Some(last) = self.rest.replace(longer)
            && longer.windows == WINDOWS
        {
            self.compare(&last, &longer);
        }
        self.turn = UnitQuaternion::identity();
        self.weigh(&longer);
    }

    fn compare(&mut self, before: &Rest, now: &Rest) {
        let change = (now.rate - before.rate).norm();
        let [by_rates, by_forces] = self.repeatability();
        let rate_variance = by_rates.max(now.rate_variance + before.rate_variance);
        let sigmas = change / rate_variance.sqrt();
        if sigmas > SIGMAS && self.bias_change.is_none_or(|worst| change > worst.rad_s) {
            self.bias_change = Some(BiasChange {
                before_ns: before.end_ns,
                after_ns: now.end_ns,
                rad_s: change,
                sigmas,
            });
        }
        let seconds = now.end_ns.saturating_sub(before.end_ns) as f64 * 1e-9;
        if seconds > LONGEST_TURN_S || self.turn.angle() < LEAST_TURN_RAD {
            return;
        }
        // The window that has just ended belongs to the turn too; its own turn is nothing.
        let carried = self.turn.inverse().to_rotation_matrix();
        let (u1, u2) = (before.force.normalize(), now.force.normalize());
        let c = carried.matrix();
        let difference = u2 - c * u1;
        let by_axes = so3::skew(&u2) - c * so3::skew(&u1);
        let by_scale = -self.turn.scaled_axis().cross(&(c * u1));
        let mut design = Matrix3x4::zeros();
        design.fixed_view_mut::<3, 3>(0, 0).copy_from(&by_axes);
        design.set_column(3, &by_scale);
        let by_bias = rate_variance * seconds * seconds;
        let force_variance = by_forces.max(now.force_variance + before.force_variance);
        let variance = force_variance / now.force.norm_squared() + by_bias;
        self.information += design.transpose() * design / variance;
        self.weighted += design.transpose() * difference / variance;
        self.turns += 1;
    }

    /// Variances of the difference of two windows' means, per axis, as the windows of one rest show them.
    fn repeatability(&self) -> [f64; 2] {
        self.repeated
            .map(|sum| sum / f64::from(self.repeats.max(1)))
    }

    fn weigh(&mut self, rest: &Rest) {
        let length = (rest.force.norm(), rest.force_variance);
        let [low, high] = self.lengths.unwrap_or([length; 2]);
        self.lengths = Some([
            if length.0 < low.0 { length } else { low },
            if length.0 > high.0 { length } else { high },
        ]);
    }

    /// The largest change of the gyroscope's bias from one rest to the next, where it is no chance.
    #[must_use]
    pub fn bias_change(&self) -> Option<BiasChange> {
        self.bias_change
    }

    /// The rotation of the accelerometer's axes from the gyroscope's, where it is no chance.
    #[must_use]
    pub fn misalignment(&self) -> Option<Misalignment> {
        let mut information = self.information;
        information[(3, 3)] += SCALE_STD.powi(-2);
        let covariance = information.try_inverse().filter(|_| self.turns >= 2)?;
        let rotation = (covariance * self.weighted).xyz();
        let marginal = covariance.fixed_view::<3, 3>(0, 0).try_inverse()?;
        let square = rotation.dot(&(marginal * rotation));
        (square > SIGMAS * SIGMAS).then(|| Misalignment {
            rotation,
            sigmas: square.sqrt(),
            turns: self.turns,
        })
    }

    /// How much the measured gravity depends on the pose, where it is no chance.
    #[must_use]
    pub fn scale_error(&self) -> Option<ScaleError> {
        let [(low, a), (high, b)] = self.lengths?;
        let sigmas = (high - low) / (a + b).max(self.repeatability()[1]).sqrt();
        (sigmas > SIGMAS).then(|| ScaleError {
            share: 2.0 * (high - low) / (high + low),
            sigmas,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_simulation::random::{normal_vector, stream};

    /// Six poses, 4 s of rest in each, and turns of 2 s between them.
    fn boards(misalignment: Vector3<f64>, scale: Vector3<f64>, jump: f64) -> Rests {
        let mut noise = stream(5, "rests");
        let mut rests = Rests::default();
        let axes = [
            Vector3::x(),
            Vector3::y(),
            Vector3::x(),
            Vector3::z(),
            Vector3::y(),
        ];
        let mut attitude = UnitQuaternion::identity();
        let chip = so3::exp(&misalignment).inverse();
        let mut bias = Vector3::new(0.01, -0.02, 0.005);
        for k in 0..3400_i64 {
            let (leg, t) = ((k / 600) as usize, (k % 600) as f64 * 0.01);
            let rate = match axes.get(leg) {
                Some(axis) if (4.0..6.0).contains(&t) => axis * 0.8,
                _ => Vector3::zeros(),
            };
            if k == 1750 {
                bias.x += jump;
            }
            attitude *= so3::exp(&(rate * 0.01));
            let force = chip * (attitude.inverse() * Vector3::new(0.0, 0.0, 9.81));
            rests.rate(
                k * 10_000_000,
                &(rate + bias + normal_vector(&mut noise, 2e-3)),
            );
            rests.force(&(force.component_mul(&scale) + normal_vector(&mut noise, 0.02)));
        }
        rests
    }

    #[test]
    fn two_chips_are_found_with_their_angles() {
        let rests = boards(Vector3::new(0.03, -0.02, 0.01), Vector3::repeat(1.0), 0.0);
        let found = rests.misalignment().unwrap();
        let off = (found.rotation - Vector3::new(0.03, -0.02, 0.01)).norm();
        assert!(off < 0.004, "{found:?}");
        assert_eq!(rests.bias_change(), None);
    }

    #[test]
    fn a_good_board_has_nothing_wrong() {
        let rests = boards(Vector3::zeros(), Vector3::repeat(1.0), 0.0);
        assert_eq!(rests.misalignment(), None);
        assert_eq!(rests.bias_change(), None);
        assert_eq!(rests.scale_error(), None);
    }

    #[test]
    fn a_scale_of_three_percent_and_a_bias_that_jumps_are_found() {
        let rests = boards(Vector3::zeros(), Vector3::new(1.03, 1.0, 1.0), 0.0);
        let found = rests.scale_error().unwrap();
        assert!((0.01..0.035).contains(&found.share), "{found:?}");
        let jump = boards(Vector3::zeros(), Vector3::repeat(1.0), 0.03)
            .bias_change()
            .unwrap();
        assert!((jump.rad_s - 0.03).abs() < 2e-3, "{jump:?}");
        assert!(
            (jump.before_ns..=jump.after_ns).contains(&17_500_000_000),
            "{jump:?}"
        );
    }
}
