//! Limits of numbers: single precision, a day, the memory of a chip.

use super::*;

#[test]
fn single_precision_follows_double() {
    let (mut double, motion) = drive(config(), &Drive::default(), |_, _, _| ());
    let mut single = GnssIns::<f32, 64>::new(GnssInsConfig {
        imu_samples: ImuSamples::Means,
        ..GnssInsConfig::default()
    })
    .unwrap();
    let mut truth = Motion::start();
    for k in 1..=6000_i64 {
        truth.step(k as f64 * 0.01, 0.01);
        let time_ns = k * 10_000_000;
        let (rate, force) = (
            truth.rate().map(|x| x as f32),
            truth.force().map(|x| x as f32),
        );
        single.imu(time_ns, &rate, &force).unwrap();
        if k % 100 == 0 {
            let ned = truth.position.map(|x| x as f32);
            let std = Vector3::new(0.05, 0.05, 0.1);
            single.gnss_position(
                time_ns,
                &GnssPosition {
                    ned,
                    std,
                    has_height: true,
                },
            );
            let (ned, std) = (truth.velocity().map(|x| x as f32), Vector3::repeat(0.05));
            single.gnss_velocity(
                time_ns,
                &GnssVelocity {
                    ned,
                    std,
                    has_vertical: true,
                },
            );
        }
    }
    assert!((truth.position - motion.position).norm() < 1e-9);
    let (d, s) = (double.state().unwrap(), single.state().unwrap());
    assert!((d.position - s.position.map(f64::from)).norm() < 0.02);
    assert!((d.velocity - s.velocity.map(f64::from)).norm() < 0.01);
    for i in 0..15 {
        let ratio = f64::from(s.covariance[(i, i)]) / d.covariance[(i, i)];
        assert!((ratio - 1.0).abs() < 0.05, "{i}: {ratio}");
    }
    // A saved copy goes on exactly.
    let mut copy = double;
    let next = double.time_ns().unwrap() + 10_000_000;
    for ins in [&mut double, &mut copy] {
        ins.imu(next, &truth.rate(), &truth.force()).unwrap();
    }
    assert_eq!(double, copy);
}

#[test]
fn the_covariance_is_one_after_a_day_in_single_precision() {
    // Stands, is seen once a minute, has samples at 2 Hz: 86,400 s cheaply, with every kind of step in it.
    let mut ins = GnssIns::<f32>::new(GnssInsConfig {
        zero_velocity: true,
        non_holonomic: true,
        time_offset_std_s: 0.05,
        initial_heading: Some([0.3, 0.1]),
        ..GnssInsConfig::default()
    })
    .unwrap();
    let force = Vector3::new(0.1, -0.2, -9.79);
    let mut noise = 1_u32;
    for k in 1..=172_800_i64 {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let n = (noise >> 16) as f32 / 65_536.0 - 0.5;
        let time_ns = k * 500_000_000;
        let (rate, force) = (
            Vector3::new(n, -n, n) * 0.002,
            force + Vector3::new(-n, n, n) * 0.05,
        );
        ins.imu(time_ns, &rate, &force).unwrap();
        if k % 20 == 2 {
            ins.barometer(time_ns, 400.0 + n);
        }
        if k % 120 == 2 || k < 40 {
            let (ned, std) = (Vector3::new(n, -n, 2.0 * n), Vector3::repeat(2.0));
            ins.gnss_position(
                time_ns,
                &GnssPosition {
                    ned,
                    std,
                    has_height: true,
                },
            );
        }
    }
    assert_eq!(ins.restarts(), 0);
    let p = ins.state().unwrap().covariance.map(f64::from);
    let d = p.diagonal().map(|v| 1.0 / v.sqrt());
    let scale = nalgebra::SMatrix::<f64, 15, 15>::from_diagonal(&d);
    assert!(cholesky(&(scale * p * scale)).is_some(), "{}", p.diagonal());
    let position = ins.state().unwrap().position.map(f64::from);
    for i in 0..3 {
        assert!(
            position[i].abs() < 4.0 * p[(6 + i, 6 + i)].sqrt(),
            "{position}"
        );
    }
}

#[test]
fn a_chip_holds_it_in_what_is_said() {
    let bytes = size_of::<GnssIns<f32, 0>>();
    assert!(
        (30_000..33_000).contains(&bytes),
        "{bytes} bytes without history"
    );
}
