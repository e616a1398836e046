//! A run's fixes: which are used, the noise of each, which are held out.

use nalgebra::Vector3;
use northing_core::earth::wgs84::{Geodetic, LocalFrame};
use northing_recording::{GnssPosition, GnssQuality, GnssVelocity, VERTICAL_OF_HORIZONTAL};

use super::Session;
use crate::navigation::moving_frame::MovingFrame;
use crate::navigation::navigator::{Aid, AidKind};
use crate::navigation::score::LastFix;
use crate::navigation::smoothed::Scored;
use crate::statistics::seconds_between;

/// Error of a range to a satellite, m: with a dilution of 1 half the fixes are within 3 m.
const RANGE_ERROR_M: f64 = 3.6;
/// Above this dilution a fix is not worth using.
const LARGEST_HDOP: f64 = 8.0;
/// A fix that states a larger standard deviation says nothing, m.
const LARGEST_STD_M: f64 = 1e5;
/// Fewer satellites give no position.
const FEWEST_SATELLITES: u8 = 4;
/// Standard deviations of a velocity where the receiver states none, m/s: across, down.
const VELOCITY_STD: [f64; 2] = [0.15, 0.25];
/// Why a fix is left out that the consensus of the first fixes contradicts.
const CONTRADICTED: &str = "too far from the next ones to have been travelled";
/// A velocity this much older than a fix does not belong to it, s.
const SAME_FIX_S: f64 = 1.5;

impl Session<'_> {
    /// `left_out`: those after it contradict it.
    pub(super) fn gnss_position(&mut self, time_ns: i64, fix: &GnssPosition, left_out: bool) {
        self.counts.fixes += 1;
        if let Some(reason) = unusable(fix).or(left_out.then_some(CONTRADICTED)) {
            *self.counts.unusable.entry(reason).or_default() += 1;
            self.unusable = true;
            return;
        }
        self.unusable = false;
        self.scorer.fix_came(time_ns);
        let thinned = !self
            .fix_index
            .is_multiple_of(u64::from(self.options.gnss_every));
        self.fix_index += 1;
        let left_out = self.options.without.contains(&AidKind::GnssPosition);
        self.held_out = thinned || left_out || self.scorer.in_outage(time_ns);
        if !self.held_out {
            self.follow_fix(time_ns, fix);
        }
        let ned = self.place(time_ns, fix);
        let from_the_first = self
            .frame
            .map_or(ned, |frame| frame.seen_from_the_first(&ned));
        self.observer.fix(time_ns, &from_the_first, !self.held_out);
        let std = position_std(fix);
        self.counts.fixes_ns.add(time_ns);
        self.turns.fix(time_ns, &ned, std.x.max(std.y));
        self.axes.fix(time_ns, &ned, std.x.max(std.y));
        self.counts.zero_std += u64::from(fix.std_m.is_some() && stated(fix.std_m).is_none());
        let vertical_std = fix.height_m.map(|_| std.z);
        let latencies = &self.options.parameters.error_state;
        let valid_ns = before(time_ns, latencies.position_latency_s);
        if self.held_out {
            if !self.has_reference {
                self.score_position(valid_ns, &ned, std.x.max(std.y), vertical_std);
            }
            return;
        }
        self.counts.given += 1;
        if let Some(std) = stated(fix.std_m) {
            self.counts.states(std.x.max(std.y));
        }
        self.score(Scored::FixUsed);
        self.remember(valid_ns, &ned);
        let vertical =
            vertical_std.is_some() && !self.options.without.contains(&AidKind::GnssHeight);
        let stated = stated(fix.std_m).is_some();
        let aid = Aid::Position {
            ned,
            std,
            vertical,
            stated,
        };
        self.aid(time_ns, &aid);
        if let Some(estimate) = self.navigator.estimate() {
            self.travel.estimate(&estimate);
        }
    }

    /// Metres from the origin of now; the first one is the first fix that got here.
    fn place(&mut self, time_ns: i64, fix: &GnssPosition) -> Vector3<f64> {
        let now = self.frame.map(|frame| *frame.now());
        let height = now.map_or(0.0, |frame| frame.origin().height_m);
        let place = Geodetic {
            latitude_rad: fix.latitude_rad,
            longitude_rad: fix.longitude_rad,
            height_m: fix.height_m.unwrap_or(height),
        };
        if let Some(frame) = &mut self.frame {
            frame.is_at(&place);
            return frame.now().ned(&place);
        }
        let frame = LocalFrame::new(place);
        self.frame = Some(MovingFrame::new(frame, time_ns, fix));
        self.observer.origin(&frame);
        self.declination = self.navigator.origin(&frame, time_ns);
        Vector3::zeros()
    }

    /// Keeps a fix for the answers that need no filter; its velocity is the way from the one before until
    /// the receiver tells it.
    fn remember(&mut self, time_ns: i64, ned: &Vector3<f64>) {
        let velocity = self.last_fix.map_or_else(Vector3::zeros, |last| {
            let passed = seconds_between(last.time_ns, time_ns);
            if passed > 0.0 {
                (ned - last.ned) / passed
            } else {
                last.velocity
            }
        });
        self.last_fix = Some(LastFix {
            time_ns,
            ned: *ned,
            velocity,
        });
    }

    pub(super) fn gnss_velocity(&mut self, time_ns: i64, velocity: &GnssVelocity) {
        let Some(frame) = self.frame else {
            return;
        };
        // What comes with a fix that nobody should use is no measurement either.
        if self.unusable || !velocity.is_finite() {
            return;
        }
        let vertical = velocity.down_m_s.is_some();
        let ned = Vector3::new(
            velocity.north_m_s,
            velocity.east_m_s,
            velocity.down_m_s.unwrap_or(0.0),
        );
        let ned = frame.velocity(&ned);
        self.turns.velocity(time_ns, &ned);
        if !self.has_reference {
            let latencies = &self.options.parameters.error_state;
            let valid_ns = before(time_ns, latencies.velocity_latency_s);
            if self.held_out {
                self.score(Scored::Velocity(valid_ns, ned, vertical));
            }
            self.score(Scored::Course(valid_ns, ned, self.turn_rate));
        }
        if self.held_out {
            return;
        }
        if let Some(last) = &mut self.last_fix
            && seconds_between(last.time_ns, time_ns).abs() < SAME_FIX_S
        {
            last.velocity = ned;
        }
        let [across, down] = VELOCITY_STD;
        let std = stated(velocity.std_m_s).unwrap_or(Vector3::new(across, across, down));
        self.aid(time_ns, &Aid::Velocity { ned, std, vertical });
    }
}

/// When a number was true that has a stamp and is late by `latency_s`.
fn before(time_ns: i64, latency_s: f64) -> i64 {
    time_ns.saturating_sub((latency_s * 1e9) as i64)
}

/// Why a fix is not to be used.
pub(crate) fn unusable(fix: &GnssPosition) -> Option<&'static str> {
    if matches!(fix.quality, GnssQuality::Invalid) {
        Some("the receiver calls it invalid")
    } else if matches!(fix.quality, GnssQuality::Estimated) {
        Some("dead reckoning of the receiver")
    } else if fix.is_at_zero() {
        Some("latitude and longitude are both exactly 0")
    } else if !fix.is_usable() {
        Some("not a place on the Earth")
    } else if fix
        .std_m
        .is_some_and(|[north, east, _]| north.max(east) > LARGEST_STD_M)
    {
        Some("an error above 100 km is stated")
    } else if fix.satellites.is_some_and(|n| n < FEWEST_SATELLITES) {
        Some("fewer than 4 satellites")
    } else if fix.hdop.is_some_and(|hdop| hdop > LARGEST_HDOP) {
        Some("dilution of precision above 8")
    } else {
        None
    }
}

/// Standard deviations as a receiver states them; one that is not above zero states nothing.
fn stated(std: Option<[f64; 3]>) -> Option<Vector3<f64>> {
    std.map(Vector3::from).filter(|std| std.min() > 0.0)
}

/// Standard deviations of a fix, m, north, east, down: the receiver's, or from its dilution.
pub(super) fn position_std(fix: &GnssPosition) -> Vector3<f64> {
    if let Some(std) = stated(fix.std_m) {
        return std;
    }
    let hdop = fix.hdop.unwrap_or(1.0).max(0.5);
    let across = RANGE_ERROR_M * hdop * std::f64::consts::FRAC_1_SQRT_2;
    Vector3::new(
        across,
        across,
        RANGE_ERROR_M * VERTICAL_OF_HORIZONTAL * hdop,
    )
}
