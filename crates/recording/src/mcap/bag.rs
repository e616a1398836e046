//! The folder that `ros2 bag record` makes: `metadata.yaml` and files of MCAP or SQLite, one after the other.
//!
//! Of `metadata.yaml` only the names of the files, their order and the kind of storage are read. A recorder that was
//! stopped leaves none; then the files are taken in the order of their numbers.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use super::bag_file::messages;
use super::file::{Contents, End, MCAP, contents};
use super::order::in_order;
use super::ros_source::{Read, RosSource};
use super::tf_static::{Mounting, StaticTransforms};
use super::topics;
use super::{Wanted, devices, mounted, nothing};
use crate::error::{RecordingError, Result, shown};
use crate::event::Event;
use crate::issues::Issues;
use crate::limits::{BAG_FILES, read_description};
use crate::metadata::Metadata;
use crate::recording::{EventSource, Opened};

const METADATA: &str = "metadata.yaml";

/// Opens a folder; `None` when it is no bag.
pub(crate) fn open_folder(
    path: &Path,
    file: &str,
    mut metadata: Metadata,
    wanted: Wanted<'_>,
) -> Result<Option<Opened>> {
    let Some(paths) = files(path, file)? else {
        return Ok(None);
    };
    BAG_FILES.check(paths.len() as u64, file, "")?;
    let contents = contents_of_all(&paths, file)?;
    if !devices(&contents.channels).is_empty() {
        let problem = "a folder with recordings of the lab; open one of its files";
        return Err(RecordingError::unsupported(file, problem));
    }
    let Some((topics, notes)) = topics::choose(&contents, wanted, file)? else {
        return Err(nothing(file, &contents));
    };
    contents.format.clone_into(&mut metadata.format);
    let mounting = mounted(&contents, &topics, &mut metadata);
    let ordered = in_order(topics.reads(), |reads| {
        Ok(Bag::new(&paths, reads, &mounting))
    })?;
    Ok(Some(Opened {
        notes: [notes, mounting.notes().to_vec()]
            .into_iter()
            .flatten()
            .chain(ordered.note)
            .collect(),
        ..Opened::new(metadata, ordered.sensors, ordered.source)
    }))
}

/// The files of a bag in their order; `None` when the folder is none.
fn files(folder: &Path, file: &str) -> Result<Option<Vec<PathBuf>>> {
    let list = folder.join(METADATA);
    if list.is_file() {
        let text = read_description(&list)?;
        if text.contains("rosbag2_bagfile_information") {
            return listed(folder, &text, file).map(Some);
        }
    }
    let failed = |error| RecordingError::io(file, "list the folder", error);
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if is_bag_file(&name) {
            found.push(path);
        }
    }
    // `bag_2` comes before `bag_10`.
    found.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    Ok((!found.is_empty()).then_some(found))
}

/// The files that `metadata.yaml` lists.
fn listed(folder: &Path, text: &str, file: &str) -> Result<Vec<PathBuf>> {
    let refused = |problem: String| Err(RecordingError::unsupported(file, problem));
    let unquoted = |text: &str| text.trim().trim_matches(['"', '\'']).to_owned();
    let (mut names, mut is_list) = (Vec::new(), false);
    for line in text.lines().map(str::trim) {
        match line.strip_prefix('-') {
            Some(name) if is_list => names.push(unquoted(name)),
            _ => is_list = line == "relative_file_paths:",
        }
    }
    if names.is_empty() {
        return refused(format!("its {METADATA} lists no file"));
    }
    for name in &names {
        if name.contains(['/', '\\']) || !is_bag_file(name) {
            return refused(format!(
                "its {METADATA} lists `{}`, which is no .mcap or .db3 file of the folder",
                shown(name)
            ));
        }
    }
    Ok(names.into_iter().map(|name| folder.join(name)).collect())
}

/// Whether a name is one of the files of a bag, perhaps compressed as a whole.
fn is_bag_file(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let name = name.strip_suffix(".zstd").unwrap_or(&name);
    name.ends_with(".mcap") || name.ends_with(".db3")
}

/// The channels of all files together.
fn contents_of_all(paths: &[PathBuf], file: &str) -> Result<Contents> {
    let mut all = Contents {
        format: MCAP,
        channels: Vec::new(),
        frames: BTreeMap::new(),
        transforms: StaticTransforms::default(),
        end: End::Complete,
    };
    for path in paths {
        let found = contents(&mut messages(path)?, &path.display().to_string())?;
        all.format = found.format;
        for channel in found.channels {
            if all.channels.iter().all(|c| c.topic != channel.topic) {
                all.channels.push(channel);
            }
        }
        all.transforms.extend(found.transforms);
        for (topic, frame) in found.frames {
            all.frames.entry(topic).or_insert(frame);
        }
    }
    if all.channels.is_empty() {
        return Err(RecordingError::damaged(
            file,
            "none of its files has a message that can be read",
        ));
    }
    Ok(all)
}

/// The events of the files, of which one is open at a time.
struct Bag {
    paths: VecDeque<PathBuf>,
    reads: Vec<Read>,
    mounting: Mounting,
    current: Option<RosSource>,
}

impl Bag {
    fn new(paths: &[PathBuf], reads: &[Read], mounting: &Mounting) -> Self {
        Self {
            paths: paths.iter().cloned().collect(),
            reads: reads.to_vec(),
            mounting: mounting.clone(),
            current: None,
        }
    }
}

impl EventSource for Bag {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        loop {
            if let Some(source) = &mut self.current
                && let Some(event) = source.next_event(issues)?
            {
                return Ok(Some(event));
            }
            let Some(path) = self.paths.pop_front() else {
                return Ok(None);
            };
            let messages = messages(&path)?;
            self.current = Some(RosSource::new(messages, &self.reads, &self.mounting));
        }
    }
}
