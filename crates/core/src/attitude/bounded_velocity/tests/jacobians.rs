//! The transition and every measurement row against dual numbers (acceptance test d).

use nalgebra::{RealField, SMatrix, SVector};
use num_dual::{DualSVec64, gradient, jacobian};

use super::*;
use crate::attitude::CompassHeading;
use layout::{Covariance, VELOCITY};

type Dual = DualSVec64<CAPACITY>;
type Errors22<T> = SVector<T, CAPACITY>;

fn dual(v: &Vector3<f64>) -> Vector3<Dual> {
    v.map(Dual::from)
}

/// A filter in the middle of things: no state is zero.
fn busy<T: Scalar>() -> BoundedVelocity<T> {
    let mut f = BoundedVelocity::new(full::<T>()).unwrap();
    let attitude = so3::exp(&Vector3::new(lit(0.5), lit(-0.8), lit(1.1)));
    f.initialize(&initial(TangentFrame::Enu, attitude));
    let s = &mut f.state;
    s.gyroscope_bias = Vector3::new(lit(0.1), lit(-0.2), lit(0.05));
    s.scale = Matrix3::from_fn(|i, j| lit(0.002 * (i as f64 - 0.7 * j as f64)));
    s.hard_iron_ut = Vector3::new(lit(5.0), lit(-8.0), lit(3.0));
    s.field_ut = nalgebra::Vector2::new(lit(24.0), lit(38.0));
    s.velocity = nalgebra::Vector2::new(lit(0.3), lit(-0.1));
    f
}

/// Six samples at 286 Hz: one update interval.
fn samples() -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> {
    (0..6).map(|k| {
        let t = f64::from(k);
        let rate = Vector3::new(3.0 + 0.1 * t, -2.0, 4.0 - 0.2 * t);
        (rate, Vector3::new(2.0 - t, 5.0, 8.0 + 0.5 * t))
    })
}

const DT: f64 = 0.0035;

fn feed<T: Scalar>(f: &mut BoundedVelocity<T>) {
    for (rate, force) in samples() {
        // Without the update that the last one makes due.
        f.state.since_velocity_update = T::zero();
        f.propagate(&rate.map(lit), lit(DT));
        f.update_accelerometer(&force.map(lit));
    }
}

/// The error of a filter whose state is off by `x`, after the samples, with respect to one that is
/// not.
fn error_after(nominal: &BoundedVelocity<f64>, x: &Errors22<Dual>) -> Errors22<Dual> {
    let mut truth = busy::<Dual>();
    let turn = so3::exp(&Vector3::new(x[0], x[1], x[2]));
    truth.state.level_from_body = turn * truth.state.level_from_body;
    for i in 0..2 {
        truth.state.velocity[i] += x[VELOCITY + i];
    }
    for i in 0..3 {
        truth.state.gyroscope_bias[i] += x[BIAS + i];
    }
    truth.state.add_scale(x);
    feed(&mut truth);
    let mut error = *x;
    let estimate = nominal.state.level_from_body.cast::<Dual>();
    let turn = so3::log(&(truth.state.level_from_body * estimate.inverse()));
    error.fixed_rows_mut::<3>(ATTITUDE).copy_from(&turn);
    for i in 0..2 {
        error[VELOCITY + i] = truth.state.velocity[i] - nominal.state.velocity[i];
    }
    error
}

#[test]
fn transition_equals_dual_numbers_of_the_true_error() {
    let mut nominal = busy::<f64>();
    feed(&mut nominal);
    let (_, j): (_, SMatrix<f64, CAPACITY, CAPACITY>) =
        jacobian(|x| error_after(&nominal, &x), &Errors22::zeros());
    let difference = j - nominal.state.sums.transition(&nominal.state.layout);
    let time = nominal.state.sums.time;
    for row in 0..CAPACITY {
        for column in 0..CAPACITY {
            // What bias and scale do to the velocity within an interval is left out (B8b).
            let left_out = (VELOCITY..BIAS).contains(&row) && (BIAS..SCALE + 9).contains(&column);
            let fastest = if column < SCALE { 1.0 } else { 5.0 };
            let limit = if left_out {
                0.6 * time * time * 11.0 * fastest
            } else {
                1e-6
            };
            let value = difference[(row, column)].abs();
            assert!(value < limit, "({row}, {column}): {value}");
        }
    }
}

#[test]
fn the_step_by_rows_equals_the_dense_product() {
    for scale in [ScaleStates::Off, ScaleStates::Diagonal, ScaleStates::Full] {
        let mut f = busy::<f64>();
        f.config.scale_states = scale;
        f.state.layout = layout::Layout::new(&f.config, true);
        let n = f.state.layout.len();
        let m = Covariance::from_fn(|i, j| ((7 * i + 3 * j) as f64).sin());
        let mut p = m * m.transpose() + Covariance::identity() * 0.1;
        for i in n..CAPACITY {
            p.row_mut(i).fill(0.0);
            p.column_mut(i).fill(0.0);
        }
        f.state.covariance = p;
        feed(&mut f);
        let (phi, sums, layout) = (
            f.state.sums.transition(&f.state.layout),
            f.state.sums,
            f.state.layout,
        );
        let mut expected = phi * p * phi.transpose();
        let mut add = |first: usize, size: usize, variance: f64| {
            for i in first..first + size {
                expected[(i, i)] += variance;
            }
        };
        add(ATTITUDE, 3, sums.angle_variance);
        add(VELOCITY, 2, sums.velocity_variance);
        add(BIAS, 3, 1e-3);
        add(layout.field().unwrap(), 2, 2e-3);
        add(layout.hard_iron().unwrap(), 3, 3e-3);
        sums.propagate_covariance(&mut f.state.covariance, &layout, [1e-3, 2e-3, 3e-3]);
        let p = f.state.covariance;
        assert!((p - expected).amax() < 1e-11, "{}", (p - expected).amax());
        assert_eq!(p, p.transpose());
    }
}

#[test]
fn field_rows_equal_dual_numbers() {
    let f = busy::<f64>();
    let (state, layout) = (f.state, f.state.layout);
    let (field, iron) = (layout.field().unwrap(), layout.hard_iron().unwrap());
    let residual = |x: Errors22<Dual>| {
        let turn = so3::exp(&Vector3::new(x[0], x[1], x[2]));
        let truth = turn * state.level_from_body.cast::<Dual>();
        let (north, down) = (x[field] + state.field_ut.x, x[field + 1] + state.field_ut.y);
        let iron = dual(&state.hard_iron_ut) + Vector3::new(x[iron], x[iron + 1], x[iron + 2]);
        let measured = truth.inverse() * Vector3::new(Dual::from(0.0), north, -down) + iron;
        let level = state.level_from_body.cast::<Dual>() * (measured - dual(&state.hard_iron_ut));
        let expected = Vector3::new(0.0, state.field_ut.x, -state.field_ut.y);
        level - dual(&expected)
    };
    let (zero, j): (_, SMatrix<f64, 3, CAPACITY>) = jacobian(residual, &Errors22::zeros());
    assert!(zero.norm() < 1e-12);
    let m = f.field_measurement(&Vector3::new(1.0, 20.0, -40.0));
    for (i, row) in m.rows.iter().enumerate() {
        let mut dense = Errors22::<f64>::zeros();
        for (state, h) in row.elements() {
            dense[*state] += *h;
        }
        assert!((dense - j.row(i).transpose()).amax() < 1e-9, "row {i}");
    }
}

#[test]
fn a_compass_row_in_level_axes_equals_dual_numbers() {
    let f = busy::<f64>();
    let q = f.state.level_from_body;
    let heading = |q: &UnitQuaternion<f64>| (q * Vector3::y()).xy();
    let now = heading(&q);
    let measured = CompassHeading {
        frame: TangentFrame::Enu,
        heading: now.x.atan2(now.y),
        std: 0.1,
    };
    let row = q * measured.measure(&q).unwrap().row;
    let (_, expected) = gradient(
        |a: SVector<DualSVec64<3>, 3>| {
            let top = so3::exp(&a) * q.cast::<DualSVec64<3>>() * Vector3::y();
            RealField::atan2(top.x, top.y)
        },
        &Vector3::zeros(),
    );
    // Headings run clockwise, residuals about up.
    assert!((row + expected).amax() < 1e-12);
}
