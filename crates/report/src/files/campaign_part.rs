//! Parts of a campaign as Parquet files: what `--shard` writes and `merge` reads.
//!
//! One row for each sum: `series` (-1 the navigation, else the tracker's place in the list), `step`,
//! `quantity`, the two halves of the 128-bit sum, and how many terms were not finite. What campaign
//! it is of stands in the file's metadata, as JSON.

use std::fs::File;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, anyhow, bail};
use northing_experiments::exact_sum::ExactSum;
use northing_experiments::radar::campaign::{CampaignKey, Part};
use northing_experiments::radar::sums::CampaignSums;
use northing_experiments::radar::{Campaign, TrackerKind};
use northing_recording::AtomicFile;
use northing_recording::parquet_table::write_group;
use parquet::column::reader::ColumnReader;
use parquet::data_type::Int64Type;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use serde::{Deserialize, Serialize};

/// Key of the metadata.
const KEY: &str = "northing_campaign";
const SCHEMA: &str = "message campaign_part { required int64 series; required int64 step; \
                      required int64 quantity; required int64 sum_high; required int64 sum_low; \
                      required int64 not_finite; }";
const COLUMNS: usize = 6;
/// Rows that a part can have at most: far beyond a day at 1 Hz with all trackers.
const MOST_ROWS: i64 = 20_000_000;

/// What the metadata says.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    version: u32,
    campaign: CampaignKey,
    ranges: Vec<Range<u64>>,
    runs: u64,
    skipped: Vec<u64>,
    elapsed_s: f64,
}

/// Writes a part.
///
/// # Errors
/// The file exists and `force` is not given, or cannot be written.
pub fn write(path: &Path, part: &Part, force: bool) -> Result<()> {
    let place = || format!("{}: cannot write it", path.display());
    let header = Header {
        version: 1,
        campaign: part.key.clone(),
        ranges: part.ranges.clone(),
        runs: part.sums.runs,
        skipped: part.sums.skipped.clone(),
        elapsed_s: part.elapsed_s,
    };
    let header = KeyValue::new(KEY.to_owned(), serde_json::to_string(&header)?);
    let properties = WriterProperties::builder()
        .set_key_value_metadata(Some(vec![header]))
        .build();
    let output = AtomicFile::create(path, force)?;
    let schema = Arc::new(parse_message_type(SCHEMA)?);
    let mut output =
        SerializedFileWriter::new(output, schema, Arc::new(properties)).with_context(place)?;
    write_group::<Int64Type>(&mut output, &columns(&part.sums)).with_context(place)?;
    Ok(output.into_inner().with_context(place)?.commit()?)
}

/// All sums as columns.
fn columns(sums: &CampaignSums) -> [Vec<i64>; COLUMNS] {
    let mut columns: [Vec<i64>; COLUMNS] = Default::default();
    let mut row = |series: i64, step: usize, quantity: usize, sum: &ExactSum| {
        let bits = sum.units.cast_unsigned();
        let row = [
            series,
            step as i64,
            quantity as i64,
            ((bits >> 64) as u64).cast_signed(),
            (bits as u64).cast_signed(),
            sum.not_finite.cast_signed(),
        ];
        for (column, value) in columns.iter_mut().zip(row) {
            column.push(value);
        }
    };
    for (step, sums) in sums.navigation.iter().enumerate() {
        for (quantity, sum) in sums.iter().enumerate() {
            row(-1, step, quantity, sum);
        }
    }
    for (series, steps) in sums.trackers.iter().enumerate() {
        for (step, sums) in steps.iter().enumerate() {
            for (quantity, sum) in sums.iter().enumerate() {
                row(series as i64, step, quantity, sum);
            }
        }
    }
    columns
}

/// Reads a part.
///
/// # Errors
/// The file cannot be read, or is no part of a campaign.
pub fn read(path: &Path) -> Result<Part> {
    let file = path.display().to_string();
    // The decoder has been seen to panic on garbage; that becomes an error like any other damage.
    let part = catch_unwind(AssertUnwindSafe(|| read_file(path)))
        .unwrap_or_else(|_| Err(anyhow!("the Parquet decoder gave up")));
    part.with_context(|| {
        format!("{file}: not a part of a campaign as `montecarlo --out` writes it")
    })
}

fn read_file(path: &Path) -> Result<Part> {
    let reader = SerializedFileReader::new(File::open(path)?)?;
    let metadata = reader.metadata().file_metadata();
    if metadata.num_rows() > MOST_ROWS {
        bail!("it has {} rows", metadata.num_rows());
    }
    let pairs = metadata.key_value_metadata().into_iter().flatten();
    let header = pairs
        .filter(|pair| pair.key == KEY)
        .find_map(|pair| pair.value.as_deref());
    let header: Header = serde_json::from_str(header.context("its metadata says nothing of one")?)?;
    if header.version != 1 {
        bail!("it has version {}, expected 1", header.version);
    }
    let mut columns: [Vec<i64>; COLUMNS] = Default::default();
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group)?;
        let rows = usize::try_from(group.metadata().num_rows())?;
        for (index, column) in columns.iter_mut().enumerate() {
            let ColumnReader::Int64ColumnReader(mut values) = group.get_column_reader(index)?
            else {
                bail!("column {index} does not hold 64-bit integers");
            };
            values.read_records(rows, None, None, column)?;
        }
    }
    fill(header, &columns)
}

/// Puts the rows in their places.
fn fill(header: Header, columns: &[Vec<i64>; COLUMNS]) -> Result<Part> {
    let key = header.campaign;
    northing_simulation::scenario::ScenarioTables::check(&key.scenario)
        .map_err(|problem| anyhow!(problem))?;
    let kinds: Vec<TrackerKind> = key
        .trackers
        .iter()
        .map(|name| TrackerKind::parse(name))
        .collect::<Result<_, _>>()?;
    let campaign = Campaign::new(&key.scenario, &kinds, key.seed, key.runs)?;
    if campaign.trackers() != kinds || header.skipped.len() != kinds.len() {
        bail!("its list of trackers is not in order");
    }
    let held: u64 = header
        .ranges
        .iter()
        .map(|range| range.end.saturating_sub(range.start))
        .sum();
    let outside = header.ranges.iter().any(|range| range.end > key.runs);
    if held != header.runs || held == 0 || outside {
        bail!("its runs are not those of its ranges");
    }
    let mut sums = CampaignSums::new(&kinds, campaign.world().scans());
    sums.runs = header.runs;
    sums.skipped = header.skipped;
    let expected = sums.navigation.len() * (8 + 3 * kinds.len());
    let [series, steps, quantities, high, low, not_finite] = columns;
    if columns.iter().any(|column| column.len() != expected) {
        bail!("it has {} rows, expected {expected}", series.len());
    }
    for row in 0..expected {
        let (step, quantity) = (
            usize::try_from(steps[row])?,
            usize::try_from(quantities[row])?,
        );
        let place = match usize::try_from(series[row]) {
            Ok(tracker) => sums
                .trackers
                .get_mut(tracker)
                .and_then(|steps| steps.get_mut(step))
                .and_then(|sums| sums.get_mut(quantity)),
            Err(_) => sums
                .navigation
                .get_mut(step)
                .and_then(|sums| sums.get_mut(quantity)),
        };
        let bits =
            (u128::from(high[row].cast_unsigned()) << 64) | u128::from(low[row].cast_unsigned());
        *place.with_context(|| format!("row {row} has no place"))? = ExactSum {
            units: bits.cast_signed(),
            not_finite: not_finite[row].cast_unsigned(),
        };
    }
    Ok(Part {
        key,
        ranges: header.ranges,
        sums,
        elapsed_s: header.elapsed_s,
    })
}
