//! Filters as values in C's memory: a structure of words that is large enough, whose first word says that a filter is in it.
//!
//! Filters own nothing and have no destructor, so whoever copies the structure copies the filter, and saves it with that.

use core::mem::{align_of, size_of, size_of_val};

/// Memory of so many words for a filter, as C sees it.
pub(crate) trait Storage {
    /// What is kept in it.
    type Filter: Copy;
    /// The number that says that it is: one a kind, so that one filter is not taken for another.
    const MAGIC: u64;

    /// The words.
    fn words(&self) -> &[u64];

    /// The same, to be written.
    fn words_mut(&mut self) -> &mut [u64];

    /// The filter, if there is one.
    fn filter(&self) -> Option<&Self::Filter> {
        let (first, rest) = self.words().split_first()?;
        let is_there = *first == Self::MAGIC && fits::<Self::Filter>(rest);
        // SAFETY: `put` has written a filter of this type to these words, which are long enough and aligned for it.
        is_there.then(|| unsafe { &*rest.as_ptr().cast::<Self::Filter>() })
    }

    /// The same, to be fed.
    fn filter_mut(&mut self) -> Option<&mut Self::Filter> {
        let (first, rest) = self.words_mut().split_first_mut()?;
        let is_there = *first == Self::MAGIC && fits::<Self::Filter>(rest);
        // SAFETY: as above, and the borrow is exclusive.
        is_there.then(|| unsafe { &mut *rest.as_mut_ptr().cast::<Self::Filter>() })
    }

    /// Puts a filter in.
    fn put(&mut self, filter: Self::Filter) {
        let Some((first, rest)) = self.words_mut().split_first_mut() else {
            return;
        };
        if fits::<Self::Filter>(rest) {
            // SAFETY: the words are long enough and aligned for it.
            unsafe { rest.as_mut_ptr().cast::<Self::Filter>().write(filter) };
            *first = Self::MAGIC;
        }
    }
}

/// Whether the words are long enough and aligned for a filter.
const fn fits<F>(words: &[u64]) -> bool {
    size_of::<F>() <= size_of_val(words) && align_of::<F>() <= align_of::<u64>()
}

/// Lets a structure of words hold a filter.
macro_rules! storage {
    ($name:ident: $filter:ty, $magic:literal) => {
        const _: () = assert!(
            size_of::<$filter>() + size_of::<u64>() <= size_of::<$name>()
                && align_of::<$filter>() <= align_of::<u64>(),
            "the memory of a filter is too small"
        );

        impl $crate::value::Storage for $name {
            type Filter = $filter;
            const MAGIC: u64 = $magic;

            fn words(&self) -> &[u64] {
                &self.words
            }

            fn words_mut(&mut self) -> &mut [u64] {
                &mut self.words
            }
        }
    };
}
pub(crate) use storage;
