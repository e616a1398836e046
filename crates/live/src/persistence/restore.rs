//! Devices of the lab and what is saved of them: found when they come, handed over when they change.

use super::SavedDevice;
use crate::engine::DeviceEngine;
use crate::lab::{Device, Lab};
use crate::to_page::ToPage;

impl Lab {
    /// Why nothing can be saved at present, in a sentence.
    pub(crate) fn persistence_problem(&self) -> Option<String> {
        self.persistence.as_ref()?.problem()
    }

    /// Saves a device, where it is one that comes back.
    pub(crate) fn save_device(&self, device: &Device, saved: impl FnOnce() -> SavedDevice) {
        if let Some(persistence) = &self.persistence
            && comes_back(device.source)
        {
            persistence.save_device(saved());
        }
    }

    /// What is known of a device from an earlier start.
    pub(crate) fn saved(&self, id: &str, source: &str) -> Option<SavedDevice> {
        let persistence = self.persistence.as_ref()?;
        comes_back(source).then(|| persistence.device(id)).flatten()
    }

    /// Puts a new device into the state that was saved; where that cannot be, it begins anew and that is said.
    pub(crate) fn restored(
        &self,
        engine: &mut DeviceEngine,
        saved: Option<SavedDevice>,
    ) -> Option<SavedDevice> {
        let saved = saved?;
        let error = match engine.restore(&saved) {
            Ok(()) => return Some(saved),
            Err(error) => error.to_string(),
        };
        let text = match &self.persistence {
            Some(persistence) if persistence.device(&saved.id).as_ref() == Some(&saved) => {
                persistence.refuse_device(&saved.id, &error)
            }
            _ => format!("the saved settings of `{}`: {error}", saved.id),
        };
        self.tell(&ToPage::error(text));
        None
    }
}

/// Whether a device that delivers so is the same one at the next start: virtual ones and recordings are others.
fn comes_back(source: &str) -> bool {
    !matches!(source, "virtual" | "replay")
}
