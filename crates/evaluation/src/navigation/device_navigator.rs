//! The estimator `device`: what the device itself said, scored and drawn like any other.
//!
//! It looks at no measurement. A fix is one that the device had used, so none can be kept from it.

use nalgebra::Vector3;
use northing_core::earth::{FrameChange, LocalFrame};
use northing_core::navigation::Validity;

use super::navigator::{Aid, NavigationEstimate, Navigator, Told};

/// What the device said last.
#[derive(Debug, Default)]
pub(crate) struct DeviceNavigator {
    said: Option<NavigationEstimate>,
}

impl Navigator for DeviceNavigator {
    fn inertial(&mut self, _: i64, _: &Vector3<f64>, _: &Vector3<f64>, _: &mut Vec<Told>) {}

    fn origin(&mut self, _: &LocalFrame, _: i64) -> Option<f64> {
        None
    }

    /// What it said stands in the frame in which it was said.
    fn move_origin(&mut self, _: &LocalFrame, _: &FrameChange<f64>, _: i64) {}

    fn aid(&mut self, _: i64, _: &Aid, _: &mut Vec<Told>) {}

    fn device(&mut self, estimate: &NavigationEstimate) {
        self.said = Some(*estimate);
    }

    fn estimate(&mut self) -> Option<NavigationEstimate> {
        self.said
    }

    fn validity(&self) -> Validity {
        self.said.map_or(Validity::Aligning, |said| said.validity)
    }
}
