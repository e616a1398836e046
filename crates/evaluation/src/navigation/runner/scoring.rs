//! A run's scores: at once with the filter's estimate, or later with the smoothed one.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::earth::wgs84::Geodetic;
use northing_core::geometry::frames::ned_from_enu;
use northing_core::geometry::rotation::from_matrix;
use northing_recording::{BodyAxes, Frames, GnssPosition, Reference, WorldFrame};

use super::Session;
use crate::navigation::navigator::NavigationEstimate;
use crate::navigation::observer::ScoredPoint;
use crate::navigation::score::ScorePoint;
use crate::navigation::smoothed::{self, Scored};

impl Session<'_> {
    pub(super) fn reference_position(&mut self, time_ns: i64, place: &GnssPosition) {
        self.has_reference = true;
        let Some(moving) = self.frame.filter(|_| place.is_usable()) else {
            return;
        };
        let frame = *moving.now();
        let height = place.height_m.unwrap_or(frame.origin().height_m);
        let ned = frame.ned(&Geodetic {
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m: height,
        });
        self.observer
            .reference(time_ns, &moving.seen_from_the_first(&ned));
        let [north, east, down] = place.std_m.unwrap_or_default();
        let vertical_std = place.height_m.map(|_| down);
        self.score_position(time_ns, &ned, north.max(east), vertical_std);
    }

    /// Scores at a place where the antenna was at `time_ns`.
    pub(super) fn score_position(
        &mut self,
        time_ns: i64,
        ned: &Vector3<f64>,
        std: f64,
        vertical_std: Option<f64>,
    ) {
        let Some(frame) = self.frame.map(|frame| *frame.now()) else {
            return;
        };
        self.counts.scored_at_reference = self.has_reference;
        let point = ScorePoint {
            time_ns,
            frame,
            ned: *ned,
            std,
            vertical_std,
            last_fix: self.last_fix,
        };
        self.score(Scored::Position(point));
    }

    /// Scores with the estimate of now, or keeps it for the smoother.
    pub(super) fn score(&mut self, scored: Scored) {
        if self.options.smooth {
            self.kept.push(scored);
        } else {
            let estimate = self.navigator.estimate();
            self.score_with(&scored, estimate.as_ref());
        }
    }

    fn score_with(&mut self, scored: &Scored, estimate: Option<&NavigationEstimate>) {
        let error = scored.score(&mut self.scorer, estimate);
        if let (Some(error), Some(estimate), Scored::Position(point)) = (error, estimate, scored) {
            let c = &estimate.position_covariance;
            self.observer.scored(&ScoredPoint {
                time_ns: point.time_ns,
                error,
                horizontal_std: (c.m11 + c.m22).max(0.0).sqrt(),
                vertical_std: c.m33.max(0.0).sqrt(),
                truth_std: point.std,
                vertical: point.vertical_std.is_some(),
            });
        }
    }

    /// Scores and shows the smoothed estimates.
    pub(super) fn smooth(&mut self) {
        let (nodes, summary) = self.navigator.smoothed();
        self.smoothing = summary;
        for scored in core::mem::take(&mut self.kept) {
            let time_ns = scored.time_ns().unwrap_or_default();
            self.score_with(&scored, smoothed::at(&nodes, time_ns).as_ref());
        }
        if self.observer.interval_ns() < i64::MAX {
            for node in &nodes {
                self.observer.estimate(node);
            }
        }
    }

    pub(super) fn reference_attitude(&mut self, time_ns: i64, reference: &Reference) {
        if reference.scored && reference.attitude.coords.iter().all(|x| x.is_finite()) {
            let ned_from_frd = self.ned_from_frd(&reference.attitude);
            self.score(Scored::Attitude(time_ns, ned_from_frd));
        }
    }

    /// An attitude of the recording as `ned_from_body` with a body of forward, right, down.
    pub(super) fn ned_from_frd(
        &self,
        world_from_body: &UnitQuaternion<f64>,
    ) -> UnitQuaternion<f64> {
        let Frames { world, body } = self.frames;
        if (world, body) == (WorldFrame::Ned, BodyAxes::Frd) {
            return *world_from_body;
        }
        let columns = body.forward_right_down().map(|axis| match world {
            WorldFrame::Ned => world_from_body * axis,
            WorldFrame::Enu => ned_from_enu(&(world_from_body * axis)),
        });
        from_matrix(&Matrix3::from_columns(&columns))
    }
}
