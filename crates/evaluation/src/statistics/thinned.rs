//! A series of bounded length for plots: every n-th element, n doubling whenever it is full.

/// A vector that keeps every n-th element pushed, doubling n whenever it is full.
#[derive(Debug, Clone)]
pub struct Thinned<T> {
    items: Vec<T>,
    capacity: usize,
    stride: u64,
    pushed: u64,
}

impl<T> Thinned<T> {
    /// Keeps at most `capacity` elements (at least 2).
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self {
            items: Vec::new(),
            capacity: capacity.max(2),
            stride: 1,
            pushed: 0,
        }
    }

    /// Takes the next element, or lets it pass.
    pub fn push(&mut self, item: impl FnOnce() -> T) {
        if self.pushed.is_multiple_of(self.stride) {
            if self.items.len() >= self.capacity {
                let mut keep = false;
                self.items.retain(|_| {
                    keep = !keep;
                    keep
                });
                self.stride *= 2;
            }
            if self.pushed.is_multiple_of(self.stride) {
                self.items.push(item());
            }
        }
        self.pushed += 1;
    }

    /// The elements kept, in order.
    #[must_use]
    pub fn items(&self) -> &[T] {
        &self.items
    }

    /// How many were pushed in all.
    #[must_use]
    pub const fn pushed(&self) -> u64 {
        self.pushed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_an_even_stride_and_a_bounded_length() {
        let mut kept = Thinned::new(10);
        for i in 0..1000_u64 {
            kept.push(|| i);
        }
        let steps: Vec<u64> = kept.items().windows(2).map(|w| w[1] - w[0]).collect();
        assert!(kept.items().len() <= 10 && kept.items().len() > 4);
        assert!(steps.iter().all(|s| *s == steps[0]), "{:?}", kept.items());
        assert_eq!((kept.items()[0], kept.pushed()), (0, 1000));
    }
}
