//! Spike, stuck-value, noise and saturation detection on the samples of one three-axis sensor.
//!
//! A sample far from the one before it is neither used nor refused: it waits until the next one comes. If that
//! is back where it was, the sample was a spike; if it stays, the sample was a step, and the filter is given what it
//! missed. Far is measured by how the samples of this sensor change (F1), nothing else.
//!
//! Repeated samples are no fault by themselves: rounded sensors repeat at rest, and some loggers write each sample
//! twice. They are one where a repetition has become improbable: by the resolution and the changes just before (F2), and by
//! how often this sensor has repeated itself so far.

mod noise;

use nalgebra::Vector3;

use self::noise::WhiteNoise;

use crate::scalar::{Scalar, greater, lesser, lit, seconds};

/// So many usual changes (root mean square) away is far.
const FAR: f64 = 12.0;
/// And so many steps of the sensor's resolution.
const FAR_STEPS: f64 = 8.0;
/// Samples before a change can be called unusual.
const FEWEST: u32 = 16;
/// Samples that are doubted in a row before they are used: it has become wild.
const MOST_SUSPECTS: u8 = 6;
/// Memory of the usual change, of the change just before, and of the interval, samples.
const MEMORY: f64 = 64.0;
const SHORT_MEMORY: f64 = 8.0;
/// The chance of a repetition on one axis, times its change in steps: the density of a normal at its middle.
const REPEAT: f64 = 0.4;
/// A change of at most so many steps of the rounding is small.
const SMALL_STEPS: f64 = 2.1;
/// Square of the chance below which a run of repetitions is a stuck sensor, and fewest repetitions.
const STUCK_CHANCE2: f64 = 1e-18;
const STUCK_RUN: u16 = 3;
/// So many repetitions of the largest component beside others that move are seldom chance.
pub(super) const HELD_RUN: u16 = 10;
/// No single repetition says more than this (square of a chance): the model is not that good.
const LEAST_CHANCE2: f64 = 1e-4;
/// Square of the chance below which a component that repeats at the largest value ever seen is clipped.
const CLIPPED_CHANCE2: f64 = 1e-15;
/// Longer than so many usual intervals is a hole: nothing is compared across it.
const HOLE: f64 = 3.0;

/// A jump of a gyroscope is not doubted below this turn (rad), one of an accelerometer below so much velocity (m/s): taps
/// and steps are no faults, and a sample that cannot be noticed is not worth one of delay.
const LEAST_TURN_RAD: f64 = 0.004_375;
const LEAST_PUSH: f64 = 0.05;
/// White noise of a gyroscope is vibration or wear below this, rad/sqrt(s), and of an accelerometer, m/s/sqrt(s).
const LEAST_TURN_WALK: f64 = 0.1;
const LEAST_PUSH_WALK: f64 = 1.0;

/// What a check says of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Checked<T: Scalar> {
    /// Like those before it.
    Good,
    /// Far from the last good one: the next sample decides. Not to be used yet.
    Suspect,
    /// Good, and so were those that waited: the integral over all since the last good one (unit times s), by the
    /// trapezoidal rule.
    Step(Vector3<T>),
    /// Good, but those that waited were not.
    Spike {
        /// Stamp of the last good sample before them.
        from_ns: i64,
        /// Their largest distance from it.
        size: T,
    },
    /// The sensor repeats itself: not a measurement.
    Stuck {
        /// Stamp of the sample that it repeats.
        from_ns: i64,
    },
    /// White noise, many times stronger than the changes before: not a measurement.
    Noise {
        /// Since when.
        from_ns: i64,
    },
    /// A component is at the end of the range.
    Saturated {
        /// The end of the range.
        full_scale: T,
    },
}

impl<T: Scalar> Checked<T> {
    /// Whether the sample is a measurement, clipped or not.
    #[inline]
    #[must_use]
    pub const fn is_measured(&self) -> bool {
        !matches!(
            self,
            Self::Suspect | Self::Stuck { .. } | Self::Noise { .. }
        )
    }
}

/// A component that repeats itself while others change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held<T: Scalar> {
    /// So many times.
    pub run: u16,
    /// Mean square of its last changes before that.
    pub change2: T,
}

/// Checks the samples of one three-axis sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SampleCheck<T: Scalar> {
    /// A jump that adds less to the integral in one interval (unit times s) is not worth a doubt.
    least: T,
    /// White noise whose integral walks less (unit times sqrt(s)) is vibration or wear: its samples are still measurements.
    least_walk: T,
    last: Option<(i64, Vector3<T>)>,
    suspicion: Option<Suspicion<T>>,
    samples: u32,
    /// Mean interval, s.
    interval: T,
    /// Mean square of the change between samples, all axes.
    usual_change2: T,
    /// Mean square of the last changes that were some, by axis.
    recent_change2: Vector3<T>,
    /// The smallest change that was seen: the sensor's resolution.
    resolution: T,
    repeats: Repeats<T>,
    noise: WhiteNoise<T>,
    /// The largest component that was seen, and the end of the range, zero where it is not known.
    largest: T,
    full_scale: T,
}

/// Samples that wait.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Suspicion<T: Scalar> {
    good_ns: i64,
    good: Vector3<T>,
    /// Distance of the last, and the largest.
    jump: T,
    largest_jump: T,
    samples: u8,
    /// Their integral since the last good one.
    integral: Vector3<T>,
}

/// Runs of equal samples.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Repeats<T: Scalar> {
    since_ns: i64,
    run: u16,
    is_stuck: bool,
    /// Square of the chance of the run.
    chance2: T,
    /// The last two changes, and whether they were those of a motion that comes to rest when the run began.
    changes: [Vector3<T>; 2],
    arrives: bool,
    /// Repetitions that were not to be expected and ended soon, of all samples.
    harmless: u32,
    /// Runs of single components while others change.
    component_runs: [u16; 3],
}

impl<T: Scalar> Default for SampleCheck<T> {
    /// One that doubts jumps of any size.
    fn default() -> Self {
        Self::new(T::zero(), T::zero())
    }
}

impl<T: Scalar> SampleCheck<T> {
    /// One for a gyroscope's samples, rad/s.
    pub fn of_gyroscope() -> Self {
        Self::new(lit(LEAST_TURN_RAD), lit(LEAST_TURN_WALK))
    }

    /// One for an accelerometer's samples, m/s^2.
    pub fn of_accelerometer() -> Self {
        Self::new(lit(LEAST_PUSH), lit(LEAST_PUSH_WALK))
    }

    /// One that doubts jumps which add more than `least` to the integral of the samples in one interval (unit times s), and
    /// noise which makes it walk by more than `least_walk` (unit times sqrt(s)).
    pub fn new(least: T, least_walk: T) -> Self {
        Self {
            least,
            least_walk,
            last: None,
            suspicion: None,
            samples: 0,
            interval: T::zero(),
            usual_change2: T::zero(),
            recent_change2: Vector3::zeros(),
            resolution: T::zero(),
            repeats: Repeats {
                since_ns: 0,
                run: 0,
                is_stuck: false,
                chance2: T::one(),
                changes: [Vector3::zeros(); 2],
                arrives: false,
                harmless: 0,
                component_runs: [0; 3],
            },
            noise: WhiteNoise::default(),
            largest: T::zero(),
            full_scale: T::zero(),
        }
    }
}

impl<T: Scalar> SampleCheck<T> {
    /// The usual interval between samples, s, once there have been a few.
    #[inline]
    pub fn interval_s(&self) -> Option<T> {
        (self.samples >= FEWEST).then_some(self.interval)
    }

    /// The largest component of the last sample where it repeats itself while others change.
    #[inline]
    pub fn held(&self) -> Option<Held<T>> {
        // Nearly always none does.
        if self.repeats.component_runs == [0; 3] {
            return None;
        }
        self.longest_held()
    }

    fn longest_held(&self) -> Option<Held<T>> {
        let (_, last) = self.last.as_ref()?;
        let runs = &self.repeats.component_runs;
        let largest = last.amax();
        let components = last.iter().zip(runs).zip(&self.recent_change2);
        let held = components
            .filter(|((component, run), _)| **run > 0 && component.abs() >= largest)
            .map(|((_, run), change2)| Held {
                run: *run,
                change2: *change2,
            });
        held.max_by_key(|held| held.run)
    }

    /// Whether the largest component has stood still for some samples while others moved: it may be clipped, at whatever level.
    #[inline]
    pub fn may_be_clipped(&self) -> bool {
        self.held().is_some_and(|held| held.run >= HELD_RUN)
    }

    /// The smallest change that was seen, zero before any was.
    #[inline]
    pub fn resolution(&self) -> T {
        self.resolution
    }

    /// Stamp of the first of equal samples, if the last one repeats it.
    #[inline]
    pub fn repeats_since_ns(&self) -> Option<i64> {
        (self.repeats.run > 0).then_some(self.repeats.since_ns)
    }

    /// Stamp of the last sample.
    #[inline]
    pub fn last_ns(&self) -> Option<i64> {
        self.last.map(|(last_ns, _)| last_ns)
    }

    /// Forgets the last sample, so that the next one is compared with none; what was learnt stays.
    pub fn interrupt(&mut self) {
        self.last = None;
        self.suspicion = None;
        self.repeats.run = 0;
        self.repeats.chance2 = T::one();
        self.noise.interrupt();
    }

    /// Looks at a finite sample that is newer than the last one.
    #[inline]
    pub fn check(&mut self, time_ns: i64, sample: &Vector3<T>) -> Checked<T> {
        let Some((last_ns, last)) = self.last.replace((time_ns, *sample)) else {
            self.largest = self.largest.max(sample.amax());
            return Checked::Good;
        };
        let dt: T = seconds(last_ns, time_ns);
        if self.samples >= FEWEST && dt > self.interval * lit(HOLE) {
            // Nothing is known of the time between; what comes behind it is another world.
            self.suspicion = None;
            self.learn_interval(dt);
            return Checked::Good;
        }
        self.learn_interval(dt);
        let change = sample - last;
        let change2 = change.norm_squared();
        // Of a motion that has just ended the last changes tell, not those of seconds ago.
        let just_before2 = self.recent_change2.sum() * lit(2.0);
        let usual2 = lesser(self.usual_change2, just_before2);
        // Before it is learnt from: the first change of a rest that reads zeros may be a spike.
        let is_far = self.is_far(change2, usual2);
        let mut was_stuck = false;
        if change2 == T::zero() {
            if let Some(from_ns) = self.repeated(last_ns) {
                self.suspicion = None;
                return Checked::Stuck { from_ns };
            }
        } else {
            was_stuck = self.repeats.is_stuck;
            self.changed(&change);
        }
        let limit2 = self.least_walk * self.least_walk;
        if let Some(from_ns) =
            self.noise
                .since(last_ns, sample, (&change, change2), (limit2, self.interval))
        {
            self.suspicion = None;
            return Checked::Noise { from_ns };
        }
        let clipped = self.clipped_at(sample, &change);
        let checked = match self.suspicion {
            // What it repeated says nothing about where it should be now.
            _ if was_stuck => Checked::Good,
            Some(suspicion) => self.judge(suspicion, sample, (&last, dt)),
            None if is_far => self.doubt(sample, (last_ns, &last, dt), change2.sqrt()),
            None => {
                self.usual_change2 += (change2 - self.usual_change2) * self.weight(MEMORY);
                Checked::Good
            }
        };
        match (checked, clipped) {
            (Checked::Good, Some(full_scale)) => Checked::Saturated { full_scale },
            (checked, _) => checked,
        }
    }

    /// A sample that is far from the one before it waits.
    fn doubt(
        &mut self,
        sample: &Vector3<T>,
        (last_ns, last, dt): (i64, &Vector3<T>, T),
        jump: T,
    ) -> Checked<T> {
        self.suspicion = Some(Suspicion {
            good_ns: last_ns,
            good: *last,
            jump,
            largest_jump: jump,
            samples: 1,
            integral: (last + sample) * (dt * lit(0.5)),
        });
        Checked::Suspect
    }

    #[inline]
    fn is_far(&self, change2: T, usual2: T) -> bool {
        // What is seldom so is asked first: this runs for every sample.
        if self.samples < FEWEST || change2 <= usual2 * lit(FAR * FAR) {
            return false;
        }
        let steps = self.resolution * lit(FAR_STEPS);
        let least = self.least / self.interval.max(T::default_epsilon());
        change2 > least * least && change2 > steps * steps
    }

    /// A sample after some that wait: where it lies says what they were.
    fn judge(
        &mut self,
        mut held: Suspicion<T>,
        sample: &Vector3<T>,
        (last, dt): (&Vector3<T>, T),
    ) -> Checked<T> {
        self.suspicion = None;
        held.integral += (last + sample) * (dt * lit(0.5));
        let from_good = (sample - held.good).norm();
        let from_last = (sample - last).norm();
        if from_good * lit(4.0) <= held.largest_jump {
            return Checked::Spike {
                from_ns: held.good_ns,
                size: held.largest_jump,
            };
        }
        let stays = from_last + from_last <= held.jump;
        // A motion that begins goes on where a spike turns back.
        let goes_on = (sample - last).dot(&(last - held.good)) > T::zero();
        if stays || goes_on || held.samples >= MOST_SUSPECTS {
            // One that is told again confirms the jump: such are usual where samples are.
            let change = if from_last > T::zero() {
                from_last
            } else {
                held.jump
            };
            let change2 = change * change;
            self.usual_change2 += (change2 - self.usual_change2) * self.weight(MEMORY);
            return Checked::Step(held.integral);
        }
        held.samples += 1;
        held.jump = from_good;
        held.largest_jump = held.largest_jump.max(from_good);
        self.suspicion = Some(held);
        Checked::Suspect
    }

    /// Another repetition: since when the sensor is stuck, if it is (F2).
    fn repeated(&mut self, last_ns: i64) -> Option<i64> {
        let step2 = self.resolution * self.resolution * lit(REPEAT * REPEAT);
        let mut chance2 = T::one();
        for recent2 in &self.recent_change2 {
            if *recent2 > step2 {
                chance2 *= step2 / *recent2;
            }
        }
        if self.repeats.run == 0 {
            self.repeats.since_ns = last_ns;
            self.repeats.arrives = self.arrives();
        }
        let repeats = &mut self.repeats;
        if repeats.arrives {
            chance2 = T::one();
        }
        repeats.run = repeats.run.saturating_add(1);
        let usual = lit::<T>(f64::from(repeats.harmless.saturating_add(1)))
            / lit(f64::from(self.samples.saturating_add(2)));
        repeats.chance2 = (repeats.chance2 * chance2.max(usual * usual).max(lit(LEAST_CHANCE2)))
            .max(lit(STUCK_CHANCE2 * 1e-6));
        let is_stuck = repeats.run >= STUCK_RUN && repeats.chance2 < lit(STUCK_CHANCE2);
        repeats.is_stuck = is_stuck;
        if !is_stuck {
            repeats.harmless = repeats.harmless.saturating_add(1);
        }
        is_stuck.then_some(repeats.since_ns)
    }

    /// Whether the last two changes were those of a motion that comes to rest: a step of the rounding, or few that neither grow nor turn
    /// back.
    fn arrives(&self) -> bool {
        let [before, last] = &self.repeats.changes;
        let step = self.resolution * lit(1.1);
        let small = self.resolution * lit(SMALL_STEPS);
        let fades = |(before, last): (&T, &T)| {
            let size = last.abs();
            let goes_on = size <= before.abs() + step && *before * *last >= T::zero();
            before.abs() <= small + step && size <= small && (size <= step || goes_on)
        };
        before.iter().zip(last).all(fades)
    }

    /// A sample that is not the one before.
    #[inline]
    fn changed(&mut self, change: &Vector3<T>) {
        if self.repeats.run > 0 || self.repeats.is_stuck {
            self.end_run(change);
        }
        let [_, last] = self.repeats.changes;
        self.repeats.changes = [last, *change];
        let weight = self.weight(SHORT_MEMORY);
        let mut smallest = if self.resolution > T::zero() {
            self.resolution
        } else {
            change.amax()
        };
        for (component, recent2) in change.iter().zip(&mut self.recent_change2) {
            let size = component.abs();
            if size > T::zero() {
                *recent2 += (size * size - *recent2) * weight;
                smallest = lesser(size, smallest);
            }
        }
        self.resolution = smallest;
    }

    /// Ends a run of repetitions by a change.
    fn end_run(&mut self, change: &Vector3<T>) {
        let small = self.resolution * lit(SMALL_STEPS);
        if self.repeats.run >= STUCK_RUN && change.amax() <= small {
            // It goes on where it was: it rested, and its noise is below its rounding.
            let step2 = self.resolution * self.resolution;
            for recent2 in &mut self.recent_change2 {
                *recent2 = recent2.min(step2);
            }
        }
        self.repeats.run = 0;
        self.repeats.is_stuck = false;
        self.repeats.chance2 = T::one();
    }

    /// The end of the range where a component is there: the largest value ever seen, once a component has repeated it
    /// while it should have changed, and others did.
    #[inline]
    fn clipped_at(&mut self, sample: &Vector3<T>, change: &Vector3<T>) -> Option<T> {
        let zero = T::zero();
        if change.x != zero && change.y != zero && change.z != zero {
            self.repeats.component_runs = [0; 3];
        } else {
            self.components_repeated(sample, change);
        }
        let [x, y, z] = [sample.x.abs(), sample.y.abs(), sample.z.abs()];
        let largest = greater(greater(x, y), z);
        if largest > self.largest {
            self.largest = largest;
        }
        if self.full_scale <= T::zero() {
            return None;
        }
        if largest > self.full_scale * lit(1.001) {
            // It measures beyond: that was no end.
            self.full_scale = T::zero();
            return None;
        }
        (largest >= self.full_scale).then_some(self.full_scale)
    }

    /// Counts how often single components have repeated themselves, and finds the end of the range by it.
    fn components_repeated(&mut self, sample: &Vector3<T>, change: &Vector3<T>) {
        // What changes by the rounding alone rests, wherever it rests.
        let is_strong = change.amax() > self.resolution * lit(SMALL_STEPS);
        for i in 0..3 {
            let size = sample[i].abs();
            if change[i] != T::zero() {
                self.repeats.component_runs[i] = 0;
            } else if is_strong {
                let run = self.repeats.component_runs[i].saturating_add(1);
                self.repeats.component_runs[i] = run;
                if size < self.largest || size == T::zero() {
                    continue;
                }
                let step2 = self.resolution * self.resolution * lit(REPEAT * REPEAT);
                let chance2 = step2 / self.recent_change2[i].max(step2);
                // A product: the library's power is thousands of instructions on a chip.
                let chance2 = chance2.max(lit(LEAST_CHANCE2));
                let chance2 = (0..run.min(100)).fold(T::one(), |run, _| run * chance2);
                if chance2 < lit(CLIPPED_CHANCE2) {
                    self.full_scale = size;
                }
            }
        }
    }

    #[inline]
    fn weight(&self, memory: f64) -> T {
        if self.samples >= memory as u32 {
            return lit(1.0 / memory);
        }
        // Not divided in double precision, which a chip does in software.
        T::one() / lit::<T>(f64::from(self.samples.max(1))).min(lit(memory))
    }

    #[inline]
    fn learn_interval(&mut self, dt: T) {
        self.samples = self.samples.saturating_add(1);
        let most = if self.samples > FEWEST {
            self.interval * lit(HOLE)
        } else {
            dt
        };
        self.interval += (lesser(dt, most) - self.interval) * self.weight(MEMORY);
    }

    /// The numbers, for checks of a saved state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = &T> {
        let held = self.suspicion.iter();
        let last = self.last.iter().flat_map(|(_, last)| last);
        held.flat_map(|held| {
            let vectors = held.good.iter().chain(&held.integral);
            vectors.chain([&held.jump, &held.largest_jump])
        })
        .chain(last)
        .chain(self.repeats.changes.iter().flatten())
        .chain(&self.recent_change2)
        .chain([
            &self.least,
            &self.least_walk,
            &self.interval,
            &self.usual_change2,
            &self.resolution,
            &self.repeats.chance2,
            &self.largest,
            &self.full_scale,
        ])
        .chain(self.noise.numbers())
    }
}

#[cfg(test)]
mod tests;
