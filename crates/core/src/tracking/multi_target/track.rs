//! One track: its start from a single detection, and when it is confirmed, over, or a duplicate.

use nalgebra::{Matrix2, Matrix2x3, SMatrix, Vector2, Vector3};

use super::{MultiTargetConfig, MultiTargetSettings, Scan};
use crate::kalman::covariance::normalized_square;
use crate::kalman::innovation::{Innovation, SkipReason};
use crate::restorable::{InvalidState, covariance, finite, not_negative};
use crate::scalar::{Scalar, lit};
use crate::tracking::association::ipda::{Existence, ExistenceModel};
use crate::tracking::coordinated_turn::{TargetCovariance, TargetState};
use crate::tracking::detection::{CrossCovariance, Detection};
use crate::tracking::dwell_time::{DwellTime, DwellTimes};
use crate::tracking::echo::{Echo, EchoCovariance};
use crate::tracking::imm::{Imm, Mode};
use crate::tracking::own_ship::OwnShip;
use crate::tracking::seen::Seen;

/// Status of a track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum TrackStatus {
    /// May be clutter.
    Tentative,
    /// Has been confirmed; stays so until it ends.
    Confirmed,
}

/// Why a track ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum TrackEnd {
    /// Its existence fell below `delete_existence` or `delete_confirmed_existence`.
    Existence,
    /// The standard deviation of its position passed `largest_position_std_m`.
    Uncertain,
    /// A state or covariance was not finite, or not positive.
    Numerical,
    /// It followed the target of another track.
    Merged {
        /// The track that stays.
        into: u32,
    },
}

/// A track that ended in the last scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EndedTrack {
    /// Number of the track.
    pub id: u32,
    /// What it was.
    pub status: TrackStatus,
    /// Why it ended.
    pub end: TrackEnd,
}

/// A target, or what may be one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct Track<T, const M: usize> {
    /// Number of the track, never used twice by one tracker.
    pub id: u32,
    /// Whether it is confirmed.
    pub status: TrackStatus,
    /// Existence and visibility.
    pub existence: Existence<T>,
    /// The estimates of the motion models.
    pub imm: Imm<T, M>,
    /// Seconds since the track began.
    pub age_s: T,
    /// Seconds since a detection probably came from it.
    pub silent_s: T,
    /// The last update: the likeliest detection under the likeliest model, or why there was none.
    pub innovation: Innovation<T>,
    /// How long it stays in the straight model.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) dwell: DwellTime<T>,
    /// The last detection that was surely its own.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) seen: Option<Seen<T>>,
}

impl<T: Scalar, const M: usize> Track<T, M> {
    /// State and covariance over all models.
    pub fn estimate(&self) -> Mode<T> {
        self.imm.estimate()
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        for mode in &self.imm.modes {
            finite("state of a track", &mode.state)?;
            covariance("covariance of a track", &mode.covariance)?;
            finite(
                "cross-covariance of a track",
                mode.cross.iter().chain(&mode.echo),
            )?;
            not_negative("probability of a motion model", [&mode.probability])?;
        }
        let Existence {
            existence,
            visibility,
            unbroken,
        } = &self.existence;
        not_negative("existence of a track", [existence, visibility, unbroken])?;
        not_negative("age of a track", [&self.age_s, &self.silent_s])?;
        self.dwell.check()?;
        let innovation = &self.innovation;
        let numbers = innovation.residual.iter().chain(&innovation.covariance);
        let seen = self.seen.iter();
        let seen = seen.flat_map(|seen| {
            let vectors = [&seen.residual, &seen.spread, &seen.extent];
            let change = seen.change.iter().map(|change| &change.by);
            vectors
                .into_iter()
                .chain(&seen.left)
                .chain(change)
                .flatten()
                .chain([&seen.time_s])
        });
        finite("last detection of a track", seen)?;
        finite("innovation of a track", numbers.chain([&innovation.nis]))
    }

    /// Whether it is told as a target: confirmed, and its target is there more likely than not (`report_existence`). A confirmed
    /// track that is not may be seen again, with its number.
    pub fn is_reported(&self, settings: &MultiTargetSettings<T>) -> bool {
        self.status == TrackStatus::Confirmed
            && self.existence.existence >= settings.report_existence
    }

    /// Lets `dt` seconds pass; the shares of the own ship's errors and of the echo's place that are still there are those of [`Imm::predict`].
    pub(super) fn predict(
        &mut self,
        config: &MultiTargetConfig<T, M>,
        (existence, dwell): (&ExistenceModel<T>, &DwellTimes<T>),
        dt: T,
        (kept, echo_kept): (&Vector3<T>, T),
    ) {
        let mut models = config.models;
        if let (true, Some(straight)) =
            (config.settings.learn_manoeuvres, models.dwell_s.first_mut())
        {
            *straight = self
                .dwell
                .predict(*straight, dwell, self.imm.modes[0].probability, dt);
        }
        self.imm.predict(&models, dt, kept, echo_kept);
        self.existence.predict(existence, dt);
        self.age_s += dt;
        self.silent_s += dt;
    }

    /// Learns from what a scan did to the probabilities of the models, which were `before` until then.
    pub(super) fn learn_manoeuvres(
        &mut self,
        config: &MultiTargetConfig<T, M>,
        before: &Imm<T, M>,
    ) {
        let likelier: [T; M] = core::array::from_fn(|m| {
            let [was, is] = [before, &self.imm].map(|imm| imm.modes[m].probability);
            if was > T::zero() { is / was } else { T::one() }
        });
        if let (true, Some(straight)) = (
            config.settings.learn_manoeuvres,
            config.models.dwell_s.first(),
        ) {
            self.dwell.learn(*straight, &likelier);
        }
    }

    /// Distance from the own ship, m.
    pub(super) fn range_m(&self, own_ship: &OwnShip<T>) -> T {
        let x = self.estimate().state;
        Vector2::new(x[0] - own_ship.north_m, x[2] - own_ship.east_m).norm()
    }

    pub(super) fn confirm(&mut self, config: &MultiTargetConfig<T, M>) {
        if self.existence.existence >= config.settings.confirm_existence {
            self.status = TrackStatus::Confirmed;
        }
    }

    /// Why the track is over, if it is.
    pub(super) fn end(
        &self,
        config: &MultiTargetConfig<T, M>,
        own_ship: &OwnShip<T>,
    ) -> Option<TrackEnd> {
        let limit = match self.status {
            TrackStatus::Tentative => config.settings.delete_existence,
            TrackStatus::Confirmed => config.settings.delete_confirmed_existence,
        };
        if !self.imm.is_valid() {
            return Some(TrackEnd::Numerical);
        }
        if self.existence.existence < limit {
            return Some(TrackEnd::Existence);
        }
        let estimate = self.estimate();
        let (x, p) = (estimate.state, estimate.covariance);
        let offset = Vector2::new(x[0] - own_ship.north_m, x[2] - own_ship.east_m);
        let by_pose = by_pose(&offset);
        // An uncertain pose makes every target uncertain and is no reason to let it go.
        let of_pose = (by_pose * own_ship.covariance * by_pose.transpose()).trace();
        let largest = config.settings.largest_position_std_m;
        (p[(0, 0)] + p[(2, 2)] > largest * largest + of_pose).then_some(TrackEnd::Uncertain)
    }

    pub(super) fn is_senior_to(&self, other: &Self) -> bool {
        match (self.status, other.status) {
            (TrackStatus::Confirmed, TrackStatus::Tentative) => true,
            (TrackStatus::Tentative, TrackStatus::Confirmed) => false,
            _ => self.age_s >= other.age_s,
        }
    }
}

/// Whether two estimates are of one target: positions and velocities agree within their covariances.
pub(super) fn is_same_target<T: Scalar>(a: &Mode<T>, b: &Mode<T>, merge_sigmas: T) -> bool {
    let limit = merge_sigmas * merge_sigmas;
    // Most pairs are far apart, which one component tells: its normalised square is never more than that of all.
    let north = a.state[0] - b.state[0];
    let variance = a.covariance[(0, 0)] + b.covariance[(0, 0)];
    if north * north > limit * variance * lit(1.001) {
        return false;
    }
    let d = (a.state - b.state).fixed_rows::<4>(0).into_owned();
    let p = (a.covariance + b.covariance)
        .fixed_view::<4, 4>(0, 0)
        .into_owned();
    normalized_square(&d, &p).is_some_and(|distance| distance < limit)
}

/// One-point initiation (I1 to I3): the position from the detection, its covariance from sensor
/// *and* own ship, and the cross-covariance that follows. `None` for a bearing, which has no position,
/// and for a detection that is not valid.
pub(super) fn initiate<T: Scalar, const M: usize>(
    detection: &Detection<T>,
    (scan, echo): (&Scan<'_, T>, &Echo<T>),
    config: &MultiTargetConfig<T, M>,
    id: u32,
) -> Option<Track<T, M>> {
    if !detection.is_valid() {
        return None;
    }
    let (position, by_pose, noise) = locate(detection, scan)?;
    let own = &scan.own_ship.covariance;
    let place = by_pose * own * by_pose.transpose() + noise;
    let cross_place = by_pose * own;
    let mut state = TargetState::zeros();
    let mut p = TargetCovariance::zeros();
    let mut cross = CrossCovariance::zeros();
    for (i, at) in [0, 2].into_iter().enumerate() {
        state[at] = position[i];
        p[(at + 1, at + 1)] =
            config.settings.birth_speed_std_m_s * config.settings.birth_speed_std_m_s;
        for (k, other) in [0, 2].into_iter().enumerate() {
            p[(at, other)] = place[(i, k)];
        }
        for k in 0..3 {
            cross[(at, k)] = cross_place[(i, k)];
        }
    }
    let turn = config.models.turn.std_rad_s;
    p[(4, 4)] = turn * turn;
    // The target lies on the other side of its echo's place.
    let mut of_echo = EchoCovariance::zeros();
    of_echo[(0, 0)] = -echo.lasting;
    of_echo[(2, 1)] = -echo.lasting;
    let mut imm = Imm::new(&config.models, state, p, cross, of_echo);
    if let [_, .., fast] = &mut imm.modes[..] {
        // (I4): a sum of two densities has the long tail that speeds have.
        let tail = config.settings.birth_speed_tail;
        for speed in [1, 3] {
            fast.covariance[(speed, speed)] *= tail * tail;
        }
    }
    imm.is_valid().then_some(Track {
        id,
        status: TrackStatus::Tentative,
        existence: Existence::seen(config.settings.birth_existence),
        imm,
        age_s: T::zero(),
        silent_s: T::zero(),
        innovation: Innovation::skipped(SkipReason::NotInitialized),
        dwell: DwellTime::default(),
        seen: None,
    })
}

/// Jacobian of a position at this offset (north, east) from the own ship by its north, east and heading (I2): heading turns the offset.
fn by_pose<T: Scalar>(offset: &Vector2<T>) -> Matrix2x3<T> {
    let (one, zero) = (T::one(), T::zero());
    Matrix2x3::new(one, zero, -offset.y, zero, one, offset.x)
}

/// Position of a detection, its Jacobian by the own ship's pose, and the covariance of the sensor's
/// noise in north and east.
fn locate<T: Scalar>(
    detection: &Detection<T>,
    scan: &Scan<'_, T>,
) -> Option<(Vector2<T>, Matrix2x3<T>, Matrix2<T>)> {
    let noise = &scan.sensor.noise;
    let extent = Matrix2::identity() * (noise.extent_std_m * noise.extent_std_m);
    match *detection {
        Detection::Bearing { .. } => None,
        Detection::Position { north_m, east_m } => {
            Some((Vector2::new(north_m, east_m), SMatrix::zeros(), extent))
        }
        Detection::RangeBearing {
            range_m,
            bearing_rad,
        } => {
            let own = scan.own_ship;
            let direction = bearing_rad + own.heading_rad;
            let (s, c) = (direction.sin(), direction.cos());
            let offset = Vector2::new(range_m * c, range_m * s);
            let by_pose = by_pose(&offset);
            let zero = T::zero();
            let by_sensor = Matrix2::new(c, -offset.y, s, offset.x);
            let r = Matrix2::new(
                noise.range_std_m * noise.range_std_m,
                zero,
                zero,
                noise.bearing_std_rad * noise.bearing_std_rad,
            );
            let position = Vector2::new(own.north_m, own.east_m) + offset;
            let sensor = by_sensor * r * by_sensor.transpose() + extent;
            (range_m < lit(1e9)).then_some((position, by_pose, sensor))
        }
    }
}
