//! The Earth: the WGS-84 ellipsoid, local tangent frames, gravity and rotation.
//!
//! | what | file |
//! |---|---|
//! | geodetic, Earth-centred and local north-east-down coordinates, radii of curvature | `wgs84.rs` |
//! | normal gravity, Earth rate | `gravity.rs` |
//! | one local frame seen from another | `frame_change.rs` |
//!
//! Coordinates on the globe are `f64`: a degree in single precision steps by 0.4 to 1.7 m. What comes out,
//! metres from an origin, may be of any precision.

pub mod frame_change;
pub mod gravity;
pub mod wgs84;

pub use frame_change::FrameChange;
pub use gravity::{earth_rate_ned, normal_gravity};
pub use wgs84::{Geodetic, LocalFrame, Radii};
