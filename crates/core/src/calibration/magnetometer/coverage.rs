//! Which directions of the sphere have been seen: a picture for the user, and a reason to refuse.
//!
//! 72 cells of equal area: six slices of equal height (Archimedes: they have equal area), each cut
//! into twelve sectors. A cell is about 24 degrees wide.

use nalgebra::Vector3;

use crate::scalar::{Scalar, lit};

/// Slices along the z axis.
pub const SLICES: usize = 6;

/// Sectors about the z axis.
pub const SECTORS: usize = 12;

/// Number of cells.
pub const CELLS: usize = SLICES * SECTORS;

/// The cells of the sphere, how often each was seen, and one sample of each.
///
/// Directions are those of `sample - centre`, in body axes: of the field, as the device sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coverage<T: Scalar> {
    centre: Vector3<T>,
    counts: [u16; CELLS],
    /// The first sample of each cell, to sort again when a better centre is known.
    examples: [Vector3<T>; CELLS],
}

impl<T: Scalar> Coverage<T> {
    /// Nothing seen, directions counted from `centre`.
    pub(super) fn new(centre: Vector3<T>) -> Self {
        Self {
            centre,
            counts: [0; CELLS],
            examples: [Vector3::zeros(); CELLS],
        }
    }

    pub(super) fn centre(&self) -> Vector3<T> {
        self.centre
    }

    pub(super) fn add(&mut self, sample: &Vector3<T>) {
        let Some(cell) = cell_of(&(sample - self.centre)) else {
            return;
        };
        if let (Some(count), Some(example)) =
            (self.counts.get_mut(cell), self.examples.get_mut(cell))
        {
            if *count == 0 {
                *example = *sample;
            }
            *count = count.saturating_add(1);
        }
    }

    /// The same about another centre. Only one sample a cell is known, so two may fall into one,
    /// and counts begin again.
    pub(super) fn about(&self, centre: Vector3<T>) -> Self {
        let mut sorted = Self::new(centre);
        for (count, example) in self.counts.iter().zip(&self.examples) {
            if *count > 0 {
                sorted.add(example);
            }
        }
        sorted
    }

    /// Samples seen in each cell, up to 65535; cell `slice * SECTORS + sector`.
    pub fn counts(&self) -> &[u16; CELLS] {
        &self.counts
    }

    /// Number of cells seen.
    pub fn covered(&self) -> usize {
        self.counts.iter().filter(|count| **count > 0).count()
    }

    /// Share of the sphere seen, 0 to 1.
    pub fn share(&self) -> T {
        lit::<T>(self.covered() as f64) / lit::<T>(CELLS as f64)
    }

    /// The middle (unit vector) of the unseen cell that is farthest from every seen one: where to
    /// turn next, so that the field comes from there. `None` when all or none are seen.
    pub fn widest_gap(&self) -> Option<Vector3<T>> {
        let mut widest = None;
        let mut widest_cosine = lit::<T>(2.0);
        for (cell, _) in self
            .counts
            .iter()
            .enumerate()
            .filter(|(_, count)| **count == 0)
        {
            let direction = cell_direction::<T>(cell);
            let nearest_cosine = self.nearest_cosine(&direction)?;
            if nearest_cosine < widest_cosine {
                (widest, widest_cosine) = (Some(direction), nearest_cosine);
            }
        }
        widest
    }

    /// Cosine of the angle to the nearest cell seen; `None` when none is.
    fn nearest_cosine(&self, direction: &Vector3<T>) -> Option<T> {
        let seen = self
            .counts
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0);
        let cosines = seen.map(|(cell, _)| cell_direction::<T>(cell).dot(direction));
        cosines.reduce(|a, b| a.max(b))
    }
}

/// The cell in which a direction of any length lies; `None` when it is zero or not finite.
pub fn cell_of<T: Scalar>(direction: &Vector3<T>) -> Option<usize> {
    let norm = direction.norm();
    if !(norm > T::zero() && norm.is_finite()) {
        return None;
    }
    let height = (direction.z / norm + T::one()) * lit(0.5);
    let turn = direction.y.atan2(direction.x) / T::two_pi() + lit(0.5);
    Some(step(height, SLICES) * SECTORS + step(turn, SECTORS))
}

/// In which of `parts` equal parts of 0 to 1 a value lies.
fn step<T: Scalar>(value: T, parts: usize) -> usize {
    let bounds = 1..parts;
    bounds
        .filter(|k| value >= lit::<T>(*k as f64) / lit::<T>(parts as f64))
        .count()
}

/// The middle of a cell as a unit vector, for pictures. A number beyond [`CELLS`] counts from zero
/// again.
pub fn cell_direction<T: Scalar>(cell: usize) -> Vector3<T> {
    let (slice, sector) = ((cell / SECTORS) % SLICES, cell % SECTORS);
    let middle = |k: usize, parts: usize| lit::<T>((k as f64 + 0.5) / parts as f64);
    let z = middle(slice, SLICES) * lit(2.0) - T::one();
    let angle = (middle(sector, SECTORS) - lit(0.5)) * T::two_pi();
    let across = (T::one() - z * z).sqrt();
    Vector3::new(across * angle.cos(), across * angle.sin(), z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    #[test]
    fn the_middle_of_a_cell_lies_in_it() {
        for cell in 0..CELLS {
            let direction = cell_direction::<f64>(cell);
            assert!((direction.norm() - 1.0).abs() < 1e-12);
            assert_eq!(cell_of(&direction), Some(cell));
            assert_eq!(cell_of(&(cell_direction::<f32>(cell) * 40.0)), Some(cell));
        }
        assert_eq!(cell_of(&Vector3::<f64>::zeros()), None);
        assert_eq!(cell_of(&Vector3::new(f64::NAN, 1.0, 0.0)), None);
    }

    /// 72000 directions: 1000 a cell, standard deviation 31.
    #[test]
    fn cells_are_equally_large() {
        let mut rng = Pcg64::seed_from_u64(0xC0_7E6A);
        let mut coverage = Coverage::new(Vector3::new(1.0, 2.0, 3.0));
        for _ in 0..72_000 {
            let direction = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            coverage.add(&(coverage.centre() + direction));
        }
        assert!(coverage.counts().iter().all(|n| n.abs_diff(1000) < 150));
        assert!((coverage.share() - 1.0).abs() < 1e-12 && coverage.widest_gap().is_none());
    }

    #[test]
    fn the_widest_gap_is_opposite_to_a_single_direction() {
        let mut coverage = Coverage::new(Vector3::<f64>::zeros());
        assert_eq!((coverage.covered(), coverage.widest_gap()), (0, None));
        coverage.add(&cell_direction(20));
        let gap = coverage.widest_gap().unwrap();
        assert!(gap.dot(&cell_direction(20)) < -0.95);
        assert_eq!(coverage.covered(), 1);
    }

    /// Seen from a point on the sphere all directions lie in one half; about the centre in all.
    #[test]
    fn sorting_about_another_centre_moves_the_directions() {
        let mut coverage = Coverage::new(Vector3::new(0.0, 0.0, -1.0));
        (0..CELLS).for_each(|cell| coverage.add(&cell_direction::<f64>(cell)));
        assert!(coverage.covered() <= CELLS / 2);
        let sorted = coverage.about(Vector3::zeros());
        assert!(sorted.covered() >= coverage.covered() * 3 / 4);
        let below = sorted.counts()[..CELLS / 2].iter().any(|n| *n > 0);
        assert!(below, "the lower half is seen");
    }
}
