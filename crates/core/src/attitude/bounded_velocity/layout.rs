//! Error states in use, and their places in the covariance.
//!
//! Attitude, velocity and bias are always there, the other blocks follow each other without holes:
//! a block that is off takes no place, and the loops, which run over the states in use, no time.

use nalgebra::{SMatrix, SVector};

use super::config::{BoundedVelocityConfig, ScaleStates};
use crate::scalar::Scalar;

/// Most error states: attitude 3, velocity 2, bias 3, scale 9, field 2, hard iron 3.
pub const CAPACITY: usize = 22;
/// First state of the attitude error (rad, level axes).
pub const ATTITUDE: usize = 0;
/// First state of the horizontal velocity (m/s, east and north).
pub const VELOCITY: usize = 3;
/// First state of the gyroscope bias (rad/s, body axes).
pub const BIAS: usize = 5;
/// First state of the scale block.
pub const SCALE: usize = 8;

/// Covariance of the error states; rows and columns beyond [`Layout::len`] are zero.
pub type Covariance<T> = SMatrix<T, CAPACITY, CAPACITY>;
/// A correction of the error states.
pub type Correction<T> = SVector<T, CAPACITY>;

/// The states in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Layout {
    scale: ScaleStates,
    field: Option<usize>,
    hard_iron: Option<usize>,
    len: usize,
}

impl Layout {
    /// The states that `config` asks for; those of the magnetometer only where there is one.
    pub fn new<T: Scalar>(config: &BoundedVelocityConfig<T>, has_magnetometer: bool) -> Self {
        let scale = config.scale_states;
        let mut len = SCALE + scale_len(scale);
        let mut block = |wanted: bool, size: usize| {
            let first = len;
            (wanted && has_magnetometer).then(|| {
                len += size;
                first
            })
        };
        let field = block(config.initial_field_std_ut > T::zero(), 2);
        let hard_iron = block(config.initial_hard_iron_std_ut > T::zero(), 3);
        Self {
            scale,
            field,
            hard_iron,
            len,
        }
    }

    /// The same with hard iron behind the others.
    pub(super) fn with_hard_iron(self) -> Self {
        if self.hard_iron.is_some() {
            return self;
        }
        Self {
            hard_iron: Some(self.len),
            len: self.len + 3,
            ..self
        }
    }

    /// Whether the blocks stand where [`Self::new`] puts them.
    pub(super) fn is_valid(&self) -> bool {
        let mut len = SCALE + scale_len(self.scale);
        let mut follows = |block: Option<usize>, size: usize| {
            let first = len;
            len += block.map_or(0, |_| size);
            block.is_none_or(|block| block == first)
        };
        let in_place = follows(self.field, 2) && follows(self.hard_iron, 3);
        in_place && len == self.len
    }

    /// Which errors of the scale are states.
    #[inline]
    pub fn scale(&self) -> ScaleStates {
        self.scale
    }

    /// How many states the scale block has: 0, 3 or 9. They stand from [`SCALE`] on; the nine are
    /// the rows of the matrix one after the other.
    #[inline]
    pub fn scale_len(&self) -> usize {
        scale_len(self.scale)
    }

    /// First state of the field's horizontal (northward) and downward strength (microtesla).
    #[inline]
    pub fn field(&self) -> Option<usize> {
        self.field
    }

    /// First state of the hard iron (microtesla, body axes).
    #[inline]
    pub fn hard_iron(&self) -> Option<usize> {
        self.hard_iron
    }

    /// How many states there are.
    #[inline]
    #[allow(clippy::len_without_is_empty, reason = "eight states are always there")]
    pub fn len(&self) -> usize {
        self.len
    }
}

#[inline]
const fn scale_len(scale: ScaleStates) -> usize {
    match scale {
        ScaleStates::Off => 0,
        ScaleStates::Diagonal => 3,
        ScaleStates::Full => 9,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_follow_each_other_without_holes() {
        let mut config = BoundedVelocityConfig::<f64>::lab();
        let of = |config: &BoundedVelocityConfig<f64>, has| {
            let layout = Layout::new(config, has);
            (layout.field(), layout.hard_iron(), layout.len())
        };
        assert_eq!(of(&config, true), (Some(17), None, 19));
        config.initial_hard_iron_std_ut = 12.0;
        assert_eq!(of(&config, true), (Some(17), Some(19), CAPACITY));
        assert_eq!(of(&config, false), (None, None, 17));
        config.initial_field_std_ut = 0.0;
        config.scale_states = ScaleStates::Diagonal;
        assert_eq!(of(&config, true), (None, Some(11), 14));
        config.scale_states = ScaleStates::Off;
        assert_eq!(of(&config, false), (None, None, SCALE));
    }
}
