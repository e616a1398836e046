//! Files that are whole or not there: written aside and renamed, and what cannot be read is kept under another name.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::private;

/// What is added to the name of a file that is not finished.
const UNFINISHED: &str = "unfinished";
/// What is added to the name of a file that cannot be used.
const SET_ASIDE: &str = "set-aside";

/// Why a file was not taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Refused {
    /// It is none of ours or damaged, in words.
    Damaged(String),
    /// A newer version of the program wrote it.
    Newer(u64),
}

/// Writes a file that is whole or not there: into another one first, which then takes its place. For the owner alone.
pub(super) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let unfinished = beside(path, UNFINISHED);
    // Left by a program that was killed.
    match std::fs::remove_file(&unfinished) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let written = private::create_new(&unfinished).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_data()
    });
    let written = written.and_then(|()| std::fs::rename(&unfinished, path));
    if written.is_err() {
        // A full disk is not filled further.
        let _ = std::fs::remove_file(&unfinished);
    }
    written
}

/// As [`write()`], of a value as JSON.
pub(super) fn write_json(path: &Path, value: &impl Serialize) -> io::Result<()> {
    let mut text = serde_json::to_vec_pretty(value)?;
    text.push(b'\n');
    write(path, &text)
}

/// Reads what [`write_json`] wrote, if it says that it is of this format and no newer version.
pub(super) fn read_json<T: DeserializeOwned>(
    path: &Path,
    format: &str,
    version: u64,
) -> Result<T, Refused> {
    let damaged = |text: String| Refused::Damaged(text);
    let bytes = std::fs::read(path).map_err(|error| damaged(error.to_string()))?;
    let value: Value =
        serde_json::from_slice(&bytes).map_err(|error| damaged(error.to_string()))?;
    if value["format"] != format {
        return Err(damaged(format!("it does not say that it is `{format}`")));
    }
    match value["version"].as_u64() {
        Some(written) if written > version => return Err(Refused::Newer(written)),
        Some(_) => {}
        None => return Err(damaged("it does not say its version".to_owned())),
    }
    serde_json::from_value(value).map_err(|error| damaged(error.to_string()))
}

/// Gives a file or folder another name beside it, which nothing has yet. Returns the name.
pub(super) fn set_aside(path: &Path) -> io::Result<String> {
    for number in 1..1000 {
        let ending = match number {
            1 => SET_ASIDE.to_owned(),
            _ => format!("{SET_ASIDE}-{number}"),
        };
        let other = beside(path, &ending);
        if other.symlink_metadata().is_err() {
            std::fs::rename(path, &other)?;
            return Ok(name_of(&other));
        }
    }
    Err(io::Error::from(io::ErrorKind::AlreadyExists))
}

/// Whether a name is of a file that was set aside or not finished.
pub(super) fn is_left_over(name: &str) -> bool {
    name.contains(&format!(".{SET_ASIDE}")) || name.ends_with(&format!(".{UNFINISHED}"))
}

fn beside(path: &Path, ending: &str) -> PathBuf {
    path.with_file_name(format!("{}.{ending}", name_of(path)))
}

/// The last part of a path.
pub(super) fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_file_is_replaced_as_a_whole_and_is_the_owners_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        std::fs::write(beside(&path, UNFINISHED), "half of").unwrap();
        for number in [1, 2] {
            let value = json!({"format": "f", "version": 1, "number": number});
            write_json(&path, &value).unwrap();
            assert_eq!(read_json::<Value>(&path, "f", 1), Ok(value));
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        }
    }

    #[test]
    fn what_is_not_ours_damaged_or_newer_is_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_json::<Value>(&path, "f", 1)
        };
        for text in [
            "",
            "{",
            r#"{"format": "other", "version": 1}"#,
            r#"{"format": "f"}"#,
        ] {
            assert!(matches!(read(text), Err(Refused::Damaged(_))), "{text}");
        }
        assert_eq!(
            read(r#"{"format": "f", "version": 9}"#),
            Err(Refused::Newer(9))
        );
    }

    #[test]
    fn what_is_set_aside_never_takes_the_place_of_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        for text in ["first", "second"] {
            std::fs::write(&path, text).unwrap();
            let name = set_aside(&path).unwrap();
            assert!(is_left_over(&name));
            let kept = std::fs::read_to_string(folder.path().join(name)).unwrap();
            assert_eq!(kept, text);
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
