//! Outages of a vehicle that stood or hovered before: it stays where it was, unless it drives off.

use super::*;

const HOVERING_S: usize = 60;

/// Hovers for a minute with a good receiver and a compass, and then has no receiver for `seconds`, with a motion that begins after so many
/// of them and an accelerometer whose bias steps forward (m/s^2) as the outage begins. How far off it is at the end, what it states of that
/// (one standard deviation), and how far it went, m.
fn outage(seconds: usize, driving_after: usize, [swaying, force_step]: [f64; 2]) -> [f64; 3] {
    let mut ins = GnssIns::<f64, 64>::new(config()).unwrap();
    let mut motion = Motion::start();
    let began = motion.position;
    for k in 1..=(HOVERING_S + seconds) * 100 {
        let t = k as f64 * 0.01;
        motion.step(t - (HOVERING_S + driving_after) as f64 + STILL_S, 0.01);
        let time_ns = k as i64 * 10_000_000;
        let is_outage = k > HOVERING_S * 100;
        let step = Vector3::x() * if is_outage { force_step } else { 0.0 };
        let sway = Vector3::new((7.0 * t).sin(), (5.0 * t).cos(), 0.0) * swaying;
        let force = motion.force() + sway + step;
        ins.imu(time_ns, &motion.rate(), &force).unwrap();
        if k % 10 == 0 {
            ins.heading(time_ns, motion.heading, 0.02);
        }
        if k % 20 == 0 && !is_outage {
            // Positions that are the same to the last digit would be those of a receiver that is frozen.
            let noise = Vector3::new((3.0 * t).sin(), (11.0 * t).cos(), 0.0) * 0.05;
            let fix = GnssPosition::new(motion.position + noise, Vector3::repeat(0.05));
            ins.gnss_position(time_ns, &fix);
        }
    }
    let state = ins.state().unwrap();
    let off = (state.position - motion.position).xy().norm();
    let p = state.covariance.fixed_view::<2, 2>(6, 6).into_owned();
    let way = (motion.position - began).norm();
    [off, p.trace().sqrt(), way]
}

#[test]
fn what_hovered_stays_where_it_was() {
    // The bias alone would carry it 54 m away.
    let [off, stated, _] = outage(60, 60, [0.6, 0.03]);
    assert!(off < 1.5 && off < 3.0 * stated, "{off} +- {stated}");
}

/// The longer the outage has lasted the less its own velocity is known, and the more of it is held.
#[test]
fn what_drives_off_is_not_held() {
    for (after, most) in [(0, 0.1), (10, 0.7), (30, 0.7)] {
        let [off, stated, way] = outage(after + 20, after, [0.1, 0.0]);
        assert!(
            off < most * way && off < 3.0 * stated,
            "{after}: {off} +- {stated} of {way}"
        );
    }
}
