//! From a manifest's columns to those of the file.

use super::problem;
use super::schema::{
    Column, Manifest, PressureUnit, QuaternionColumns, QuaternionDirection, QuaternionOrder,
    TimeUnit, VectorColumns,
};
use crate::delimited::{Channel, Layout};
use crate::error::{RecordingError, Result, join};
use crate::event::SensorKind;
use crate::options::{FieldUnit, ForceUnit, OpenOptions, RateUnit};

/// Finds the manifest's columns in the file.
pub(super) struct LayoutBuilder<'a> {
    pub(super) manifest: &'a Manifest,
    pub(super) manifest_file: &'a str,
    pub(super) file: &'a str,
    pub(super) names: Vec<String>,
    pub(super) options: &'a OpenOptions,
}

impl LayoutBuilder<'_> {
    pub(super) fn build(self) -> Result<Layout> {
        let manifest = self.manifest;
        let mut channels = Vec::new();
        let rate = |unit: Option<RateUnit>| {
            self.options
                .gyroscope_unit
                .or(unit)
                .map_or(1.0, RateUnit::to_rad_per_s)
        };
        let force = |unit: Option<ForceUnit>| {
            self.options
                .accelerometer_unit
                .or(unit)
                .map_or(1.0, ForceUnit::to_m_per_s2)
        };
        let field = |unit: Option<FieldUnit>| {
            self.options
                .magnetometer_unit
                .or(unit)
                .map_or(1.0, FieldUnit::to_microtesla)
        };
        channels.extend(self.vector(SensorKind::Gyroscope, manifest.gyroscope.as_ref(), rate)?);
        channels.extend(self.vector(
            SensorKind::Accelerometer,
            manifest.accelerometer.as_ref(),
            force,
        )?);
        channels.extend(self.vector(
            SensorKind::Magnetometer,
            manifest.magnetometer.as_ref(),
            field,
        )?);
        let raw = manifest.magnetometer_uncalibrated.as_ref();
        channels.extend(self.vector(SensorKind::MagnetometerUncalibrated, raw, field)?);
        let bias = manifest.device_gyroscope_bias.as_ref();
        channels.extend(self.vector(SensorKind::DeviceGyroscopeBias, bias, rate)?);
        channels.extend(self.vector(SensorKind::Position, manifest.position.as_ref(), |_| 1.0)?);
        channels.extend(self.vector(SensorKind::Velocity, manifest.velocity.as_ref(), |_| 1.0)?);
        if let Some(device) = &manifest.device_orientation {
            if device.scored.is_some() {
                return Err(problem(
                    self.manifest_file,
                    "[device_orientation] has `scored`, which belongs to [reference]".to_owned(),
                ));
            }
            let (columns, inverse) = self.quaternion(device)?;
            channels.push(Channel::DeviceOrientation { columns, inverse });
        }
        if let Some(pressure) = &manifest.pressure {
            let factor = match pressure.unit {
                PressureUnit::Pa => 1.0,
                PressureUnit::Hpa => 100.0,
                PressureUnit::Kpa => 1000.0,
            };
            let column = self.column(&pressure.column)?;
            channels.push(Channel::one(SensorKind::Pressure, column, factor));
        }
        if let Some(reference) = &manifest.reference {
            let (columns, inverse) = self.quaternion(reference)?;
            let scored = reference
                .scored
                .as_ref()
                .map(|c| self.column(c))
                .transpose()?;
            channels.push(Channel::Reference {
                columns,
                inverse,
                scored,
            });
        }
        self.finish(channels)
    }

    fn finish(self, channels: Vec<Channel>) -> Result<Layout> {
        let layout = Layout {
            time: self.column(&self.manifest.time.column)?,
            time_exponent: match self.manifest.time.unit {
                TimeUnit::S => 9,
                TimeUnit::Ms => 6,
                TimeUnit::Us => 3,
                TimeUnit::Ns => 0,
            },
            channels,
            decimal_comma: self.manifest.decimal_comma,
            names: self.names,
        };
        check_columns(&layout, self.manifest_file)?;
        if self.manifest.gyroscope.is_none() {
            return Err(RecordingError::no_gyroscope(
                self.manifest_file,
                &layout.sensors(),
            ));
        }
        Ok(layout)
    }

    fn column(&self, column: &Column) -> Result<usize> {
        let missing = |what: String| RecordingError::MissingColumns {
            file: self.file.to_owned(),
            missing: what,
            present: join(self.names.iter().map(String::as_str)),
            advice: format!("correct the column in {}", self.manifest_file),
        };
        match column {
            Column::Number(0) => Err(problem(
                self.manifest_file,
                "column number 0: columns are counted from 1".to_owned(),
            )),
            Column::Number(number) if *number <= self.names.len() => Ok(number - 1),
            Column::Number(number) => Err(missing(format!("column number {number}"))),
            Column::Name(_) if !self.manifest.header => Err(problem(
                self.manifest_file,
                "with header = false columns are given by number, from 1".to_owned(),
            )),
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
        factor: impl Fn(Option<U>) -> f64,
    ) -> Result<Option<Channel>> {
        let Some(vector) = columns else {
            return Ok(None);
        };
        let factor = factor(vector.unit);
        let axes = match &vector.axes {
            Some(text) => parse_axes(text).ok_or_else(|| {
                problem(
                    self.manifest_file,
                    format!(
                        "[{}] axes = {text:?}: expected each of x, y, z once, with or without a minus, e.g. \"x,-y,z\"",
                        kind.name().replace('-', "_")
                    ),
                )
            })?,
            None => [(0, 1.0), (1, 1.0), (2, 1.0)],
        };
        let mut places = [0; 3];
        let mut factors = [1.0; 3];
        for (body_axis, (file_axis, sign)) in axes.into_iter().enumerate() {
            places[body_axis] = self.column(&vector.columns[file_axis])?;
            factors[body_axis] = sign * factor;
        }
        Ok(Some(Channel::Vector {
            kind,
            columns: places,
            factors,
        }))
    }

    fn quaternion(&self, quaternion: &QuaternionColumns) -> Result<([usize; 4], bool)> {
        let mut places = [0; 4];
        for (place, column) in places.iter_mut().zip(&quaternion.columns) {
            *place = self.column(column)?;
        }
        if matches!(quaternion.order, QuaternionOrder::Xyzw) {
            places.rotate_right(1);
        }
        Ok((
            places,
            quaternion.direction == QuaternionDirection::WorldToBody,
        ))
    }
}

/// `x,-y,z`: for each body axis the file's axis and its sign.
fn parse_axes(text: &str) -> Option<[(usize, f64); 3]> {
    let mut axes = [(0, 0.0); 3];
    let mut used = [false; 3];
    let mut parts = text.split(',');
    for axis in &mut axes {
        let part = parts.next()?.trim();
        let (name, sign) = part
            .strip_prefix('-')
            .map_or((part, 1.0), |rest| (rest, -1.0));
        let place = ["x", "y", "z"].iter().position(|n| *n == name)?;
        if std::mem::replace(&mut used[place], true) {
            return None;
        }
        *axis = (place, sign);
    }
    parts.next().is_none().then_some(axes)
}

/// Refuses a column that is named twice: one of the two is a slip of the pen. Only the device's own
/// orientation may be the reference as well, where a file holds nothing better.
fn check_columns(layout: &Layout, manifest_file: &str) -> Result<()> {
    let mut used = vec![layout.time];
    let orientation = layout.channels.iter().find_map(|channel| match channel {
        Channel::DeviceOrientation { columns, .. } => Some(columns),
        _ => None,
    });
    for channel in &layout.channels {
        let is_reference = matches!(channel, Channel::Reference { .. });
        for column in channel.columns() {
            let is_shared = is_reference && orientation.is_some_and(|own| own.contains(&column));
            if used.contains(&column) && !is_shared {
                let name = layout.names.get(column).map_or("", String::as_str);
                return Err(problem(
                    manifest_file,
                    format!("column `{name}` is used twice; every column has one meaning"),
                ));
            }
            used.push(column);
        }
    }
    Ok(())
}
