//! Named random streams: each sensor draws from its own, determined by (seed, name) alone.
//!
//! A simulation never shares one generator between its parts. Each part asks for the stream of its
//! name, so adding, removing or reordering sensors leaves the noise of all the others exactly as it
//! was, and a run with one disturbance more differs from the run without it by that disturbance
//! only.
//!
//! Names in use: `motion`, `disturbance`, and per sensor `<sensor>` (noise), `<sensor>/errors`
//! (what is drawn once: bias, scale), `<sensor>/bias` (its random walk), `<sensor>/timing` (jitter,
//! dropouts).

use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// The generator of every stream: small, fast, the same on all machines.
pub type Stream = Pcg64Mcg;

/// The stream that belongs to `name` under `seed`. The same pair always gives the same stream;
/// different names or different seeds give unrelated ones.
#[must_use]
pub fn stream(seed: u64, name: &str) -> Stream {
    // The seed is scrambled before the name comes in: neighbouring seeds must not cancel against
    // neighbouring names.
    let mut state = splitmix64(seed) ^ fnv1a(name.as_bytes());
    let mut next = || {
        state = state.wrapping_add(GOLDEN_GAMMA);
        u128::from(splitmix64(state))
    };
    Pcg64Mcg::new((next() << 64) | next())
}

/// The seed of one run of a campaign: the same pair always gives the same, and neighbouring runs of
/// neighbouring campaigns share nothing.
#[must_use]
pub fn run_seed(campaign_seed: u64, run: u64) -> u64 {
    splitmix64(splitmix64(campaign_seed) ^ run.wrapping_mul(GOLDEN_GAMMA).rotate_left(32))
}

/// One draw from the standard normal distribution.
#[inline]
pub fn standard_normal(stream: &mut Stream) -> f64 {
    StandardNormal.sample(stream)
}

/// Three independent normal draws with zero mean and standard deviation `std`.
pub fn normal_vector(stream: &mut Stream, std: f64) -> Vector3<f64> {
    let (x, y, z) = (
        standard_normal(stream),
        standard_normal(stream),
        standard_normal(stream),
    );
    Vector3::new(x, y, z) * std
}

const GOLDEN_GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser of the SplitMix64 generator: a bijection in which every input bit flips about half
/// of the output bits.
const fn splitmix64(value: u64) -> u64 {
    let mut z = value.wrapping_add(GOLDEN_GAMMA);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The 64-bit FNV-1a hash: stable across versions and machines, unlike the standard library's.
const fn fnv1a(bytes: &[u8]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325;
    let mut i = 0;
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        i += 1;
    }
    hash
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng as _;

    #[test]
    fn the_hashes_match_their_published_test_values() {
        assert_eq!(fnv1a(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv1a(b"foobar"), 0x8594_4171_f739_67e8);
        // First output of SplitMix64 seeded with zero.
        assert_eq!(splitmix64(0), 0xe220_a839_7b1d_cdaf);
    }

    #[test]
    fn a_stream_is_determined_by_seed_and_name() {
        let draw = |seed, name| stream(seed, name).next_u64();
        assert_eq!(draw(7, "gyroscope"), draw(7, "gyroscope"));
        assert_ne!(draw(7, "gyroscope"), draw(7, "accelerometer"));
        assert_ne!(draw(7, "gyroscope"), draw(8, "gyroscope"));
    }

    #[test]
    fn runs_of_neighbouring_campaigns_share_no_seed() {
        let mut seeds: Vec<u64> = (0..100)
            .flat_map(|campaign| (0..1000).map(move |run| run_seed(campaign, run)))
            .collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 100_000);
    }

    #[test]
    fn streams_are_uncorrelated_between_names_and_between_neighbouring_seeds() {
        let n = 100_000;
        let correlation = |mut a: Stream, mut b: Stream| {
            let sum: f64 = (0..n)
                .map(|_| standard_normal(&mut a) * standard_normal(&mut b))
                .sum();
            sum / f64::from(n)
        };
        // The standard deviation of the mean is 1/sqrt(n) = 0.0032.
        assert!(correlation(stream(1, "gyroscope"), stream(1, "magnetometer")).abs() < 0.015);
        for seed in 0..5 {
            assert!(
                correlation(stream(seed, "gyroscope"), stream(seed + 1, "gyroscope")).abs() < 0.015
            );
        }
    }
}
