//! A small world for the tests of the trackers: random own errors, detections, targets.

use nalgebra::{Matrix3, Vector3, Vector4};
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::radar::PredictedDetection;
use super::{RadarDetection, RadarNoise};

pub(super) struct Scene {
    rng: Pcg64Mcg,
    /// Covariance of the own pose.
    pub(super) covariance: Matrix3<f64>,
    root: Matrix3<f64>,
}

impl Scene {
    pub(super) fn new(seed: u64) -> Self {
        let root = Matrix3::new(1.5, 0.0, 0.0, 0.4, 1.2, 0.0, 0.002, -0.003, 0.01);
        Self {
            rng: Pcg64Mcg::seed_from_u64(seed),
            covariance: root * root.transpose(),
            root,
        }
    }

    pub(super) fn normal(&mut self) -> f64 {
        self.rng.sample(StandardNormal)
    }

    /// An error of the own pose with [`Self::covariance`].
    pub(super) fn draw_error(&mut self) -> Vector3<f64> {
        let white = Vector3::from_fn(|_, _| self.normal());
        self.root * white
    }

    pub(super) fn detect_exactly(
        &self,
        target: &Vector4<f64>,
        pose: &Vector3<f64>,
    ) -> RadarDetection<f64> {
        PredictedDetection::new(target, pose).unwrap().detection
    }

    pub(super) fn detect(
        &mut self,
        target: &Vector4<f64>,
        pose: &Vector3<f64>,
        noise: &RadarNoise<f64>,
    ) -> RadarDetection<f64> {
        let exact = self.detect_exactly(target, pose);
        RadarDetection {
            range: exact.range + noise.range_std * self.normal(),
            bearing: exact.bearing + noise.bearing_std * self.normal(),
        }
    }
}
