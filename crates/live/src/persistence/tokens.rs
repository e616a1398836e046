//! The secrets of a lab that runs, for the case that it is killed: `tokens.json`, for the owner alone. A lab that ends in order
//! removes it.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{Persistence, files, set_aside};

/// What the file says of itself.
const FORMAT: &str = "northing-lab-tokens";
/// The version that this program writes.
const VERSION: u64 = 1;

/// The secrets. Of those that no address is made of only a SHA-256 is kept, in hexadecimal.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedTokens {
    format: String,
    version: u64,
    /// What lets phones deliver.
    pub lab: Option<String>,
    /// What lets a teacher elsewhere in.
    pub teacher: Option<String>,
    /// The secret of each device.
    pub owners: Vec<SavedOwner>,
    /// The keys in cookies.
    pub keys: Vec<SavedKey>,
}

/// The secret of a device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedOwner {
    /// The device.
    pub device: String,
    /// SHA-256 of its phone's secret.
    pub sha256: String,
}

/// The key in a cookie.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedKey {
    /// SHA-256 of it.
    pub sha256: String,
    /// The device of a student; none of a teacher.
    pub device: Option<String>,
    /// Whether the phone itself has it.
    pub is_phone: bool,
}

impl SavedTokens {
    /// Of a lab as it is.
    #[must_use]
    pub fn new(lab: &str, teacher: Option<&str>, owners: &[SavedOwner], keys: &[SavedKey]) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            lab: Some(lab.to_owned()),
            teacher: teacher.map(str::to_owned),
            owners: owners.to_vec(),
            keys: keys.to_vec(),
        }
    }
}

impl Persistence {
    fn tokens_file(&self) -> PathBuf {
        self.folder.join("tokens.json")
    }

    /// The secrets of a lab that was killed.
    ///
    /// # Errors
    /// They cannot be read, in a sentence.
    pub fn tokens(&self) -> Result<Option<SavedTokens>, String> {
        let path = self.tokens_file();
        if !path.exists() {
            return Ok(None);
        }
        let read = files::read_json(&path, FORMAT, VERSION);
        read.map(Some)
            .map_err(|why| set_aside(&path, "the secrets of a lab that was killed", &why))
    }

    /// Writes the secrets of `now` and waits for it; what is asked for later is written later.
    pub fn save_tokens(&self, now: impl FnOnce() -> SavedTokens) {
        let path = self.tokens_file();
        let _one = crate::lab::lock(&self.tokens);
        let written = files::write_json(&path, &now());
        self.teller.note(&path, written);
    }

    /// Removes them.
    pub fn forget_tokens(&self) {
        let _one = crate::lab::lock(&self.tokens);
        // Where it cannot be removed, the next lab has the same secrets, as after a crash.
        let _ = std::fs::remove_file(self.tokens_file());
    }
}
