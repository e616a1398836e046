//! KITTI's raw recordings: a folder `oxts` with one file a sample in `data`, and `timestamps.txt`.
//!
//! Read first: `docs/formats.md`, section "KITTI". A file has thirty numbers: what the vehicle's GNSS/INS unit has measured
//! and what it has made of it. Body axes are forward, left, up; yaw counts from east to north.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use crate::delimited::{Channel, DelimitedSource, Form, Layout, Rows, TimeForm};
use crate::error::{RecordingError, Result};
use crate::event::SensorKind;
use crate::limits::{LOG_LINE, Limit};
use crate::metadata::{BodyAxes, Metadata};
use crate::recording::Opened;
use crate::text::{open_file, read_line};

/// The numbers of a file, behind the date and the time of day.
const NAMES: [&str; 32] = [
    "date",
    "time of day",
    "lat",
    "lon",
    "alt",
    "roll",
    "pitch",
    "yaw",
    "vn",
    "ve",
    "vf",
    "vl",
    "vu",
    "ax",
    "ay",
    "az",
    "af",
    "al",
    "au",
    "wx",
    "wy",
    "wz",
    "wf",
    "wl",
    "wu",
    "pos_accuracy",
    "vel_accuracy",
    "navstat",
    "numsats",
    "posmode",
    "velmode",
    "orimode",
];

/// The samples of a drive: minutes at 10 or 100 a second.
const FILES: Limit = Limit {
    what: "the folder",
    most: 1_000_000,
    unit: "files",
    advice: "divide the drive",
};

/// Opens a folder of that layout: the drive's, `oxts` or `oxts/data`; `None` when it is none.
pub(crate) fn open_folder(path: &Path, file: &str, metadata: &Metadata) -> Result<Option<Opened>> {
    let is_data = path.file_name().is_some_and(|name| name == "data");
    let above = path.parent().filter(|_| is_data).map(Path::to_owned);
    let candidates: Vec<PathBuf> = [path.join("oxts"), path.to_owned()]
        .into_iter()
        .chain(above)
        .collect();
    let is_root =
        |root: &&PathBuf| root.join("timestamps.txt").is_file() && root.join("data").is_dir();
    let Some(root) = candidates.iter().find(is_root) else {
        return Ok(None);
    };
    let failed = |error| RecordingError::io(file, "list the folder", error);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(root.join("data")).map_err(failed)? {
        let entry = entry.map_err(failed)?.path();
        if crate::open::has_extension(&entry, "txt") {
            files.push(entry);
            FILES.check(files.len() as u64, file, "")?;
        }
    }
    files.sort_unstable();
    // A folder of a laser scanner has the same layout with other files.
    let Some(first) = files.first() else {
        return Ok(None);
    };
    let mut text = String::new();
    let input = open_file(first, &first.display().to_string())?;
    let is_text = input.take(LOG_LINE).read_to_string(&mut text).is_ok();
    if !is_text || text.split_whitespace().count() != NAMES.len() - 2 {
        return Ok(None);
    }
    let stamps = root.join("timestamps.txt");
    let stamps = BufReader::new(open_file(&stamps, &stamps.display().to_string())?);
    let lines = Lines {
        stamps,
        files: files.into_iter(),
        line: Vec::new(),
        at: 0,
    };
    let mut builder = csv::ReaderBuilder::new();
    builder.delimiter(b' ').has_headers(false);
    let name = format!("{file} (samples of oxts as lines)");
    let rows = Rows::new(name, &mut builder, Box::new(lines), 0);
    let layout = layout();
    let metadata = Metadata {
        format: "kitti".to_owned(),
        body_axes: Some(BodyAxes::Flu),
        ..metadata.clone()
    };
    let sensors = layout.sensors();
    let mut opened = Opened::new(
        metadata,
        sensors,
        Box::new(DelimitedSource::new(rows, layout)),
    );
    opened.notes.push(
        "Positions, velocities and the device's orientation are the solution of the vehicle's own GNSS/INS unit, not a receiver's \
         fixes: their errors last, and a run over them is not independent of it."
            .to_owned(),
    );
    Ok(Some(opened))
}

fn layout() -> Layout {
    let place = |name: &str| {
        NAMES
            .iter()
            .position(|known| *known == name)
            .unwrap_or_default()
    };
    let columns = |names: [&str; 3]| names.map(place);
    let mut position = Channel::new(SensorKind::GnssPosition, &columns(["lat", "lon", "alt"]));
    let degree = 1_f64.to_radians();
    position.put(0, Some(place("lat")), degree);
    position.put(1, Some(place("lon")), degree);
    // One number for the position: taken as that of the plane, of which one axis has the root of its half, and as that of
    // the height, of which the files say nothing.
    let accuracy = Some(place("pos_accuracy"));
    position.put(3, accuracy, std::f64::consts::FRAC_1_SQRT_2);
    position.put(4, accuracy, std::f64::consts::FRAC_1_SQRT_2);
    position.put(5, accuracy, 1.0);
    position.put(7, Some(place("numsats")), 1.0);
    let mut velocity = Channel::new(SensorKind::GnssVelocity, &columns(["vn", "ve", "vu"]));
    velocity.put(2, Some(place("vu")), -1.0);
    let angles = columns(["roll", "pitch", "yaw"]);
    Layout {
        names: NAMES.map(str::to_owned).to_vec(),
        time: 0,
        time_form: TimeForm::DateAndTime(1),
        channels: vec![
            Channel::new(SensorKind::Gyroscope, &columns(["wx", "wy", "wz"])),
            Channel::new(SensorKind::Accelerometer, &columns(["ax", "ay", "az"])),
            position,
            velocity,
            Channel::new(SensorKind::DeviceOrientation, &angles).of_form(Form::RollPitchYaw),
        ],
        decimal_comma: false,
        rows: None,
    }
}

/// The stamps and the files side by side, as lines. A sample whose file or stamp is missing is a line that is short.
struct Lines {
    stamps: BufReader<File>,
    files: std::vec::IntoIter<PathBuf>,
    line: Vec<u8>,
    at: usize,
}

impl Lines {
    fn fill(&mut self) -> std::io::Result<bool> {
        let Some(path) = self.files.next() else {
            return Ok(false);
        };
        let other = |error: RecordingError| std::io::Error::other(error.to_string());
        let mut stamp = Vec::new();
        read_line(&mut self.stamps, LOG_LINE, &mut stamp, "timestamps.txt").map_err(other)?;
        let mut text = Vec::new();
        File::open(&path)?
            .take(4 * LOG_LINE)
            .read_to_end(&mut text)?;
        self.line.clear();
        self.at = 0;
        let words = stamp
            .split(u8::is_ascii_whitespace)
            .chain(text.split(u8::is_ascii_whitespace));
        for word in words.filter(|word| !word.is_empty()) {
            if !self.line.is_empty() {
                self.line.push(b' ');
            }
            self.line.extend_from_slice(word);
        }
        self.line.push(b'\n');
        Ok(true)
    }
}

impl Read for Lines {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        if self.at == self.line.len() && !self.fill()? {
            return Ok(0);
        }
        let rest = &self.line[self.at..];
        let count = rest.len().min(out.len());
        out[..count].copy_from_slice(&rest[..count]);
        self.at += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Sample;
    use crate::{OpenOptions, open};

    fn drive(samples: usize) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("oxts/data");
        std::fs::create_dir_all(&data).unwrap();
        let mut stamps = String::new();
        for k in 0..samples {
            stamps.push_str(&format!(
                "2011-09-26 13:02:{:02}.{:09}\n",
                20 + k / 10,
                k % 10 * 100_000_000
            ));
            // East, then to the left.
            let yaw = 0.1 * k as f64;
            let row = format!(
                "49.015 8.434 116.4 0.02 0.01 {yaw} 1.5 9.0 9.1 0.1 0.05 0.2 0.3 9.8 0.2 0.3 9.8 0.01 0.02 0.03 0.01 0.02 0.03 \
                 0.5 0.04 4 9 4 4 0\n"
            );
            std::fs::write(data.join(format!("{k:010}.txt")), row).unwrap();
        }
        std::fs::write(folder.path().join("oxts/timestamps.txt"), stamps).unwrap();
        folder
    }

    #[test]
    fn the_drive_oxts_and_its_data_all_open() {
        let folder = drive(25);
        for inside in ["", "oxts", "oxts/data"] {
            let path = folder.path().join(inside);
            let mut recording = open(&path, &OpenOptions::default()).unwrap();
            assert_eq!(recording.metadata().format, "kitti");
            let events: Vec<_> = recording.by_ref().map(Result::unwrap).collect();
            assert_eq!(events.len(), 25 * 5, "{inside}");
            assert_eq!(events[0].time_ns, 1_317_042_140_000_000_000);
            assert_eq!(events[124].time_ns - events[0].time_ns, 2_400_000_000);
            for event in &events[50..55] {
                let is_right = match event.sample {
                    Sample::AngularRate(v) => v == nalgebra::Vector3::new(0.01, 0.02, 0.03),
                    Sample::SpecificForce(v) => v == nalgebra::Vector3::new(0.2, 0.3, 9.8),
                    Sample::GnssPosition(fix) => {
                        let [n, e, d] = fix.std_m.unwrap();
                        (n * n + e * e - 0.25).abs() < 1e-12
                            && (d - 0.5).abs() < 1e-12
                            && fix.height_m == Some(116.4)
                    }
                    Sample::GnssVelocity(v) => {
                        (v.north_m_s, v.east_m_s, v.down_m_s) == (1.5, 9.0, Some(-0.05))
                    }
                    Sample::DeviceOrientation(q) => {
                        // A radian to the left of east, bow a little down.
                        let ahead = q * nalgebra::Vector3::x();
                        (ahead.y.atan2(ahead.x) - 1.0).abs() < 1e-9
                            && (ahead.z + 0.01_f64.sin()).abs() < 1e-9
                    }
                    _ => false,
                };
                assert!(is_right, "{event:?}");
            }
            assert!(
                recording
                    .issues()
                    .sentences()
                    .join(" ")
                    .contains("own GNSS/INS unit")
            );
        }
    }

    #[test]
    fn a_sample_that_is_cut_off_is_named() {
        let folder = drive(5);
        let file = folder.path().join("oxts/data/0000000002.txt");
        std::fs::write(file, "49.0 8.4 116.4").unwrap();
        let recording = open(folder.path(), &OpenOptions::default()).unwrap();
        let error = recording
            .filter_map(Result::err)
            .next()
            .unwrap()
            .to_string();
        assert!(
            error.contains("line 3") && error.contains("5 cells"),
            "{error}"
        );
        // Another sensor's folder of the same layout is none of this kind.
        let first = folder.path().join("oxts/data/0000000000.txt");
        std::fs::write(first, "1.0 2.0 3.0 0.4\n").unwrap();
        assert!(open(folder.path(), &OpenOptions::default()).is_err());
        std::fs::remove_dir_all(folder.path().join("oxts/data")).unwrap();
        assert!(open(folder.path(), &OpenOptions::default()).is_err());
    }
}
