//! Shards: the I-th of N parts of many runs, for machines that share them.

use std::ops::Range;

/// The I-th of N parts, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Which one, from 1.
    pub index: u64,
    /// Of how many.
    pub count: u64,
}

/// A shard that there is not.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("shard `{text}`: expected {expected}")]
pub struct ShardError {
    /// What was asked for.
    pub text: String,
    /// What there is.
    pub expected: String,
}

/// What `I/N` can be.
const FROM_ONE: &str = "I/N with I from 1 to N, e.g. 1/4, and no more shards than runs";

impl Shard {
    /// All runs.
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    /// Reads `I/N`, I from 1 to N.
    ///
    /// # Errors
    /// It is not of that form, or there is no such part.
    pub fn parse(text: &str) -> Result<Self, ShardError> {
        let shard = text.split_once('/').and_then(|(index, count)| {
            let (index, count) = (index.trim().parse().ok()?, count.trim().parse().ok()?);
            (1..=count)
                .contains(&index)
                .then_some(Self { index, count })
        });
        shard.ok_or_else(|| ShardError {
            text: text.to_owned(),
            expected: FROM_ONE.to_owned(),
        })
    }

    /// The shard of an index that counts from 0, as tasks of Slurm and Kubernetes do.
    ///
    /// # Errors
    /// There are no shards, or not so many.
    pub fn from_zero(index: u64, count: u64) -> Result<Self, ShardError> {
        if index < count {
            let index = index + 1;
            return Ok(Self { index, count });
        }
        Err(ShardError {
            text: format!("index {index} of {count}"),
            expected: match count.checked_sub(1) {
                Some(last) => format!("an index from 0 to {last}"),
                None => "one shard or more".to_owned(),
            },
        })
    }

    /// The refusal of a shard in which there is no run.
    #[must_use]
    pub fn without_runs(&self) -> ShardError {
        ShardError {
            text: format!("{}/{}", self.index, self.count),
            expected: FROM_ONE.to_owned(),
        }
    }

    /// Its runs out of `runs`.
    #[must_use]
    pub fn range(&self, runs: u64) -> Range<u64> {
        let bound = |i: u64| (u128::from(runs) * u128::from(i) / u128::from(self.count)) as u64;
        bound(self.index - 1)..bound(self.index)
    }
}

#[cfg(test)]
mod tests {
    use super::Shard;

    #[test]
    fn indices_from_zero_and_from_one_are_the_same_shards_and_cover_all_runs_once() {
        for (runs, count) in [(10, 3), (7, 7), (1_000_003, 16)] {
            let mut next = 0;
            for index in 0..count {
                let shard = Shard::from_zero(index, count).unwrap();
                assert_eq!(
                    shard,
                    Shard::parse(&format!("{}/{count}", index + 1)).unwrap()
                );
                assert_eq!(shard.range(runs).start, next);
                next = shard.range(runs).end;
            }
            assert_eq!(next, runs);
        }
        let message = |index, count| Shard::from_zero(index, count).unwrap_err().to_string();
        assert!(message(16, 16).contains("index 16 of 16`: expected an index from 0 to 15"));
        assert!(message(0, 0).contains("one shard or more"));
        assert!(Shard::parse("0/16").is_err() && Shard::parse("17/16").is_err());
    }
}
