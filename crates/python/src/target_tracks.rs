//! What a scan told the multi-target tracker: the tracks, what the scan was to each, and those that ended.

use northing_core::tracking::multi_target::ScanError;
use northing_evaluation::tracking::{
    EndedTrack as CoreEndedTrack, FollowedTrack, TrackStatus, end_reason,
};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::streams::Innovation;

fn status_word(status: TrackStatus) -> &'static str {
    match status {
        TrackStatus::Tentative => "tentative",
        TrackStatus::Confirmed => "confirmed",
    }
}

/// A track after a scan.
#[pyclass(frozen, module = "northing._northing")]
pub(crate) struct TargetTrack(pub(crate) FollowedTrack);

#[pymethods]
impl TargetTrack {
    /// Its number, never used twice by one tracker.
    #[getter]
    fn id(&self) -> u32 {
        self.0.target.id
    }

    /// `tentative` or `confirmed`.
    #[getter]
    fn status(&self) -> &'static str {
        status_word(self.0.status)
    }

    /// Whether it is told as a target: confirmed, and its target is there more likely than not (`report_existence`).
    #[getter]
    fn reported(&self) -> bool {
        self.0.is_reported
    }

    /// North (m), its rate (m/s), east (m), its rate (m/s), turn rate (rad/s).
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let target = &self.0.target;
        let ([north, east], [to_north, to_east]) = (target.place, target.velocity);
        PyArray1::from_slice(py, &[north, to_north, east, to_east, target.turn_rate])
    }

    /// Its covariance.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = self.0.target.covariance.transpose();
        PyArray1::from_slice(py, rows.as_slice()).reshape([5, 5])
    }

    /// Standard deviations of the state.
    #[getter]
    fn std<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let variances = self.0.target.covariance.diagonal();
        PyArray1::from_slice(py, variances.map(|v| v.max(0.0).sqrt()).as_slice())
    }

    /// Probability that there is a target.
    #[getter]
    fn existence(&self) -> f64 {
        self.0.target.existence
    }

    /// Probability that the sensor can see it, if there is one.
    #[getter]
    fn visibility(&self) -> f64 {
        self.0.target.visibility
    }

    /// Probabilities of the motion models: straight, turning, manoeuvring.
    #[getter]
    fn models<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.target.models)
    }

    /// Seconds since it began.
    #[getter]
    fn age_s(&self) -> f64 {
        self.0.age_s
    }

    /// Seconds since a detection probably came from it.
    #[getter]
    fn silent_s(&self) -> f64 {
        self.0.silent_s
    }

    /// Detections of the last scan in its gate.
    #[getter]
    fn detections_in_gate(&self) -> usize {
        self.0.target.association.in_gate
    }

    /// The likeliest of them, its row.
    #[getter]
    fn detection(&self) -> Option<u32> {
        self.0.target.association.likeliest.map(|(row, _)| row)
    }

    /// Probability that the target caused it.
    #[getter]
    fn detection_probability(&self) -> Option<f64> {
        let likeliest = self.0.target.association.likeliest;
        likeliest.map(|(_, probability)| probability)
    }

    /// Probability that the target caused none.
    #[getter]
    fn missed_probability(&self) -> f64 {
        self.0.target.association.missed
    }

    /// Of the likeliest detection under the likeliest motion model.
    #[getter]
    fn innovation(&self) -> Innovation {
        Innovation(self.0.innovation)
    }

    fn __repr__(&self) -> String {
        let target = &self.0.target;
        format!(
            "<track {}, {}: {:.1} m north, {:.1} m east, existence {:.3}>",
            target.id,
            self.status(),
            target.place[0],
            target.place[1],
            target.existence
        )
    }
}

/// A track that ended in a scan.
#[pyclass(frozen, module = "northing._northing")]
pub(crate) struct EndedTrack(CoreEndedTrack);

#[pymethods]
impl EndedTrack {
    /// Its number.
    #[getter]
    fn id(&self) -> u32 {
        self.0.id
    }

    /// What it was: `tentative` or `confirmed`.
    #[getter]
    fn status(&self) -> &'static str {
        status_word(self.0.status)
    }

    /// Why, in the words of `northing track --out`.
    #[getter]
    fn reason(&self) -> String {
        end_reason(self.0.end)
    }

    fn __repr__(&self) -> String {
        format!("<track {} ended: {}>", self.0.id, self.reason())
    }
}

/// What one scan told the tracker.
#[pyclass(frozen, module = "northing._northing")]
pub(crate) struct ScanRecord {
    pub(crate) time_ns: i64,
    pub(crate) sensor: String,
    pub(crate) error: Option<ScanError>,
    pub(crate) tracks: Vec<FollowedTrack>,
    pub(crate) ended: Vec<CoreEndedTrack>,
}

impl ScanRecord {
    fn those(&self, wanted: impl Fn(&FollowedTrack) -> bool) -> Vec<TargetTrack> {
        let those = self.tracks.iter().filter(|track| wanted(track));
        those.copied().map(TargetTrack).collect()
    }
}

#[pymethods]
impl ScanRecord {
    /// Its stamp, ns.
    #[getter]
    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    /// The sensor's name.
    #[getter]
    fn sensor(&self) -> &str {
        &self.sensor
    }

    /// Why the scan was refused; `None`: it was used.
    #[getter]
    fn reason(&self) -> Option<&'static str> {
        self.error.map(ScanError::description)
    }

    /// Every track after it, tentative ones too.
    #[getter]
    fn tracks(&self) -> Vec<TargetTrack> {
        self.tracks.iter().copied().map(TargetTrack).collect()
    }

    /// The confirmed ones.
    #[getter]
    fn confirmed(&self) -> Vec<TargetTrack> {
        self.those(|track| track.status == TrackStatus::Confirmed)
    }

    /// Those of them whose targets are there more likely than not (`report_existence`). The others are kept in case they are seen again.
    #[getter]
    fn reported(&self) -> Vec<TargetTrack> {
        self.those(|track| track.is_reported)
    }

    /// The tracks that ended in it, tentative ones too.
    #[getter]
    fn ended(&self) -> Vec<EndedTrack> {
        self.ended.iter().copied().map(EndedTrack).collect()
    }

    fn __repr__(&self) -> String {
        match self.reason() {
            Some(reason) => format!("<scan of {} refused: {reason}>", self.sensor),
            None => format!(
                "<scan of {}: {} tracks confirmed, {} tentative, {} ended>",
                self.sensor,
                self.confirmed().len(),
                self.tracks.len() - self.confirmed().len(),
                self.ended.len()
            ),
        }
    }
}
