//! Attitude sample by sample: `mekf` for a bench, `bounded-velocity` for what people carry.

use core::ffi::c_int;
use core::mem::{align_of, size_of};

use northing_core::attitude::{
    AttitudeConfig, AttitudeDriver, AttitudeEstimator, BoundedVelocity, BoundedVelocityConfig,
    DriverConfig, Mekf, Propagation,
};
use northing_core::geometry::rotation;

use crate::shared::{Innovation, Real, Setting, Status, set, vector, write};
use crate::value::{Storage, storage};

/// What the parameters start from. Functions take it as a number: one that is none of these is refused as out of range.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Profile {
    /// Carried by people.
    HandHeld = 0,
    /// On a bench.
    Lab = 1,
}

impl Profile {
    /// The one of this number.
    fn of(number: c_int) -> Option<Self> {
        let mut all = [Self::HandHeld, Self::Lab].into_iter();
        all.find(|profile| *profile as c_int == number)
    }
}

/// Words of the memory of each filter.
#[cfg(feature = "double")]
pub const NORTHING_MEKF_WORDS: usize = 1140;
/// Words of the memory of each filter.
#[cfg(not(feature = "double"))]
pub const NORTHING_MEKF_WORDS: usize = 620;
/// Words of the memory of each filter.
#[cfg(feature = "double")]
pub const NORTHING_BOUNDED_VELOCITY_WORDS: usize = 2040;
/// Words of the memory of each filter.
#[cfg(not(feature = "double"))]
pub const NORTHING_BOUNDED_VELOCITY_WORDS: usize = 1080;

/// The multiplicative extended Kalman filter: attitude and gyroscope bias. Yours to keep; copy it by assignment.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct MekfMemory {
    /// Its memory; nobody else's business.
    pub words: [u64; NORTHING_MEKF_WORDS],
}

storage!(MekfMemory: AttitudeDriver<Real, Mekf<Real>>, 0x6e6f_7274_6865_6d31);

/// The bounded-velocity filter: for phones and wearables. Yours to keep; copy it by assignment.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct BoundedVelocityMemory {
    /// Its memory; nobody else's business.
    pub words: [u64; NORTHING_BOUNDED_VELOCITY_WORDS],
}

storage!(BoundedVelocityMemory: AttitudeDriver<Real, BoundedVelocity<Real>>, 0x6e6f_7274_6865_6231);

/// A driver that takes a sample, if both are there.
fn driver<S: Storage, T>(
    storage: Option<&mut S>,
    sample: Option<T>,
) -> Option<(&mut S::Filter, T)> {
    storage.and_then(Storage::filter_mut).zip(sample)
}

fn gyroscope<E: AttitudeEstimator<Real>>(
    fed: Option<(&mut AttitudeDriver<Real, E>, nalgebra::Vector3<Real>)>,
    time_ns: i64,
) -> Status {
    let Some((driver, rate)) = fed else {
        return Status::NoFilter;
    };
    match driver.gyroscope(time_ns, &rate) {
        Propagation::Done => Status::Ok,
        Propagation::Skipped(_) if !driver.is_started() => Status::Aligning,
        Propagation::Skipped(_) => Status::Skipped,
    }
}

fn quat<E: AttitudeEstimator<Real>>(
    driver: Option<&AttitudeDriver<Real, E>>,
) -> Result<[Real; 4], Status> {
    let attitude = driver.ok_or(Status::NoFilter)?.attitude();
    attitude
        .map(|attitude| rotation::to_wxyz(&attitude))
        .ok_or(Status::Aligning)
}

fn covariance<E: AttitudeEstimator<Real>>(
    driver: Option<&AttitudeDriver<Real, E>>,
) -> Result<nalgebra::Matrix3<Real>, Status> {
    let driver = driver.ok_or(Status::NoFilter)?;
    if !driver.is_started() {
        return Err(Status::Aligning);
    }
    let covariance = driver.attitude_covariance();
    covariance.map(|p| p.transpose()).ok_or(Status::NotStated)
}

fn gyroscope_bias<E: AttitudeEstimator<Real>>(
    driver: Option<&AttitudeDriver<Real, E>>,
) -> Result<nalgebra::Vector3<Real>, Status> {
    let driver = driver.ok_or(Status::NoFilter)?;
    if !driver.is_started() {
        return Err(Status::Aligning);
    }
    driver
        .gyroscope_bias()
        .map(|(bias, _)| bias)
        .ok_or(Status::NotStated)
}

/// Makes a filter that waits for its first samples, with a profile and parameters by name. On an error nothing is made.
///
/// # Safety
/// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
#[cfg(feature = "double")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_mekf_init(
    filter: *mut MekfMemory,
    profile: c_int,
    settings: *const Setting,
    count: usize,
) -> Status {
    // SAFETY: the caller says so.
    unsafe { init_mekf(filter, profile, settings, count) }
}

/// Makes a filter that waits for its first samples, with a profile and parameters by name. On an error nothing is made.
///
/// # Safety
/// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
#[cfg(not(feature = "double"))]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_mekf_init_float(
    filter: *mut MekfMemory,
    profile: c_int,
    settings: *const Setting,
    count: usize,
) -> Status {
    // SAFETY: the caller says so.
    unsafe { init_mekf(filter, profile, settings, count) }
}

/// # Safety
/// As of the functions above.
unsafe fn init_mekf(
    filter: *mut MekfMemory,
    profile: c_int,
    settings: *const Setting,
    count: usize,
) -> Status {
    // SAFETY: the caller says so; any bits are words.
    let Some(storage) = (unsafe { filter.as_mut() }) else {
        return Status::NoFilter;
    };
    let mut config = match Profile::of(profile) {
        Some(Profile::HandHeld) => AttitudeConfig::hand_held(),
        Some(Profile::Lab) => AttitudeConfig::lab(),
        None => return Status::OutOfRange,
    };
    // SAFETY: the caller says so.
    if let Err(status) = unsafe { set(&mut config, settings, count) } {
        return status;
    }
    match Mekf::new(config) {
        Ok(made) => {
            storage.put(AttitudeDriver::new(made, DriverConfig::default()));
            Status::Ok
        }
        Err(_) => Status::OutOfRange,
    }
}

/// Takes an angular rate, rad/s, body axes.
///
/// # Safety
/// `filter` is null or points to a structure; `rate` is null or points to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_mekf_gyroscope(
    filter: *mut MekfMemory,
    time_ns: i64,
    rate: *const Real,
) -> Status {
    // SAFETY: the caller says so.
    gyroscope(unsafe { driver(filter.as_mut(), vector(rate)) }, time_ns)
}

/// Takes a specific force, m/s^2, body axes: at rest +9.81 on the axis that points up. Tells what it told.
///
/// # Safety
/// `filter` is null or points to a structure; `force` is null or points to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_mekf_accelerometer(
    filter: *mut MekfMemory,
    time_ns: i64,
    force: *const Real,
) -> Innovation {
    // SAFETY: the caller says so.
    let fed = unsafe { driver(filter.as_mut(), vector(force)) };
    fed.map_or(Innovation::NONE, |(driver, force)| {
        (&driver.accelerometer(time_ns, &force)).into()
    })
}

/// Takes a magnetic field, microtesla, body axes. Tells what it told.
///
/// # Safety
/// `filter` is null or points to a structure; `field` is null or points to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_mekf_magnetometer(
    filter: *mut MekfMemory,
    time_ns: i64,
    field: *const Real,
) -> Innovation {
    // SAFETY: the caller says so.
    let fed = unsafe { driver(filter.as_mut(), vector(field)) };
    fed.map_or(Innovation::NONE, |(driver, field)| {
        (&driver.magnetometer(time_ns, &field)).into()
    })
}

/// Writes the attitude, body to east-north-up, w, x, y, z.
///
/// # Safety
/// `filter` is null or points to a structure; `to` is null or points to four numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_mekf_quat(filter: *const MekfMemory, to: *mut Real) -> Status {
    // SAFETY: the caller says so.
    match quat(unsafe { filter.as_ref() }.and_then(Storage::filter)) {
        // SAFETY: the caller says so.
        Ok(numbers) => unsafe { write(to, &numbers) },
        Err(status) => status,
    }
}

/// Writes the covariance of the local attitude error in body axes, rad^2, row by row.
///
/// # Safety
/// `filter` is null or points to a structure; `to` is null or points to nine numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_mekf_covariance(
    filter: *const MekfMemory,
    to: *mut Real,
) -> Status {
    // SAFETY: the caller says so.
    match covariance(unsafe { filter.as_ref() }.and_then(Storage::filter)) {
        // SAFETY: the caller says so.
        Ok(rows) => unsafe { write(to, rows.as_slice()) },
        Err(status) => status,
    }
}

/// Writes the gyroscope bias, rad/s.
///
/// # Safety
/// `filter` is null or points to a structure; `to` is null or points to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_mekf_gyroscope_bias(
    filter: *const MekfMemory,
    to: *mut Real,
) -> Status {
    // SAFETY: the caller says so.
    match gyroscope_bias(unsafe { filter.as_ref() }.and_then(Storage::filter)) {
        // SAFETY: the caller says so.
        Ok(bias) => unsafe { write(to, bias.as_slice()) },
        Err(status) => status,
    }
}

/// Makes a filter that waits for its first samples, with a profile and parameters by name. On an error nothing is made.
///
/// # Safety
/// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
#[cfg(feature = "double")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_bounded_velocity_init(
    filter: *mut BoundedVelocityMemory,
    profile: c_int,
    settings: *const Setting,
    count: usize,
) -> Status {
    // SAFETY: the caller says so.
    unsafe { init_bounded_velocity(filter, profile, settings, count) }
}

/// Makes a filter that waits for its first samples, with a profile and parameters by name. On an error nothing is made.
///
/// # Safety
/// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
#[cfg(not(feature = "double"))]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_bounded_velocity_init_float(
    filter: *mut BoundedVelocityMemory,
    profile: c_int,
    settings: *const Setting,
    count: usize,
) -> Status {
    // SAFETY: the caller says so.
    unsafe { init_bounded_velocity(filter, profile, settings, count) }
}

/// # Safety
/// As of the functions above.
unsafe fn init_bounded_velocity(
    filter: *mut BoundedVelocityMemory,
    profile: c_int,
    settings: *const Setting,
    count: usize,
) -> Status {
    // SAFETY: the caller says so; any bits are words.
    let Some(storage) = (unsafe { filter.as_mut() }) else {
        return Status::NoFilter;
    };
    let mut config = match Profile::of(profile) {
        Some(Profile::HandHeld) => BoundedVelocityConfig::hand_held(),
        Some(Profile::Lab) => BoundedVelocityConfig::lab(),
        None => return Status::OutOfRange,
    };
    // SAFETY: the caller says so.
    if let Err(status) = unsafe { set(&mut config, settings, count) } {
        return status;
    }
    match BoundedVelocity::new(config) {
        Ok(made) => {
            storage.put(AttitudeDriver::new(made, DriverConfig::default()));
            Status::Ok
        }
        Err(_) => Status::OutOfRange,
    }
}

/// Takes an angular rate, rad/s, body axes.
///
/// # Safety
/// `filter` is null or points to a structure; `rate` is null or points to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_bounded_velocity_gyroscope(
    filter: *mut BoundedVelocityMemory,
    time_ns: i64,
    rate: *const Real,
) -> Status {
    // SAFETY: the caller says so.
    gyroscope(unsafe { driver(filter.as_mut(), vector(rate)) }, time_ns)
}

/// Takes a specific force, m/s^2, body axes: at rest +9.81 on the axis that points up. Tells what it told.
///
/// # Safety
/// `filter` is null or points to a structure; `force` is null or points to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_bounded_velocity_accelerometer(
    filter: *mut BoundedVelocityMemory,
    time_ns: i64,
    force: *const Real,
) -> Innovation {
    // SAFETY: the caller says so.
    let fed = unsafe { driver(filter.as_mut(), vector(force)) };
    fed.map_or(Innovation::NONE, |(driver, force)| {
        (&driver.accelerometer(time_ns, &force)).into()
    })
}

/// Takes a magnetic field, microtesla, body axes. Tells what it told.
///
/// # Safety
/// `filter` is null or points to a structure; `field` is null or points to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_bounded_velocity_magnetometer(
    filter: *mut BoundedVelocityMemory,
    time_ns: i64,
    field: *const Real,
) -> Innovation {
    // SAFETY: the caller says so.
    let fed = unsafe { driver(filter.as_mut(), vector(field)) };
    fed.map_or(Innovation::NONE, |(driver, field)| {
        (&driver.magnetometer(time_ns, &field)).into()
    })
}

/// Writes the attitude, body to east-north-up, w, x, y, z.
///
/// # Safety
/// `filter` is null or points to a structure; `to` is null or points to four numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_bounded_velocity_quat(
    filter: *const BoundedVelocityMemory,
    to: *mut Real,
) -> Status {
    // SAFETY: the caller says so.
    match quat(unsafe { filter.as_ref() }.and_then(Storage::filter)) {
        // SAFETY: the caller says so.
        Ok(numbers) => unsafe { write(to, &numbers) },
        Err(status) => status,
    }
}

/// Writes the covariance of the local attitude error in body axes, rad^2, row by row.
///
/// # Safety
/// `filter` is null or points to a structure; `to` is null or points to nine numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_bounded_velocity_covariance(
    filter: *const BoundedVelocityMemory,
    to: *mut Real,
) -> Status {
    // SAFETY: the caller says so.
    match covariance(unsafe { filter.as_ref() }.and_then(Storage::filter)) {
        // SAFETY: the caller says so.
        Ok(rows) => unsafe { write(to, rows.as_slice()) },
        Err(status) => status,
    }
}

/// Writes the gyroscope bias, rad/s.
///
/// # Safety
/// `filter` is null or points to a structure; `to` is null or points to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_bounded_velocity_gyroscope_bias(
    filter: *const BoundedVelocityMemory,
    to: *mut Real,
) -> Status {
    // SAFETY: the caller says so.
    match gyroscope_bias(unsafe { filter.as_ref() }.and_then(Storage::filter)) {
        // SAFETY: the caller says so.
        Ok(bias) => unsafe { write(to, bias.as_slice()) },
        Err(status) => status,
    }
}
