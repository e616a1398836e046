//! Solutions of RTKLIB (`.pos`): positions and perhaps velocities of a receiver, after a header of lines with `%`.
//!
//! Read first: `docs/formats.md`, section "RTKLIB"; RTKLIB's manual, "Output Solution Format". The last line of the header
//! names the columns; the first of them are the time, a date and a time of day or GPS week and seconds of it.

use std::io::{BufReader, Cursor, Read};

use crate::delimited::{Blanks, Channel, DelimitedSource, Form, Layout, Rows, TimeForm};
use crate::error::{RecordingError, Result, shown};
use crate::event::SensorKind;
use crate::metadata::Metadata;
use crate::recording::Opened;
use crate::text::Input;

/// Bytes in which the header and the first row stand.
const HEAD: u64 = 1 << 16;
/// The names of the first column behind the time, of the forms that a solution can have.
const PLACES: [&str; 4] = [
    "latitude(deg)",
    "latitude(d'\")",
    "x-ecef(m)",
    "e-baseline(m)",
];
/// What is written before the first column.
const TIMES: [&str; 3] = ["GPST", "UTC", "JST"];

/// Whether a text begins with the header of a solution.
pub(crate) fn recognises(text: &str) -> bool {
    let mut lines = text.lines().take_while(|line| line.starts_with('%'));
    lines.any(|line| PLACES.iter().any(|place| line.contains(place)))
}

/// Opens a solution.
///
/// # Errors
/// It cannot be read, or has positions in another form than degrees and metres.
pub(crate) fn open(mut input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let mut head = Vec::new();
    let read = input.by_ref().take(HEAD).read_to_end(&mut head);
    read.map_err(|error| RecordingError::io(file, "read it", error))?;
    let text = String::from_utf8_lossy(&head).into_owned();
    let mut lines = text.lines();
    let comments = lines.by_ref().take_while(|line| line.starts_with('%'));
    let header = comments.filter(|line| PLACES.iter().any(|place| line.contains(place)));
    let names = names(header.last().unwrap_or_default());
    let first = text
        .lines()
        .find(|line| !line.starts_with('%'))
        .unwrap_or_default();
    let clock = names.first().map_or("GPST", String::as_str).to_owned();
    let has_commas = first.contains(',');
    let layout = layout(&names, first, has_commas, file)?;
    let sensors = layout.sensors();
    // The header is taken off here, so that rows are counted from behind it.
    let comments = head.split_inclusive(|byte| *byte == b'\n');
    let comments = comments.take_while(|line| line.starts_with(b"%"));
    let (lines_before, bytes) = comments.fold((0, 0), |(lines, bytes), line| {
        (lines + 1, bytes + line.len())
    });
    let mut rest = head;
    rest.drain(..bytes);
    let input = Cursor::new(rest).chain(input);
    let input: Input = match has_commas {
        true => Box::new(input),
        false => Box::new(Blanks::new(BufReader::with_capacity(1 << 16, input))),
    };
    let mut builder = csv::ReaderBuilder::new();
    builder
        .delimiter(if has_commas { b',' } else { b' ' })
        .comment(Some(b'%'))
        .has_headers(false);
    let rows = Rows::new(file.to_owned(), &mut builder, input, lines_before);
    let mut opened = Opened::ned(
        "rtklib",
        metadata,
        &sensors,
        Box::new(DelimitedSource::new(rows, layout)),
    );
    if clock != "UTC" {
        opened.notes.push(match clock.as_str() {
            "JST" => "Time stamps are Japan's, nine hours ahead of UTC, as the file says.".to_owned(),
            _ => "Time stamps are GPS time, which is ahead of UTC by the leap seconds since 1980, as the file says.".to_owned(),
        });
    }
    Ok(opened)
}

/// The names in the header, that of the time first.
fn names(header: &str) -> Vec<String> {
    let header = header.trim_start_matches('%');
    let names = header.split(|c: char| c.is_whitespace() || c == ',');
    names
        .filter(|name| !name.is_empty())
        .map(str::to_owned)
        .collect()
}

/// The columns of a solution, of which `first` is the first row.
fn layout(names: &[String], first: &str, has_commas: bool, file: &str) -> Result<Layout> {
    let refused = |problem: String| Err(RecordingError::unsupported(file, problem));
    let is_known = names
        .first()
        .is_some_and(|time| TIMES.contains(&time.as_str()));
    let Some(place) = names.get(1).filter(|_| is_known) else {
        return refused("no line with % names the columns of a solution of RTKLIB; write it again with its header (out-outhead=on)".to_owned());
    };
    if place != PLACES[0] {
        return refused(format!(
            "a solution with {}, which is not read; write it again with latitude and longitude in degrees and height \
             (out-solformat=llh, out-degform=deg)",
            shown(place)
        ));
    }
    // With commas the date and the time of day are one cell, unless the time is told by weeks.
    let has_date = first.contains('/');
    let (cells, time_form) = match (has_date, has_commas) {
        (true, true) => (1, TimeForm::DateTime),
        (true, false) => (2, TimeForm::DateAndTime(1)),
        (false, _) => (2, TimeForm::GpsWeek(1)),
    };
    let column = |name: &str| {
        let mut rest = names[1..].iter();
        rest.position(|other| other.split('(').next() == Some(name))
            .map(|place| place + cells)
    };
    let mut position = Channel::new(SensorKind::GnssPosition, &[]);
    for (number, name, factor) in [
        (0, "latitude", 1_f64.to_radians()),
        (1, "longitude", 1_f64.to_radians()),
        (2, "height", 1.0),
        (3, "sdn", 1.0),
        (4, "sde", 1.0),
        (5, "sdu", 1.0),
        (7, "ns", 1.0),
        (8, "Q", 1.0),
    ] {
        position.put(number, column(name), factor);
    }
    let mut channels = vec![position.of_form(Form::RtklibPosition)];
    if let [Some(north), Some(east), Some(up)] = ["vn", "ve", "vu"].map(column) {
        let mut velocity = Channel::new(SensorKind::GnssVelocity, &[north, east]);
        velocity.put(2, Some(up), -1.0);
        for (number, name) in [(3, "sdvn"), (4, "sdve"), (5, "sdvu")] {
            velocity.put(number, column(name), 1.0);
        }
        channels.push(velocity);
    }
    let time_names = ["date", "time of day"]
        .into_iter()
        .take(cells)
        .map(str::to_owned);
    Ok(Layout {
        names: time_names.chain(names[1..].iter().cloned()).collect(),
        time: 0,
        time_form,
        channels,
        decimal_comma: false,
        rows: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Event, Sample};
    use crate::gnss::GnssQuality;
    use crate::{OpenOptions, Recording, read_bytes};

    const HEADER: &str = "% program   : simulated\n\
        % (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)\n";
    const NAMES: &str = "%  GPST          latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  \
        sdun(m) age(s)  ratio    vn(m/s)    ve(m/s)    vu(m/s)   sdvn   sdve   sdvu  sdvne  sdveu  sdvun\n";

    fn read(text: &str) -> Recording {
        read_bytes(
            text.as_bytes().to_vec(),
            "rover.pos",
            &OpenOptions::default(),
        )
        .unwrap()
    }

    fn row(time: &str, quality: u8) -> String {
        format!(
            "{time}   47.123456789    8.5   460.25  {quality}  11  0.01  0.02  0.03  0.001  0.0  0.0  1.5  99.9  3.0  4.0  0.5  \
             0.1 0.2 0.3 0 0 0\n"
        )
    }

    #[test]
    fn a_row_is_a_fix_and_a_velocity_with_their_deviations() {
        let text = format!(
            "{HEADER}{NAMES}{}{}",
            row("2025/07/08 19:34:18.250", 1),
            row("2025/07/08 19:34:18.500", 2)
        );
        let mut recording = read(&text);
        assert_eq!(recording.metadata().format, "rtklib");
        let events: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
        assert_eq!(events.len(), 4);
        assert_eq!(events[0].time_ns, 1_752_003_258_250_000_000);
        let Sample::GnssPosition(fix) = events[0].sample else {
            panic!("{events:?}")
        };
        assert!((fix.latitude_rad - 47.123456789_f64.to_radians()).abs() < 1e-15);
        assert_eq!(
            (fix.height_m, fix.satellites, fix.std_m),
            (Some(460.25), Some(11), Some([0.01, 0.02, 0.03]))
        );
        assert_eq!(fix.quality, GnssQuality::RtkFixed);
        let Sample::GnssVelocity(velocity) = events[1].sample else {
            panic!("{events:?}")
        };
        assert_eq!(
            (velocity.north_m_s, velocity.east_m_s, velocity.down_m_s),
            (3.0, 4.0, Some(-0.5))
        );
        assert_eq!(velocity.std_m_s, Some([0.1, 0.2, 0.3]));
        let Sample::GnssPosition(fix) = events[2].sample else {
            panic!("{events:?}")
        };
        assert_eq!(fix.quality, GnssQuality::RtkFloat);
        assert!(
            recording
                .issues()
                .sentences()
                .join(" ")
                .contains("GPS time")
        );
    }

    #[test]
    fn weeks_and_commas_tell_the_same_time() {
        let weeks = format!("{HEADER}{NAMES}{}", row("2374  243258.250", 5));
        let date = row("2025/07/08 19:34:18.250", 5);
        let commas = date
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(",")
            .replacen(',', " ", 1);
        let commas = format!("{HEADER}{}{commas}\n", NAMES.replace("GPST", "UTC"));
        for text in [weeks, commas] {
            let mut recording = read(&text);
            let events: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
            assert_eq!(events.len(), 2, "{text}");
            assert_eq!(events[0].time_ns, 1_752_003_258_250_000_000, "{text}");
            assert_eq!(
                recording.issues().sentences().is_empty(),
                text.contains("UTC")
            );
        }
    }

    #[test]
    fn other_forms_are_refused_with_what_to_do_and_cut_rows_with_their_line() {
        for place in &PLACES[1..] {
            let text =
                format!("{HEADER}%  GPST  {place} b c Q ns\n2025/07/08 19:34:18 1 2 3 1 9\n");
            let options = OpenOptions::default();
            let error = read_bytes(text.into_bytes(), "rover.pos", &options)
                .err()
                .unwrap()
                .to_string();
            assert!(
                error.contains(place) && error.contains("out-solformat=llh"),
                "{error}"
            );
        }
        let whole = format!(
            "{HEADER}{NAMES}{}{}",
            row("2025/07/08 19:34:18.250", 1),
            row("2025/07/08 19:34:18.500", 2)
        );
        for cut in 0..whole.len() {
            let bytes = whole.as_bytes()[..cut].to_vec();
            if let Ok(recording) = read_bytes(bytes, "cut.pos", &OpenOptions::default()) {
                let _ = recording.count();
            }
        }
        let bad = format!(
            "{HEADER}{NAMES}{}",
            row("2025/07/08 19:34:18.250", 1).replace("460.25", "high")
        );
        let error = read(&bad).next().unwrap().unwrap_err().to_string();
        assert!(
            error.starts_with("rover.pos, line 4, column `height(m)`: `high` is not a number"),
            "{error}"
        );
    }
}
