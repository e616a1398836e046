//! Seeded garbage: numbers, vectors, intervals, stamps, standard deviations and settings.

use nalgebra::{RealField, UnitQuaternion, Vector2, Vector3};
use northing_core::parameters::{Range, Table, Value};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// One stream of garbage. How much of it is plausible changes from sequence to sequence.
pub struct Garbage {
    rng: Pcg64Mcg,
    share: f64,
    extreme: f64,
}

/// A literal in the precision of a filter.
pub fn number<T: RealField + Copy>(x: f64) -> T {
    nalgebra::convert(x)
}

impl Garbage {
    pub fn new(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let pick = |rng: &mut Pcg64Mcg, of: &[f64]| of[rng.random_range(0..of.len())];
        let share = pick(&mut rng, &[0.0, 0.02, 0.1, 0.4, 0.9]);
        let extreme = pick(&mut rng, &[0.0, 0.1, 0.5, 1.0]);
        Self {
            rng,
            share,
            extreme,
        }
    }

    pub fn below(&mut self, n: usize) -> usize {
        self.rng.random_range(0..n)
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.rng.random::<f64>() < probability
    }

    /// From one power of ten to another, of either sign.
    fn log_uniform(&mut self, least: f64, most: f64) -> f64 {
        let exponent = least + (most - least) * self.rng.random::<f64>();
        10_f64.powf(exponent)
    }

    /// A number that no sensor gives, as a rule.
    fn bad(&mut self) -> f64 {
        let size = match self.below(8) {
            0 => return f64::NAN,
            1 => return f64::INFINITY,
            2 => return f64::NEG_INFINITY,
            3 => return 0.0,
            4 => self.log_uniform(-30.0, -3.0),
            5 => self.log_uniform(0.0, 6.0),
            6 => self.log_uniform(6.0, 19.0),
            _ => self.log_uniform(19.0, 38.0),
        };
        if self.chance(0.5) { size } else { -size }
    }

    /// About `size` in either direction, or garbage.
    pub fn near<T: RealField + Copy>(&mut self, size: f64) -> T {
        let x = if self.chance(self.share) {
            self.bad()
        } else {
            size * (2.0 * self.rng.random::<f64>() - 1.0)
        };
        number(x)
    }

    /// About `at`, each component give or take `size`; or garbage, in one component or in all.
    pub fn around<T: RealField + Copy>(&mut self, at: [f64; 3], size: f64) -> Vector3<T> {
        let mut v = at.map(|x| x + size * (2.0 * self.rng.random::<f64>() - 1.0));
        if self.chance(self.share) {
            let only = self.below(4);
            for (i, x) in v.iter_mut().enumerate() {
                if only == 3 || only == i {
                    *x = self.bad();
                }
            }
        }
        Vector3::from(v).map(number)
    }

    pub fn vector<T: RealField + Copy>(&mut self, size: f64) -> Vector3<T> {
        self.around([0.0; 3], size)
    }

    pub fn plane<T: RealField + Copy>(&mut self, size: f64) -> Vector2<T> {
        self.vector(size).xy()
    }

    /// An interval: the usual one, a long one, one of up to 1e9 s, none, one that goes back, or no number.
    pub fn interval<T: RealField + Copy>(&mut self, usual: f64) -> T {
        let dt = if self.chance(self.share) {
            match self.below(5) {
                0 => self.log_uniform(-12.0, -3.0),
                1 => self.log_uniform(-1.0, 4.0),
                2 => self.log_uniform(4.0, 9.0),
                3 => -self.log_uniform(-6.0, 9.0),
                _ => self.bad(),
            }
        } else {
            usual
        };
        number(dt)
    }

    /// A stamp: the clock moves on as usual, or repeats, goes back, or leaps.
    pub fn stamp(&mut self, clock_ns: &mut i64, usual_ns: i64) -> i64 {
        if self.chance(self.share * 0.3) {
            match self.below(6) {
                0 => return *clock_ns,
                1 => return clock_ns.saturating_sub(self.log_uniform(3.0, 18.0) as i64),
                2 => return clock_ns.saturating_add(self.log_uniform(6.0, 18.0) as i64),
                3 => *clock_ns = clock_ns.saturating_add(self.log_uniform(8.0, 12.0) as i64),
                4 => return if self.chance(0.5) { i64::MAX } else { i64::MIN },
                _ => *clock_ns = clock_ns.saturating_sub(self.log_uniform(3.0, 11.0) as i64),
            }
        }
        *clock_ns = clock_ns.saturating_add(usual_ns);
        *clock_ns
    }

    /// A standard deviation: about the usual one, from 1e-12 to 1e12, zero, negative, or no number.
    pub fn std<T: RealField + Copy>(&mut self, usual: f64) -> T {
        let std = if self.chance(0.2 + self.share) {
            match self.below(8) {
                0 => self.bad(),
                1 => 0.0,
                2 => 1e-12,
                3 => 1e12,
                4 => self.log_uniform(-12.0, -6.0),
                _ => self.log_uniform(-12.0, 12.0),
            }
        } else {
            usual * self.log_uniform(-1.0, 1.0)
        };
        number(std)
    }

    pub fn stds<T: RealField + Copy>(&mut self, usual: f64) -> Vector3<T> {
        if self.chance(0.5) {
            Vector3::repeat(self.std(usual))
        } else {
            Vector3::new(self.std(usual), self.std(usual), self.std(usual))
        }
    }

    /// Any rotation; now and then none.
    pub fn rotation<T: RealField + Copy>(&mut self, size: f64) -> UnitQuaternion<T> {
        let r = self.vector::<T>(size);
        let q = UnitQuaternion::from_scaled_axis(r);
        if self.chance(self.share * 0.2) {
            UnitQuaternion::new_unchecked(q.into_inner() * self.near::<T>(2.0))
        } else {
            q
        }
    }

    /// Settings from the ends of what is permitted: each parameter at an end, between, or as it is.
    pub fn settings<C: Table>(&mut self) -> C {
        let profiles = C::PROFILES;
        let mut config = profiles[self.below(profiles.len())].1();
        for row in C::PARAMETERS {
            if !self.chance(self.extreme) {
                continue;
            }
            if let Some(value) = self.value(&row.range) {
                let set = config.set_parameter(row.name, value);
                set.unwrap_or_else(|e| panic!("{e}: {value:?}"));
            }
        }
        config.check().unwrap();
        config
    }

    fn value<T: RealField + Copy>(&mut self, range: &Range) -> Option<Value<T>> {
        Some(match range {
            Range::From(..) | Range::Above(..) => Value::Number(self.within(range)),
            Range::Count(least) => Value::Count(least + self.below(4) as u32),
            Range::Flag => Value::Flag(self.chance(0.5)),
            Range::Words(words) => Value::Word(words[self.below(words.len())]),
            Range::Vector(each) => Value::Vector([0; 3].map(|_| self.within(each))),
            Range::Optional(_) if self.chance(0.3) => Value::Absent,
            Range::Optional(inner) => return self.value(inner),
            Range::Pair(value, std) => Value::Pair([self.within(value), self.within(std)]),
            Range::Described(_) => return None,
        })
    }

    /// A number of a range, its ends above all.
    pub fn within<T: RealField + Copy>(&mut self, range: &Range) -> T {
        let (least, most) = match *range {
            Range::From(least, most) => (least, most),
            Range::Above(limit, most) => (limit + 1e-6 * (most - limit), most),
            _ => panic!("{range} is no interval"),
        };
        let between = match self.below(6) {
            0 | 1 => least,
            2 | 3 => most,
            4 if least >= 0.0 => self
                .log_uniform(least.max(most * 1e-9).log10(), most.log10())
                .clamp(least, most),
            _ => least + (most - least) * self.rng.random::<f64>(),
        };
        number(between)
    }
}
