//! Attitude estimators, alone and behind their driver, and the axis filters.

use nalgebra::{Matrix2, Matrix3, RealField};
use northing_core::Restorable;
use northing_core::attitude::{
    AttitudeConfig, AttitudeDriver, AttitudeEstimator, AxisFilters, BoundedVelocity,
    CompassHeading, Complementary, ComplementaryForm, DriverConfig, EkfReconstruction,
    InitialState, Integration, Mekf, Mekf3, QuaternionEkf, References, Usque,
};
use northing_core::geometry::frames::TangentFrame;

use super::garbage::{Garbage, number};
use super::harness::{Check, continuable, covariance, record, run, unit};

const FORCE: [f64; 3] = [0.0, 0.0, 9.81];
const FIELD: [f64; 3] = [0.0, 22.0, -42.0];

fn start<T: RealField + Copy>(g: &mut Garbage) -> InitialState<T> {
    let magnetic = g.chance(0.8);
    let factor = Matrix3::<T>::from_columns(&[g.vector(0.3), g.vector(0.3), g.vector(0.3)]);
    let attitude_covariance = if g.chance(0.5) {
        Matrix3::from_diagonal(&g.stds(0.1).map(|std: T| std * std))
    } else {
        let product = factor * factor.transpose();
        (product + product.transpose()) * nalgebra::convert::<f64, T>(0.5)
    };
    InitialState {
        attitude: g.rotation(3.0),
        attitude_covariance,
        gyroscope_bias: g.vector(0.02),
        gyroscope_bias_std: g.std(0.02),
        north_known: g.chance(0.5),
        references: References {
            specific_force: g.around(FORCE, 0.1),
            magnetic_field: magnetic.then(|| g.around(FIELD, 1.0)),
        },
    }
}

fn compass<T: RealField + Copy>(g: &mut Garbage) -> CompassHeading<T> {
    CompassHeading {
        frame: if g.chance(0.5) {
            TangentFrame::Enu
        } else {
            TangentFrame::Ned
        },
        heading: g.near(4.0),
        std: g.std(0.1),
    }
}

fn operate<T, E>(filter: &mut E, g: &mut Garbage) -> Check
where
    T: RealField + Copy,
    E: AttitudeEstimator<T>,
{
    match g.below(20) {
        0 => filter.initialize(&start(g)),
        1 => filter.add_attitude_variance(g.near(0.1)),
        2 | 3 => return record("compass", &filter.update_compass(&compass(g))),
        4..8 => {
            let field = g.around(FIELD, 10.0);
            return record("magnetometer", &filter.update_magnetometer(&field));
        }
        8..13 => {
            let force = g.around(FORCE, 2.0);
            return record("accelerometer", &filter.update_accelerometer(&force));
        }
        _ => {
            let _ = filter.propagate(&g.vector(3.0), g.interval(0.01));
        }
    }
    Ok(())
}

fn check<T, E>(filter: &E) -> Check
where
    T: RealField + Copy,
    E: AttitudeEstimator<T> + Restorable + Clone,
{
    unit("attitude", &filter.attitude())?;
    continuable(filter)?;
    if let Some(p) = filter.attitude_covariance() {
        covariance("attitude covariance", &p)?;
    }
    if let Some((_, p)) = filter.gyroscope_bias() {
        covariance("bias covariance", &p)?;
    }
    if filter.rate_at_rest().iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err("the bias is not finite".to_owned())
    }
}

/// The estimator alone, and behind its driver. `inside` checks what the trait does not show.
fn estimator<T, E>(name: &str, make: impl Fn(&mut Garbage) -> E, inside: impl Fn(&E) -> Check)
where
    T: RealField + Copy,
    E: AttitudeEstimator<T> + Restorable + Clone,
{
    let started = |g: &mut Garbage| {
        let mut filter = make(g);
        filter.initialize(&start(g));
        filter
    };
    let whole = |filter: &E| inside(filter).and_then(|()| check(filter));
    run(name, started, operate, whole);
    let driven = |g: &mut Garbage| {
        let config = DriverConfig {
            alignment_s: nalgebra::convert(0.1),
            ..DriverConfig::default()
        };
        (AttitudeDriver::new(make(g), config), 0_i64)
    };
    run(
        &format!("{name} behind its driver"),
        driven,
        drive,
        |(driver, _)| {
            continuable(driver)?;
            driver.attitude().map_or(Ok(()), |q| unit("attitude", &q))?;
            let p = driver.attitude_covariance();
            p.map_or(Ok(()), |p| covariance("attitude covariance", &p))
        },
    );
}

fn drive<T, E>((driver, clock_ns): &mut (AttitudeDriver<T, E>, i64), g: &mut Garbage) -> Check
where
    T: RealField + Copy,
    E: AttitudeEstimator<T> + Restorable,
{
    let time_ns = g.stamp(clock_ns, 3_000_000);
    match g.below(12) {
        0 => record("compass", &driver.compass(time_ns, g.near(4.0), g.std(0.1))),
        1 | 2 => record(
            "magnetometer",
            &driver.magnetometer(time_ns, &g.around(FIELD, 10.0)),
        ),
        3..7 => record(
            "accelerometer",
            &driver.accelerometer(time_ns, &g.around(FORCE, 2.0)),
        ),
        _ => {
            let _ = driver.gyroscope(time_ns, &g.vector(3.0));
            Ok(())
        }
    }
}

/// A test of each estimator in both precisions.
macro_rules! both {
    ($($test:ident: $filter:ident, $name:literal, |$g:ident| $make:expr $(, $inside:expr)?;)+) => {
        mod single {
            use super::*;
            type T = f32;
            $(#[test] fn $test() {
                estimator::<T, $filter<T>>(concat!($name, ", f32"), |$g| $make, both!(@ $($inside)?));
            })+
        }
        mod double {
            use super::*;
            type T = f64;
            $(#[test] fn $test() {
                estimator::<T, $filter<T>>(concat!($name, ", f64"), |$g| $make, both!(@ $($inside)?));
            })+
        }
    };
    (@) => { |_| Ok(()) };
    (@ $inside:expr) => { $inside };
}

fn settings<T: RealField + Copy>(g: &mut Garbage) -> AttitudeConfig<T> {
    g.settings()
}

both! {
    integration: Integration, "integration", |_g| Integration::default();
    mekf: Mekf, "MEKF", |g| Mekf::new(settings(g)).unwrap(),
        |f| covariance("covariance", &f.state().covariance);
    mekf3: Mekf3, "three-state MEKF", |g| Mekf3::new(settings(g)).unwrap();
    usque: Usque, "USQUE", |g| Usque::new(settings(g)).unwrap(),
        |f| covariance("covariance", &f.save().covariance);
    quaternion_ekf: QuaternionEkf, "quaternion EKF", |g| QuaternionEkf::new(settings(g)).unwrap(),
        |f| {
            covariance("covariance", &f.state().covariance)?;
            covariance("error covariance", &f.error_covariance())
        };
    ekf_reconstruction: EkfReconstruction, "EKF and observer", |g| EkfReconstruction::new(settings(g)).unwrap();
    complementary: Complementary, "complementary", |g| {
        let forms = [ComplementaryForm::Explicit, ComplementaryForm::Passive, ComplementaryForm::Direct];
        let form = forms[g.below(3)];
        Complementary::new(form, settings(g)).unwrap()
    };
    bounded_velocity: BoundedVelocity, "bounded velocity", |g| BoundedVelocity::new(g.settings()).unwrap(),
        |f| covariance("covariance", &f.save().covariance);
}

fn axis_filters<T: RealField + Copy>(name: &str) {
    let make = |g: &mut Garbage| {
        let angles: [T; 3] = [0; 3].map(|_| g.near(4.0));
        let start = angles.map(|x| {
            if x.abs() <= number(100.0) {
                x
            } else {
                T::zero()
            }
        });
        AxisFilters::new(g.settings(), start).unwrap()
    };
    let operate = |filter: &mut AxisFilters<T>, g: &mut Garbage| match g.below(10) {
        0..5 => {
            let _ = filter.propagate(&g.vector(3.0), g.interval(0.01));
            Ok(())
        }
        5..7 => {
            let force = g.around([0.0, 0.0, -9.81], 3.0);
            record("accelerometer", &filter.update_accelerometer(&force))
        }
        7..9 => record(
            "magnetometer",
            &filter.update_magnetometer(&g.around(FIELD, 10.0)),
        ),
        _ => record("heading", &filter.update_heading(g.near(4.0))),
    };
    run(name, make, operate, |filter| {
        continuable(filter)?;
        unit("attitude", &filter.attitude())?;
        for axis in filter.axes() {
            let [angle, cross, bias] = axis.covariance;
            covariance("covariance", &Matrix2::new(angle, cross, cross, bias))?;
        }
        Ok(())
    });
}

#[test]
fn axis_filters_in_both_precisions() {
    axis_filters::<f32>("attitude axis filters, f32");
    axis_filters::<f64>("attitude axis filters, f64");
}
