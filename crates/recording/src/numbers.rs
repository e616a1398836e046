//! A sample as a row of numbers: what columns of tables and bytes on the wire hold.
//!
//! A number that is absent is NaN. The order of a kind's numbers is the order of its columns.

use nalgebra::Vector3;

use crate::device_navigation::DeviceNavigation;
use crate::event::{
    CompassHeading, Reference, Sample, Sample as S, SensorKind, TrueHeading, WaterVelocity,
    quaternion_from_file,
};
use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};

/// The most numbers that a sample has.
pub(crate) const MOST: usize = DeviceNavigation::NUMBERS;

/// The names of the columns of each kind in a format of tables, with blanks between them.
pub(crate) type ColumnsOfKinds = [(SensorKind, &'static str); SensorKind::ALL.len()];

/// The columns of a kind in such a table.
pub(crate) fn columns(of: &ColumnsOfKinds, kind: SensorKind) -> Vec<&'static str> {
    let own = of.iter().filter(|(known, _)| *known == kind);
    own.flat_map(|(_, names)| names.split(' ')).collect()
}

/// How many numbers the samples of a kind have, and how many of them must be there.
pub(crate) const fn widths(kind: SensorKind) -> (usize, usize) {
    match kind {
        SensorKind::Pressure | SensorKind::ForwardSpeed => (1, 1),
        SensorKind::CompassHeading => (2, 2),
        SensorKind::TrueHeading | SensorKind::WaterVelocity => (2, 1),
        SensorKind::DeviceOrientation | SensorKind::Reference => (4, 4),
        SensorKind::GnssPosition | SensorKind::ReferencePosition => (9, 2),
        SensorKind::GnssVelocity => (6, 2),
        SensorKind::DeviceNavigation => (DeviceNavigation::NUMBERS, DeviceNavigation::NUMBERS),
        _ => (3, 3),
    }
}

/// The numbers of a sample and how many they are; quaternions w, x, y, z as they are inside.
pub(crate) fn numbers(sample: &Sample) -> ([f64; MOST], usize) {
    let mut row = [f64::NAN; MOST];
    let mut put = |values: &[f64]| row[..values.len()].copy_from_slice(values);
    match sample {
        S::DeviceOrientation(q) | S::Reference(Reference { attitude: q, .. }) => {
            put(&[q.w, q.i, q.j, q.k]);
        }
        S::Pressure(x) | S::ForwardSpeed(x) => put(&[*x]),
        S::CompassHeading(c) => put(&[c.heading_rad, c.std_rad]),
        S::TrueHeading(h) => put(&[h.heading_rad, or_nan(h.std_rad)]),
        S::WaterVelocity(w) => put(&[w.forward_m_s, or_nan(w.starboard_m_s)]),
        S::GnssPosition(fix) | S::ReferencePosition(fix) => put(&of_position(fix)),
        S::GnssVelocity(velocity) => put(&of_velocity(velocity)),
        S::DeviceNavigation(estimate) => put(&estimate.row()),
        vector => put(vector.vector().unwrap_or_default().as_slice()),
    }
    (row, widths(sample.kind()).0)
}

/// The sample of a row of numbers; `scored` is for a reference. `None` when numbers are missing at
/// the end of the row.
pub(crate) fn sample(kind: SensorKind, row: &[f64], scored: bool) -> Option<Sample> {
    let row = row.get(..widths(kind).0)?;
    Some(match (kind, row) {
        (SensorKind::Pressure, [x]) => S::Pressure(*x),
        (SensorKind::ForwardSpeed, [x]) => S::ForwardSpeed(*x),
        (SensorKind::CompassHeading, [heading_rad, std_rad]) => S::CompassHeading(CompassHeading {
            heading_rad: *heading_rad,
            std_rad: *std_rad,
        }),
        (SensorKind::TrueHeading, [heading_rad, std]) => S::TrueHeading(TrueHeading {
            heading_rad: *heading_rad,
            std_rad: number(*std),
        }),
        (SensorKind::WaterVelocity, [forward_m_s, starboard]) => S::WaterVelocity(WaterVelocity {
            forward_m_s: *forward_m_s,
            starboard_m_s: number(*starboard),
        }),
        (SensorKind::DeviceOrientation, [w, x, y, z]) => {
            S::DeviceOrientation(quaternion_from_file(*w, *x, *y, *z))
        }
        (SensorKind::Reference, [w, x, y, z]) => S::Reference(Reference {
            attitude: quaternion_from_file(*w, *x, *y, *z),
            scored,
        }),
        (SensorKind::GnssPosition, row) => S::GnssPosition(position(row)?),
        (SensorKind::ReferencePosition, row) => S::ReferencePosition(position(row)?),
        (SensorKind::DeviceNavigation, row) => {
            S::DeviceNavigation(DeviceNavigation::from_row(row.try_into().ok()?))
        }
        (SensorKind::GnssVelocity, [north, east, down, std @ ..]) => {
            S::GnssVelocity(GnssVelocity {
                north_m_s: *north,
                east_m_s: *east,
                down_m_s: number(*down),
                std_m_s: three(std),
            })
        }
        (kind, [x, y, z]) => return Sample::from_vector(kind, Vector3::new(*x, *y, *z)),
        _ => return None,
    })
}

fn of_position(fix: &GnssPosition) -> [f64; 9] {
    let [north, east, down] = fix.std_m.unwrap_or([f64::NAN; 3]);
    [
        fix.latitude_rad,
        fix.longitude_rad,
        or_nan(fix.height_m),
        north,
        east,
        down,
        or_nan(fix.hdop),
        or_nan(fix.satellites.map(f64::from)),
        or_nan(fix.quality.to_gga().map(f64::from)),
    ]
}

fn position(row: &[f64]) -> Option<GnssPosition> {
    let [
        latitude_rad,
        longitude_rad,
        height,
        north,
        east,
        down,
        hdop,
        satellites,
        quality,
    ] = *row
    else {
        return None;
    };
    // A float as an integer saturates: what is no small number becomes one that means nothing.
    let small = |x: f64| number(x).map(|x| x as u8);
    Some(GnssPosition {
        latitude_rad,
        longitude_rad,
        height_m: number(height),
        std_m: three(&[north, east, down]),
        hdop: number(hdop),
        satellites: small(satellites),
        quality: small(quality).map_or(GnssQuality::Unknown, GnssQuality::from_gga),
    })
}

fn of_velocity(velocity: &GnssVelocity) -> [f64; 6] {
    let [north, east, down] = velocity.std_m_s.unwrap_or([f64::NAN; 3]);
    [
        velocity.north_m_s,
        velocity.east_m_s,
        or_nan(velocity.down_m_s),
        north,
        east,
        down,
    ]
}

/// Three standard deviations, or none where one is missing.
fn three(std: &[f64]) -> Option<[f64; 3]> {
    let std: [f64; 3] = std.try_into().ok()?;
    std.iter().all(|x| !x.is_nan()).then_some(std)
}

fn number(x: f64) -> Option<f64> {
    (!x.is_nan()).then_some(x)
}

fn or_nan(x: Option<f64>) -> f64 {
    x.unwrap_or(f64::NAN)
}
