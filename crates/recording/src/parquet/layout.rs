//! Which columns of a Parquet file make which sensor.

use parquet::basic::Type as Physical;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};

use super::{MOVING, SENSORS, TIME};
use crate::error::{RecordingError, Result, join, shown};
use crate::event::SensorKind;

/// Which columns of the file are read, and what they make.
pub(super) struct Layout {
    /// Column numbers in the file; the first is the time.
    pub(super) columns: Vec<usize>,
    pub(super) names: Vec<String>,
    /// Sensor and where its first value stands in `columns`.
    pub(super) sensors: Vec<(SensorKind, usize)>,
    pub(super) moving: Option<usize>,
}

impl Layout {
    pub(super) fn find<R: ChunkReader + 'static>(
        reader: &SerializedFileReader<R>,
        file: &str,
    ) -> Result<Self> {
        let schema = reader.metadata().file_metadata().schema_descr();
        let present: Vec<(String, Physical)> = schema
            .columns()
            .iter()
            .map(|column| (column.path().string(), column.physical_type()))
            .collect();
        let place_of = |name: &str| present.iter().position(|(n, _)| n == name);
        let missing = |names: &[&str]| {
            RecordingError::MissingColumns {
            file: file.to_owned(),
            missing: format!("column {}", join(names.iter().copied())),
            present: join(present.iter().map(|(name, _)| name.as_str())),
            advice: "the columns are t (s), gx gy gz (rad/s), ax ay az (m/s^2), mx my mz (uT), as docs/formats.md says"
                .to_owned(),
        }
        };
        let mut layout = Self {
            columns: vec![place_of(TIME).ok_or_else(|| missing(&[TIME]))?],
            names: Vec::new(),
            sensors: Vec::new(),
            moving: None,
        };
        for (kind, names) in SENSORS {
            let names = names.split(' ');
            let absent: Vec<&str> = names.clone().filter(|n| place_of(n).is_none()).collect();
            if absent.len() == names.clone().count() {
                continue;
            }
            if !absent.is_empty() {
                return Err(missing(&absent));
            }
            layout.sensors.push((kind, layout.columns.len()));
            layout.columns.extend(names.filter_map(place_of));
        }
        let kinds: Vec<_> = layout.sensors.iter().map(|(kind, _)| *kind).collect();
        if kinds.is_empty() {
            return Err(missing(&["gx", "gy", "gz"]));
        }
        RecordingError::check_sensors(file, &kinds)?;
        if let Some(place) = place_of(MOVING) {
            layout.moving = Some(layout.columns.len());
            layout.columns.push(place);
        }
        layout.check_types(&present, file)?;
        let repetitions = |place: usize| schema.column(place).max_rep_level();
        if layout.columns.iter().any(|place| repetitions(*place) > 0) {
            return Err(missing(&["with single numbers (lists are not read)"]));
        }
        Ok(layout)
    }

    fn check_types(&mut self, present: &[(String, Physical)], file: &str) -> Result<()> {
        for &place in &self.columns {
            let (name, physical) = &present[place];
            let numeric = matches!(
                physical,
                Physical::FLOAT
                    | Physical::DOUBLE
                    | Physical::INT32
                    | Physical::INT64
                    | Physical::BOOLEAN
            );
            if !numeric {
                return Err(RecordingError::unsupported(
                    file,
                    format!(
                        "column `{}` is of type {physical}; expected float or double",
                        shown(name)
                    ),
                ));
            }
            self.names.push(name.clone());
        }
        Ok(())
    }
}
