//! Whether a satellite receiver says that its carrier moves: a smooth car in a steady turn feels like one at rest.

use northing_recording::{GnssPosition, GnssVelocity};

/// Beyond so many standard deviations it moves, ...
const SIGMAS: f64 = 5.0;
/// ... and at least so fast (m/s): receivers at rest show less, whatever they state.
const SLOWEST_M_S: f64 = 0.5;
/// Standard deviations of receivers that state none, m/s and m.
const VELOCITY_STD_M_S: f64 = 0.3;
const POSITION_STD_M: f64 = 10.0;
/// A velocity counts for so long, and two fixes further apart in time say nothing, ns.
const VELOCITY_NS: i64 = 2_000_000_000;
const FIXES_NS: i64 = 20_000_000_000;
const EARTH_RADIUS_M: f64 = 6.371e6;

/// Watches fixes and velocities over ground.
#[derive(Debug, Clone, Copy, Default)]
pub struct GroundMotion {
    /// The fix that the next ones are compared with.
    anchor: Option<(i64, GnssPosition)>,
    until_ns: Option<i64>,
}

impl GroundMotion {
    /// Takes a velocity over ground.
    pub fn velocity(&mut self, time_ns: i64, velocity: &GnssVelocity) {
        let stated = velocity.std_m_s.map(|std| std[0].max(std[1]));
        let std = stated.unwrap_or(VELOCITY_STD_M_S);
        if velocity.north_m_s.hypot(velocity.east_m_s) > SLOWEST_M_S.max(SIGMAS * std) {
            self.moves(time_ns, VELOCITY_NS);
        }
    }

    /// Takes a fix.
    pub fn position(&mut self, time_ns: i64, fix: &GnssPosition) {
        if !fix.is_usable() {
            return;
        }
        let Some((anchor_ns, anchor)) = self.anchor else {
            self.anchor = Some((time_ns, *fix));
            return;
        };
        let passed_ns = time_ns.saturating_sub(anchor_ns);
        let std = |fix: &GnssPosition| fix.std_m.map_or(POSITION_STD_M, |std| std[0].max(std[1]));
        let far_m = SIGMAS * std(fix).hypot(std(&anchor));
        let slowest_m = SLOWEST_M_S * passed_ns as f64 * 1e-9;
        if distance_m(fix, &anchor) > far_m.max(slowest_m) && passed_ns < FIXES_NS {
            self.moves(time_ns, passed_ns);
        } else if passed_ns < FIXES_NS {
            return;
        }
        self.anchor = Some((time_ns, *fix));
    }

    fn moves(&mut self, time_ns: i64, for_ns: i64) {
        self.until_ns = Some(time_ns.saturating_add(for_ns));
    }

    /// Whether it moves now, as far as the receiver has said.
    #[must_use]
    pub fn is_moving(&self, time_ns: i64) -> bool {
        self.until_ns.is_some_and(|until_ns| time_ns < until_ns)
    }
}

fn distance_m(a: &GnssPosition, b: &GnssPosition) -> f64 {
    let north = a.latitude_rad - b.latitude_rad;
    let east = (a.longitude_rad - b.longitude_rad) * a.latitude_rad.cos();
    EARTH_RADIUS_M * north.hypot(east)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fix(north_m: f64, std_m: Option<f64>) -> GnssPosition {
        GnssPosition {
            latitude_rad: 0.8 + north_m / EARTH_RADIUS_M,
            longitude_rad: 0.2,
            std_m: std_m.map(|std| [std; 3]),
            quality: northing_recording::GnssQuality::Autonomous,
            ..GnssPosition::default()
        }
    }

    /// GIVEN fixes once a second of a car at 10 m/s, of one that stands, and of one that stops WHEN they are taken THEN it moves
    /// while it moves.
    #[test]
    fn fixes_say_whether_it_moves() {
        for std_m in [Some(0.02), Some(2.0), None] {
            let mut motion = GroundMotion::default();
            for k in 0..120_i64 {
                let driven = (k as f64).clamp(30.0, 60.0) - 30.0;
                let wobble = if k % 2 == 0 { 1.0 } else { -1.0 } * std_m.unwrap_or(5.0);
                motion.position(k * 1_000_000_000, &fix(10.0 * driven + wobble, std_m));
                let moves = motion.is_moving(k * 1_000_000_000 + 1);
                assert!(!moves || (31..75).contains(&k), "{std_m:?} {k}");
                assert!(moves || !(42..=60).contains(&k), "{std_m:?} {k}");
            }
        }
    }

    #[test]
    fn velocities_say_whether_it_moves() {
        let mut motion = GroundMotion::default();
        for (speed, moves) in [(0.2, false), (14.0, true)] {
            motion.velocity(0, &GnssVelocity::from_course(speed, 1.0));
            assert_eq!(motion.is_moving(1_000_000_000), moves);
            assert!(!motion.is_moving(VELOCITY_NS));
        }
    }
}
