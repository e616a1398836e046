//! The in-motion alignment in simulated worlds: what it finds, what it states, and that it never states a heading that
//! is wrong.

#![allow(clippy::unwrap_used)]

#[path = "in_motion_alignment/world.rs"]
mod world;

use northing_core::Scalar;
use northing_core::geometry::so3;
use northing_core::nalgebra::{UnitQuaternion, Vector3, convert, try_convert};
use northing_core::navigation::GnssPosition;
use northing_core::navigation::in_motion_alignment::{
    AlignmentStatus, InMotionAlignment, InMotionAlignmentConfig,
};
use world::{DT, GPS, RTK, Receiver, Vehicle, World, world};

const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// An unmodelled lever arm and clock that a receiver's stated standard deviation says nothing of.
const RTK_OFF: Receiver = Receiver {
    stated: 0.05,
    arm: 0.2,
    clock: 0.05,
    ..RTK
};

/// The estimate at a fix, and how far it is off.
#[derive(Debug, Clone, Copy)]
struct Moment {
    t: f64,
    status: AlignmentStatus,
    horizontal_m: f64,
    inside_95: bool,
    heading_off: f64,
    heading_std: f64,
    tilt_off: f64,
    tilt_std: f64,
    ned_from_body: UnitQuaternion<f64>,
    position: Vector3<f64>,
}

impl Moment {
    /// A heading stated below 8 degrees that is off by more than 5 degrees and three standard deviations.
    fn is_wrong(&self) -> bool {
        self.heading_std < 8.0 * DEGREE
            && self.heading_off.abs() > (3.0 * self.heading_std).max(5.0 * DEGREE)
    }
}

/// Runs a world and looks half a second after each fix.
fn run<T: Scalar, const K: usize, const N: usize>(world: &World) -> Vec<Moment> {
    let config = InMotionAlignmentConfig::<T>::default();
    let mut alignment = InMotionAlignment::<T, K, N>::new(config).unwrap();
    run_with(&mut alignment, world, |_, _| ())
}

fn run_with<T: Scalar, const K: usize, const N: usize>(
    alignment: &mut InMotionAlignment<T, K, N>,
    world: &World,
    mut beside: impl FnMut(&mut InMotionAlignment<T, K, N>, usize),
) -> Vec<Moment> {
    let to = |v: &Vector3<f64>| v.map(convert::<f64, T>);
    let mut moments = Vec::new();
    let mut fixes = world.fixes.iter().peekable();
    for k in 0..world.position.len() {
        if let Some((_, fix)) = fixes.next_if(|(at, _)| *at == k) {
            let fix = GnssPosition {
                ned: to(&fix.ned),
                std: to(&fix.std),
                has_height: fix.has_height,
            };
            alignment.gnss_position(&fix);
            beside(alignment, k);
        }
        if k % 100 == 80 {
            moments.extend(look(alignment, world, k));
        }
        if let Some([rate, force]) = world.samples.get(k) {
            alignment
                .propagate(&to(rate), &to(force), convert(DT))
                .unwrap();
        }
    }
    moments
}

fn look<T: Scalar, const K: usize, const N: usize>(
    alignment: &InMotionAlignment<T, K, N>,
    world: &World,
    k: usize,
) -> Option<Moment> {
    let from = |v: T| try_convert::<T, f64>(v).unwrap();
    let solution = alignment.solution()?;
    let position = solution.position.map(from);
    let [w, i, j, l] =
        northing_core::geometry::rotation::to_wxyz(&solution.ned_from_body).map(from);
    let ned_from_body = northing_core::geometry::rotation::from_wxyz([w, i, j, l]).unwrap();
    let off = (world.position[k.saturating_add_signed(world.late)] - position).xy();
    let covariance = solution.position_covariance.map(from);
    let covariance = covariance.fixed_view::<2, 2>(0, 0).into_owned();
    let nees = off.dot(&(covariance.try_inverse().unwrap() * off));
    let error = so3::log(&(world.ned_from_body[k] * ned_from_body.inverse()));
    Some(Moment {
        t: k as f64 * DT,
        status: alignment.status(),
        horizontal_m: off.norm(),
        inside_95: nees < 5.991,
        heading_off: error.z,
        heading_std: from(solution.heading_std),
        tilt_off: error.xy().norm(),
        tilt_std: from(solution.tilt_std),
        ned_from_body,
        position,
    })
}

/// First second at which it is aligned.
fn aligned_at(moments: &[Moment]) -> Option<f64> {
    let aligned = |m: &&Moment| m.status == AlignmentStatus::Aligned;
    moments.iter().find(aligned).map(|m| m.t)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
    f64::sqrt(sum / count)
}

#[test]
fn survey() {
    for (name, vehicle, receiver) in [
        ("car rtk", Vehicle::Car, RTK),
        ("car rtk off", Vehicle::Car, RTK_OFF),
        ("drone rtk", Vehicle::Drone, RTK),
        ("drone rtk off", Vehicle::Drone, RTK_OFF),
        ("drone gps", Vehicle::Drone, GPS),
        ("phone gps", Vehicle::Phone, GPS),
        ("straight rtk", Vehicle::Straight, RTK),
        ("standing rtk", Vehicle::Standing, RTK),
        ("standing gps", Vehicle::Standing, GPS),
    ] {
        let started = std::time::Instant::now();
        let (mut at, mut wrong, mut pos, mut inside, mut nees, mut head, mut std) =
            (vec![], 0, vec![], vec![], vec![], vec![], vec![]);
        for seed in 0..20 {
            let world = world(vehicle, &receiver, seed, 60.0);
            let m = run::<f64, 8, 12>(&world);
            at.extend(aligned_at(&m));
            wrong += usize::from(m.iter().any(Moment::is_wrong));
            let late = || m.iter().filter(|m| m.t > 5.0);
            pos.push(rms(late().map(|m| m.horizontal_m)));
            inside.push(late().filter(|m| m.inside_95).count() as f64 / late().count() as f64);
            nees.extend(
                late()
                    .filter(|m| m.status == AlignmentStatus::Aligned)
                    .map(|m| (m.heading_off / m.heading_std).powi(2)),
            );
            head.extend(m.last().map(|m| m.heading_off.abs() / DEGREE));
            std.extend(m.last().map(|m| m.heading_std / DEGREE));
        }
        at.sort_by(f64::total_cmp);
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        println!(
            "{name:14} aligned {} median {:.1}  wrong {wrong}  pos {:.3} worst {:.3} inside {:.3}  nees {:.2}  end heading {:.2} std {:.2}..{:.2}  {:.1?}",
            at.len(),
            at.get(at.len() / 2).copied().unwrap_or(f64::NAN),
            rms(pos.iter().copied()),
            pos.iter().copied().fold(0.0, f64::max),
            mean(&inside),
            mean(&nees),
            mean(&head),
            std.iter().copied().fold(1e9, f64::min),
            std.iter().copied().fold(0.0, f64::max),
            started.elapsed()
        );
    }
}
