//! Axes of a sensor in another order and with other signs, as a manifest writes them: `x,-y,z`.

use std::fmt;
use std::str::FromStr;

use nalgebra::Vector3;

const NAMES: [&str; 3] = ["x", "y", "z"];

/// Of each axis of the body the axis of the file that it is, and its sign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SignedAxes([(usize, f64); 3]);

impl SignedAxes {
    /// As they stand in the file.
    pub(crate) const AS_THEY_ARE: Self = Self([(0, 1.0), (1, 1.0), (2, 1.0)]);
    /// All with the opposite sign.
    pub(crate) const REVERSED: Self = Self([(0, -1.0), (1, -1.0), (2, -1.0)]);

    /// All 48, as they are first. Half of them are left-handed.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        const ORDERS: [[usize; 3]; 6] = [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [1, 2, 0],
            [2, 0, 1],
            [2, 1, 0],
        ];
        ORDERS.into_iter().flat_map(|order| {
            (0..8_u8).map(move |signs| {
                let sign = |axis: usize| if signs >> axis & 1 == 1 { -1.0 } else { 1.0 };
                Self([0, 1, 2].map(|axis| (order[axis], sign(axis))))
            })
        })
    }

    /// Of each axis of the body the axis of the file (0 to 2), and its sign.
    pub(crate) const fn by_body_axis(self) -> [(usize, f64); 3] {
        self.0
    }

    /// A vector of the file along the axes of the body.
    pub(crate) fn of(self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from(self.0.map(|(axis, sign)| sign * v[axis]))
    }
}

impl fmt::Display for SignedAxes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |(axis, sign): (usize, f64)| {
            let minus = if sign < 0.0 { "-" } else { "" };
            format!("{minus}{}", NAMES[axis])
        };
        f.write_str(&self.0.map(axis).join(","))
    }
}

impl FromStr for SignedAxes {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let expected = "expected each of x, y, z once, with or without a minus, e.g. \"x,-y,z\"";
        let mut axes = Self::AS_THEY_ARE.0;
        let mut used = [false; 3];
        let mut parts = text.split(',');
        for axis in &mut axes {
            let part = parts.next().ok_or(expected)?.trim();
            let (name, sign) = part
                .strip_prefix('-')
                .map_or((part, 1.0), |rest| (rest, -1.0));
            let place = NAMES.iter().position(|n| *n == name).ok_or(expected)?;
            if std::mem::replace(&mut used[place], true) {
                return Err(expected);
            }
            *axis = (place, sign);
        }
        match parts.next() {
            None => Ok(Self(axes)),
            Some(_) => Err(expected),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_different_and_read_as_they_are_written() {
        let all: Vec<SignedAxes> = SignedAxes::all().collect();
        assert_eq!((all.len(), all[0]), (48, SignedAxes::AS_THEY_ARE));
        assert!(all.contains(&SignedAxes::REVERSED));
        let v = Vector3::new(1.0, 2.0, 3.0);
        for (k, axes) in all.iter().enumerate() {
            assert_eq!(axes.to_string().parse(), Ok(*axes));
            assert!(all[..k].iter().all(|other| other.of(&v) != axes.of(&v)));
        }
    }

    #[test]
    fn words_that_are_no_axes_are_refused() {
        let axes: SignedAxes = " y, -x,z".parse().unwrap();
        let turned = axes.of(&Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(turned, Vector3::new(2.0, -1.0, 3.0));
        for text in ["", "x,y", "x,y,z,x", "x,x,z", "x,--y,z", "x,y,w", "+x,y,z"] {
            assert!(text.parse::<SignedAxes>().is_err(), "{text}");
        }
    }
}
