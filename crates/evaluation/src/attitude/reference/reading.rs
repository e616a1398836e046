//! Other readings of a reference's quaternions: in another order of the numbers, or the other way round.

use std::fmt;

use nalgebra::{Quaternion, UnitQuaternion};
use northing_core::geometry::so3;

use crate::attitude::reference::rates::Window;

/// Another reading than the one that was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reading {
    /// Where the numbers stand.
    pub order: Order,
    /// Whether they turn the world's vectors into body axes where body to world was taken, or the reverse.
    pub is_inverse: bool,
}

/// Where the numbers of a quaternion stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// As they were read.
    AsRead,
    /// w, x, y, z was read where x, y, z, w is written.
    ScalarLast,
    /// x, y, z, w was read where w, x, y, z is written.
    ScalarFirst,
}

impl Reading {
    /// All but the one that was taken.
    pub(super) const ALL: [Self; 5] = [
        Self::new(Order::AsRead, true),
        Self::new(Order::ScalarLast, false),
        Self::new(Order::ScalarLast, true),
        Self::new(Order::ScalarFirst, false),
        Self::new(Order::ScalarFirst, true),
    ];

    const fn new(order: Order, is_inverse: bool) -> Self {
        Self { order, is_inverse }
    }

    fn attitude(self, read: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let [x, y, z, w] = read.coords.into();
        let q = UnitQuaternion::from_quaternion(match self.order {
            Order::AsRead => Quaternion::new(w, x, y, z),
            Order::ScalarLast => Quaternion::new(z, w, x, y),
            Order::ScalarFirst => Quaternion::new(x, y, z, w),
        });
        if self.is_inverse { q.inverse() } else { q }
    }

    /// The window with the rate of this reading.
    pub(super) fn of(self, window: &Window) -> Window {
        let [from, to] = window.attitudes.each_ref().map(|q| self.attitude(q));
        let rate = so3::log(&(from.inverse() * to)) / (window.to_s - window.from_s);
        Window { rate, ..*window }
    }
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let order = match self.order {
            Order::AsRead => None,
            Order::ScalarLast => Some("as x, y, z, w (order = \"xyzw\")"),
            Order::ScalarFirst => Some("as w, x, y, z (order = \"wxyz\")"),
        };
        let way = self
            .is_inverse
            .then_some("inverted (the other `direction`: body-to-world or world-to-body)");
        match (order, way) {
            (Some(order), Some(way)) => write!(f, "{order} and {way}"),
            (one, other) => f.write_str(one.or(other).unwrap_or("as they are")),
        }
    }
}
