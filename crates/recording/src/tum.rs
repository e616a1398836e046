//! Trajectories in TUM form (`timestamp tx ty tz qx qy qz qw`), as `evo` and motion capture write them: a reference.
//!
//! Read first: `docs/formats.md`, section "TUM trajectory". The attitudes are read, the world's z axis taken as up unless a comment
//! says another `world_frame`; the positions are metres in a frame that the file does not place on the Earth.

use std::io::BufReader;

use crate::csv::read_comments;
use crate::delimited::{Blanks, Channel, DelimitedSource, Layout, Rows, TimeForm};
use crate::error::Result;
use crate::event::SensorKind;
use crate::metadata::{Metadata, WorldFrame};
use crate::recording::Opened;
use crate::stamp;
use crate::text::Input;

const NAMES: [&str; 8] = ["timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"];
/// How far a quaternion's length may be from 1: three decimals are written by some.
const LENGTH_OFF: f64 = 0.01;

/// Whether a text is lines of a stamp, a position and a quaternion of length 1.
pub(crate) fn recognises(text: &str) -> bool {
    let is_pose = |line: &str| {
        let numbers: Option<Vec<f64>> = line
            .split_whitespace()
            .map(|word| word.parse().ok())
            .collect();
        numbers.is_some_and(|numbers| {
            let length = |q: &[f64]| q.iter().map(|part| part * part).sum::<f64>().sqrt();
            numbers.len() == NAMES.len() && (length(&numbers[4..]) - 1.0).abs() < LENGTH_OFF
        })
    };
    // The last line may be cut off.
    let whole = text.rsplit_once('\n').map_or(text, |(whole, _)| whole);
    let mut lines = whole
        .lines()
        .filter(|line| !line.starts_with('#') && !line.trim().is_empty())
        .take(8)
        .peekable();
    lines.peek().is_some() && lines.all(is_pose)
}

/// Opens a trajectory, reading its comments.
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let mut input = BufReader::with_capacity(1 << 16, input);
    let mut told = Metadata::default();
    let lines_before = read_comments(&mut input, file, &mut told)?;
    let layout = Layout {
        names: NAMES.map(str::to_owned).to_vec(),
        time: 0,
        time_form: TimeForm::Decimal(stamp::SECONDS),
        channels: vec![Channel::new(SensorKind::Reference, &[7, 4, 5, 6])],
        decimal_comma: false,
        rows: None,
    };
    let input = Blanks::new(input);
    let mut builder = csv::ReaderBuilder::new();
    builder
        .delimiter(b' ')
        .comment(Some(b'#'))
        .has_headers(false);
    let rows = Rows::new(file.to_owned(), &mut builder, Box::new(input), lines_before);
    let metadata = Metadata {
        format: "tum".to_owned(),
        // Of other programs' comments nothing else is known to be meant for us.
        world_frame: told.world_frame,
        ..metadata
    };
    let sensors = layout.sensors();
    let mut opened = Opened::new(
        metadata,
        sensors,
        Box::new(DelimitedSource::new(rows, layout)),
    );
    let up = match told.world_frame {
        WorldFrame::Enu => "up",
        WorldFrame::Ned => "down, as its comment says",
    };
    opened.notes.push(format!(
        "Of the trajectory the attitudes are used, its z axis taken as {up}; its positions are in a frame of their own and are not used."
    ));
    Ok(opened)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_told_from_other_columns_of_numbers() {
        let poses = "# timestamp tx ty tz qx qy qz qw\n1.5 0 0 0 0 0 0 1\n1.6  1 2 3 0.5 0.5 -0.5 0.5\n1.7 1 2";
        assert!(recognises(poses));
        assert!(!recognises("1.5 0 0 0 0 0 0 2\n"));
        assert!(!recognises("1.5 0 0 0 0 0 1\n"));
        assert!(!recognises("# timestamp tx ty tz qx qy qz qw\n"));
        assert!(!recognises(""));
    }
}
