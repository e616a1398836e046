//! From a manifest's columns to those of the file.

mod navigation;

use super::schema::{
    Column, ForceColumnUnit, PressureUnit, QuaternionColumns, QuaternionDirection, QuaternionOrder,
    RateColumnUnit, Source, TimeColumn, TimeUnit, VectorColumns,
};
use crate::delimited::{Channel, Form, Layout, RowsOf, TimeForm};
use crate::error::{RecordingError, Result, join};
use crate::event::SensorKind;
use crate::options::{FieldUnit, ForceUnit, OpenOptions, RateUnit};
use crate::signed_axes::SignedAxes;

/// Finds the manifest's columns in the file.
pub(super) struct LayoutBuilder<'a> {
    pub(super) source: &'a Source,
    pub(super) manifest_file: &'a str,
    pub(super) file: &'a str,
    pub(super) names: Vec<String>,
    pub(super) options: &'a OpenOptions,
}

impl LayoutBuilder<'_> {
    pub(super) fn build(self) -> Result<Layout> {
        let mut channels = self.vectors()?;
        let source = self.source;
        if let Some(device) = &source.device_orientation {
            if device.scored.is_some() {
                return Err(
                    self.problem("[device_orientation] has `scored`, which belongs to [reference]")
                );
            }
            channels.push(self.quaternion(SensorKind::DeviceOrientation, device)?);
        }
        if let Some(pressure) = &source.pressure {
            let channel = Channel::new(SensorKind::Pressure, &[self.column(&pressure.column)?]);
            channels.push(match pressure.unit {
                PressureUnit::Pa => channel,
                PressureUnit::Hpa => channel.times(100.0),
                PressureUnit::Kpa => channel.times(1000.0),
                PressureUnit::M => channel.of_form(Form::PressureHeight),
            });
        }
        self.navigation(&mut channels)?;
        if let Some(reference) = &source.reference {
            let mut channel = self.quaternion(SensorKind::Reference, reference)?;
            channel.scored = self.optional(reference.scored.as_ref())?;
            channels.push(channel);
        }
        self.finish(channels)
    }

    /// The channels of the vector sensors.
    fn vectors(&self) -> Result<Vec<Channel>> {
        use SensorKind as Kind;
        let source = self.source;
        let rate = |unit: Option<RateUnit>| {
            let unit = self.options.gyroscope_unit.or(unit);
            (unit.map_or(1.0, RateUnit::to_rad_per_s), false)
        };
        let rate_or_angle = |unit: Option<RateColumnUnit>| match unit {
            Some(RateColumnUnit::Rad) => (1.0, true),
            Some(RateColumnUnit::Deg) => (1_f64.to_radians(), true),
            Some(RateColumnUnit::DegPerS) => rate(Some(RateUnit::DegPerS)),
            Some(RateColumnUnit::RadPerS) | None => rate(None),
        };
        let force = |unit: Option<ForceColumnUnit>| {
            let unit = match unit {
                Some(ForceColumnUnit::MPerS) => return (1.0, true),
                Some(ForceColumnUnit::G) => Some(ForceUnit::G),
                Some(ForceColumnUnit::MPerS2) | None => None,
            };
            let unit = self.options.accelerometer_unit.or(unit);
            (unit.map_or(1.0, ForceUnit::to_m_per_s2), false)
        };
        let field = |unit: Option<FieldUnit>| {
            let unit = self.options.magnetometer_unit.or(unit);
            (unit.map_or(1.0, FieldUnit::to_microtesla), false)
        };
        let raw = source.magnetometer_uncalibrated.as_ref();
        let bias = source.device_gyroscope_bias.as_ref();
        let channels = [
            self.vector(Kind::Gyroscope, source.gyroscope.as_ref(), rate_or_angle)?,
            self.vector(Kind::Accelerometer, source.accelerometer.as_ref(), force)?,
            self.vector(Kind::Magnetometer, source.magnetometer.as_ref(), field)?,
            self.vector(Kind::MagnetometerUncalibrated, raw, field)?,
            self.vector(Kind::DeviceGyroscopeBias, bias, rate)?,
            self.vector(Kind::Position, source.position.as_ref(), |_| (1.0, false))?,
            self.vector(Kind::Velocity, source.velocity.as_ref(), |_| (1.0, false))?,
        ];
        Ok(channels.into_iter().flatten().collect())
    }

    fn finish(self, channels: Vec<Channel>) -> Result<Layout> {
        let Some(time) = &self.source.time else {
            return Err(self.problem(
                "missing key `time`: the column of the time stamps and its unit, or the rate of the rows, e.g. \
                 time = { rate_hz = 100.0 }",
            ));
        };
        let (time, time_form) = self.time(time)?;
        let rows = match &self.source.rows {
            Some(filter) => Some(RowsOf {
                column: self.column(&filter.column)?,
                equals: filter.equals.clone().into_bytes(),
            }),
            None => None,
        };
        let layout = Layout {
            time,
            time_form,
            channels,
            decimal_comma: self.source.decimal_comma,
            rows,
            names: self.names,
        };
        check_columns(&layout, self.manifest_file)?;
        if layout.channels.is_empty() {
            return Err(RecordingError::manifest(
                self.manifest_file,
                format!(
                    "no columns of any sensor for {}: add e.g. [gyroscope] with `columns`",
                    self.file
                ),
            ));
        }
        Ok(layout)
    }

    /// The column of the time stamps, and how they are written there.
    fn time(&self, time: &TimeColumn) -> Result<(usize, TimeForm)> {
        let wrong = |what: &str| Err(self.problem(format!("[time] {what}")));
        match (&time.column, &time.columns, time.unit, time.rate_hz) {
            (Some(column), None, Some(unit), None) => Ok((self.column(column)?, time_form(unit))),
            (Some(_), None, None, None) => {
                wrong("missing key `unit`: one of s, ms, us, ns, date-time, time-of-day")
            }
            (None, Some([date, time_of_day]), None | Some(TimeUnit::DateTime), None) => {
                let form = TimeForm::DateAndTime(self.column(time_of_day)?);
                Ok((self.column(date)?, form))
            }
            (None, Some(_), Some(_), None) => {
                wrong("has two `columns`, a date and a time of day, whose `unit` is date-time")
            }
            (None, None, None, Some(rate_hz)) => match rate_hz {
                1e-3..=1e6 => Ok((0, TimeForm::Rate(rate_hz))),
                _ => wrong("rate_hz: expected rows in a second, 0.001 to 1000000"),
            },
            _ => wrong(
                "needs either `column` and `unit`, or `columns` with a date and a time of day, or `rate_hz` alone",
            ),
        }
    }

    fn problem(&self, problem: impl Into<String>) -> RecordingError {
        RecordingError::manifest(self.manifest_file, problem)
    }

    fn column(&self, column: &Column) -> Result<usize> {
        let missing = |what: String| RecordingError::MissingColumns {
            file: self.file.to_owned(),
            missing: what,
            present: join(self.names.iter().map(String::as_str)),
            advice: format!("correct the column in {}", self.manifest_file),
        };
        match column {
            Column::Number(0) => Err(self.problem("column number 0: columns are counted from 1")),
            Column::Number(number) if *number <= self.names.len() => Ok(number - 1),
            Column::Number(number) => Err(missing(format!("column number {number}"))),
            Column::Name(_) if !self.source.header => {
                Err(self.problem("with header = false columns are given by number, from 1"))
            }
            Column::Name(name) => {
                let mut places = self.names.iter().enumerate().filter(|(_, n)| *n == name);
                let Some((place, _)) = places.next() else {
                    return Err(missing(format!("column {}", join([name.as_str()]))));
                };
                if places.next().is_some() {
                    return Err(RecordingError::RepeatedColumn {
                        file: self.file.to_owned(),
                        column: name.clone(),
                    });
                }
                Ok(place)
            }
        }
    }

    fn vector<U: Copy>(
        &self,
        kind: SensorKind,
        columns: Option<&VectorColumns<U>>,
        factor: impl Fn(Option<U>) -> (f64, bool),
    ) -> Result<Option<Channel>> {
        let Some(vector) = columns else {
            return Ok(None);
        };
        let (factor, is_increment) = factor(vector.unit);
        let scale = vector.scale.unwrap_or(1.0);
        if !scale.is_normal() {
            return Err(self.problem(format!(
                "[{}] scale = {scale}: expected what a number is multiplied by, e.g. 0.001",
                kind.name().replace('-', "_")
            )));
        }
        let axes = match &vector.axes {
            Some(text) => text.parse().map_err(|expected: &str| {
                self.problem(format!(
                    "[{}] axes = {text:?}: {expected}",
                    kind.name().replace('-', "_")
                ))
            })?,
            None => SignedAxes::AS_THEY_ARE,
        };
        let mut channel = Channel::new(kind, &[]);
        for (body_axis, (file_axis, sign)) in axes.by_body_axis().into_iter().enumerate() {
            let column = self.column(&vector.columns[file_axis])?;
            channel.put(body_axis, Some(column), sign * factor * scale);
        }
        if is_increment {
            channel.form = Form::Increment;
        }
        Ok(Some(channel))
    }

    fn quaternion(&self, kind: SensorKind, quaternion: &QuaternionColumns) -> Result<Channel> {
        let channel = Channel::new(kind, &self.wxyz(&quaternion.columns, quaternion.order)?);
        Ok(match quaternion.direction {
            QuaternionDirection::BodyToWorld => channel,
            QuaternionDirection::WorldToBody => channel.of_form(Form::Inverse),
        })
    }

    /// The columns of a quaternion, w first.
    fn wxyz(&self, columns: &[Column; 4], order: QuaternionOrder) -> Result<[usize; 4]> {
        let mut places = self.places(columns)?;
        if matches!(order, QuaternionOrder::Xyzw) {
            places.rotate_right(1);
        }
        Ok(places)
    }
}

fn time_form(unit: TimeUnit) -> TimeForm {
    match unit {
        TimeUnit::S => TimeForm::Decimal(9),
        TimeUnit::Ms => TimeForm::Decimal(6),
        TimeUnit::Us => TimeForm::Decimal(3),
        TimeUnit::Ns => TimeForm::Decimal(0),
        TimeUnit::DateTime => TimeForm::DateTime,
        TimeUnit::TimeOfDay => TimeForm::TimeOfDay,
    }
}

/// Refuses a column that is named twice: one of the two is a slip of the pen. Only the device's own
/// orientation may be the reference as well, where a file holds nothing better, and the parts of a
/// reference track share its position.
fn check_columns(layout: &Layout, manifest_file: &str) -> Result<()> {
    let mut used = layout.time_columns();
    let mut channels = layout.channels.iter();
    let orientation = channels.find(|channel| channel.kind == SensorKind::DeviceOrientation);
    for channel in &layout.channels {
        let is_reference = channel.kind == SensorKind::Reference
            && matches!(channel.form, Form::Plain | Form::Inverse);
        for column in channel.read() {
            let own = orientation.is_some_and(|own| own.columns.contains(&Some(column)));
            let is_shared = is_reference && own;
            if used.contains(&column) && !is_shared {
                let name = layout.names.get(column).map_or("", String::as_str);
                return Err(RecordingError::manifest(
                    manifest_file,
                    format!("column `{name}` is used twice; every column has one meaning"),
                ));
            }
            used.push(column);
        }
    }
    Ok(())
}
