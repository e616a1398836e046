//! How a file writes its quaternions: which number is w, which way they turn vectors, and where their z axis points.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{Confidence, Found};

/// Fewer rows tell nothing.
const LEAST_ROWS: usize = 30;

/// A way to write a quaternion.
#[derive(Debug, Clone)]
pub(super) struct Writing {
    pub(super) order: &'static str,
    pub(super) direction: &'static str,
    /// Whether the world's z axis points down.
    pub(super) is_down: bool,
    pub(super) found: Found,
}

/// How steadily the accelerometer points to one end of the world's z axis: the sum of its vertical parts over its
/// length, -1 to 1.
fn vertical(rows: &[([f64; 4], Vector3<f64>)], is_scalar_last: bool, is_inverse: bool) -> f64 {
    let (mut sum, mut length) = (0.0, 0.0);
    for (q, force) in rows {
        let [w, x, y, z] = if is_scalar_last {
            [q[3], q[0], q[1], q[2]]
        } else {
            *q
        };
        let attitude = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let turned = if is_inverse {
            attitude.inverse() * force
        } else {
            attitude * force
        };
        sum += turned.z;
        length += force.norm();
    }
    sum / length
}

impl Writing {
    /// Of the rows of a file: the four numbers as they stand (w first where their names say so) and the specific force.
    /// The right way turns the force to the vertical at all times; where the device hardly turned all ways do. `has_force` says
    /// whether any of the tables has an accelerometer on the clock of these rows.
    pub(super) fn of(rows: &[([f64; 4], Vector3<f64>)], is_ordered: bool, has_force: bool) -> Self {
        const WAYS: [(bool, bool); 4] =
            [(false, false), (false, true), (true, false), (true, true)];
        let told = |is_last: bool| if is_last { "xyzw" } else { "wxyz" };
        let turned = |is_inverse: bool| {
            if is_inverse {
                "world-to-body"
            } else {
                "body-to-world"
            }
        };
        let mut ways: Vec<(f64, bool, bool)> = WAYS
            .into_iter()
            .filter(|(is_last, _)| !(is_ordered && *is_last))
            .map(|(last, inverse)| (vertical(rows, last, inverse), last, inverse))
            .collect();
        ways.sort_by(|(a, ..), (b, ..)| b.abs().total_cmp(&a.abs()));
        let ((share, last, inverse), (next, ..)) = (ways[0], ways[1]);
        let is_clear =
            rows.len() >= LEAST_ROWS && share.abs() > 0.8 && share.abs() - next.abs() > 0.02;
        if !is_clear {
            // As they are usually written; the vertical is told even by a device at rest.
            let is_down = rows.len() >= LEAST_ROWS && vertical(rows, false, false) < -0.8;
            let because = match (has_force, rows.len() >= LEAST_ROWS) {
                (false, _) => "no table has an accelerometer on its clock".to_owned(),
                (true, false) => {
                    "the accelerometer has samples at fewer than 30 of its times".to_owned()
                }
                (true, true) => format!(
                    "the best way turns the accelerometer to the vertical for {:.1} % of its length, the next best for {:.1} %",
                    100.0 * share.abs(),
                    100.0 * next.abs()
                ),
            };
            let why = format!(
                "it cannot be told which way it turns vectors: {because}; w first, body to world and z {} are taken",
                if is_down { "down" } else { "up" }
            );
            return Self {
                order: told(false),
                direction: turned(false),
                is_down,
                found: Found::new(why, Confidence::Assumed),
            };
        }
        let why = format!(
            "turned so the accelerometer points {} for {:.1} % of its length ({:.1} % the next best way)",
            if share < 0.0 {
                "to minus z, so z is down,"
            } else {
                "to plus z, so z is up,"
            },
            100.0 * share.abs(),
            100.0 * next.abs()
        );
        Self {
            order: told(last),
            direction: turned(inverse),
            is_down: share < 0.0,
            found: Found::new(why, Confidence::Likely),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_direction_and_the_vertical_are_told_by_gravity() {
        for down in [false, true] {
            let up = if down { -9.81 } else { 9.81 };
            let rows: Vec<(UnitQuaternion<f64>, Vector3<f64>)> = (0..500)
                .map(|k| {
                    let t = f64::from(k) * 0.05;
                    let attitude =
                        UnitQuaternion::from_euler_angles(t.sin(), 0.7 * (0.3 * t).sin(), t);
                    (attitude, attitude.inverse() * Vector3::new(0.0, 0.0, up))
                })
                .collect();
            let made = |last: bool, inverse: bool| -> Vec<([f64; 4], Vector3<f64>)> {
                let row = |(q, force): &(UnitQuaternion<f64>, Vector3<f64>)| {
                    let q = if inverse { q.inverse() } else { *q };
                    let [x, y, z, w]: [f64; 4] = q.coords.into();
                    (if last { [x, y, z, w] } else { [w, x, y, z] }, *force)
                };
                rows.iter().map(row).collect()
            };
            for (last, inverse) in [(false, false), (false, true), (true, false), (true, true)] {
                let found = Writing::of(&made(last, inverse), !last, true);
                assert_eq!(found.order, if last { "xyzw" } else { "wxyz" });
                assert_eq!(found.direction == "world-to-body", inverse);
                assert_eq!(found.is_down, down);
                assert_eq!(found.found.confidence, Confidence::Likely);
            }
        }
    }

    #[test]
    fn at_rest_it_is_assumed_and_said() {
        let rows = vec![([1.0, 0.0, 0.0, 0.0], Vector3::new(0.0, 0.0, -9.81)); 100];
        let found = Writing::of(&rows, true, true);
        assert_eq!(found.found.confidence, Confidence::Assumed);
        assert!(found.is_down);
        assert!(found.found.why.contains("z down"), "{}", found.found.why);
        assert!(!found.found.why.contains("no table has"));
        let alone = Writing::of(&[], true, false);
        assert!(alone.found.why.contains("no table has an accelerometer"));
    }
}
