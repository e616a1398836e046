//! From a manifest's columns of satellite receivers, speeds and headings to those of the file.

use super::super::navigation::{
    CoordinateUnit, EcefColumns, LocalColumns, PositionColumns, QualityCode, VelocityAxes,
    VelocityColumns,
};
use super::super::schema::{Column, QuaternionDirection};
use super::LayoutBuilder;
use crate::delimited::{Channel, Form};
use crate::error::Result;
use crate::event::SensorKind;
use crate::gnss::VERTICAL_OF_HORIZONTAL;
use crate::local_place::LocalPlace;

impl LayoutBuilder<'_> {
    /// Adds the channels of navigation.
    pub(super) fn navigation(&self, channels: &mut Vec<Channel>) -> Result<()> {
        let source = self.source;
        if let Some(position) = &source.gnss_position {
            channels.push(self.gnss_position(position)?);
        }
        if let Some(local) = &source.local_position {
            if source.gnss_position.is_some() {
                return Err(self.problem(
                    "has both [gnss_position] and [local_position]; a table has one position",
                ));
            }
            channels.push(self.local_position(local)?);
        }
        if let Some(velocity) = &source.gnss_velocity {
            channels.push(self.gnss_velocity(velocity)?);
        }
        if let Some(speed) = &source.forward_speed {
            let column = self.column(&speed.column)?;
            let factor = speed.unit.to_m_per_s();
            channels.push(Channel::new(SensorKind::ForwardSpeed, &[column]).times(factor));
        }
        if let Some(water) = &source.water_velocity {
            let factor = water.unit.to_m_per_s();
            let forward = [self.column(&water.forward)?];
            let mut row = Channel::new(SensorKind::WaterVelocity, &forward).times(factor);
            row.columns[1] = self.optional(water.starboard.as_ref())?;
            channels.push(row);
        }
        if let Some(heading) = &source.true_heading {
            let factor = heading.unit.to_rad();
            let column = [self.column(&heading.column)?];
            let mut row = Channel::new(SensorKind::TrueHeading, &column).times(factor);
            row.columns[1] = self.optional(heading.std.as_ref())?;
            channels.push(row);
        }
        if let Some(ecef) = &source.ecef_reference {
            self.ecef(ecef, channels)?;
        }
        Ok(())
    }

    fn gnss_position(&self, position: &PositionColumns) -> Result<Channel> {
        let is_minutes = position.unit == CoordinateUnit::DegreesMinutes;
        // Those are taken apart as they stand, by the form.
        let to_rad = if is_minutes {
            1.0
        } else {
            position.unit.to_rad()
        };
        let to_m = position.accuracy_unit.to_m();
        let mut row = Channel::new(SensorKind::GnssPosition, &[]);
        row.put(0, Some(self.column(&position.latitude)?), to_rad);
        row.put(1, Some(self.column(&position.longitude)?), to_rad);
        let height = self.optional(position.height.as_ref())?;
        row.put(2, height, position.height_unit.to_m());
        match (&position.std, &position.accuracy) {
            (Some(_), Some(_)) => {
                return Err(
                    self.problem("[gnss_position] has both `std` and `accuracy`; keep one of them")
                );
            }
            (Some(std), None) => {
                for (number, column) in (3..).zip(std) {
                    row.put(number, Some(self.column(column)?), to_m);
                }
            }
            (None, Some(accuracy)) => self.accuracy(&mut row, accuracy, to_m)?,
            (None, None) => {}
        }
        row.columns[6] = self.optional(position.hdop.as_ref())?;
        row.columns[7] = self.optional(position.satellites.as_ref())?;
        row.columns[8] = self.optional(position.quality.as_ref())?;
        match (position.quality_code, is_minutes) {
            (QualityCode::Gga, false) => Ok(row),
            (QualityCode::Gga, true) => Ok(row.of_form(Form::DegreesMinutes)),
            (QualityCode::Rtklib, false) => Ok(row.of_form(Form::RtklibPosition)),
            (QualityCode::Rtklib, true) => Err(self.problem(
                "[gnss_position] has unit = \"deg-min\" and quality_code = \"rtklib\", which writes degrees",
            )),
        }
    }

    /// The radius of a fix, and the vertical standard deviation where there is one.
    fn accuracy(&self, row: &mut Channel, accuracy: &[Column], to_m: f64) -> Result<()> {
        let wrong = |what: &str| Err(self.problem(format!("[gnss_position] accuracy: {what}")));
        let (radius, vertical) = match accuracy {
            [radius] => (self.column(radius)?, None),
            [radius, vertical] => (self.column(radius)?, Some(self.column(vertical)?)),
            _ => return wrong("expected [horizontal, vertical], or [horizontal] alone"),
        };
        if vertical == Some(radius) {
            return wrong("both columns are the same; write [horizontal] alone");
        }
        let of_an_axis = std::f64::consts::FRAC_1_SQRT_2 * to_m;
        row.put(3, Some(radius), of_an_axis);
        row.put(4, Some(radius), of_an_axis);
        match vertical {
            Some(vertical) => row.put(5, Some(vertical), to_m),
            None => row.put(5, Some(radius), VERTICAL_OF_HORIZONTAL * to_m),
        }
        Ok(())
    }

    fn local_position(&self, local: &LocalColumns) -> Result<Channel> {
        let wrong = |what: &str| Err(self.problem(format!("[local_position] {what}")));
        let Some(columns) = &local.columns else {
            return wrong("needs `columns`; a `topic` is of bags");
        };
        if local.std.is_some() && local.std_m.is_some() {
            return wrong("has both `std` and `std_m`; keep one of them");
        }
        let place = LocalPlace::new(&local.origin, local.axes, local.std_m, self.manifest_file)?;
        let mut row = Channel::new(SensorKind::GnssPosition, &[]);
        self.put_components(&mut row, columns, local.std.as_ref(), local.axes, 1.0)?;
        Ok(row.of_form(Form::Local(place)))
    }

    fn gnss_velocity(&self, velocity: &VelocityColumns) -> Result<Channel> {
        let wrong = |what: &str| Err(self.problem(format!("[gnss_velocity] {what}")));
        match (&velocity.columns, &velocity.speed, &velocity.course) {
            (Some(columns), None, None) => {
                if velocity.speed_std.is_some() {
                    return wrong("has `speed_std` without `speed`; with `columns` it is `std`");
                }
                self.components(columns, velocity)
            }
            (None, Some(speed), Some(course)) => {
                if velocity.std.is_some() {
                    return wrong("has `std` without `columns`; with `speed` it is `speed_std`");
                }
                let mut row = Channel::new(SensorKind::GnssVelocity, &[self.column(speed)?])
                    .times(velocity.speed_unit.to_m_per_s())
                    .of_form(Form::SpeedAndCourse);
                row.put(1, Some(self.column(course)?), velocity.course_unit.to_rad());
                row.columns[2] = self.optional(velocity.speed_std.as_ref())?;
                Ok(row)
            }
            _ => wrong("needs either three `columns`, or `speed` and `course`"),
        }
    }

    fn components(&self, columns: &[Column; 3], velocity: &VelocityColumns) -> Result<Channel> {
        let mut row = Channel::new(SensorKind::GnssVelocity, &[]);
        let to_m_per_s = velocity.speed_unit.to_m_per_s();
        self.put_components(
            &mut row,
            columns,
            velocity.std.as_ref(),
            velocity.axes,
            to_m_per_s,
        )?;
        Ok(row)
    }

    /// Puts three components and their standard deviations, each times `factor`, as north, east, down.
    fn put_components(
        &self,
        row: &mut Channel,
        columns: &[Column; 3],
        std: Option<&[Column; 3]>,
        axes: VelocityAxes,
        factor: f64,
    ) -> Result<()> {
        let order = axes.order();
        for (column, number) in columns.iter().zip(order) {
            let sign = if number == 2 { axes.down() } else { 1.0 };
            row.put(number, Some(self.column(column)?), sign * factor);
        }
        for (column, number) in std.into_iter().flatten().zip(order) {
            row.put(3 + number, Some(self.column(column)?), factor);
        }
        Ok(())
    }

    fn ecef(&self, ecef: &EcefColumns, channels: &mut Vec<Channel>) -> Result<()> {
        let place = self.places(&ecef.position_m)?;
        let mut put = |kind, columns: &[usize]| {
            let inverse = ecef.direction == QuaternionDirection::WorldToBody;
            channels.push(Channel::new(kind, columns).of_form(Form::Ecef { place, inverse }));
        };
        put(SensorKind::ReferencePosition, &place);
        if let Some(velocity) = &ecef.velocity_m_s {
            put(SensorKind::ReferenceVelocity, &self.places(velocity)?);
        }
        if let Some(attitude) = &ecef.attitude {
            put(SensorKind::Reference, &self.wxyz(attitude, ecef.order)?);
        }
        Ok(())
    }

    pub(super) fn places<const N: usize>(&self, columns: &[Column; N]) -> Result<[usize; N]> {
        let mut places = [0; N];
        for (place, column) in places.iter_mut().zip(columns) {
            *place = self.column(column)?;
        }
        Ok(places)
    }

    pub(super) fn optional(&self, column: Option<&Column>) -> Result<Option<usize>> {
        column.map(|column| self.column(column)).transpose()
    }
}
