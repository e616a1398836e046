//! Inertial samples of a GNSS/INS: checks, gaps, the Earth, and whether the unit stands.

use nalgebra::{UnitQuaternion, Vector3};

use super::sample_faults::Usable;
use super::stillness::{StillnessWindow, Window};
use super::{
    ERRORS, ErrorListener, GAP_LIMIT_S, GnssIns, GnssInsConfig, ImuSamples, LONGEST_GAP_S, seconds,
};
use crate::faults::leaping_stamp::Stamp;
use crate::faults::{Fault, FaultySensor};
use crate::kalman::SkipReason;
use crate::kalman::innovation::check_vector;
use crate::navigation::Validity;
use crate::navigation::history::HeldSample;
use crate::navigation::in_motion_alignment::AlignmentStatus;
use crate::scalar::{Scalar, lit};

/// A body stands when its velocity is below so many of its standard deviations, and these below this, m/s.
const STANDING_SIGMAS: f64 = 3.0;
pub(super) const STANDING_SPEED: f64 = 0.3;
/// Over a gap it goes in steps of this, ns.
const BRIDGED_BY_NS: i64 = 100_000_000;
/// Earth's mean radius, m: how gravity turns and falls with position.
const EARTH_RADIUS_M: f64 = 6.371e6;
/// Nearer to the origin than this (m) the first order is enough: it is off by 0.1 mm/s^2.
const PLANE_WITHIN_M: f64 = 1e4;

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Takes an angular rate (rad/s) and specific force (m/s^2) of one stamp, body axes.
    ///
    /// # Errors
    /// Why the sample was refused; it is counted and changes nothing.
    pub fn imu(
        &mut self,
        time_ns: i64,
        angular_rate: &Vector3<T>,
        specific_force: &Vector3<T>,
    ) -> Result<(), SkipReason> {
        let newer = self.is_newer(time_ns);
        let checked = check_vector(angular_rate, T::zero(), lit(100.0))
            .and_then(|()| check_vector(specific_force, T::zero(), lit(1e3)))
            .and(if newer {
                Ok(())
            } else {
                Err(SkipReason::NotNewer)
            });
        let used = self.config.imu_samples != ImuSamples::None;
        let checked = checked.and(if used {
            Ok(())
        } else {
            Err(SkipReason::NotUsed)
        });
        if let Err(reason) = checked {
            self.memory.imu_skipped = self.memory.imu_skipped.saturating_add(1);
            if let (SkipReason::NotNewer, Some((last, _, _))) = (reason, self.memory.last_imu) {
                self.note_stamp_behind(time_ns, last);
            }
            return Err(reason);
        }
        if self.leaps(time_ns) {
            self.memory.imu_skipped = self.memory.imu_skipped.saturating_add(1);
            return Err(SkipReason::Suspect);
        }
        self.memory.behind = 0;
        self.memory.ahead_ns = None;
        let last = self
            .memory
            .last_imu
            .replace((time_ns, *angular_rate, *specific_force));
        let now = self.memory.now_ns.replace(time_ns);
        // After a start from a known state the first sample stands for the time since.
        let start = now.filter(|_| self.memory.started);
        let last = last.or(start.map(|start| (start, *angular_rate, *specific_force)));
        let Some((last_ns, last_rate, last_force)) = last else {
            return Ok(());
        };
        let dt: T = seconds(last_ns, time_ns);
        if dt > lit(GAP_LIMIT_S) {
            self.memory.gaps = self.memory.gaps.saturating_add(1);
            if dt > lit(LONGEST_GAP_S) {
                self.memory.window = StillnessWindow::default();
                self.memory.still_windows = 0;
                self.restart();
            } else {
                let from_ns = now.unwrap_or(last_ns);
                self.bridge([from_ns, time_ns], [&last_rate, &last_force]);
            }
            return Ok(());
        }
        self.settle();
        let (angular_rate, specific_force) = self.usable(time_ns, angular_rate, specific_force, dt);
        let half = lit::<T>(0.5);
        let (rate, force) = match self.config.imu_samples {
            ImuSamples::Instants => (
                (angular_rate.value + last_rate) * half,
                (specific_force.value + last_force) * half,
            ),
            ImuSamples::Means | ImuSamples::None => (angular_rate.value, specific_force.value),
        };
        let rate = rate + angular_rate.owed / dt;
        let force = force + specific_force.owed / dt;
        if angular_rate.faulty_since_ns.is_none() && specific_force.faulty_since_ns.is_none() {
            self.expect_vibration(&angular_rate, &specific_force, dt);
            self.step(&rate, &force, dt, [T::zero(); 2]);
        } else {
            self.step_unseen(
                time_ns,
                [&angular_rate, &specific_force],
                [&rate, &force],
                dt,
            );
        }
        Ok(())
    }

    /// Takes a specific force (m/s^2, body axes) of a stamp at which the gyroscope delivers nothing: the angular rate is that of a
    /// motion of which only the past is known (`docs/derivations/faults.md`, F4). For a pause of the gyroscope; while it
    /// delivers, samples go to [`Self::imu`].
    ///
    /// # Errors
    /// Why it was refused; it changes nothing. Before the first sample of both, and behind a gap, there is no motion to go on from.
    pub fn imu_without_rate(
        &mut self,
        time_ns: i64,
        specific_force: &Vector3<T>,
    ) -> Result<(), SkipReason> {
        check_vector(specific_force, T::zero(), lit(1e3))?;
        let Some((last_ns, last_rate, last_force)) = self.memory.last_imu else {
            return Err(SkipReason::NotInitialized);
        };
        if time_ns <= last_ns {
            return Err(SkipReason::NotNewer);
        }
        let dt: T = seconds(last_ns, time_ns);
        if dt > lit(GAP_LIMIT_S) {
            return Err(SkipReason::NotUsed);
        }
        self.memory.now_ns = Some(time_ns);
        self.settle();
        let (still, rest) = self.at_rest(specific_force);
        let faults = &mut self.memory.faults;
        let rate = faults.missing_rate(time_ns, &last_rate, &still, dt);
        let force = faults.force(time_ns, specific_force, &rest, dt);
        self.memory.last_imu = Some((time_ns, rate.value, force.value));
        let mean = match self.config.imu_samples {
            ImuSamples::Instants => (force.value + last_force) * lit::<T>(0.5),
            ImuSamples::Means | ImuSamples::None => force.value,
        };
        let felt = mean + force.owed / dt;
        self.step_unseen(time_ns, [&rate, &force], [&rate.value, &felt], dt);
        Ok(())
    }

    /// Goes on over a time (ns) without inertial samples, as F4 has it for the angular rate; the velocity is held. `last` are the angular
    /// rate and the specific force before.
    pub(super) fn bridge(&mut self, [from_ns, until_ns]: [i64; 2], last: [&Vector3<T>; 2]) {
        let mut now_ns = from_ns;
        while now_ns < until_ns {
            let time_ns = now_ns.saturating_add(BRIDGED_BY_NS).min(until_ns);
            let dt: T = seconds(now_ns, time_ns);
            now_ns = time_ns;
            self.memory.now_ns = Some(time_ns);
            let (still, rest) = self.at_rest(last[1]);
            let faults = &mut self.memory.faults;
            let rate = faults.unseen_rate(time_ns, last[0], &still, dt);
            let force = Usable {
                value: rest,
                ..rate
            };
            self.step_unseen(time_ns, [&rate, &force], [&rate.value, &rest], dt);
        }
    }

    /// Whether a sample is newer than the last one, and than what a gap was bridged to.
    fn is_newer(&mut self, time_ns: i64) -> bool {
        let Some((last_ns, ..)) = self.memory.last_imu else {
            return true;
        };
        let newer = time_ns > last_ns;
        let bridged = self.memory.now_ns.is_some_and(|now| time_ns <= now);
        // One that goes on from the last: what was bridged was no gap.
        let goes_on = seconds::<T>(last_ns, time_ns) <= lit(GAP_LIMIT_S);
        self.memory.samples_come_late |= newer && bridged && goes_on;
        newer && !bridged
    }

    /// Goes on to the instant of a measurement behind a gap of the inertial samples. A second stamp must say so, before the next sample
    /// comes: one may be false. Not where a unit delivers its samples late, many at once.
    pub(super) fn go_on_in_a_gap(&mut self, time_ns: i64) {
        let Some((last_ns, rate, force)) = self.memory.last_imu else {
            return;
        };
        let gap: T = seconds(last_ns, time_ns);
        let is_gap = gap > lit(GAP_LIMIT_S) && gap <= lit(LONGEST_GAP_S);
        if !is_gap || self.memory.samples_come_late {
            return;
        }
        let before = self.memory.ahead_ns.replace(time_ns);
        if let (true, Some(now_ns)) = (before.is_some_and(|b| b < time_ns), self.memory.now_ns) {
            self.bridge([now_ns, time_ns], [&rate, &force]);
        }
    }

    /// Angular rate and specific force of a body at rest; before the start of one that does not turn, and what is measured.
    fn at_rest(&self, specific_force: &Vector3<T>) -> (Vector3<T>, Vector3<T>) {
        if !self.memory.started {
            return (Vector3::zeros(), *specific_force);
        }
        let state = self.filter.state();
        let up = Vector3::z() * -self.config.gravity;
        let rest = state.ned_from_body.inverse() * up + state.accelerometer_bias;
        (state.gyroscope_bias, rest)
    }

    /// Whether a stamp is so far ahead that the filter would start anew, and no other sample has gone on from it.
    fn leaps(&mut self, time_ns: i64) -> bool {
        let last_ns = self.memory.last_imu.map(|(last_ns, _, _)| last_ns);
        let (sensor, limit) = (Some(FaultySensor::Gyroscope), lit::<T>(LONGEST_GAP_S));
        match (self.memory.leaping).look(sensor, last_ns, time_ns, limit) {
            Stamp::GoesOn | Stamp::Refutes(None) => false,
            Stamp::Refutes(Some(fault)) => {
                self.memory.faults.log.happened(fault);
                false
            }
            Stamp::Doubted => true,
        }
    }

    /// What to use of the samples of an instant; it is what the next interval begins with.
    fn usable(
        &mut self,
        time_ns: i64,
        angular_rate: &Vector3<T>,
        specific_force: &Vector3<T>,
        dt: T,
    ) -> (Usable<T>, Usable<T>) {
        let (still, rest) = self.at_rest(specific_force);
        let faults = &mut self.memory.faults;
        let rate = faults.rate(time_ns, angular_rate, &still, dt);
        let force = faults.force(time_ns, specific_force, &rest, dt);
        self.memory.last_imu = Some((time_ns, rate.value, force.value));
        (rate, force)
    }

    /// Moves on by `dt` with a rate or a force that was not measured, or not wholly: what is not known of it becomes noise,
    /// and nothing is concluded from it about standing.
    fn step_unseen(
        &mut self,
        time_ns: i64,
        [angular_rate, specific_force]: [&Usable<T>; 2],
        [rate, force]: [&Vector3<T>; 2],
        dt: T,
    ) {
        self.catch_up();
        let before = self.measured_noise();
        let turn = self.memory.faults.unseen_turn(angular_rate, time_ns, dt);
        let mut widened = [before[0].max((turn / dt).sqrt()), before[1]];
        if specific_force.faulty_since_ns.is_some() {
            widened[1] = before[1].max(self.config.gap_velocity_random_walk);
        }
        self.filter.set_noise_densities(widened);
        self.alignment.samples_are_unseen();
        self.memory.bias_steps.forget();
        self.step(rate, force, dt, widened);
        self.catch_up();
        self.filter.set_noise_densities(before);
        self.memory.window = StillnessWindow::default();
        self.memory.due_window = None;
        self.memory.may_be_still = false;
        self.memory.still_windows = 0;
    }

    /// The oldest fault of the inertial samples that was not taken yet. A fault that lasts comes twice: when it is found,
    /// and when it is over.
    pub fn take_fault(&mut self) -> Option<Fault<T>> {
        self.memory.faults.log.take()
    }

    /// Angular rate (rad/s) and specific force (m/s^2) of the last sample as they were used: what stands for a false one.
    pub fn last_sample(&self) -> Option<(Vector3<T>, Vector3<T>)> {
        self.memory.last_imu.map(|(_, rate, force)| (rate, force))
    }

    /// The fault of a sensor under way.
    pub fn fault_now(&self, sensor: FaultySensor) -> Option<&Fault<T>> {
        self.memory.faults.log.now(sensor)
    }

    /// Lets the filter expect the noise that the samples show.
    fn expect_vibration(&mut self, angular_rate: &Usable<T>, specific_force: &Usable<T>, dt: T) {
        if !self.config.vibration_noise {
            return;
        }
        let (rate, force) = (&angular_rate.value, &specific_force.value);
        self.memory.vibration.add(rate, force, dt);
        let densities = self.measured_noise();
        self.filter.set_noise_densities(densities);
    }

    /// Noise densities of samples that are measured: as set, or as they show.
    pub(super) fn measured_noise(&self) -> [T; 2] {
        let c = &self.config;
        let stated = [c.gyroscope_noise_density, c.accelerometer_noise_density];
        if c.vibration_noise {
            self.memory.vibration.noise_densities(stated)
        } else {
            stated
        }
    }

    /// Moves on by `dt` with a rate and force that held over it; `unseen` are their noise densities where they were not measured.
    fn step(&mut self, rate: &Vector3<T>, force: &Vector3<T>, dt: T, unseen: [T; 2]) {
        let window = self.memory.window.add(rate, force, self.config.gravity, dt);
        if let Some(window) = &window {
            let stands = self.memory.stands_until_ns >= self.memory.now_ns || self.seems_to_stand();
            self.see_window(window, stands && window.may_be_still);
        }
        let (rate, force) = if self.memory.started {
            self.on_the_earth(rate, force)
        } else {
            (*rate, *force)
        };
        // Cannot be refused: checked above, and the interval is positive and short.
        if !self.memory.started || self.filter.propagate(&rate, &force, dt).is_ok() {
            self.memory.history.push(&HeldSample {
                angular_rate: rate,
                specific_force: force,
                dt,
                unseen,
            });
        }
        if self.memory.aligning {
            self.keep_for_alignment(dt);
            self.go_on_alone_in_an_outage();
        }
        self.memory.since_velocity += dt;
        self.memory.since_constraint += dt;
        self.memory.due_window = window.or(self.memory.due_window);
    }

    /// Whether fixes say that it stands: the estimate's velocity is none within its standard deviations, which are small.
    fn seems_to_stand(&self) -> bool {
        let Some(state) = self.state() else {
            return false;
        };
        let std = state.velocity_std().norm() * lit(STANDING_SIGMAS);
        let aided = !matches!(self.validity(), Validity::DeadReckoning | Validity::Invalid);
        aided && std < lit(STANDING_SPEED) && state.velocity.norm() < std
    }

    /// Where the heading is known and fixes stay away, the filter and all that aids it go on.
    fn go_on_alone_in_an_outage(&mut self) {
        let since = self.memory.last_fix_ns.zip(self.memory.now_ns);
        let since = since.map(|(fix, now)| seconds::<T>(fix, now));
        let outage = since.is_some_and(|s| s > self.config.validity.dead_reckoning_after_s);
        let aligned = self.alignment.status() == AlignmentStatus::Aligned;
        if self.memory.started && outage && aligned {
            self.go_on_alone();
        }
    }

    /// Counts windows at rest, and learns from those in which it is `known` to stand.
    fn see_window(&mut self, window: &Window<T>, known: bool) {
        self.memory.may_be_still = window.may_be_still;
        if known {
            self.memory.quiet.learn(window);
        }
        let still = known || self.memory.quiet.agrees(window);
        self.memory.still_windows = if still {
            self.memory.still_windows.saturating_add(1)
        } else {
            0
        };
    }

    /// As [`GnssInsConfig::on_the_plane`], where the filter is.
    pub(super) fn on_the_earth(
        &self,
        rate: &Vector3<T>,
        force: &Vector3<T>,
    ) -> (Vector3<T>, Vector3<T>) {
        let state = self.filter.state();
        let [position, velocity] = [&state.position, &state.velocity];
        let attitude = &state.ned_from_body;
        self.config
            .on_the_plane([position, velocity], attitude, [rate, force])
    }
}

impl<T: Scalar> GnssInsConfig<T> {
    /// Takes out of an angular rate and a specific force what a flat Earth at rest does not have: Earth rate, Coriolis force,
    /// and gravity that turns and falls with the distance from the origin (E27).
    pub fn on_the_plane(
        &self,
        [position, velocity]: [&Vector3<T>; 2],
        ned_from_body: &UnitQuaternion<T>,
        [rate, force]: [&Vector3<T>; 2],
    ) -> (Vector3<T>, Vector3<T>) {
        let mut extra = if self.earth_curvature {
            gravity_beyond_the_origin(position, self.gravity)
        } else {
            Vector3::zeros()
        };
        let earth = Vector3::from(self.earth_rate_rad_s);
        let turns = earth.norm_squared() > T::zero();
        if turns {
            extra -= earth.cross(velocity) * lit::<T>(2.0);
        }
        let body_from_ned = ned_from_body.inverse();
        let rate = if turns {
            rate - body_from_ned * earth
        } else {
            *rate
        };
        (rate, force + body_from_ned * extra)
    }
}

/// What gravity at a position (m, NED) has beyond that of the origin, m/s^2, on a spherical Earth (E27).
fn gravity_beyond_the_origin<T: Scalar>(position: &Vector3<T>, gravity: T) -> Vector3<T> {
    let radius = lit::<T>(EARTH_RADIUS_M);
    let p = position;
    if p.norm_squared() < lit(PLANE_WITHIN_M * PLANE_WITHIN_M) {
        return Vector3::new(-p.x, -p.y, p.z + p.z) * (gravity / radius);
    }
    let to_centre = Vector3::new(-p.x, -p.y, radius - p.z) / radius;
    let distance = to_centre.norm().max(lit(0.5));
    to_centre * (gravity / (distance * distance * distance)) - Vector3::z() * gravity
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn gravity_goes_on_from_the_plane_to_the_sphere() {
        let g = 9.81;
        for direction in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let [within, beyond] = [0.999, 1.001]
                .map(|share| gravity_beyond_the_origin(&(direction * PLANE_WITHIN_M * share), g));
            assert!(
                (within - beyond).norm() < 2e-4,
                "{direction}: {within} {beyond}"
            );
        }
        // A quarter of the way around the Earth it pulls back along the old north.
        let quarter = Vector3::new(EARTH_RADIUS_M, 0.0, EARTH_RADIUS_M);
        let all = gravity_beyond_the_origin(&quarter, g) + Vector3::z() * g;
        assert_relative_eq!(all, Vector3::x() * -g, epsilon = 1e-9);
    }
}
