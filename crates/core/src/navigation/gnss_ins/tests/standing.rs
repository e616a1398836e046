//! Long standing before a drive: noise shows no heading and no time offset, and the drive is followed from its first second on.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::geometry::trigonometry::wrap;
use crate::navigation::ATTITUDE;

const DT: f64 = 0.05;
const DRIVING_S: f64 = 120.0;
/// White noise of a position, m.
const FIX_STD: f64 = 0.5;

/// What the receiver says of a place while it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Receiver {
    /// Each fix is measured anew.
    Noisy,
    /// One fix, again and again, from the first minute on.
    Identical,
}

struct Standing {
    receiver: Receiver,
    seconds: f64,
    seed: u64,
}

impl Standing {
    /// Stands and drives with the noise of a cheap unit; `each` fix sees the seconds of the drive, below zero before it.
    fn and_drive(&self, mut each: impl FnMut(f64, &GnssIns<f64, 64>, &Motion)) {
        let mut random = Pcg64Mcg::seed_from_u64(self.seed);
        let mut noise = |std: f64| {
            Vector3::from_fn(|_, _| {
                let drawn: f64 = StandardNormal.sample(&mut random);
                drawn * std
            })
        };
        let mut ins = GnssIns::<f64, 64>::new(config()).unwrap();
        let mut motion = Motion::start();
        let rate_bias = Vector3::new(3e-3, -2e-3, 4e-3);
        let force_bias = Vector3::new(0.05, -0.03, 0.04);
        let mut last = motion.position;
        for k in 1..=((self.seconds + DRIVING_S) / DT) as i64 {
            let t = k as f64 * DT;
            let driving = t - self.seconds;
            motion.step(driving + STILL_S, DT);
            let time_ns = (t * 1e9).round() as i64;
            let rate = motion.rate() + rate_bias + noise(3e-3);
            let force = motion.force() + force_bias + noise(0.03);
            ins.imu(time_ns, &rate, &force).unwrap();
            if k % 20 != 0 {
                continue;
            }
            if self.receiver == Receiver::Noisy || t < 60.0 || driving > 0.0 {
                last = motion.position + noise(FIX_STD);
            }
            let std = Vector3::repeat(FIX_STD);
            ins.gnss_position(time_ns, &GnssPosition::new(last, std));
            each(driving, &ins, &motion);
        }
    }

    /// While it stands the heading stays unknown; in the drive it is never three standard deviations off once it is stated
    /// within 8 degrees, nor the position.
    fn check(&self) {
        let (mut known, mut seconds) = (0, 0);
        let name = std::format!("{:?}, seed {}", self.receiver, self.seed);
        self.and_drive(|t, ins, motion| {
            let Some(state) = ins.state() else {
                return;
            };
            let std = state.covariance[(ATTITUDE + 2, ATTITUDE + 2)].sqrt();
            if t <= 0.0 {
                let late = ins.augmented_states().values[TIME_OFFSET];
                assert!(late.abs() < 0.12, "{name}, {t} s: {late} s late");
                assert!(t < 30.0 - self.seconds || std > 0.6, "{name}, {t} s: {std}");
                return;
            }
            let off = (state.position - motion.position).xy().norm();
            let p = state.covariance.fixed_view::<2, 2>(6, 6).into_owned();
            let stated = p.trace().sqrt();
            assert!(off < 3.0 * stated, "{name}, {t} s: {off} +- {stated} m");
            seconds += 1;
            if std < 8_f64.to_radians() {
                let [yaw, ..] = rotation::to_yaw_pitch_roll(&state.ned_from_body);
                let turned = wrap(yaw - motion.heading).abs();
                assert!(turned < 3.0 * std, "{name}, {t} s: {turned} +- {std} rad");
                known += 1;
            }
        });
        assert!(
            10 * known > 8 * seconds,
            "{name}: known {known} of {seconds}"
        );
    }
}

#[test]
fn standing_for_long_shows_no_heading_and_harms_no_drive() {
    for seed in 1..=4 {
        for receiver in [Receiver::Noisy, Receiver::Identical] {
            Standing {
                receiver,
                seconds: 1800.0,
                seed,
            }
            .check();
        }
    }
}

#[test]
fn hours_of_standing_do_no_harm_to_the_drive_after_it() {
    Standing {
        receiver: Receiver::Noisy,
        seconds: 7200.0,
        seed: 17,
    }
    .check();
    Standing {
        receiver: Receiver::Identical,
        seconds: 3600.0,
        seed: 17,
    }
    .check();
}
