//! Rotations: SO(3) exponential and logarithm, Jacobians, conversions and frames.

pub mod frames;
pub mod rotation;
pub mod so3;
