//! Barometric height, up to an offset that drifts with the weather.
//!
//! *Read first:* `docs/derivations/error_state.md`, (E24).

use nalgebra::Vector1;

use crate::navigation::POSITION;
use crate::navigation::augmented_states::{AugmentedStates, BAROMETER_OFFSET};
use crate::navigation::error_state::{Row, SIDE, SparseMeasurement};
use crate::navigation::history::Instant;
use crate::scalar::{Scalar, lit};

/// Pressure at sea level in the standard atmosphere, Pa.
pub const STANDARD_PRESSURE_PA: f64 = 101_325.0;

/// Height (m) of a pressure (Pa) in the standard atmosphere (ICAO Doc 7488: to 11 km), 0 at 1013.25 hPa.
/// `None` for a pressure that no vehicle meets there.
pub fn pressure_height<T: Scalar>(pressure_pa: T) -> Option<T> {
    let sensible = pressure_pa >= lit(2e4) && pressure_pa <= lit(1.2e5);
    sensible.then(|| {
        let ratio = pressure_pa / lit(STANDARD_PRESSURE_PA);
        lit::<T>(44_330.77) * (T::one() - ratio.powf(lit(0.190_263)))
    })
}

/// Row of a height (m, up, of any zero) (E24).
pub fn measurement<T: Scalar>(
    then: &Instant<T>,
    side: &AugmentedStates<T>,
    height: T,
    variance: T,
) -> SparseMeasurement<T, 1> {
    let predicted = -then.position.z + side.values[BAROMETER_OFFSET];
    SparseMeasurement {
        rows: [Row::default()
            .with(POSITION + 2, -T::one())
            .with(SIDE + BAROMETER_OFFSET, T::one())],
        residual: Vector1::new(height - predicted),
        variance: Vector1::new(variance),
        freed: [POSITION + 2],
    }
}
