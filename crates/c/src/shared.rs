//! What the functions share: numbers, innovations, settings by name, statuses.

use core::ffi::{CStr, c_char};

use northing_core::kalman::{Innovation as CoreInnovation, Outcome as CoreOutcome, SkipReason};
use northing_core::parameters::{Range, Table, Value};

/// The numbers: `double`, or `float` where the library is built for single precision (define `NORTHING_FLOAT`).
#[cfg(feature = "double")]
pub type Real = f64;
/// The numbers: `double`, or `float` where the library is built for single precision (define `NORTHING_FLOAT`).
#[cfg(not(feature = "double"))]
pub type Real = f32;

/// How a call ended.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// It did what it says.
    Ok = 0,
    /// A pointer is null, or the structure holds no filter: it was not initialised.
    NoFilter = 1,
    /// There is no parameter of this name.
    UnknownParameter = 2,
    /// A parameter outside its permitted range, or of another kind.
    OutOfRange = 3,
    /// There is no estimate yet: the filter aligns itself.
    Aligning = 4,
    /// The sample was refused and has changed nothing: not finite, not newer, out of range.
    Skipped = 5,
    /// The filter makes no statement of that kind.
    NotStated = 6,
}

/// What a filter did with a measurement.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Used with its stated noise.
    Fused = 0,
    /// Used with inflated noise.
    Inflated = 1,
    /// Refused: too far from what was expected.
    Gated = 2,
    /// Not used: not finite, out of range (so is a standard deviation of 0), not newer, the same numbers again, far from its neighbours,
    /// or there is no filter, or it is not aligned yet.
    NotUsed = 3,
    /// Taken: it takes effect with a later sample, and is in that innovation.
    Gathered = 4,
}

/// What a measurement told a filter.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    /// Measured less predicted, in the unit of the sensor.
    pub residual: [Real; 3],
    /// What the filter expected of it, S, row by row.
    pub covariance: [Real; 9],
    /// Normalised innovation squared.
    pub nis: Real,
    /// Components measured; 0 where nothing was.
    pub degrees_of_freedom: u8,
    /// What was done with it.
    pub outcome: Outcome,
}

impl From<&CoreInnovation<Real>> for Innovation {
    fn from(told: &CoreInnovation<Real>) -> Self {
        let mut covariance = [0.0; 9];
        covariance.copy_from_slice(told.covariance.transpose().as_slice());
        Self {
            residual: told.residual.into(),
            covariance,
            nis: told.nis,
            degrees_of_freedom: told.degrees_of_freedom,
            outcome: match told.outcome {
                CoreOutcome::Fused => Outcome::Fused,
                CoreOutcome::Inflated => Outcome::Inflated,
                CoreOutcome::Gated => Outcome::Gated,
                CoreOutcome::Skipped(SkipReason::Accumulated) => Outcome::Gathered,
                CoreOutcome::Skipped(_) => Outcome::NotUsed,
            },
        }
    }
}

impl Innovation {
    /// Of a measurement that nobody looked at.
    pub(crate) const NONE: Self = Self {
        residual: [0.0; 3],
        covariance: [0.0; 9],
        nis: 0.0,
        degrees_of_freedom: 0,
        outcome: Outcome::NotUsed,
    };
}

/// A parameter by the name that `northing estimators NAME` lists, without the estimator's prefix, and its value.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Setting {
    /// Its name.
    pub name: *const c_char,
    /// Its value: a number in the first place, a switch as 0 or 1 there, or the three components of a vector.
    pub value: [Real; 3],
}

/// Sets parameters by name.
///
/// # Safety
/// `settings` is null or points to so many settings, their names to strings of C.
pub(crate) unsafe fn set<C: Table<Number = Real>>(
    config: &mut C,
    settings: *const Setting,
    count: usize,
) -> Result<(), Status> {
    if settings.is_null() || count == 0 {
        return Ok(());
    }
    // SAFETY: the caller says so.
    let settings = unsafe { core::slice::from_raw_parts(settings, count) };
    for setting in settings {
        if setting.name.is_null() {
            return Err(Status::UnknownParameter);
        }
        // SAFETY: the caller says so.
        let name = unsafe { CStr::from_ptr(setting.name) };
        let row = name.to_str().ok().and_then(|name| {
            let mut rows = C::PARAMETERS.iter();
            rows.find(|row| row.name == name)
        });
        let row = row.ok_or(Status::UnknownParameter)?;
        let value = value(&row.range, setting.value).ok_or(Status::OutOfRange)?;
        let set = config.set_parameter(row.name, value);
        set.map_err(|_| Status::OutOfRange)?;
    }
    Ok(())
}

/// Numbers as this range takes them; `None`: it takes words.
fn value(range: &Range, numbers: [Real; 3]) -> Option<Value<Real>> {
    let [number, second, _] = numbers;
    Some(match range {
        Range::From(..) | Range::Above(..) => Value::Number(number),
        Range::Vector(_) => Value::Vector(numbers),
        Range::Pair(..) => Value::Pair([number, second]),
        Range::Optional(inner) => return value(inner, numbers),
        Range::Flag => Value::Flag(number > 0.5),
        Range::Count(_) if (0.0..=1e9).contains(&number) => Value::Count(number as u32),
        Range::Count(_) | Range::Words(_) | Range::Described(_) => return None,
    })
}

/// The vector that a pointer points to.
///
/// # Safety
/// `vector` is null or points to three numbers.
pub(crate) unsafe fn vector(vector: *const Real) -> Option<nalgebra::Vector3<Real>> {
    // SAFETY: the caller says so; arrays have the alignment of their elements.
    let numbers = unsafe { vector.cast::<[Real; 3]>().as_ref() };
    numbers.map(|numbers| (*numbers).into())
}

/// Writes numbers to where a pointer points.
///
/// # Safety
/// `to` is null or points to as many numbers.
pub(crate) unsafe fn write(to: *mut Real, numbers: &[Real]) -> Status {
    if to.is_null() {
        return Status::NoFilter;
    }
    // SAFETY: the caller says so, and what is written is not there.
    unsafe { core::ptr::copy_nonoverlapping(numbers.as_ptr(), to, numbers.len()) };
    Status::Ok
}
