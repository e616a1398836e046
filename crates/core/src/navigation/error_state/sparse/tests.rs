//! Sparse scalar updates against the dense joint update in Joseph form, over all 25 states.

use super::*;
use crate::kalman::covariance::cholesky;
use crate::navigation::augmented_states::AUGMENTED_STATES;
use crate::navigation::augmented_states::AugmentedStep;
use crate::navigation::{ErrorStateConfig, ErrorTransition, NavigationState};
use approx::assert_relative_eq;
use nalgebra::SMatrix;

const ALL: usize = STATES + AUGMENTED_STATES;
type Joint = SMatrix<f64, ALL, ALL>;
type JointVector = SVector<f64, ALL>;

fn spread(i: usize, j: usize) -> f64 {
    ((i * 7 + j * 3) as f64).sin()
}

/// A filter and augmented states whose joint covariance is a full random one.
fn start() -> (ErrorStateFilter<f64>, AugmentedStates<f64>, Joint) {
    let a = Joint::from_fn(spread);
    let scale =
        JointVector::from_fn(|i, _| [0.02, 0.3, 1.5, 0.05, 0.003, 1.0, 0.03, 2.0, 2.0][i / 3]);
    let d = Joint::from_diagonal(&scale);
    let joint = d * (a * a.transpose() * 0.05 + Joint::identity()) * d;
    let state = NavigationState {
        ned_from_body: rotation::from_yaw_pitch_roll([0.7, 0.1, -0.2]),
        velocity: Vector3::new(8.0, 5.0, 0.1),
        position: Vector3::new(100.0, -50.0, 1.0),
        accelerometer_bias: Vector3::new(0.02, -0.01, 0.03),
        gyroscope_bias: Vector3::new(1e-3, -2e-3, 5e-4),
        covariance: joint.fixed_view::<STATES, STATES>(0, 0).into_owned(),
        pending: ErrorTransition::default(),
        skipped: 0,
    };
    let side = AugmentedStates {
        values: SVector::from_fn(|i, _| 0.1 * i as f64),
        cross: joint
            .fixed_view::<STATES, AUGMENTED_STATES>(0, SIDE)
            .into_owned(),
        covariance: joint
            .fixed_view::<AUGMENTED_STATES, AUGMENTED_STATES>(SIDE, SIDE)
            .into_owned(),
    };
    let filter = ErrorStateFilter::new(ErrorStateConfig::default(), state).unwrap();
    (filter, side, joint)
}

fn joint_of(filter: &ErrorStateFilter<f64>, side: &AugmentedStates<f64>) -> Joint {
    let mut joint = Joint::zeros();
    joint
        .fixed_view_mut::<STATES, STATES>(0, 0)
        .copy_from(&filter.state().covariance);
    joint
        .fixed_view_mut::<STATES, AUGMENTED_STATES>(0, SIDE)
        .copy_from(&side.cross);
    joint
        .fixed_view_mut::<AUGMENTED_STATES, STATES>(SIDE, 0)
        .copy_from(&side.cross.transpose());
    joint
        .fixed_view_mut::<AUGMENTED_STATES, AUGMENTED_STATES>(SIDE, SIDE)
        .copy_from(&side.covariance);
    joint
}

fn measurement() -> SparseMeasurement<f64, 3> {
    let row = |k: usize| {
        let mut row = Row::default();
        for (n, state) in [0, 2, 4, 6 + k, 12, 13, SIDE + k, SIDE + 3, SIDE + 6]
            .into_iter()
            .enumerate()
        {
            row = row.with(state, 1.0 + spread(n, k));
        }
        row
    };
    SparseMeasurement {
        rows: [0, 1, 2].map(row),
        residual: Vector3::new(0.7, -0.4, 0.2),
        variance: Vector3::new(0.5, 0.3, 0.9),
        freed: [6, 7, 8],
    }
}

#[test]
fn sequential_scalars_equal_the_dense_joseph_form() {
    let (mut filter, mut side, joint) = start();
    let before = *filter.state();
    let (values, m) = (side.values, measurement());
    let mut h = SMatrix::<f64, 3, ALL>::zeros();
    for (i, row) in m.rows.iter().enumerate() {
        for (state, element) in row.elements() {
            h[(i, *state)] += element;
        }
    }
    let r = Matrix3::from_diagonal(&m.variance);
    let s = h * joint * h.transpose() + r;
    let k = joint * h.transpose() * s.try_inverse().unwrap();
    let d: JointVector = k * m.residual;
    let left = Joint::identity() - k * h;
    let mut g = Joint::identity();
    let angle: Vector3<f64> = d.fixed_rows::<3>(0).into_owned();
    let reset = Matrix3::identity() + so3::skew(&angle) * 0.5;
    g.fixed_view_mut::<3, 3>(0, 0).copy_from(&reset);
    let plus = g * (left * joint * left.transpose() + k * r * k.transpose()) * g.transpose();

    let mut gate = CountedGate::default();
    let innovation = filter.fuse_sparse(&mut side, &m, &mut gate, 16.3, &mut ());
    assert_eq!(innovation.outcome, Outcome::Fused);
    assert_relative_eq!(innovation.covariance, s, epsilon = 1e-10);
    let nis = (m.residual.transpose() * s.try_inverse().unwrap() * m.residual)[0];
    assert_relative_eq!(innovation.nis, nis, epsilon = 1e-10);
    let weights = Joint::from_diagonal(&joint.diagonal().map(|v| 1.0 / v.sqrt()));
    let now = joint_of(&filter, &side);
    assert_relative_eq!(
        weights * now * weights,
        weights * plus * weights,
        epsilon = 1e-9
    );
    assert_relative_eq!(
        side.values - values,
        d.fixed_rows::<AUGMENTED_STATES>(SIDE).into_owned(),
        epsilon = 1e-10
    );
    let after = filter.state();
    assert_relative_eq!(
        after.position - before.position,
        d.fixed_rows::<3>(6).into_owned(),
        epsilon = 1e-10
    );
    let turned = so3::log(&(after.ned_from_body * before.ned_from_body.inverse()));
    assert_relative_eq!(turned, angle, epsilon = 1e-10);
}

#[test]
fn augmented_states_propagate_as_the_joint_covariance_does() {
    let (mut filter, mut side, joint) = start();
    for _ in 0..10 {
        let (rate, force) = (Vector3::new(0.1, 0.2, -0.3), Vector3::new(0.5, 0.2, -9.7));
        filter.propagate(&rate, &force, 0.01).unwrap();
    }
    let transition = filter.catch_up();
    let step = AugmentedStep {
        decay: core::array::from_fn(|i| 1.0 - 0.05 * i as f64),
        added: core::array::from_fn(|i| 0.01 * i as f64),
    };
    let values = side.values;
    side.propagate(&transition, &step);
    let mut phi = Joint::identity();
    phi.fixed_view_mut::<STATES, STATES>(0, 0)
        .copy_from(&transition.to_matrix());
    for i in 0..AUGMENTED_STATES {
        phi[(SIDE + i, SIDE + i)] = step.decay[i];
    }
    let mut dense = phi * joint * phi.transpose();
    for i in 0..AUGMENTED_STATES {
        dense[(SIDE + i, SIDE + i)] += step.added[i];
    }
    let now = joint_of(&filter, &side);
    let cross = dense
        .fixed_view::<STATES, AUGMENTED_STATES>(0, SIDE)
        .into_owned();
    assert_relative_eq!(side.cross, cross, epsilon = 1e-12);
    let own = dense
        .fixed_view::<AUGMENTED_STATES, AUGMENTED_STATES>(SIDE, SIDE)
        .into_owned();
    assert_relative_eq!(side.covariance, own, epsilon = 1e-12);
    assert_relative_eq!(side.values[6], values[6] * step.decay[6], epsilon = 1e-12);
    assert!(cholesky(&now).is_some());
}

#[test]
fn states_that_are_not_in_use_change_nothing() {
    let (filter, _, _) = start();
    let (mut with, mut without) = (filter, filter);
    let mut side = AugmentedStates::default();
    let mut m = measurement();
    with.fuse_sparse(&mut side, &m, &mut CountedGate::default(), 0.0, &mut ());
    assert_eq!(side, AugmentedStates::default());
    for row in &mut m.rows {
        let kept = row.elements().iter().filter(|(state, _)| *state < SIDE);
        *row = kept.fold(Row::default(), |row, (state, h)| row.with(*state, *h));
    }
    without.fuse_sparse(&mut side, &m, &mut CountedGate::default(), 0.0, &mut ());
    assert_eq!(with, without);
}

#[test]
fn outliers_are_refused_five_times_and_then_accepted_with_the_state_set_free() {
    let (mut filter, mut side, _) = start();
    let mut m = SparseMeasurement {
        rows: [6, 7].map(Row::of_state),
        residual: nalgebra::Vector2::new(100.0, -50.0),
        variance: nalgebra::Vector2::repeat(1.0),
        freed: [6, 7],
    };
    let mut gate = CountedGate::default();
    let before = *filter.state();
    for _ in 0..REJECTIONS_ACCEPTED {
        let innovation = filter.fuse_sparse(&mut side, &m, &mut gate, 13.8, &mut ());
        assert_eq!(innovation.outcome, Outcome::Gated);
        assert_eq!(*filter.state(), before);
    }
    let innovation = filter.fuse_sparse(&mut side, &m, &mut gate, 13.8, &mut ());
    assert_eq!(innovation.outcome, Outcome::Inflated);
    let moved = filter.state().position - before.position;
    assert!(
        (moved.xy() - m.residual).norm() < 0.1,
        "the position is where the fixes are: {moved}"
    );
    let turned = rotation::angle_between(&filter.state().ned_from_body, &before.ned_from_body);
    assert!(turned < 0.1, "and the attitude is kept: {turned}");
    // What cannot be fused is skipped, and changes nothing.
    let before = *filter.state();
    m.variance.fill(-1.0);
    let innovation = filter.fuse_sparse(&mut side, &m, &mut gate, 13.8, &mut ());
    assert_eq!(innovation.outcome, Outcome::Skipped(SkipReason::Numerical));
    m.variance.fill(1.0);
    m.residual.x = f64::NAN;
    let innovation = filter.fuse_sparse(&mut side, &m, &mut gate, 13.8, &mut ());
    assert_eq!(innovation.outcome, Outcome::Skipped(SkipReason::Numerical));
    assert_eq!(filter.state().covariance, before.covariance);
    assert_eq!(filter.state().skipped, before.skipped + 2);
}

#[test]
fn variances_stay_within_numbers_and_correlations_with_them() {
    let (mut filter, mut side, _) = start();
    filter.state.covariance *= 1e9;
    side.cross *= 1e9_f64.sqrt();
    filter.limit_covariance(&mut side, &mut ());
    let p = filter.state().covariance;
    for i in 0..STATES {
        assert!(p[(i, i)] <= LARGEST_VARIANCES[i / 3] * (1.0 + 1e-12));
    }
    let weights =
        Joint::from_diagonal(&joint_of(&filter, &side).diagonal().map(|v| 1.0 / v.sqrt()));
    assert!(cholesky(&(weights * joint_of(&filter, &side) * weights)).is_some());
}
