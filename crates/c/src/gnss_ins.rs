//! Position, velocity and attitude from an inertial unit and a receiver: body axes forward, right, down, the world north, east,
//! down of an origin that the caller chooses.

use core::mem::{align_of, size_of};

use nalgebra::Vector3;
use northing_core::geometry::rotation;
use northing_core::navigation::{GnssIns, GnssInsConfig, GnssPosition, GnssVelocity, Validity};

use crate::shared::{Innovation, Real, Setting, Status, set, vector, write};
use crate::value::{Storage, storage};

/// What the position is worth.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SolutionStatus {
    /// There is no position yet.
    Aligning = 0,
    /// Fixes come, position and velocity are good; the heading is not known yet.
    HeadingUnknown = 1,
    /// Fixes come.
    Aided = 2,
    /// No fix for a while.
    DeadReckoning = 3,
    /// No fix for too long, or too uncertain.
    Invalid = 4,
}

/// Words of its memory.
#[cfg(feature = "double")]
pub const NORTHING_GNSS_INS_WORDS: usize = 8300;
/// Words of its memory.
#[cfg(not(feature = "double"))]
pub const NORTHING_GNSS_INS_WORDS: usize = 4250;

/// The GNSS/INS. Yours to keep; copy it by assignment.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct GnssInsMemory {
    /// Its memory; nobody else's business.
    pub words: [u64; NORTHING_GNSS_INS_WORDS],
}

storage!(GnssInsMemory: GnssIns<Real>, 0x6e6f_7274_6867_6e31);

/// Makes a GNSS/INS that waits for its first samples, with parameters by name. On an error nothing is made.
///
/// # Safety
/// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
#[cfg(feature = "double")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_init(
    filter: *mut GnssInsMemory,
    settings: *const Setting,
    count: usize,
) -> Status {
    // SAFETY: the caller says so.
    unsafe { init(filter, settings, count) }
}

/// Makes a GNSS/INS that waits for its first samples, with parameters by name. On an error nothing is made.
///
/// # Safety
/// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
#[cfg(not(feature = "double"))]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_init_float(
    filter: *mut GnssInsMemory,
    settings: *const Setting,
    count: usize,
) -> Status {
    // SAFETY: the caller says so.
    unsafe { init(filter, settings, count) }
}

/// # Safety
/// As of the functions above.
unsafe fn init(filter: *mut GnssInsMemory, settings: *const Setting, count: usize) -> Status {
    // SAFETY: the caller says so; any bits are words.
    let Some(storage) = (unsafe { filter.as_mut() }) else {
        return Status::NoFilter;
    };
    let mut config = GnssInsConfig::default();
    // SAFETY: the caller says so.
    if let Err(status) = unsafe { set(&mut config, settings, count) } {
        return status;
    }
    match GnssIns::new(config) {
        Ok(made) => {
            storage.put(made);
            Status::Ok
        }
        Err(_) => Status::OutOfRange,
    }
}

/// Takes an angular rate, rad/s, and a specific force, m/s^2, of one stamp.
///
/// # Safety
/// `filter` is null or points to a structure; the others are null or point to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_imu(
    filter: *mut GnssInsMemory,
    time_ns: i64,
    rate: *const Real,
    force: *const Real,
) -> Status {
    // SAFETY: the caller says so.
    let (storage, rate, force) = unsafe { (filter.as_mut(), vector(rate), vector(force)) };
    let ins = storage.and_then(Storage::filter_mut);
    let Some(((ins, rate), force)) = ins.zip(rate).zip(force) else {
        return Status::NoFilter;
    };
    match ins.imu(time_ns, &rate, &force) {
        Ok(()) => Status::Ok,
        Err(_) => Status::Skipped,
    }
}

/// Takes a position, m north, east, down of the origin, with its standard deviations, above 0. Without a height down is NaN. Tells what
/// it told horizontally; what it told vertically is written to `vertical`, unless that is null.
///
/// # Safety
/// `filter` is null or points to a structure; `ned` and `std` are null or point to three numbers, `vertical` to a structure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_position(
    filter: *mut GnssInsMemory,
    time_ns: i64,
    ned: *const Real,
    std: *const Real,
    vertical: *mut Innovation,
) -> Innovation {
    // SAFETY: the caller says so.
    let (storage, ned, std) = unsafe { (filter.as_mut(), vector(ned), vector(std)) };
    let ins = storage.and_then(Storage::filter_mut);
    let Some(((ins, ned), std)) = ins.zip(ned).zip(std) else {
        return Innovation::NONE;
    };
    let told = ins.gnss_position(time_ns, &fix(ned, std));
    // SAFETY: the caller says so.
    if let Some(vertical) = unsafe { vertical.as_mut() } {
        *vertical = (&told.vertical).into();
    }
    (&told.horizontal).into()
}

/// A fix; without a height where down is NaN.
fn fix(mut ned: Vector3<Real>, mut std: Vector3<Real>) -> GnssPosition<Real> {
    let has_height = !ned.z.is_nan();
    if !has_height {
        // Numbers that pass for some, and are not looked at.
        (ned.z, std.z) = (0.0, std.x);
    }
    GnssPosition {
        has_height,
        ..GnssPosition::new(ned, std)
    }
}

/// Takes a velocity over ground, m/s north, east, down, with its standard deviations, above 0. Tells what it told.
///
/// # Safety
/// `filter` is null or points to a structure; the others are null or point to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_velocity(
    filter: *mut GnssInsMemory,
    time_ns: i64,
    ned: *const Real,
    std: *const Real,
) -> Innovation {
    // SAFETY: the caller says so.
    let (storage, ned, std) = unsafe { (filter.as_mut(), vector(ned), vector(std)) };
    let ins = storage.and_then(Storage::filter_mut);
    match ins.zip(ned).zip(std) {
        Some(((ins, ned), std)) => {
            (&ins.gnss_velocity(time_ns, &GnssVelocity::new(ned, std))).into()
        }
        None => Innovation::NONE,
    }
}

/// Takes a true heading of the forward axis, rad clockwise from north, with its standard deviation. Tells what it told.
///
/// # Safety
/// `filter` is null or points to a structure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_heading(
    filter: *mut GnssInsMemory,
    time_ns: i64,
    heading: Real,
    std: Real,
) -> Innovation {
    // SAFETY: the caller says so.
    match (unsafe { filter.as_mut() }).and_then(Storage::filter_mut) {
        Some(ins) => (&ins.heading(time_ns, heading, std)).into(),
        None => Innovation::NONE,
    }
}

/// Takes a magnetic field, microtesla, body axes. Tells what it told.
///
/// # Safety
/// `filter` is null or points to a structure; `field` is null or points to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_magnetometer(
    filter: *mut GnssInsMemory,
    time_ns: i64,
    field: *const Real,
) -> Innovation {
    // SAFETY: the caller says so.
    let (storage, field) = unsafe { (filter.as_mut(), vector(field)) };
    match storage.and_then(Storage::filter_mut).zip(field) {
        Some((ins, field)) => (&ins.magnetometer(time_ns, &field)).into(),
        None => Innovation::NONE,
    }
}

/// What the position is worth; of a structure without a filter: aligning.
///
/// # Safety
/// `filter` is null or points to a structure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_solution_status(
    filter: *const GnssInsMemory,
) -> SolutionStatus {
    // SAFETY: the caller says so.
    let ins = (unsafe { filter.as_ref() }).and_then(Storage::filter);
    match ins.map_or(Validity::Aligning, GnssIns::validity) {
        Validity::Aligning => SolutionStatus::Aligning,
        Validity::HeadingUnknown => SolutionStatus::HeadingUnknown,
        Validity::Aided => SolutionStatus::Aided,
        Validity::DeadReckoning => SolutionStatus::DeadReckoning,
        Validity::Invalid => SolutionStatus::Invalid,
    }
}

/// Writes position (m) and velocity (m/s), north, east, down, and their standard deviations; each may be null.
///
/// # Safety
/// `filter` is null or points to a structure; the others are null or point to three numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_solution(
    filter: *const GnssInsMemory,
    position: *mut Real,
    position_std: *mut Real,
    velocity: *mut Real,
    velocity_std: *mut Real,
) -> Status {
    // SAFETY: the caller says so.
    let Some(ins) = (unsafe { filter.as_ref() }).and_then(Storage::filter) else {
        return Status::NoFilter;
    };
    let Some(state) = ins.state() else {
        return Status::Aligning;
    };
    let told: [(*mut Real, Vector3<Real>); 4] = [
        (position, state.position),
        (position_std, state.position_std()),
        (velocity, state.velocity),
        (velocity_std, state.velocity_std()),
    ];
    for (to, numbers) in told {
        if !to.is_null() {
            // SAFETY: the caller says so.
            unsafe { write(to, numbers.as_slice()) };
        }
    }
    Status::Ok
}

/// Writes the attitude, body to north-east-down, w, x, y, z.
///
/// # Safety
/// `filter` is null or points to a structure; `quat` is null or points to four numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn northing_gnss_ins_quat(
    filter: *const GnssInsMemory,
    quat: *mut Real,
) -> Status {
    // SAFETY: the caller says so.
    let Some(ins) = (unsafe { filter.as_ref() }).and_then(Storage::filter) else {
        return Status::NoFilter;
    };
    match ins.state() {
        // SAFETY: the caller says so.
        Some(state) => unsafe { write(quat, &rotation::to_wxyz(&state.ned_from_body)) },
        None => Status::Aligning,
    }
}
