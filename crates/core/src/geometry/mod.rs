//! Rotations: SO(3) exponential and logarithm, Jacobians, conversions and frames; trigonometry for small chips.

pub mod frames;
pub mod rotation;
pub mod so3;
pub mod trigonometry;
