//! Hard iron of a magnetometer that is said to be calibrated.

use super::*;

const HARD_IRON: Vector3<f64> = Vector3::new(9.0, -6.0, 7.0);

/// After a minute in a hand: the filter, and the root mean square of the heading's errors from half a minute on, deg.
fn carried(
    config: BoundedVelocityConfig<f64>,
    hard_iron: Vector3<f64>,
) -> (BoundedVelocity<f64>, f64) {
    let mut f = filter(config);
    let errors = Errors {
        hard_iron,
        ..Errors::default()
    };
    let (mut k, mut square, mut count) = (0, 0.0, 0.0);
    hand(60, 5, &errors, |truth, [w, a, m]| {
        f.propagate(w, 0.01);
        f.update_accelerometer(a);
        f.update_magnetometer(m);
        k += 1;
        if k > 3000 {
            let error = so3::log(&(f.attitude() * truth.inverse())).z.to_degrees();
            square += error * error;
            count += 1.0;
        }
    });
    (f, f64::sqrt(square / count))
}

fn calibrated() -> BoundedVelocityConfig<f64> {
    BoundedVelocityConfig {
        initial_hard_iron_std_ut: 0.0,
        prediction_s: 0.0,
        ..BoundedVelocityConfig::lab()
    }
}

/// GIVEN a calibrated magnetometer with hard iron WHEN the device turns THEN the filter finds it, estimates it from then on, and its heading
/// is right; without the search it is not.
#[test]
fn hard_iron_that_nobody_expected_is_found() {
    let (f, heading) = carried(calibrated(), HARD_IRON);
    let off = f.state().hard_iron_ut - HARD_IRON;
    let std = f.state().hard_iron_std_ut().unwrap();
    assert!(off.norm() < 1.5, "{off}");
    assert!(off.component_div(&std).amax() < 4.0, "{off} {std}");
    let never = BoundedVelocityConfig {
        unexpected_hard_iron: 0.0,
        ..calibrated()
    };
    let (without, wrong) = carried(never, HARD_IRON);
    assert_eq!(without.state().hard_iron_std_ut(), None);
    assert!(heading < 1.5 && wrong > 3.0 * heading, "{heading} {wrong}");
    assert!(is_sound(&f));
}

#[test]
fn a_magnetometer_that_is_calibrated_stays_so() {
    let (f, heading) = carried(calibrated(), Vector3::new(1.0, -0.5, 0.5));
    assert_eq!(f.state().hard_iron_std_ut(), None);
    assert!(heading < 3.0, "{heading}");
}

/// GIVEN hard iron that was found WHEN the filter goes on from before a step of the bias, or aligns again THEN it is not forgotten.
#[test]
fn what_was_found_stays_found() {
    let before = filter(calibrated()).learnt();
    let (f, _) = carried(calibrated(), HARD_IRON);
    let found = f.state().hard_iron_ut;
    let now = initial(TangentFrame::Enu, f.attitude());
    let resumed = Resumed {
        attitude: now.attitude,
        attitude_covariance: Matrix3::identity() * 0.01,
        bias_covariance: Matrix3::identity() * 1e-4,
        drift: Matrix3::identity() * 3.0,
        learnt: before,
    };
    let (mut again, mut restarted) = (f, f);
    again.resume(&now, &resumed);
    restarted.restart(&now);
    for f in [again, restarted] {
        assert_eq!(f.state().hard_iron_ut, found);
        assert!(f.state().hard_iron_std_ut().is_some());
        assert!(is_sound(&f));
    }
}
