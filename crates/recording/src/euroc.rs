//! EuRoC's layout of a recording (ASL): a folder `mav0` with `imu0/data.csv` and perhaps
//! `state_groundtruth_estimate0/data.csv`, or one such table.
//!
//! Read first: `docs/formats.md`, section "EuRoC". Stamps are nanoseconds; the body axes are those of the inertial sensor, whose mounting the
//! tables do not tell;
//! the world of the reference has z up and an arbitrary heading.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::delimited::{Channel, DelimitedSource, Layout, Rows, TimeForm};
use crate::error::{RecordingError, Result, join};
use crate::event::SensorKind;
use crate::false_stamps::FalseStamps;
use crate::merge::Merged;
use crate::metadata::Metadata;
use crate::recording::{EventSource, Opened};
use crate::text::{Input, open_file};

/// What the columns of the two tables are called, without units.
const TIME: &str = "timestamp";
const RATE: [&str; 3] = ["w_RS_S_x", "w_RS_S_y", "w_RS_S_z"];
const FORCE: [&str; 3] = ["a_RS_S_x", "a_RS_S_y", "a_RS_S_z"];
const ATTITUDE: [&str; 4] = ["q_RS_w", "q_RS_x", "q_RS_y", "q_RS_z"];

const IMU: &str = "imu0";
const TRUTH: &str = "state_groundtruth_estimate0";

/// Whether a text begins with the header of a table of an inertial sensor.
pub(crate) fn recognises(text: &str) -> bool {
    let header = text.lines().next().unwrap_or_default();
    header.starts_with(['#', 't']) && header.contains(RATE[0]) && header.contains(FORCE[0])
}

/// Opens a table.
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let (sensors, source) = table(Box::new(input), file)?;
    RecordingError::check_sensors(file, &sensors)?;
    Ok(opened(metadata, sensors, source))
}

/// Opens a folder of that layout: `mav0`, what it is in, or `imu0`; `None` when it is none.
pub(crate) fn open_folder(path: &Path, metadata: &Metadata) -> Result<Option<Opened>> {
    let inside = path.join("mav0");
    let root = match inside.is_dir() {
        true => inside.as_path(),
        false => path,
    };
    let beside = root.join(IMU).join("data.csv");
    let imu = match beside.is_file() {
        true => beside,
        false => root.join("data.csv"),
    };
    let is_imu = imu.is_file() && {
        let mut head = String::new();
        let input = open_file(&imu, &imu.display().to_string())?;
        let read = BufReader::new(input.take(4096)).read_line(&mut head);
        read.is_ok() && recognises(&head)
    };
    if !is_imu {
        return Ok(None);
    }
    let mut sensors = Vec::new();
    let mut sources = Vec::new();
    let truth = root.join(TRUTH).join("data.csv");
    for path in [Some(imu), truth.is_file().then_some(truth)]
        .into_iter()
        .flatten()
    {
        let name = path.display().to_string();
        let (kinds, source) = table(Box::new(open_file(&path, &name)?), &name)?;
        sensors.extend(kinds);
        sources.push(source);
    }
    sensors.sort_unstable_by_key(|kind| kind.order());
    let mut opened = opened(metadata.clone(), sensors, Box::new(Merged::new(sources)));
    if opened.sensors.contains(&SensorKind::Reference) {
        opened.notes.push(
            "The reference is state_groundtruth_estimate0: the attitude of the body; its positions and biases are not used."
                .to_owned(),
        );
    }
    let others = others(root);
    if !others.is_empty() {
        let names = join(others.iter().map(String::as_str));
        opened
            .notes
            .push(format!("Left out: {names}, of which nothing is used."));
    }
    Ok(Some(opened))
}

fn opened(metadata: Metadata, sensors: Vec<SensorKind>, source: Box<dyn EventSource>) -> Opened {
    let metadata = Metadata {
        format: "euroc".to_owned(),
        ..metadata
    };
    Opened::new(metadata, sensors, source)
}

/// The other folders of the recording: cameras, a laser tracker.
fn others(root: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(root) else {
        return Vec::new();
    };
    let names = entries
        .flatten()
        .take(64)
        .filter(|entry| entry.path().is_dir());
    let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| name != IMU && name != TRUTH).collect();
    names.sort_unstable();
    names
}

/// The sensors of a table, and its events.
fn table(input: Input, file: &str) -> Result<(Vec<SensorKind>, Box<dyn EventSource>)> {
    let mut rows = Rows::new(file.to_owned(), &mut csv::ReaderBuilder::new(), input, 0);
    let header = rows.first()?;
    let names: Vec<String> = header
        .iter()
        .map(|name| {
            let name = String::from_utf8_lossy(name);
            name.trim().trim_start_matches('#').trim().to_owned()
        })
        .collect();
    let place = |wanted: &str| {
        names
            .iter()
            .position(|name| name.split([' ', '[']).next() == Some(wanted))
    };
    let Some(time) = place(TIME) else {
        return Err(RecordingError::MissingColumns {
            file: file.to_owned(),
            missing: format!("column {TIME}"),
            present: join(names.iter().map(String::as_str)),
            advice: "a table of EuRoC begins with it".to_owned(),
        });
    };
    let columns = |names: &[&str]| {
        names
            .iter()
            .map(|name| place(name))
            .collect::<Option<Vec<_>>>()
    };
    let channels: Vec<Channel> = [
        (SensorKind::Gyroscope, &RATE[..]),
        (SensorKind::Accelerometer, &FORCE),
        (SensorKind::Reference, &ATTITUDE),
    ]
    .into_iter()
    .filter_map(|(kind, names)| Some(Channel::new(kind, &columns(names)?)))
    .collect();
    let layout = Layout {
        names,
        time,
        time_form: TimeForm::Decimal(crate::stamp::NANOSECONDS),
        channels,
        decimal_comma: false,
        rows: None,
    };
    let sensors = layout.sensors();
    let source = FalseStamps::new(DelimitedSource::new(rows, layout));
    Ok((sensors, Box::new(source)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Sample;
    use crate::{OpenOptions, open};

    const IMU_HEADER: &str = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],\
        a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
    const TRUTH_HEADER: &str = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], \
        v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1]\n";

    #[test]
    fn the_folder_what_it_is_in_and_the_table_alone_all_open() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("mav0");
        for name in ["imu0", "cam0", TRUTH] {
            std::fs::create_dir_all(root.join(name)).unwrap();
        }
        let imu: String = (0..300)
            .map(|k| {
                format!(
                    "{},0.1,0.2,{},0.3,0.4,9.81\r\n",
                    1_403_636_579_758_555_392_i64 + 5_000_000 * k,
                    k
                )
            })
            .collect();
        std::fs::write(root.join("imu0/data.csv"), format!("{IMU_HEADER}{imu}")).unwrap();
        let truth = "1403636579758555392,1,2,3,0.5,0.5,0.5,0.5,0,0,0\n";
        std::fs::write(
            root.join(TRUTH).join("data.csv"),
            format!("{TRUTH_HEADER}{truth}"),
        )
        .unwrap();
        let options = OpenOptions {
            plausibility: false,
            ..OpenOptions::default()
        };
        for (path, has_truth) in [
            (folder.path().to_owned(), true),
            (root.clone(), true),
            (root.join("imu0"), false),
            (root.join("imu0/data.csv"), false),
        ] {
            let mut recording = open(&path, &options).unwrap();
            assert_eq!(recording.metadata().format, "euroc");
            let events: Vec<_> = recording.by_ref().map(Result::unwrap).collect();
            assert_eq!(
                events.len(),
                600 + usize::from(has_truth),
                "{}",
                path.display()
            );
            assert_eq!(events[0].time_ns, 1_403_636_579_758_555_392);
            let Sample::AngularRate(rate) = events[0].sample else {
                panic!()
            };
            assert_eq!(rate, nalgebra::Vector3::new(0.1, 0.2, 0.0));
            let is_reference = |s: &Sample| matches!(s, Sample::Reference(r) if (r.attitude.w - 0.5).abs() < 1e-12);
            assert_eq!(
                events.iter().any(|event| is_reference(&event.sample)),
                has_truth
            );
            if has_truth {
                let told = recording.issues().sentences().join(" ");
                assert!(told.contains("Left out: cam0"), "{told}");
            }
        }
        let bad = format!("{IMU_HEADER}1,2,3\n");
        std::fs::write(root.join("imu0/data.csv"), bad).unwrap();
        let error = open(&root, &options)
            .unwrap()
            .next()
            .unwrap()
            .unwrap_err()
            .to_string();
        assert!(error.contains("imu0/data.csv, line 2"), "{error}");
    }
}
