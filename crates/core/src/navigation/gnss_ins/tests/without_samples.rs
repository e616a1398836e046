//! Without inertial unit: a ship with gyrocompass and log, a vehicle with fixes alone.

use super::*;

#[test]
fn without_samples_an_unmeasured_velocity_is_damped_and_a_clock_that_goes_back_is_followed() {
    let speed_after = |damping_speed_m_s: f64| {
        let ship = GnssInsConfig {
            imu_samples: ImuSamples::None,
            gap_velocity_random_walk: 0.1,
            damping_speed_m_s,
            ..GnssInsConfig::<f64>::default()
        };
        let mut ins = GnssIns::<f64>::new(ship).unwrap();
        for k in 1..=600_i64 {
            let time_ns = k * 200_000_000;
            ins.heading(time_ns, 0.0, 0.01);
            if k % 5 == 0 && k <= 300 {
                let ned = Vector3::new(k as f64, 0.0, 0.0);
                let std = Vector3::repeat(0.5);
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
        (ins.state().unwrap().velocity.x, ins)
    };
    let (free, _) = speed_after(0.0);
    let (damped, mut ins) = speed_after(1.0);
    // 5 m/s were seen; a prior of 1 m/s takes some of them away in a minute without fixes.
    assert!(
        (free - 5.0).abs() < 0.1 && (0.5..4.5).contains(&damped),
        "{free} {damped}"
    );
    assert_eq!((ins.validity(), ins.restarts()), (Validity::Invalid, 0));
    for k in 1..=20_i64 {
        ins.heading(k * 200_000_000, 0.0, 0.01);
    }
    assert_eq!((ins.validity(), ins.restarts()), (Validity::Aligning, 1));
    assert_eq!(ins.time_ns(), Some(4_000_000_000));
}

#[test]
fn a_ship_without_an_inertial_unit_is_carried_by_gyrocompass_and_log() {
    let ship = GnssInsConfig {
        imu_samples: ImuSamples::None,
        gap_attitude_random_walk: 0.02,
        gap_velocity_random_walk: 0.1,
        non_holonomic: true,
        ..GnssInsConfig::<f64>::default()
    };
    let mut ins = GnssIns::<f64>::new(ship).unwrap();
    assert_eq!(
        ins.imu(1, &Vector3::zeros(), &Vector3::zeros()),
        Err(SkipReason::NotUsed)
    );
    let mut position = Vector3::zeros();
    let mut worst = 0.0_f64;
    for k in 1..=1500_i64 {
        let t = k as f64 * 0.2;
        let heading = 0.5 + 0.01 * t;
        position += Vector3::new(heading.cos(), heading.sin(), 0.0) * (5.0 * 0.2);
        let time_ns = k * 200_000_000;
        ins.heading(time_ns, heading, 0.01);
        ins.speed(time_ns, 5.0, 0.2);
        if k % 5 == 0 && !(150.0..180.0).contains(&t) {
            let std = Vector3::repeat(2.0);
            ins.gnss_position(
                time_ns,
                &GnssPosition {
                    ned: position,
                    std,
                    has_height: true,
                },
            );
        }
        if (150.0..180.0).contains(&t) {
            worst = worst.max((ins.state().unwrap().position - position).norm());
        }
    }
    assert!(worst < 8.0, "150 m of dead reckoning: {worst}");
    assert_eq!(ins.validity(), Validity::Aided);
}

#[test]
fn without_an_inertial_unit_fixes_that_jump_for_good_are_followed() {
    let ship = GnssInsConfig {
        imu_samples: ImuSamples::None,
        gap_velocity_random_walk: 0.1,
        initial_heading: Some([0.0, 0.02]),
        ..GnssInsConfig::<f64>::default()
    };
    let mut ins = GnssIns::<f64>::new(ship).unwrap();
    let mut off = 0.0;
    for k in 1..=120_i64 {
        let time_ns = k * 1_000_000_000;
        let jumped = if k > 60 { 2000.0 } else { 0.0 };
        let ned = Vector3::new(5.0 * k as f64 + jumped, 0.0, 0.0);
        ins.heading(time_ns, 0.0, 0.01);
        ins.gnss_position(time_ns, &GnssPosition::new(ned, Vector3::repeat(1.0)));
        off = (ins.state().unwrap().position - ned).norm();
    }
    assert!(off < 10.0, "{off}");
    assert_eq!((ins.validity(), ins.realignments()), (Validity::Aided, 0));
}
