//! Consensus of the first fixes: the local frame has its origin where two of them agree.
//!
//! A receiver may begin with the place where it was switched off, on another continent, or with 0, 0. So the events
//! from the first fix on wait until a later fix shows that it could have been travelled to. Fixes from which the
//! confirming one could not have been reached are left out. What waits is bounded.

use std::collections::VecDeque;

use nalgebra::Vector3;
use northing_core::earth::wgs84::Geodetic;
use northing_recording::{Event, GnssPosition, Sample};
use serde::{Deserialize, Serialize};

use super::receiver::{position_std, unusable};
use crate::error::EvaluationError;
use crate::statistics::seconds_between;

/// Nothing that carries a receiver is faster, m/s: civil receivers give no fix above 515 m/s.
const FASTEST: f64 = 600.0;
/// So many standard deviations of both fixes are allowed for ...
const SIGMAS: f64 = 3.0;
/// ... but no more than this, m: a fix that states thousands of kilometres confirms nothing.
const LARGEST_ALLOWANCE_M: f64 = 10_000.0;
/// Mean radius of the Earth, m.
const EARTH_RADIUS_M: f64 = 6_371_000.0;
/// Events that may wait: 20 minutes of an inertial unit at 100 Hz, 30 MB.
const MOST_WAITING: usize = 1 << 18;
/// Fixes that wait for one that confirms them; of more, the oldest is given up.
const MOST_FIXES: usize = 64;

/// What is to be done with an event.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Step {
    /// Nothing waits: it is taken at once.
    Take,
    /// It waits; call [`FixConsensus::next`] until there is no more.
    Wait,
}

/// A fix that waits for another to confirm it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(in crate::navigation) struct Candidate {
    time_ns: i64,
    /// On the ellipsoid, earth-centred, m: heights are not compared.
    place: Vector3<f64>,
    /// The larger horizontal standard deviation, m.
    std: f64,
}

impl Candidate {
    pub(in crate::navigation) fn of(time_ns: i64, fix: &GnssPosition) -> Self {
        let std = position_std(fix);
        let on_ellipsoid = Geodetic {
            latitude_rad: fix.latitude_rad,
            longitude_rad: fix.longitude_rad,
            height_m: 0.0,
        };
        Self {
            time_ns,
            place: on_ellipsoid.to_ecef(),
            std: std.x.max(std.y),
        }
    }

    /// The way over the ground, on a sphere, m.
    fn distance(&self, other: &Self) -> f64 {
        let chord = (self.place - other.place).norm();
        2.0 * EARTH_RADIUS_M * (0.5 * chord / EARTH_RADIUS_M).min(1.0).asin()
    }

    /// Whether a receiver can have been at both places, each within its stated error.
    pub(in crate::navigation) fn could_reach(&self, other: &Self) -> bool {
        let errors = (SIGMAS * (self.std + other.std)).min(LARGEST_ALLOWANCE_M);
        let way = FASTEST * seconds_between(self.time_ns, other.time_ns).abs();
        self.distance(other) <= way + errors
    }

    /// Whether both are the very same numbers: a receiver that repeats itself confirms nothing.
    fn repeats(&self, other: &Self) -> bool {
        self.place == other.place
    }
}

/// The fixes that were left out.
#[derive(Debug, Clone, Copy)]
pub(super) struct LeftOut {
    count: u64,
    /// Stamps of the first and of the last, ns.
    span_ns: [i64; 2],
    /// Distance of the nearest from the fix that the others agree with, m.
    nearest_m: f64,
}

impl LeftOut {
    /// What happened, in a sentence; the recording begins at `start_ns`.
    pub(super) fn sentence(&self, start_ns: i64) -> String {
        let [first, last] = self.span_ns.map(|at| seconds_between(start_ns, at));
        let distance = distance(self.nearest_m);
        if self.count == 1 {
            format!("1 fix at {first:.1} s is {distance} from those after it: left out.")
        } else {
            format!(
                "{} fixes from {first:.1} s to {last:.1} s are {distance} or more from those after them: left out.",
                self.count
            )
        }
    }
}

/// A distance in words: kilometres with a thousands separator from 10 km on.
fn distance(metres: f64) -> String {
    if metres < 10_000.0 {
        return format!("{metres:.0} m");
    }
    // To two digits, which is all that a reader needs of it.
    let km = metres / 1000.0;
    let unit = 10_f64.powf(km.log10().floor() - 1.0).max(1.0);
    let km = ((km / unit).round() * unit) as u64;
    match (km / 1000, km % 1000) {
        (0, km) => format!("{km} km"),
        (thousands, rest) => format!("{thousands},{rest:03} km"),
    }
}

/// Holds the events back until two fixes agree.
#[derive(Debug, Default)]
pub(super) struct FixConsensus {
    found: bool,
    /// The fix that settled it.
    agreed: Option<Candidate>,
    waiting: VecDeque<Event>,
    candidates: VecDeque<Candidate>,
    /// Usable fixes so far.
    fixes: u64,
    /// Whether all of them were the very same place.
    all_alike: bool,
    left_out: Option<LeftOut>,
}

impl FixConsensus {
    /// Looks at the next event of the recording.
    pub(super) fn look_at(&mut self, event: &Event) -> Step {
        if self.found {
            return Step::Take;
        }
        if let Sample::GnssPosition(fix) = &event.sample
            && unusable(fix).is_none()
        {
            self.add(&Candidate::of(event.time_ns, fix));
        } else if self.candidates.is_empty() {
            return Step::Take;
        }
        self.waiting.push_back(*event);
        Step::Wait
    }

    fn add(&mut self, fix: &Candidate) {
        self.fixes += 1;
        let confirms = |other: &Candidate| other.could_reach(fix) && !other.repeats(fix);
        if self.candidates.iter().any(confirms) {
            self.settle(Some(*fix));
            return;
        }
        let alike = |other: &Candidate| other.repeats(fix);
        self.all_alike = self.candidates.iter().all(alike) && (self.fixes == 1 || self.all_alike);
        // Of fixes that repeat each other the newest stands for all.
        self.candidates.retain(|other| !other.repeats(fix));
        self.candidates.push_back(*fix);
        if self.candidates.len() > MOST_FIXES {
            self.candidates.pop_front();
        }
    }

    fn settle(&mut self, agreed: Option<Candidate>) {
        self.found = true;
        self.agreed = agreed;
        self.candidates = VecDeque::new();
    }

    /// The recording has ended: a place that nothing contradicts counts.
    ///
    /// # Errors
    /// There are fixes, and no two of them agree.
    pub(super) fn end(&mut self) -> Result<(), EvaluationError> {
        if !self.found && self.fixes > 0 && !self.all_alike {
            return Err(EvaluationError::NoConsensus { fixes: self.fixes });
        }
        self.settle(self.agreed);
        Ok(())
    }

    /// The next event to take, and whether it is a fix to leave out; `None` while the others have to wait.
    pub(super) fn next(&mut self) -> Option<(Event, bool)> {
        if !self.found {
            if self.waiting.len() <= MOST_WAITING {
                return None;
            }
            if self.all_alike {
                self.settle(None);
            }
        }
        let event = self.waiting.pop_front()?;
        let Sample::GnssPosition(fix) = &event.sample else {
            return Some((event, false));
        };
        if unusable(fix).is_some() {
            return Some((event, false));
        }
        let fix = Candidate::of(event.time_ns, fix);
        let fits = match &self.agreed {
            Some(agreed) => fix.could_reach(agreed),
            None => self.found,
        };
        if !fits {
            self.leave_out(&fix);
        }
        Some((event, !fits))
    }

    fn leave_out(&mut self, fix: &Candidate) {
        // Before any two agree it is far from all others.
        let others = self.agreed.iter().chain(&self.candidates);
        let others = others.filter(|other| !other.repeats(fix));
        let away = others
            .map(|other| fix.distance(other))
            .fold(f64::INFINITY, f64::min);
        let left_out = self.left_out.get_or_insert(LeftOut {
            count: 0,
            span_ns: [fix.time_ns; 2],
            nearest_m: away,
        });
        left_out.count += 1;
        left_out.span_ns[1] = fix.time_ns;
        left_out.nearest_m = left_out.nearest_m.min(away);
    }

    /// The fixes that were left out.
    pub(super) fn left_out(&self) -> Option<&LeftOut> {
        self.left_out.as_ref()
    }
}

#[cfg(test)]
mod tests;
