//! Horizontal accelerations of the inertial unit against those of the fixes: axes that are left-handed, signs that are wrong.
//!
//! A unit whose axes are mirrored turns as it should and accelerates to the wrong side. So the specific force is turned to a level
//! frame that the gyroscope holds, once as it is and once for each common mistake, and compared with the second differences of
//! the fixes: up to one unknown heading they must be the same. Nothing is taken of the vehicle. Where it only goes
//! straight on, or in a circle at one speed, a mistake fits as well as the truth, and nothing is said; nor of a drone that turns
//! faster than its fixes come.

use nalgebra::{Vector2, Vector3};
use northing_core::earth::FrameChange;
use northing_core::geometry::so3;

use crate::statistics::seconds_between;

/// Samples are averaged over so long, s, and a longer time between them is a gap.
const AVERAGED_S: f64 = 0.1;
const LONGEST_STEP_S: f64 = 0.2;
/// Time constant with which the mean force shows up, s.
const LEVEL_S: f64 = 20.0;
/// Interval of fixes whose differences are accelerations, s.
const INTERVAL_S: [f64; 2] = [0.9, 3.0];
/// Over so long (s) the gyroscope holds a heading.
const SEGMENT_S: f64 = 30.0;
/// Differences that are needed, ...
const FEWEST: usize = 40;
/// ... how many times the variance of their noise they must have, and at least, m/s.
const OVER_NOISE: f64 = 3.0;
const SLOWEST: f64 = 0.5;
/// Share of what is not noise that a mistake must explain, and the most that the axes as they are may.
const EXPLAINED: f64 = 0.7;
const NOT_EXPLAINED: f64 = 0.5;

/// What can be wrong with a unit's axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Axes {
    Right,
    LeftHanded,
    RateReversed,
    ForceReversed,
}

impl Axes {
    const ALL: [Self; 4] = [
        Self::Right,
        Self::LeftHanded,
        Self::RateReversed,
        Self::ForceReversed,
    ];

    /// Angular rate and specific force as they are if this is what is wrong. Any mirror undoes any other, but for a turn of the
    /// whole unit.
    fn mended(self, [rate, force]: [Vector3<f64>; 2]) -> [Vector3<f64>; 2] {
        let mirrored = |v: Vector3<f64>| Vector3::new(v.x, -v.y, v.z);
        match self {
            Self::Right => [rate, force],
            Self::LeftHanded => [mirrored(rate), mirrored(force)],
            Self::RateReversed => [-rate, force],
            Self::ForceReversed => [rate, -force],
        }
    }

    const fn sentence(self) -> &'static str {
        match self {
            Self::Right => "",
            Self::LeftHanded => {
                "The axes of the inertial unit are left-handed: mirrored, its accelerations are those of the fixes. Reverse one \
                 axis, or exchange two, of gyroscope and accelerometer alike (forward, right, down are a right-handed frame)."
            }
            Self::RateReversed => {
                "The signs of the gyroscope are reversed: with the opposite rates the accelerations are those of the fixes. Reverse \
                 all three axes of its table."
            }
            Self::ForceReversed => {
                "The signs of the accelerometer are reversed: with the opposite force the accelerations are those of the fixes. At \
                 rest the axis that points up must read +9.81 m/s^2. Reverse all three axes of its table."
            }
        }
    }
}

/// The unit with one thing mended: its level frame, and what it has gained since the last fix.
#[derive(Debug, Clone, Copy, Default)]
struct Levelled {
    /// Mean force of so many seconds, body axes.
    up: Vector3<f64>,
    levelled_s: f64,
    /// A direction that the gyroscope holds, body axes.
    held: Vector3<f64>,
    /// Gained in this interval: velocity (m/s), and way (m) beyond that of the velocity before.
    gained: Vector2<f64>,
    way: Vector2<f64>,
    /// Mean of the way over its interval less the velocity before it, and the velocity gained, of the interval before.
    before: [Vector2<f64>; 2],
    /// Sum over the segment of the turn that makes one of the other, as a complex number, and of the unit's squares.
    turned: Vector2<f64>,
    squares: f64,
    /// What has been explained in the segments before.
    explained: f64,
}

impl Levelled {
    fn add(&mut self, [rate, force]: [Vector3<f64>; 2], dt: f64) {
        let turn = so3::exp(&(rate * -dt));
        // At first the mean of all.
        self.levelled_s = (self.levelled_s + dt).min(LEVEL_S);
        let before = turn * self.up;
        self.up = before + (force - before) * (dt / self.levelled_s);
        let up = self.up;
        let norm = up.norm();
        if norm <= 0.0 {
            return;
        }
        let down = up / -norm;
        let held = turn * self.held;
        let level = held - down * held.dot(&down);
        let forward = if level.norm() > 0.1 {
            level.normalize()
        } else {
            // It has begun.
            down.cross(&Vector3::ith(down.iamin(), 1.0)).normalize()
        };
        self.held = forward;
        let right = down.cross(&forward);
        let gained = Vector2::new(force.dot(&forward), force.dot(&right)) * dt;
        self.way += (self.gained + gained * 0.5) * dt;
        self.gained += gained;
    }

    /// What comes to the mean velocity from the interval before to this one, which has lasted so long.
    fn close(&mut self, seconds: f64) -> Vector2<f64> {
        let [mean_before, gained_before] = self.before;
        let mean = self.way / seconds;
        self.before = [mean, self.gained];
        (self.gained, self.way) = (Vector2::zeros(), Vector2::zeros());
        gained_before + mean - mean_before
    }

    fn compare(&mut self, own: &Vector2<f64>, seen: &Vector2<f64>) {
        self.turned += Vector2::new(own.dot(seen), own.perp(seen));
        self.squares += own.norm_squared();
    }

    fn end_segment(&mut self) {
        if self.squares > 0.0 {
            self.explained += self.turned.norm_squared() / self.squares;
        }
        (self.turned, self.squares) = (Vector2::zeros(), 0.0);
    }
}

/// Gathers both while a run goes on.
#[derive(Debug, Clone, Default)]
pub(super) struct AxesAgreement {
    last_ns: Option<i64>,
    /// Turn (rad) and gain of velocity (m/s) of the samples that are averaged, and how long they last, s.
    sums: [Vector3<f64>; 2],
    summed_s: f64,
    levelled: [Levelled; 4],
    /// The last fix, and the mean velocity up to it.
    fix: Option<(i64, Vector2<f64>)>,
    velocity: Option<Vector2<f64>>,
    segment_s: f64,
    seen: usize,
    /// Sums of the squares of the differences of the fixes, and of their noise, (m/s)^2.
    squares: f64,
    noise: f64,
}

impl AxesAgreement {
    /// An inertial sample, forward, right, down.
    pub(super) fn inertial(&mut self, time_ns: i64, rate: &Vector3<f64>, force: &Vector3<f64>) {
        let last = self.last_ns.replace(time_ns);
        let dt = last.map_or(0.0, |last| seconds_between(last, time_ns));
        if !(rate.norm_squared() + force.norm_squared()).is_finite() || dt <= 0.0 {
            return;
        }
        if dt > LONGEST_STEP_S {
            self.break_off();
            return;
        }
        self.sums[0] += rate * dt;
        self.sums[1] += force * dt;
        self.summed_s += dt;
        if self.summed_s >= AVERAGED_S {
            self.level();
        }
    }

    /// Gives the samples of now to the level frames.
    fn level(&mut self) {
        let dt = core::mem::take(&mut self.summed_s);
        let sums = core::mem::take(&mut self.sums);
        if dt > 0.0 {
            for (axes, levelled) in Axes::ALL.into_iter().zip(&mut self.levelled) {
                levelled.add(axes.mended(sums.map(|sum| sum / dt)), dt);
            }
        }
    }

    /// A usable fix, m, with its horizontal standard deviation.
    pub(super) fn fix(&mut self, time_ns: i64, ned: &Vector3<f64>, std: f64) {
        let place = ned.xy();
        let Some((before_ns, before)) = self.fix else {
            self.begin(time_ns, place);
            return;
        };
        let [shortest, longest] = INTERVAL_S;
        let seconds = seconds_between(before_ns, time_ns);
        if seconds < shortest {
            return;
        }
        if seconds > longest {
            self.break_off();
            self.begin(time_ns, place);
            return;
        }
        self.level();
        self.fix = Some((time_ns, place));
        let velocity = (place - before) / seconds;
        let gained = self.levelled.each_mut().map(|one| one.close(seconds));
        self.segment_s += seconds;
        if let Some(velocity_before) = self.velocity.replace(velocity) {
            let seen = velocity - velocity_before;
            self.seen += 1;
            self.squares += seen.norm_squared();
            // Two axes of three places, the middle one twice.
            self.noise += 12.0 * (std / seconds).powi(2);
            for (levelled, own) in self.levelled.iter_mut().zip(&gained) {
                levelled.compare(own, &seen);
            }
        }
        if self.segment_s > SEGMENT_S {
            self.segment_s = 0.0;
            self.levelled.iter_mut().for_each(Levelled::end_segment);
        }
    }

    /// Positions are of another local frame from now on.
    pub(super) fn move_origin(&mut self, change: &FrameChange<f64>) {
        if let Some((_, place)) = &mut self.fix {
            *place = change.position(&place.push(0.0)).xy();
        }
    }

    fn begin(&mut self, time_ns: i64, place: Vector2<f64>) {
        self.level();
        for one in &mut self.levelled {
            one.close(1.0);
        }
        self.fix = Some((time_ns, place));
    }

    /// After a gap of samples or fixes the heading that was held is another one.
    fn break_off(&mut self) {
        (self.sums, self.summed_s) = ([Vector3::zeros(); 2], 0.0);
        (self.fix, self.velocity) = (None, None);
        self.segment_s = 0.0;
        self.levelled.iter_mut().for_each(Levelled::end_segment);
    }

    /// What is odd, a sentence.
    pub(super) fn issue(&self) -> Option<String> {
        let n = self.seen as f64;
        let clear = self.squares > (OVER_NOISE * self.noise).max(n * SLOWEST * SLOWEST);
        if self.seen < FEWEST || !clear {
            return None;
        }
        let whole = self.squares - self.noise;
        let [right, rest @ ..] = self.levelled.map(|mut one| {
            one.end_segment();
            one.explained / whole
        });
        let wrong = Axes::ALL.into_iter().skip(1).zip(rest);
        let (axes, explained) = wrong.max_by(|a, b| a.1.total_cmp(&b.1))?;
        (explained > EXPLAINED && right < NOT_EXPLAINED).then(|| axes.sentence().to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_core::geometry::rotation::from_yaw_pitch_roll;

    const DT: f64 = 0.02;

    /// How a vehicle moves: velocity and attitude (yaw, pitch, roll) at a time.
    type Motion = fn(f64) -> (Vector3<f64>, [f64; 3]);

    /// A car that brakes and speeds up in winding streets.
    fn car(t: f64) -> (Vector3<f64>, [f64; 3]) {
        let heading = 1.2 * (0.21 * t).sin() + 0.05 * t;
        let speed = 9.0 + 4.0 * (0.37 * t).sin() + 2.0 * (0.113 * t).cos();
        let velocity = Vector3::new(heading.cos(), heading.sin(), 0.0) * speed;
        (velocity, [heading, 0.0, 0.0])
    }

    /// A drone that leans into its accelerations, whatever its heading is.
    fn drone(t: f64) -> (Vector3<f64>, [f64; 3]) {
        let velocity = Vector3::new(3.0 * (0.5 * t).sin(), 4.0 * (0.31 * t).sin(), 0.0);
        let acceleration = Vector2::new(1.5 * (0.5 * t).cos(), 1.24 * (0.31 * t).cos());
        let heading = 0.9 * (0.17 * t).sin() + 0.3;
        let (sin, cos) = f64::sin_cos(heading);
        let forward = acceleration.x * cos + acceleration.y * sin;
        let right = acceleration.y * cos - acceleration.x * sin;
        let pitch = -(forward / 9.81).atan();
        let roll = (right * pitch.cos() / 9.81).atan();
        (velocity, [heading, pitch, roll])
    }

    /// The motion as a unit sees it that is mounted anyhow and whose rates and forces are changed.
    fn run(motion: Motion, change: fn([Vector3<f64>; 2]) -> [Vector3<f64>; 2]) -> AxesAgreement {
        let mut axes = AxesAgreement::default();
        let body_from_unit = from_yaw_pitch_roll([0.7, -0.2, 0.4]);
        let attitude = |t: f64| from_yaw_pitch_roll(motion(t).1) * body_from_unit;
        let mut place = Vector3::zeros();
        for k in 0..6000_i64 {
            let t = k as f64 * DT;
            let gained = (motion(t + 0.5 * DT).0 - motion(t - 0.5 * DT).0) / DT;
            let force = attitude(t).inverse() * (gained - Vector3::z() * 9.81);
            let turned = attitude(t - 0.5 * DT).inverse() * attitude(t + 0.5 * DT);
            let [rate, force] = change([so3::log(&turned) / DT, force]);
            // A bad unit.
            let rate = rate + Vector3::new(2e-3, -3e-3, 4e-3);
            let force = force + Vector3::new(0.1, 0.05, -0.1);
            axes.inertial(k * 20_000_000, &rate, &force);
            place += motion(t + 0.5 * DT).0 * DT;
            if k % 50 == 49 {
                let noise = Vector3::new((7.7 * t).sin(), (5.3 * t).cos(), 0.0) * 0.2;
                axes.fix(k * 20_000_000, &(place + noise), 0.2);
            }
        }
        axes
    }

    fn mirrored([rate, force]: [Vector3<f64>; 2]) -> [Vector3<f64>; 2] {
        [rate, force].map(|v| Vector3::new(v.y, v.x, v.z))
    }

    #[test]
    fn axes_as_they_should_be_are_no_issue() {
        for motion in [car as Motion, drone] {
            assert_eq!(run(motion, |as_it_is| as_it_is).issue(), None);
        }
        assert_eq!(AxesAgreement::default().issue(), None);
    }

    #[test]
    fn mirrored_axes_and_reversed_signs_are_found() {
        for motion in [car as Motion, drone] {
            let issue = run(motion, mirrored).issue().unwrap();
            assert!(
                issue.starts_with("The axes of the inertial unit are left-handed"),
                "{issue}"
            );
            let down_is_up = run(motion, |both| both.map(|v| Vector3::new(v.x, v.y, -v.z)));
            assert_eq!(
                down_is_up.issue().as_deref(),
                Some(Axes::LeftHanded.sentence())
            );
            let issue = run(motion, |[rate, force]| [-rate, force]).issue().unwrap();
            assert!(issue.starts_with("The signs of the gyroscope"), "{issue}");
            let issue = run(motion, |[rate, force]| [rate, -force]).issue().unwrap();
            assert!(
                issue.starts_with("The signs of the accelerometer"),
                "{issue}"
            );
        }
    }

    /// What both would look like if they were right: nothing may be said.
    #[test]
    fn where_a_mistake_fits_as_well_as_the_truth_nothing_is_said() {
        let straight: Motion = |t| (Vector3::x() * (8.0 + 5.0 * (0.4 * t).sin()), [0.0; 3]);
        let circle: Motion = |t| {
            let heading = 0.3 * t;
            let velocity = Vector3::new(heading.cos(), heading.sin(), 0.0) * 6.0;
            (velocity, [heading, 0.0, 0.0])
        };
        let still: Motion = |_| (Vector3::zeros(), [0.4, 0.0, 0.0]);
        for motion in [straight, circle, still] {
            for change in [|both| both, mirrored] {
                assert_eq!(run(motion, change).issue(), None);
            }
        }
    }

    /// An arm that swings a receiver's unit about a shoulder has forces of the wrong side at its own frequency; fixes a
    /// second apart do not follow it.
    #[test]
    fn a_unit_that_is_swung_is_not_taken_for_mirrored() {
        let swung: Motion = |t| {
            let angle = 0.6 * (6.0 * t).sin();
            let swing = 0.7 * 0.6 * 6.0 * (6.0 * t).cos();
            let heading = 0.8 * (0.2 * t).sin();
            let along = 1.4 + 0.3 * (0.5 * t).sin() + swing * angle.cos();
            let velocity = Vector3::new(heading.cos(), heading.sin(), 0.0) * along;
            (velocity, [heading, angle, 0.0])
        };
        assert_eq!(run(swung, |as_it_is| as_it_is).issue(), None);
    }
}
