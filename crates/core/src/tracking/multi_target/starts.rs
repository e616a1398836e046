//! Which detections may start a track when there is not room for all.
//!
//! A place that is free comes first, then that of a tentative track which has been missed since it began. When every other
//! place is held by confirmed tracks, by tracks that were seen again or by starts of this scan, the starts share what they hold
//! by lot (reservoir sampling, Vitter 1985), so that the order of a scan's detections decides nothing: with 400 false ones in front
//! of a true one, each scan gives it the same chance as them, and once it has been seen again it keeps its place.

use super::{MultiTargetConfig, Track, TrackStatus};
use crate::scalar::Scalar;

/// The starts of one scan.
pub(super) struct Starts {
    /// State of the lot: the number of the scan, so that runs repeat.
    lot: u64,
    /// Starts so far, those without room too.
    wanting: u64,
    /// No place before this one is free: during a scan's starts none becomes so.
    full_to: usize,
}

impl Starts {
    pub(super) fn new(scan: u64) -> Self {
        Self {
            lot: scan,
            wanting: 0,
            full_to: 0,
        }
    }

    /// A place for a new track, and whether another has to go for it.
    pub(super) fn room<T: Scalar, const M: usize>(
        &mut self,
        tracks: &[Option<Track<T, M>>],
        config: &MultiTargetConfig<T, M>,
    ) -> (Option<usize>, bool) {
        self.wanting += 1;
        let free = tracks[self.full_to..].iter().position(Option::is_none);
        self.full_to = free.map_or(tracks.len(), |free| self.full_to + free);
        if free.is_some() {
            return (Some(self.full_to), false);
        }
        if let Some(missed) = least_likely(tracks, config) {
            return (Some(missed), true);
        }
        let newborn = |(place, track): (usize, &Option<Track<T, M>>)| {
            is_newborn(track.as_ref()).then_some(place)
        };
        let places = tracks.iter().enumerate().filter_map(newborn).count();
        let drawn = self.draw(self.wanting) as usize;
        if drawn >= places {
            return (None, true);
        }
        let mut newborns = tracks.iter().enumerate().filter_map(newborn);
        (newborns.nth(drawn), true)
    }

    /// A number below `below`: splitmix64 (Steele, Lea and Flood 2014).
    fn draw(&mut self, below: u64) -> u64 {
        self.lot = self.lot.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.lot;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % below.max(1)
    }
}

/// Whether a track began with this scan.
fn is_newborn<T: Scalar, const M: usize>(track: Option<&Track<T, M>>) -> bool {
    track.is_some_and(|t| t.status == TrackStatus::Tentative && t.age_s <= T::zero())
}

/// The tentative track that least likely exists, if it is less likely to than a new one.
fn least_likely<T: Scalar, const M: usize>(
    tracks: &[Option<Track<T, M>>],
    config: &MultiTargetConfig<T, M>,
) -> Option<usize> {
    let mut out = None;
    let mut least = config.settings.birth_existence;
    for (place, track) in tracks.iter().enumerate() {
        let Some(track) = track else { continue };
        let existence = track.existence.existence;
        if track.status == TrackStatus::Tentative && existence < least {
            least = existence;
            out = Some(place);
        }
    }
    out
}
