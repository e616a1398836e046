//! Where is a car? An inertial unit at 100 Hz and a GNSS receiver at 1 Hz, and then a tunnel of five seconds.
//! It stands for five seconds and drives north at 1 m/s^2. Asked for: latitude, longitude and heading at the end of
//! the tunnel, with standard deviations.
#![allow(clippy::print_stdout, missing_docs, unreachable_pub)]
use northing_core::earth::{Geodetic, LocalFrame};
use northing_core::nalgebra::Vector3;
use northing_core::navigation::{GnssIns, GnssInsConfig, GnssPosition, GnssVelocity, Validity};

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let origin = Geodetic::from_degrees(63.43, 10.39, 45.0).ok_or("no place on Earth")?;
    let frame = LocalFrame::new(origin);
    let mut ins = GnssIns::<f64>::new(GnssInsConfig::default())?;
    for k in 1..=2500_i64 {
        let (time_ns, t) = (k * 10_000_000, k as f64 * 0.01);
        let (driven, pull) = ((t - 5.0).max(0.0), if t > 5.0 { 1.0 } else { 0.0 });
        let force = Vector3::new(pull, 0.0, -9.806_65);
        ins.imu(time_ns, &Vector3::zeros(), &force)?;
        if k % 100 == 0 && t <= 20.0 {
            let place = frame.geodetic(&(Vector3::x() * (0.5 * driven * driven)));
            let ([lat, lon], std) = (place.degrees(), Vector3::new(1.5, 1.5, 3.0));
            let fix = GnssPosition::from_degrees(&frame, [lat, lon, place.height_m], std);
            ins.gnss_position(time_ns, &fix.ok_or("no place on Earth")?);
            let velocity = GnssVelocity::new(Vector3::x() * driven, Vector3::repeat(0.1));
            ins.gnss_velocity(time_ns, &velocity);
        }
    }
    let state = ins.state().ok_or("still aligning")?;
    let [lat, lon] = state.geodetic(&frame).degrees();
    let std = state.position_std();
    println!("{lat:.6} {lon:.6} deg, std {:.1?} m", std.data.0);
    let [_, _, yaw] = state.roll_pitch_yaw_deg();
    let [_, _, yaw_std] = state.roll_pitch_yaw_std_deg();
    println!("heading {yaw:.2} deg, std {yaw_std:.2} deg");
    assert!((state.position - Vector3::x() * 200.0).norm() < 3.0 * std.norm());
    assert!(yaw.abs() < 3.0 * yaw_std && ins.validity() == Validity::DeadReckoning);
    Ok(())
}
