//! Integrated PDA (IPDA): whether the target exists at all, and whether the sensor can see it just now.
//!
//! Read first: Musicki, Evans, Stankovic, *Integrated Probabilistic Data Association*, IEEE TAC 39
//! (1994); `docs/derivations/association.md`, section 4.
//!
//! A track is a hypothesis with a probability: it starts low, every detection that fits raises it,
//! every scan without one lowers it. Confirmation and deletion are thresholds on it. A target in the
//! shadow of another is not detected for many scans and yet exists: the probability of being
//! visible takes that blow (VIPDA).
//!
//! | symbol | here |
//! |---|---|
//! | `r` | [`Existence::existence`] |
//! | `v` | [`Existence::visibility`], given that the target exists |
//! | `u` | [`Existence::unbroken`], given that the target exists |
//! | `P_D` | detection probability of a visible target, gate included |

use crate::parameters::parameters;
use crate::scalar::{Scalar, lit};

/// Probabilities of a target's existence and visibility.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct Existence<T> {
    /// Probability that there is a target.
    pub existence: T,
    /// Probability that the sensor can see it, if there is one.
    pub visibility: T,
    /// Probability that the sensor could see it ever since it did so last, if there is one; no more than `visibility`.
    #[cfg_attr(feature = "serde", serde(default = "T::one"))]
    pub unbroken: T,
}

parameters! {
    /// How existence and visibility change while nothing is measured.
    pub struct ExistenceModel;

    lifetime_s: T, "s", From(1e-4, 1e9), [600.0],
        "mean time a target stays in the area";
    visible_s: T, "s", From(1e-4, 1e9), [60.0],
        "mean time a visible target stays visible";
    hidden_s: T, "s", From(0.0, 1e9), [15.0],
        "mean time a hidden target stays hidden; zero when targets are always visible";
}

impl<T: Scalar> Existence<T> {
    /// Of a target that was detected just now, with this probability that there is one.
    pub fn seen(existence: T) -> Self {
        Self {
            existence,
            visibility: T::one(),
            unbroken: T::one(),
        }
    }

    /// Lets `dt` seconds pass (E1, E2, E6).
    pub fn predict(&mut self, model: &ExistenceModel<T>, dt: T) {
        self.existence *= (-dt / model.lifetime_s).exp();
        if model.hidden_s > T::zero() {
            let (leave, enter) = (T::one() / model.visible_s, T::one() / model.hidden_s);
            let stationary = enter / (enter + leave);
            let fade = (-(enter + leave) * dt).exp();
            self.visibility = stationary + (self.visibility - stationary) * fade;
            self.unbroken *= (-leave * dt).exp();
        } else {
            self.visibility = T::one();
            self.unbroken = T::one();
        }
    }

    /// Probability that the target causes a detection, `r v P_D` (E3).
    pub fn detection(&self, detection_probability: T) -> T {
        self.existence * self.visibility * detection_probability
    }

    /// Probability that a target which is detected now had not been hidden since it was last seen (E6).
    pub fn was_visible(&self) -> T {
        (self.unbroken / self.visibility.max(lit(1e-30))).min(T::one())
    }

    /// Weighs in a scan (E4 to E6): `missed` is the probability that none of the detections came from the
    /// target, whether it exists or not.
    pub fn update(&mut self, detection_probability: T, missed: T) {
        let caused = (T::one() - missed).max(T::zero());
        let silent = T::one() - self.detection(detection_probability);
        let tiny = lit::<T>(1e-30);
        let unseen = self.visibility * detection_probability;
        // given no detection: still there, and still visible
        let there = self.existence * (T::one() - unseen) / silent.max(tiny);
        let kept = (T::one() - detection_probability) / (T::one() - unseen).max(tiny);
        let existence = missed * there + caused;
        let share = |visible: T| {
            let visible = missed * there * visible * kept + caused;
            (visible / existence.max(tiny)).min(T::one())
        };
        self.visibility = share(self.visibility);
        self.unbroken = share(self.unbroken);
        self.existence = existence.min(T::one());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    const ALWAYS: ExistenceModel<f64> = ExistenceModel {
        lifetime_s: 1e3,
        visible_s: 1.0,
        hidden_s: 0.0,
    };

    #[test]
    fn a_miss_lowers_existence_as_bayes_says() {
        let mut e = Existence::seen(0.5);
        e.update(0.8, 1.0);
        assert_relative_eq!(e.existence, 0.5 * 0.2 / (0.5 * 0.2 + 0.5), epsilon = 1e-12);
    }

    #[test]
    fn one_detection_follows_the_recursion_of_musicki() {
        // r' = (1 - d) r / (1 - d r), d = P_D (1 - l / lambda), with one detection in the gate
        let (r, pd, ratio) = (0.3, 0.9, 6.0);
        let delta = pd - pd * ratio;
        let expected = (1.0 - delta) * r / (1.0 - delta * r);
        let miss = 1.0 - pd * r;
        let hit = pd * r * ratio;
        let mut e = Existence::seen(r);
        e.update(pd, miss / (miss + hit));
        assert_relative_eq!(e.existence, expected, epsilon = 1e-12);
    }

    #[test]
    fn a_hidden_target_keeps_its_existence_longer() {
        let hidden = ExistenceModel {
            visible_s: 30.0,
            hidden_s: 10.0,
            ..ALWAYS
        };
        let run = |model: &ExistenceModel<f64>| {
            let mut e = Existence::seen(0.99);
            for _ in 0..5 {
                e.predict(model, 1.0);
                e.update(0.9, 1.0);
            }
            e
        };
        let (with, without) = (run(&hidden), run(&ALWAYS));
        assert!(with.existence > 0.5 && without.existence < 0.01);
        assert!(with.visibility < 0.5);
    }

    #[test]
    fn whether_it_was_hidden_is_what_all_ways_through_the_gap_say() {
        // Visible or hidden in each scan of a gap: every way by itself.
        let model = ExistenceModel {
            visible_s: 20.0,
            hidden_s: 4.0,
            ..ALWAYS
        };
        let (leave, enter) = (1.0_f64 / 20.0, 1.0 / 4.0);
        let pd = 0.7;
        for misses in 0..6 {
            let mut e = Existence::seen(1.0);
            for _ in 0..misses {
                e.predict(&model, 1.0);
                e.update(pd, 1.0);
            }
            e.predict(&model, 1.0);
            // In one second of the chain, however often it changes in it.
            let fade = (-(leave + enter)).exp();
            let back = enter / (leave + enter) * (1.0 - fade);
            let hide = leave / (leave + enter) * (1.0 - fade);
            let stay = (-leave).exp();
            let mut ways = [1.0, 0.0, 0.0]; // never hidden, hidden, seen again
            let step = |[never, hidden, again]: [f64; 3]| {
                let returned = never * (1.0 - hide - stay);
                let now = never * hide + hidden * (1.0 - back) + again * hide;
                [
                    never * stay,
                    now,
                    again * (1.0 - hide) + hidden * back + returned,
                ]
            };
            for _ in 0..misses {
                let [never, hidden, again] = step(ways);
                ways = [never * (1.0 - pd), hidden, again * (1.0 - pd)];
            }
            let [never, _, again] = step(ways);
            assert_relative_eq!(e.was_visible(), never / (never + again), epsilon = 1e-12);
        }
    }

    #[test]
    fn visibility_ends_at_its_stationary_share() {
        let model = ExistenceModel {
            visible_s: 30.0,
            hidden_s: 10.0,
            ..ALWAYS
        };
        let mut e = Existence {
            visibility: 0.0,
            unbroken: 0.0,
            ..Existence::seen(1.0)
        };
        e.predict(&model, 1e3);
        assert_relative_eq!(e.visibility, 0.75, epsilon = 1e-9);
        assert_relative_eq!(e.existence, f64::exp(-1.0), epsilon = 1e-9);
    }
}
