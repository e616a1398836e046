//! The navigation state as people ask for it: latitude and longitude, degrees, standard deviations.

use nalgebra::{Matrix3, Vector3};

use crate::earth::{Geodetic, LocalFrame};
use crate::geometry::{rotation, so3};
use crate::kalman::covariance::part;
use crate::navigation::augmented_states::{AugmentedStates, TIME_OFFSET};
use crate::navigation::{
    ATTITUDE, GnssPosition, GnssVelocity, NavigationState, POSITION, VELOCITY,
};
use crate::scalar::{Scalar, lit, to_f64};

/// Degrees in a radian.
const DEGREES: f64 = 180.0 / core::f64::consts::PI;

impl<T: Scalar> NavigationState<T> {
    /// Latitude, longitude and height of the position, where `frame` is the one whose origin positions count from.
    pub fn geodetic(&self, frame: &LocalFrame) -> Geodetic {
        frame.geodetic(&self.position.map(to_f64))
    }

    /// Standard deviations of the position, m: north, east, down.
    pub fn position_std(&self) -> Vector3<T> {
        self.std_of(POSITION)
    }

    /// Position (m, NED) of an antenna `arm` metres from the unit (body axes) as its receiver dates it, with its covariance
    /// (m^2): the estimated offset between the two clocks is taken out (E39).
    pub fn antenna_position(
        &self,
        side: &AugmentedStates<T>,
        arm: &Vector3<T>,
    ) -> (Vector3<T>, Matrix3<T>) {
        let late = side.values[TIME_OFFSET];
        let block = |i: usize, j: usize| -> Matrix3<T> { part(&self.covariance, i, j) };
        let has_arm = arm.norm_squared() > T::zero();
        if !has_arm && !side.is_used(TIME_OFFSET) && late.abs() <= T::zero() {
            return (self.position, block(POSITION, POSITION));
        }
        let with = |j: usize| block(POSITION, j) - block(VELOCITY, j) * late;
        let mut own = with(POSITION) - with(VELOCITY) * late;
        let timed = |i: usize| -> Vector3<T> { part(&side.cross, i, TIME_OFFSET) };
        let mut timed_own = timed(POSITION) - timed(VELOCITY) * late;
        let mut arm = *arm;
        if has_arm {
            arm = self.ned_from_body * arm;
            let swing = -so3::skew(&arm);
            let turned = with(ATTITUDE) * swing.transpose();
            own += turned + turned.transpose();
            own += swing * block(ATTITUDE, ATTITUDE) * swing.transpose();
            timed_own += swing * timed(ATTITUDE);
        }
        let timed = timed_own;
        let moved = timed * self.velocity.transpose();
        let variance = side.covariance[(TIME_OFFSET, TIME_OFFSET)];
        let covariance =
            own - moved - moved.transpose() + self.velocity * self.velocity.transpose() * variance;
        (self.position + arm - self.velocity * late, covariance)
    }

    /// Standard deviations of the velocity, m/s: north, east, down.
    pub fn velocity_std(&self) -> Vector3<T> {
        self.std_of(VELOCITY)
    }

    /// Roll, pitch and yaw (the heading, clockwise from true north), degrees.
    pub fn roll_pitch_yaw_deg(&self) -> [T; 3] {
        let [yaw, pitch, roll] = rotation::to_yaw_pitch_roll(&self.ned_from_body);
        [roll, pitch, yaw].map(|angle| angle * lit(DEGREES))
    }

    /// Standard deviations of roll, pitch and yaw, degrees; large near the poles of the pitch, where roll and yaw are
    /// not defined.
    pub fn roll_pitch_yaw_std_deg(&self) -> [T; 3] {
        let p = self.covariance.fixed_view::<3, 3>(ATTITUDE, ATTITUDE);
        let std = rotation::yaw_pitch_roll_std(&self.ned_from_body, &p.into_owned());
        let [yaw, pitch, roll] = std;
        [roll, pitch, yaw].map(|std| std * lit(DEGREES))
    }

    fn std_of(&self, first: usize) -> Vector3<T> {
        let variances = self.covariance.diagonal();
        Vector3::from_fn(|i, _| variances[first + i].max(T::zero()).sqrt())
    }
}

impl<T: Scalar> GnssPosition<T> {
    /// A position (m, north, east and down of the origin) with its standard deviations, all three measured.
    pub fn new(ned: Vector3<T>, std: Vector3<T>) -> Self {
        Self {
            ned,
            std,
            has_height: true,
        }
    }

    /// A fix as receivers print it: latitude and longitude (degrees), height above the ellipsoid (m), and the standard
    /// deviations north, east and down (m). `frame` is where positions count from. `None` when it is no place on Earth.
    pub fn from_degrees(
        frame: &LocalFrame,
        [latitude_deg, longitude_deg, height_m]: [f64; 3],
        std: Vector3<T>,
    ) -> Option<Self> {
        let place = Geodetic::from_degrees(latitude_deg, longitude_deg, height_m)?;
        Some(Self::new(frame.ned(&place).map(lit), std))
    }
}

impl<T: Scalar> GnssVelocity<T> {
    /// A velocity (m/s, north, east, down) with its standard deviations, all three measured.
    pub fn new(ned: Vector3<T>, std: Vector3<T>) -> Self {
        Self {
            ned,
            std,
            has_vertical: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::so3;
    use nalgebra::UnitQuaternion;

    #[test]
    fn angles_move_by_the_attitude_error_as_their_deviations_say() {
        let attitude = rotation::from_yaw_pitch_roll([2.0, 0.6, -0.4]);
        let still = Vector3::zeros();
        let base = NavigationState::<f64>::new(attitude, still, still);
        for axis in 0..3 {
            let mut state = base;
            state.covariance[(axis, axis)] = 1e-8;
            let mut turn = Vector3::zeros();
            turn[axis] = 1e-4;
            let turned = NavigationState::new(so3::exp(&turn) * attitude, still, still);
            let [before, after] = [&base, &turned].map(NavigationState::roll_pitch_yaw_deg);
            for (i, std) in state.roll_pitch_yaw_std_deg().into_iter().enumerate() {
                assert!(
                    ((after[i] - before[i]).abs() - std).abs() < 1e-6,
                    "{axis} {i}"
                );
            }
        }
    }

    #[test]
    fn a_fix_in_degrees_comes_back_in_degrees() {
        let frame = LocalFrame::new(Geodetic::from_degrees(63.43, 10.39, 40.0).unwrap());
        let fix = [63.44, 10.41, 55.0];
        let fix = GnssPosition::<f64>::from_degrees(&frame, fix, Vector3::repeat(2.0)).unwrap();
        assert!((fix.ned.x - 1115.0).abs() < 2.0 && (fix.ned.y - 999.0).abs() < 2.0);
        let attitude = UnitQuaternion::identity();
        let place = NavigationState::new(attitude, Vector3::zeros(), fix.ned).geodetic(&frame);
        let [latitude, longitude] = place.degrees();
        assert!((latitude - 63.44).abs() < 1e-9 && (longitude - 10.41).abs() < 1e-9);
        let nowhere = GnssPosition::<f64>::from_degrees(&frame, [91.0, 0.0, 0.0], fix.std);
        assert!(nowhere.is_none());
    }
}
