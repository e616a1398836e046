//! Samples of several topics in the order of their stamps, without making those of the inertial sensor wait.
//!
//! Messages of one topic come in order; those of two do not, where a driver sends bursts or a network is late. What is ahead of the
//! inertial sensor waits for it. What is behind is given at its newest stamp, a field turned by what the gyroscope has measured
//! since then: it is what the magnetometer would have shown there. Several at one stamp follow each other by a nanosecond.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::geometry::so3;
use northing_recording::mcap::Role;
use northing_recording::{Event, Sample};

/// Stamps further from those of the inertial sensor are of another clock; nothing is given then.
pub(crate) const OTHER_CLOCK_NS: i64 = 5_000_000_000;
/// No burst and no delay is longer: between this and [`OTHER_CLOCK_NS`] a clock is taken to be off, and a sample to be of now.
const DELAY_NS: i64 = 1_000_000_000;
/// Over longer pauses of the gyroscope nobody knows how it turned (`--gap-limit`).
const PAUSE_NS: i64 = 500_000_000;
/// Samples that wait for the inertial sensor.
const MOST_WAITING: usize = 1000;

/// Why a sample is not given.
pub(crate) const OTHER_CLOCK: &str = "stamp of another clock than the Imu's";
const NOT_NEWER: &str = "stamp not newer";
const BEFORE: &str = "stamp before the Imu's first, or before a pause of it";
const TOO_MANY: &str = "too many before the Imu";

/// Puts samples in order.
#[derive(Debug, Default)]
pub(crate) struct Order {
    /// The newest inertial stamp.
    newest_ns: Option<i64>,
    last_rate: Option<Vector3<f64>>,
    /// The attitude against that of the first stamp, at the stamps of the gyroscope.
    turned: VecDeque<(i64, UnitQuaternion<f64>)>,
    /// Samples ahead of the inertial sensor, by their stamps.
    waiting: VecDeque<(i64, Role, Vec<Event>)>,
    ready: VecDeque<Vec<Event>>,
    /// The newest stamp of each topic, as it came and as it was given.
    stamps: BTreeMap<Role, [i64; 2]>,
    given_ns: Option<i64>,
    left_out: Vec<(Role, &'static str)>,
}

impl Order {
    /// Takes the samples of a message.
    pub(crate) fn put(&mut self, role: Role, events: Vec<Event>) {
        let Some(time_ns) = events.first().map(|event| event.time_ns) else {
            return;
        };
        match role {
            // The filter goes back for them.
            Role::Fix | Role::Velocity | Role::LocalPosition => self.ready.push_back(events),
            Role::Inertial => self.inertial(time_ns, events),
            _ => self.beside(time_ns, role, events),
        }
    }

    /// What is given next.
    pub(crate) fn next(&mut self) -> Option<Vec<Event>> {
        self.ready.pop_front()
    }

    /// What was left out since it was asked last, and why.
    pub(crate) fn left_out(&mut self) -> Vec<(Role, &'static str)> {
        std::mem::take(&mut self.left_out)
    }

    fn inertial(&mut self, time_ns: i64, events: Vec<Event>) {
        self.turn(time_ns, &events);
        let is_first = self.newest_ns.replace(time_ns).is_none();
        if is_first {
            self.ready.push_back(events);
            for (time_ns, role, events) in std::mem::take(&mut self.waiting) {
                self.beside(time_ns, role, events);
            }
            return;
        }
        self.release(time_ns);
        self.ready.push_back(events);
        self.release(time_ns.saturating_add(1));
    }

    /// Gives what has waited with a stamp before this one.
    fn release(&mut self, before_ns: i64) {
        while self.waiting.front().is_some_and(|(t, ..)| *t < before_ns) {
            if let Some((time_ns, role, events)) = self.waiting.pop_front() {
                self.give(time_ns, role, events);
            }
        }
    }

    /// Takes samples of another topic than the inertial sensor's.
    fn beside(&mut self, time_ns: i64, role: Role, mut events: Vec<Event>) {
        let Some(newest_ns) = self.newest_ns else {
            return self.wait(time_ns, role, events);
        };
        let behind_ns = newest_ns.saturating_sub(time_ns);
        if behind_ns.saturating_abs() > OTHER_CLOCK_NS {
            return self.left_out.push((role, OTHER_CLOCK));
        }
        let [last_ns, _] = *self.stamps.entry(role).or_insert([i64::MIN; 2]);
        if time_ns <= last_ns {
            return self.left_out.push((role, NOT_NEWER));
        }
        if (-DELAY_NS..0).contains(&behind_ns) {
            return self.wait(time_ns, role, events);
        }
        if (1..=DELAY_NS).contains(&behind_ns) && role == Role::Field {
            let Some(turn) = self.turn_since(time_ns) else {
                return self.left_out.push((role, BEFORE));
            };
            for event in &mut events {
                if let Sample::MagneticField(field) = &mut event.sample {
                    *field = turn * *field;
                }
            }
        }
        if let Some([last_ns, _]) = self.stamps.get_mut(&role) {
            *last_ns = time_ns;
        }
        self.give(newest_ns, role, events);
    }

    fn wait(&mut self, time_ns: i64, role: Role, events: Vec<Event>) {
        if let Some([last_ns, _]) = self.stamps.get_mut(&role) {
            *last_ns = time_ns;
        }
        if self.waiting.len() >= MOST_WAITING
            && let Some((_, role, _)) = self.waiting.pop_front()
        {
            self.left_out.push((role, TOO_MANY));
        }
        let place = self.waiting.partition_point(|(t, ..)| *t <= time_ns);
        self.waiting.insert(place, (time_ns, role, events));
    }

    /// Gives samples at a stamp, or as little later as those that were given want it.
    fn give(&mut self, time_ns: i64, role: Role, mut events: Vec<Event>) {
        let [_, last_ns] = self.stamps.entry(role).or_insert([i64::MIN; 2]);
        let time_ns = self.given_ns.map_or(time_ns, |given| given.max(time_ns));
        let time_ns = time_ns.max(last_ns.saturating_add(1));
        (*last_ns, self.given_ns) = (time_ns, Some(time_ns));
        for event in &mut events {
            event.time_ns = time_ns;
        }
        self.ready.push_back(events);
    }

    /// Follows the gyroscope.
    fn turn(&mut self, time_ns: i64, events: &[Event]) {
        let rate = events.iter().find_map(|event| match event.sample {
            Sample::AngularRate(rate) if event.sample.is_finite() => Some(rate),
            _ => None,
        });
        let Some(rate) = rate else {
            return;
        };
        let before = self.last_rate.replace(rate).unwrap_or(rate);
        let last = self.turned.back().copied();
        let pause_ns = last.map_or(0, |(last_ns, _)| time_ns.saturating_sub(last_ns));
        let attitude = match last {
            Some((_, attitude)) if pause_ns <= PAUSE_NS => {
                attitude * so3::exp(&((before + rate) * (0.5e-9 * pause_ns as f64)))
            }
            _ => {
                self.turned.clear();
                UnitQuaternion::identity()
            }
        };
        self.turned.push_back((time_ns, attitude));
        while (self.turned.get(1)).is_some_and(|(t, _)| time_ns.saturating_sub(*t) > DELAY_NS) {
            self.turned.pop_front();
        }
    }

    /// The rotation of body axes from then to the newest sample; `None` where it is not known.
    fn turn_since(&self, time_ns: i64) -> Option<UnitQuaternion<f64>> {
        let after = self.turned.partition_point(|(t, _)| *t <= time_ns);
        let (before_ns, before) = self.turned.get(after.checked_sub(1)?)?;
        let then = match self.turned.get(after) {
            None => *before,
            Some((after_ns, after)) => {
                let share = (time_ns - before_ns) as f64 / (after_ns - before_ns) as f64;
                before * so3::exp(&(so3::log(&(before.inverse() * after)) * share))
            }
        };
        let (_, newest) = self.turned.back()?;
        Some(newest.inverse() * then)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const TURNING: f64 = 1.5;

    fn inertial(time_ns: i64) -> Vec<Event> {
        let sample = Sample::AngularRate(Vector3::z() * TURNING);
        vec![Event { time_ns, sample }]
    }

    /// What a body that turns about its z axis sees of a field to the north.
    fn field(time_ns: i64) -> Vec<Event> {
        let angle = TURNING * time_ns as f64 * 1e-9;
        let north = Vector3::new(angle.cos(), -angle.sin(), 0.0);
        let sample = Sample::MagneticField(north * 40.0);
        vec![Event { time_ns, sample }]
    }

    fn given(order: &mut Order) -> Vec<Event> {
        std::iter::from_fn(|| order.next()).flatten().collect()
    }

    fn fields(events: &[Event]) -> Vec<(i64, Vector3<f64>)> {
        let fields = events.iter().filter_map(|event| match event.sample {
            Sample::MagneticField(field) => Some((event.time_ns, field)),
            _ => None,
        });
        fields.collect()
    }

    /// Ten messages of the inertial sensor, then the five fields of the same time: none is lost, and each says what is true at
    /// the stamp at which it is given.
    #[test]
    fn fields_in_bursts_are_all_given_as_they_would_be_at_the_newest_stamp() {
        let mut order = Order::default();
        let mut all = Vec::new();
        for burst in 0..20 {
            for k in 0..10 {
                order.put(Role::Inertial, inertial((burst * 10 + k) * 10 * MS));
            }
            for k in 0..5 {
                order.put(Role::Field, field((burst * 5 + k) * 20 * MS));
            }
            all.extend(given(&mut order));
        }
        assert_eq!(order.left_out(), []);
        assert!(all.is_sorted_by_key(|event| event.time_ns));
        let fields = fields(&all);
        assert_eq!(fields.len(), 100);
        assert!(fields.is_sorted_by(|(a, _), (b, _)| a < b), "each is newer");
        for (time_ns, got) in fields {
            let wanted = self::fields(&field(time_ns))[0].1;
            assert!((got - wanted).norm() < 1e-3, "{got} for {wanted}");
        }
    }

    /// Fields first: they wait, and stand between the inertial samples around them.
    #[test]
    fn fields_ahead_wait_for_the_inertial_sensor() {
        let mut order = Order::default();
        order.put(Role::Inertial, inertial(0));
        for time_ns in [15 * MS, 20 * MS, 35 * MS] {
            order.put(Role::Field, field(time_ns));
        }
        assert_eq!(given(&mut order).len(), 1);
        for time_ns in [10 * MS, 20 * MS, 30 * MS, 40 * MS] {
            order.put(Role::Inertial, inertial(time_ns));
        }
        let stamps: Vec<i64> = given(&mut order).iter().map(|e| e.time_ns / MS).collect();
        assert_eq!(stamps, [10, 15, 20, 20, 30, 35, 40]);
    }

    #[test]
    fn what_cannot_be_put_in_order_is_left_out_with_the_reason() {
        let mut order = Order::default();
        order.put(Role::Field, field(-7000 * MS));
        order.put(Role::Field, field(-20 * MS));
        order.put(Role::Inertial, inertial(0));
        order.put(Role::Inertial, inertial(10 * MS));
        order.put(Role::Field, field(10 * MS));
        order.put(Role::Field, field(10 * MS));
        // Nobody knows how it turned in a pause.
        order.put(Role::Inertial, inertial(800 * MS));
        order.put(Role::Field, field(700 * MS));
        let reasons: Vec<&str> = order.left_out().iter().map(|(_, why)| *why).collect();
        assert_eq!(reasons, [OTHER_CLOCK, BEFORE, NOT_NEWER, BEFORE]);
        assert_eq!(given(&mut order).len(), 4);
        // A clock that is two seconds off: of now, as nobody knows better.
        order.put(Role::Field, field(2800 * MS));
        assert_eq!(given(&mut order)[0].time_ns, 800 * MS);
    }
}
