//! Linear prediction: what the samples before do not say of the next one, which of a vibration is nothing and of noise all.
//!
//! Of a stretch of samples each axis is fitted with an autoregressive model of order [`ORDER`] by least squares (Kay, *Modern Spectral
//! Estimation*, 1988, chapter 7: the covariance method). A sinusoid takes two coefficients, a smooth motion a few; white noise cannot
//! be predicted at all. The stretch with the least noise is kept, as long as it may last.

use nalgebra::{SMatrix, SVector, Vector3};

/// Coefficients of a prediction: six sinusoids and a smooth motion.
const ORDER: usize = 16;
/// Samples of a stretch.
const LENGTH: usize = 240;

/// Watches the samples of one sensor.
#[derive(Debug, Clone, Default)]
pub(super) struct Prediction {
    present: Vec<Vector3<f64>>,
    /// Mean squared fourth difference of the present stretch and of the quietest one.
    squares: f64,
    quietest: Option<(f64, Vec<Vector3<f64>>)>,
}

impl Prediction {
    /// Takes the next sample and the square of its fourth difference.
    pub(super) fn add(&mut self, v: &Vector3<f64>, square: f64) {
        self.present.push(*v);
        self.squares += square;
        if self.present.len() < LENGTH {
            return;
        }
        if self
            .quietest
            .as_ref()
            .is_none_or(|(least, _)| self.squares < *least)
        {
            let full = core::mem::take(&mut self.present);
            self.quietest = Some((self.squares, full));
        }
        self.begin();
    }

    /// Samples are missing: a stretch has none.
    pub(super) fn begin(&mut self) {
        self.present.clear();
        self.squares = 0.0;
    }

    /// Variance of what is not predicted in the quietest stretch, per axis.
    pub(super) fn variance(&self) -> Option<f64> {
        let (_, samples) = self.quietest.as_ref()?;
        let axis = |k: usize| unpredicted(&samples.iter().map(|v| v[k]).collect::<Vec<_>>());
        Some((0..3).map(axis).sum::<f64>() / 3.0)
    }
}

/// Variance of what a series does not say of its next value.
fn unpredicted(series: &[f64]) -> f64 {
    let mean = series.iter().sum::<f64>() / series.len() as f64;
    let (mut normal, mut right, mut squares) = (
        SMatrix::<f64, ORDER, ORDER>::zeros(),
        SVector::<f64, ORDER>::zeros(),
        0.0,
    );
    for window in series.windows(ORDER + 1) {
        let before = SVector::<f64, ORDER>::from_fn(|k, _| window[k] - mean);
        let next = window[ORDER] - mean;
        normal += before * before.transpose();
        right += before * next;
        squares += next * next;
    }
    // Rounded values of a sensor at rest are all one.
    let ridge = 1e-9 * normal.trace() + f64::MIN_POSITIVE;
    normal += SMatrix::identity() * ridge;
    let Some(factor) = normal.cholesky() else {
        return 0.0;
    };
    let explained = right.dot(&factor.solve(&right));
    let free = (series.len() - 2 * ORDER) as f64;
    (squares - explained).max(0.0) / free
}
