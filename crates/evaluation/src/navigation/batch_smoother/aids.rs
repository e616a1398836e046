//! What each measurement of the batch smoother sees at its node: rows, residuals and variances (E13, E21-E26, E31, E47).

use nalgebra::{SMatrix, Vector3};
use northing_core::geometry::rotation;
use northing_core::navigation::aiding::{
    barometer, body_velocity, gnss_position, gnss_velocity, heading, magnetic_field, zero_velocity,
};
use northing_core::navigation::augmented_states::{
    AugmentedStates, GNSS_OFFSET, MAGNETIC_OFFSET, TIME_OFFSET,
};
use northing_core::navigation::error_state::SparseMeasurement;
use northing_core::navigation::gnss_ins::{ErrorShares, GnssInsConfig, STANDING_STD};
use northing_core::navigation::history::Instant;
use northing_core::navigation::{GnssPosition, GnssVelocity, STATES};

use super::motion::History;
use super::recorder::{Measured, Part};
use super::state::State;
use super::{Errors, LEVER_ARM, SPEED_SCALE, VELOCITY_OFFSET};

/// How much larger the floor of a height is, as in the filter.
const VERTICAL_FLOOR: f64 = 2.5;

/// One component of a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Component {
    pub(super) row: Errors,
    pub(super) residual: f64,
    pub(super) variance: f64,
}

/// Up to three components that have one weight.
pub(super) type Components = [Option<Component>; 3];

/// What measurements are compared with.
pub(super) struct Aids<'a> {
    pub(super) config: &'a GnssInsConfig<f64>,
    /// What the receiver's stated standard deviations are multiplied by: horizontal, vertical, velocity.
    pub(super) noise_scales: [f64; 3],
}

impl Measured {
    /// Which of the noise scales is the measurement's.
    pub(super) fn noise_scale(&self) -> Option<usize> {
        match self {
            Self::Position(_, _, Part::Horizontal) => Some(0),
            Self::Position(_, _, Part::Vertical) => Some(1),
            Self::Velocity(_) => Some(2),
            _ => None,
        }
    }
}

/// Standard deviations of a position with the floors of the settings.
pub(super) fn floored(fix: &GnssPosition<f64>, config: &GnssInsConfig<f64>) -> Vector3<f64> {
    let floor = config.position_std_floor_m;
    let floor = Vector3::new(floor, floor, floor * VERTICAL_FLOOR);
    fix.std.zip_map(&floor, f64::max)
}

impl Aids<'_> {
    /// The components of a measurement that was valid `age_s` before its node, whose state is `state`; none where it says
    /// nothing.
    pub(super) fn components(
        &self,
        measured: &Measured,
        state: &State,
        history: &History,
        age_s: f64,
    ) -> Components {
        let c = self.config;
        let time_offset = match measured {
            Measured::Position(..) => state.side[TIME_OFFSET],
            Measured::Velocity(_) => state.side[TIME_OFFSET] + state.velocity_offset_s,
            _ => 0.0,
        };
        let then = history.at(&state.navigation(), c.gravity, age_s + time_offset);
        let side = self.side(state);
        let arm = Vector3::from(c.vehicle_arm_m);
        let wheels = c.non_holonomic_std_m_s.powi(2);
        match *measured {
            Measured::Position(fix, shares, part) => {
                self.position(&fix, &shares, part, state, &then)
            }
            Measured::Velocity(fix) => self.velocity(&fix, state, &then),
            Measured::Heading(angle, std) => {
                heading::measurement(&then, angle, std * std).map_or([None; 3], |made| dense(&made))
            }
            Measured::MagneticField(field, declination) => {
                self.magnetic_field(&field, declination, &then, &side)
            }
            Measured::Height(height) => {
                let variance = c.barometer_std_m.powi(2);
                dense(&barometer::measurement(&then, &side, height, variance))
            }
            Measured::Speed(forward, std) => {
                let variance = std * std;
                let made = body_velocity::speed(&then, &side, &arm, forward, variance);
                scaled(dense(&made), forward, state.speed_scale)
            }
            Measured::Rest => dense(&zero_velocity::velocity(&then, STANDING_STD.powi(2))),
            Measured::RateAtRest(rate, variance) => {
                dense(&zero_velocity::rate(&rate, &state.gyroscope_bias, variance))
            }
            Measured::NonHolonomic => {
                dense(&body_velocity::non_holonomic(&then, &side, &arm, wheels))
            }
            Measured::Damping(variance) => dense(&zero_velocity::damping(&then.velocity, variance)),
        }
    }

    /// The augmented states as the aids of the filter want them. How well the iron is known enters the linearisation of a
    /// magnetic field: here it is always the prior, or passes would not converge.
    fn side(&self, state: &State) -> AugmentedStates<f64> {
        let mut side = AugmentedStates {
            values: state.side,
            cross: SMatrix::zeros(),
            covariance: SMatrix::zeros(),
        };
        for i in MAGNETIC_OFFSET..MAGNETIC_OFFSET + 3 {
            side.covariance[(i, i)] = self.config.magnetic_offset_std_ut.powi(2);
        }
        side
    }

    fn position(
        &self,
        fix: &GnssPosition<f64>,
        shares: &ErrorShares<f64>,
        part: Part,
        state: &State,
        then: &Instant<f64>,
    ) -> Components {
        let [flat, high, _] = self.noise_scales;
        let scale = Vector3::new(flat, flat, high) * shares.white;
        let white = floored(fix, self.config).component_mul(&scale);
        let jitter = then.velocity * self.config.time_jitter_s;
        let variance = white.component_mul(&white) + jitter.component_mul(&jitter);
        let offset = state.side.fixed_rows::<3>(GNSS_OFFSET).into_owned();
        let arm = &state.lever_arm;
        let axes = rotation::to_matrix(&then.ned_from_body);
        match part {
            Part::Horizontal => {
                let m = gnss_position::measurement(then, &offset, arm, &fix.ned, &variance, [0, 1]);
                with_arm(dense(&m), [0, 1, 2], &axes)
            }
            Part::Vertical if fix.has_height => {
                let m = gnss_position::measurement(then, &offset, arm, &fix.ned, &variance, [2]);
                with_arm(dense(&m), [2, 2, 2], &axes)
            }
            Part::Vertical => [None; 3],
        }
    }

    fn velocity(&self, fix: &GnssVelocity<f64>, state: &State, then: &Instant<f64>) -> Components {
        let [.., scale] = self.noise_scales;
        let floor = self.config.velocity_std_floor_m_s;
        let std = fix.std.map(|s| s.max(floor)) * scale;
        let variance = std.component_mul(&std);
        let arm = &state.lever_arm;
        let made = if fix.has_vertical {
            let m = gnss_velocity::measurement(then, arm, &fix.ned, &variance, [0, 1, 2]);
            dense(&m)
        } else {
            let m = gnss_velocity::measurement(then, arm, &fix.ned, &variance, [0, 1]);
            dense(&m)
        };
        let axes = rotation::to_matrix(&then.ned_from_body);
        let swing = axes * then.angular_rate.cross_matrix();
        let mut made = with_arm(made, [0, 1, 2], &swing);
        for component in made.iter_mut().flatten() {
            component.row[VELOCITY_OFFSET] = component.row[STATES + TIME_OFFSET];
        }
        made
    }

    fn magnetic_field(
        &self,
        field: &Vector3<f64>,
        declination: f64,
        then: &Instant<f64>,
        side: &AugmentedStates<f64>,
    ) -> Components {
        let std = self.config.magnetic_heading_std;
        let made = if self.config.magnetic_offset_std_ut > 0.0 {
            magnetic_field::measurement(then, side, field, declination, std)
        } else {
            heading::magnetic(then, field, declination, std * std)
        };
        made.map_or([None; 3], |made| dense(&made))
    }
}

fn dense<const M: usize>(made: &SparseMeasurement<f64, M>) -> Components {
    let mut components = [None; 3];
    let parts = made.rows.iter().zip(&made.residual).zip(&made.variance);
    for (component, ((sparse, residual), variance)) in components.iter_mut().zip(parts) {
        let mut row = Errors::zeros();
        for (state, h) in sparse.elements() {
            row[*state] += *h;
        }
        *component = Some(Component {
            row,
            residual: *residual,
            variance: *variance,
        });
    }
    components
}

/// A speed that is measured too high by the share `scale`, which is a state.
fn scaled(mut components: Components, measured: f64, scale: f64) -> Components {
    for component in components.iter_mut().flatten() {
        let predicted = measured - component.residual;
        component.residual -= scale * predicted;
        component.row *= 1.0 + scale;
        component.row[SPEED_SCALE] = predicted;
    }
    components
}

/// What the lever arm does to each component: the rows of `by_arm`.
fn with_arm(
    mut components: Components,
    rows: [usize; 3],
    by_arm: &SMatrix<f64, 3, 3>,
) -> Components {
    for (component, i) in components.iter_mut().zip(rows) {
        if let Some(component) = component {
            for j in 0..3 {
                component.row[LEVER_ARM + j] = by_arm[(i, j)];
            }
        }
    }
    components
}
