//! Requests to an estimator and its answers as bytes: fixed lengths, little endian, doubles as they are.
//!
//! A request is its number (one byte) and [`NUMBERS`] doubles, unused ones zero. An answer begins with a byte: 1 is a failure,
//! the length of its text (u32) and the text; 0 is followed by a byte of flags and [`ANSWERED`] doubles. The other side is
//! `crates/python/python/northing/_estimator.py`.

use nalgebra::{Matrix3, Quaternion, Vector3};
use northing_core::attitude::{CompassHeading, InitialState};
use northing_core::geometry::frames::TangentFrame;

/// Doubles of a request.
const NUMBERS: usize = 24;
/// Bytes of a request.
pub(super) const REQUEST: usize = 1 + 8 * NUMBERS;
/// Doubles of an answer: quaternion, covariance, bias, its covariance, residual, S.
const ANSWERED: usize = 4 + 9 + 3 + 9 + 3 + 9;
/// Bytes of an answer after its first.
pub(super) const ANSWER: usize = 1 + 8 * ANSWERED;
/// A text of a failure is cut here, bytes.
pub(super) const LONGEST_TEXT: usize = 1 << 16;

/// What an estimator is asked to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Request {
    /// Start, or start again, from a state.
    Start(InitialState<f64>),
    /// Move on by an angular rate, rad/s, that held for so many seconds.
    Gyroscope(Vector3<f64>, f64),
    /// Update with a specific force, m/s^2.
    Accelerometer(Vector3<f64>),
    /// Update with a magnetic field, microtesla.
    Magnetometer(Vector3<f64>),
    /// Update with a heading.
    Compass(CompassHeading<f64>),
    /// Something unseen happened: add a variance, rad^2, to each component of the attitude.
    Unseen(f64),
}

impl Request {
    /// As bytes.
    #[must_use]
    pub fn bytes(&self) -> [u8; REQUEST] {
        let mut numbers = Vec::with_capacity(NUMBERS);
        let number = match self {
            Self::Start(state) => {
                let q = &state.attitude;
                numbers.extend([q.w, q.i, q.j, q.k]);
                numbers.extend(state.attitude_covariance.transpose().iter());
                numbers.extend(state.gyroscope_bias.iter());
                numbers.push(state.gyroscope_bias_std);
                numbers.extend(state.references.specific_force.iter());
                let field = state.references.magnetic_field;
                numbers.push(f64::from(u8::from(field.is_some())));
                numbers.extend(field.unwrap_or_default().iter());
                0
            }
            Self::Gyroscope(rate, dt) => {
                numbers.extend(rate.iter().chain([dt]));
                1
            }
            Self::Accelerometer(force) => {
                numbers.extend(force.iter());
                2
            }
            Self::Magnetometer(field) => {
                numbers.extend(field.iter());
                3
            }
            Self::Compass(heading) => {
                let is_down = heading.frame == TangentFrame::Ned;
                let frame = f64::from(u8::from(is_down));
                numbers.extend([heading.heading, heading.std, frame]);
                4
            }
            Self::Unseen(variance) => {
                numbers.push(*variance);
                5
            }
        };
        let mut bytes = [0; REQUEST];
        bytes[0] = number;
        for (place, number) in bytes[1..].chunks_exact_mut(8).zip(numbers) {
            place.copy_from_slice(&number.to_le_bytes());
        }
        bytes
    }
}

/// The text of a failure: one line.
pub(super) fn failure(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let is_plain = |c: &char| !c.is_control();
    text.chars().filter(is_plain).collect()
}

/// What an estimator says after a request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// The attitude, `ref_from_body`; not yet known to be a rotation.
    pub attitude: Quaternion<f64>,
    /// Covariance of its local error in body axes, rad^2.
    pub covariance: Option<Matrix3<f64>>,
    /// Gyroscope bias, rad/s, and its covariance where that is known.
    pub bias: Option<(Vector3<f64>, Option<Matrix3<f64>>)>,
    /// Residual of the measurement and its covariance where that is stated; `None`: it was not used.
    pub innovation: Option<(Vector3<f64>, Option<Matrix3<f64>>)>,
}

impl Answer {
    /// From a whole answer, its first byte among them.
    ///
    /// # Errors
    /// What the other side says of its failure, or that this is no answer.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        match bytes.split_first() {
            Some((0, rest)) => Self::read(rest).ok_or_else(|| "has sent half an answer".to_owned()),
            Some((_, rest)) => Err(failure(rest.get(4..).unwrap_or_default())),
            None => Err("has sent no answer".to_owned()),
        }
    }

    /// From its bytes behind the first; `None`: they are too few.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (flags, numbers) = bytes.split_first()?;
        if numbers.len() != 8 * ANSWERED {
            return None;
        }
        let has = |bit: u8| flags & (1 << bit) != 0;
        let mut numbers = numbers
            .chunks_exact(8)
            .map(|chunk| f64::from_le_bytes(chunk.try_into().unwrap_or_default()));
        let mut take = |n: usize| numbers.by_ref().take(n).collect::<Vec<f64>>();
        let (q, p) = (take(4), take(9));
        let (bias, bias_covariance) = (take(3), take(9));
        let (residual, s) = (take(3), take(9));
        let matrix = |rows: &[f64]| Matrix3::from_row_slice(rows);
        let vector = |row: &[f64]| Vector3::from_column_slice(row);
        Some(Self {
            attitude: Quaternion::new(q[0], q[1], q[2], q[3]),
            covariance: has(0).then(|| matrix(&p)),
            bias: has(1).then(|| (vector(&bias), has(2).then(|| matrix(&bias_covariance)))),
            innovation: has(3).then(|| (vector(&residual), has(4).then(|| matrix(&s)))),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_and_answers_have_their_places() {
        let bytes = Request::Gyroscope(Vector3::new(1.0, -2.0, 3.5), 0.01).bytes();
        assert_eq!((bytes.len(), bytes[0]), (193, 1));
        assert_eq!(bytes[9..17], (-2.0_f64).to_le_bytes());
        assert_eq!(bytes[25..33], 0.01_f64.to_le_bytes());
        let mut answer = vec![0b11001];
        answer.extend((0..37).flat_map(|k| f64::from(k).to_le_bytes()));
        assert_eq!(answer.len(), ANSWER);
        let read = Answer::read(&answer).unwrap();
        assert_eq!(read.attitude, Quaternion::new(0.0, 1.0, 2.0, 3.0));
        let rows = (4..13).map(f64::from);
        assert_eq!(read.covariance, Some(Matrix3::from_row_iterator(rows)));
        assert!(read.bias.is_none());
        let (residual, s) = read.innovation.unwrap();
        assert_eq!(residual, Vector3::new(25.0, 26.0, 27.0));
        let rows = (28..37).map(f64::from);
        assert_eq!(s, Some(Matrix3::from_row_iterator(rows)));
        assert!(Answer::read(&answer[..20]).is_none() && Answer::read(&[]).is_none());
    }
}
