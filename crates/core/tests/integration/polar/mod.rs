//! A target about the own ship in range, direction, and velocity along and across the line of sight, by dual numbers: what steps
//! along arcs are held against (`docs/derivations/schmidt_kalman.md`, S19 and S20).

#![allow(clippy::unwrap_used)]
#![allow(dead_code)] // each test that takes this module in uses a part of it

use nalgebra::{Matrix4, SVector, Vector3, Vector4};
use num_dual::{DualNum as _, DualSVec64, jacobian};

/// These coordinates of a target and their derivative by its state.
fn polar(x: &Vector4<f64>, own: &Vector3<f64>) -> (Vector4<f64>, Matrix4<f64>) {
    let coordinates = |x: SVector<DualSVec64<4>, 4>| {
        let (north, east) = (x[0] - own[0], x[2] - own[1]);
        let direction = east.atan2(north);
        let (sin, cos) = direction.sin_cos();
        SVector::from([
            (north * north + east * east).sqrt(),
            direction,
            x[1] * cos + x[3] * sin,
            x[3] * cos - x[1] * sin,
        ])
    };
    jacobian(coordinates, x)
}

/// The target after a step that is taken in these coordinates.
pub(crate) fn on_the_arc(
    x: &Vector4<f64>,
    step: &Vector4<f64>,
    own: &Vector3<f64>,
) -> Vector4<f64> {
    let (before, derivative) = polar(x, own);
    let after = before + derivative * step;
    let (sin, cos) = after[1].sin_cos();
    Vector4::new(
        own[0] + after[0] * cos,
        after[2] * cos - after[3] * sin,
        own[1] + after[0] * sin,
        after[2] * sin + after[3] * cos,
    )
}

/// What becomes of the errors of the one state about the other, when they stay what they are in these coordinates.
pub(crate) fn map_of_errors(
    before: &Vector4<f64>,
    after: &Vector4<f64>,
    own: &Vector3<f64>,
) -> Matrix4<f64> {
    polar(after, own).1.try_inverse().unwrap() * polar(before, own).1
}
