//! Error-state filter, cascade, position axis filters, dead reckoning and in-motion alignment.

use nalgebra::{RealField, Vector3};
use northing_core::navigation::axis_filters::PositionAxisFilters;
use northing_core::navigation::in_motion_alignment::InMotionAlignment;
use northing_core::navigation::{
    Cascade, DeadReckoning, ErrorStateFilter, GnssCompassFix, GnssPosition, GnssVelocity,
    NavigationState,
};

use super::garbage::{Garbage, number};
use super::harness::{Check, continuable, covariance, record, run, unit};

/// A test of a filter in both precisions.
macro_rules! both {
    ($($test:ident: $name:literal, $make:ident, $operate:ident, $check:ident;)+) => {$(
        #[test]
        fn $test() {
            run(concat!($name, ", f32"), $make::<f32>, $operate, $check);
            run(concat!($name, ", f64"), $make::<f64>, $operate, $check);
        }
    )+};
}

both! {
    error_state_filter: "error-state filter", error_state, aid_error_state, check_error_state;
    cascade: "cascade", make_cascade, aid_cascade, check_cascade;
    position_axis_filters: "position axis filters", axes, aid_axes, check_axes;
    dead_reckoning: "dead reckoning", reckoning, reckon, check_reckoning;
    in_motion_alignment: "in-motion alignment", alignment, align, continuable;
}

fn error_state<T: RealField + Copy>(g: &mut Garbage) -> ErrorStateFilter<T> {
    let usual = [0.05, 0.5, 3.0, 0.1, 0.01];
    loop {
        let start = NavigationState::new(g.rotation(3.0), g.vector(20.0), g.vector(1000.0));
        let start = start.with_std(usual.map(|std| g.std(std)));
        if let Ok(filter) = ErrorStateFilter::new(g.settings(), start) {
            return filter;
        }
    }
}

fn aid_error_state<T: RealField + Copy>(
    filter: &mut ErrorStateFilter<T>,
    g: &mut Garbage,
) -> Check {
    match g.below(10) {
        0 => {
            let _ = filter.catch_up();
        }
        1 | 2 => {
            let fix = GnssCompassFix {
                position: g.vector(100.0),
                position_std: g.stds(3.0),
                ned_from_body: g.rotation(3.0),
                attitude_std: g.stds(0.05),
            };
            let update = filter.update_gnss_compass(&fix);
            record("position", &update.position)?;
            record("attitude", &update.attitude)?;
        }
        _ => {
            let force = g.around([0.0, 0.0, -9.81], 2.0);
            let _ = filter.propagate(&g.vector(0.5), &force, g.interval(0.02));
        }
    }
    Ok(())
}

fn check_error_state<T: RealField + Copy>(filter: &ErrorStateFilter<T>) -> Check {
    continuable(filter)?;
    unit("attitude", &filter.state().ned_from_body)?;
    covariance("covariance", &filter.state().covariance)
}

fn make_cascade<T: RealField + Copy>(g: &mut Garbage) -> Cascade<T> {
    let rest = Vector3::new(0.0, 0.0, -9.81).map(number);
    Cascade::new(g.settings(), rest).unwrap()
}

fn aid_cascade<T: RealField + Copy>(filter: &mut Cascade<T>, g: &mut Garbage) -> Check {
    let attitude = g.rotation(3.0);
    if g.chance(0.2) {
        let age = g.interval(0.05);
        let rate = g.vector(0.5);
        let innovation = filter.update_position(&g.vector(100.0), age, &attitude, &rate);
        return record("position", &innovation);
    }
    let force = g.around([0.0, 0.0, -9.81], 2.0);
    let _ = filter.propagate(&attitude, &force, g.interval(0.02));
    Ok(())
}

fn check_cascade<T: RealField + Copy>(filter: &Cascade<T>) -> Check {
    continuable(filter)
}

fn axes<T: RealField + Copy>(g: &mut Garbage) -> (PositionAxisFilters<T>, u64) {
    (PositionAxisFilters::new(g.settings()).unwrap(), 0)
}

fn aid_axes<T: RealField + Copy>(
    (filter, fixes): &mut (PositionAxisFilters<T>, u64),
    g: &mut Garbage,
) -> Check {
    if g.chance(0.2) {
        if g.chance(0.9) {
            *fixes += 1;
        }
        return record(
            "position",
            &filter.update_position(*fixes, &g.vector(100.0)),
        );
    }
    let gravity = if g.chance(0.05) {
        g.near(20.0)
    } else {
        number(9.81)
    };
    let force = g.around([0.0, 0.0, -9.81], 2.0);
    let _ = filter.propagate(&g.rotation(3.0), &force, gravity, g.interval(0.02));
    Ok(())
}

fn check_axes<T: RealField + Copy>((filter, _): &(PositionAxisFilters<T>, u64)) -> Check {
    continuable(filter)?;
    for axis in filter.axes() {
        covariance("covariance", &axis.covariance)?;
    }
    Ok(())
}

fn reckoning<T: RealField + Copy>(g: &mut Garbage) -> DeadReckoning<T> {
    DeadReckoning::new(g.settings()).unwrap()
}

fn reckon<T: RealField + Copy>(filter: &mut DeadReckoning<T>, g: &mut Garbage) -> Check {
    match g.below(10) {
        0 => record(
            "position",
            &filter.update_position(&g.plane(100.0), g.std(3.0)),
        ),
        1 => record(
            "velocity",
            &filter.update_velocity(&g.plane(5.0), g.std(0.5)),
        ),
        2 => {
            let _ = filter.water_velocity(&g.plane(5.0));
            Ok(())
        }
        _ => {
            let _ = filter.propagate(g.interval(1.0));
            Ok(())
        }
    }
}

fn check_reckoning<T: RealField + Copy>(filter: &DeadReckoning<T>) -> Check {
    continuable(filter)?;
    covariance("covariance", &filter.state().covariance)?;
    covariance("position", &filter.position_covariance())
}

type Alignment<T> = InMotionAlignment<T, 2, 4>;

fn alignment<T: RealField + Copy>(g: &mut Garbage) -> Alignment<T> {
    Alignment::new(g.settings()).unwrap()
}

fn align<T: RealField + Copy>(filter: &mut Alignment<T>, g: &mut Garbage) -> Check {
    match g.below(20) {
        0 | 1 => {
            let fix = GnssPosition {
                ned: g.vector(30.0),
                std: g.stds(3.0),
                has_height: g.chance(0.8),
            };
            let _ = filter.gnss_position(&fix);
        }
        2 => {
            let fix = GnssVelocity::new(g.vector(3.0), g.stds(0.1));
            let _ = filter.gnss_velocity(&fix);
        }
        3 => {
            let _ = filter.heading(g.near(4.0), g.std(0.2));
        }
        _ => {
            let force = g.around([0.5, 0.0, -9.81], 2.0);
            let _ = filter.propagate(&g.vector(0.5), &force, g.interval(0.05));
        }
    }
    Ok(())
}
