//! The magnetometer calibration in force: applied to every sample, changed by commands alone.

use northing_core::calibration::magnetometer::MagnetometerCalibration;
use northing_recording::{Event, Sample};

use super::DeviceSession;
use super::magnetometer::{MagnetometerAction, MagnetometerRun, recalibrated};
use northing_evaluation::statistics::lamp::{Remark, Tone};

impl DeviceSession {
    /// Begins, ends, drops or takes back a magnetometer calibration. Returns what to tell people.
    ///
    /// # Errors
    /// It cannot be done now, or the samples do not allow a calibration, in a sentence; what was
    /// under way goes on.
    pub fn calibrate_magnetometer(&mut self, action: MagnetometerAction) -> Result<Remark, String> {
        if self.experiment.is_some() {
            return Err("an experiment is under way; stop it first".to_owned());
        }
        match action {
            MagnetometerAction::Start => {
                self.magnetometer_run = Some(MagnetometerRun::default());
                Ok(Remark::new(Tone::Info, "Turn the device all over."))
            }
            MagnetometerAction::Cancel => {
                self.magnetometer_run = None;
                Ok(Remark::new(Tone::Info, "Nothing was changed."))
            }
            MagnetometerAction::Finish => {
                let run = self.magnetometer_run.as_ref();
                let run = run.ok_or("no magnetometer calibration is under way; start one")?;
                let calibration = run.finish()?;
                self.magnetometer_run = None;
                self.apply(Some(calibration));
                Ok(applied(&calibration))
            }
            MagnetometerAction::Discard => {
                if self.magnetometer.is_none() {
                    return Err("no magnetometer calibration is in force".to_owned());
                }
                self.apply(None);
                let text = "Discarded: the field counts again as the device measures it.";
                Ok(Remark::new(Tone::Info, text))
            }
        }
    }

    /// From now on the field is another one: the rest follows it, the estimates start anew.
    fn apply(&mut self, calibration: Option<MagnetometerCalibration<f64>>) {
        let before = std::mem::replace(&mut self.magnetometer, calibration);
        if let Some(rest) = &mut self.options.calibration {
            *rest = recalibrated(rest, before.as_ref(), self.magnetometer.as_ref());
        }
        self.expect_hard_iron();
        // One under way would mix two fields.
        self.calibration = None;
        // Options were checked when they were set.
        let _ = self.restart_tracks();
    }

    /// The magnetometer calibration under way.
    #[must_use]
    pub fn magnetometer_run(&self) -> Option<&MagnetometerRun> {
        self.magnetometer_run.as_ref()
    }

    /// The magnetometer calibration in force.
    #[must_use]
    pub fn magnetometer(&self) -> Option<&MagnetometerCalibration<f64>> {
        self.magnetometer.as_ref()
    }

    /// Shows a sample as measured to a calibration under way.
    pub(super) fn gather(&mut self, event: &Event) {
        if let Some(run) = &mut self.magnetometer_run {
            match &event.sample {
                Sample::MagneticField(field) => run.add_field(field),
                Sample::SpecificForce(force) => run.add_force(force),
                _ => {}
            }
        }
    }

    /// The event as everything after it takes it: its field calibrated.
    pub(super) fn calibrated(&self, event: &Event) -> Event {
        match (&self.magnetometer, event.sample) {
            (Some(calibration), Sample::MagneticField(field)) => Event {
                sample: Sample::MagneticField(calibration.apply(&field)),
                ..*event
            },
            _ => *event,
        }
    }
}

fn applied(calibration: &MagnetometerCalibration<f64>) -> Remark {
    let [x, y, z] = calibration.hard_iron_ut;
    Remark::new(
        Tone::Good,
        format!(
            "Applied from now on: hard iron {x:.1}, {y:.1}, {z:.1} uT taken away; the field's length now \
             scatters by {:.2} uT, before by {:.2} uT.",
            calibration.residual_std_ut, calibration.uncalibrated_norm_std_ut
        ),
    )
}
