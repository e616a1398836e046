//! Two pages with one identifier: two tabs of one phone's browser, or a copied profile.
//!
//! A page that is loaded anew has a new session under the old identifier, and the old session is
//! silent from then on. Two sessions that both go on are two phones: the newer one becomes a device of
//! its own, so that neither disturbs the other.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// So many batches of the older page after the newer one began make them two: a batch or two may
/// just have been late.
const RETURNS: u32 = 3;
/// A page that has been silent for so long does not count.
const SILENCE: Duration = Duration::from_secs(5);
/// Pages remembered of one identifier, and identifiers.
const MOST_PAGES: usize = 8;
const MOST_IDENTIFIERS: usize = 256;

/// A page that delivers.
#[derive(Debug)]
struct Page {
    session: String,
    last: Instant,
    /// Batches since a newer page began.
    returns: u32,
    /// The device that it is alone.
    own: Option<String>,
}

/// Which pages deliver under which identifier.
#[derive(Debug, Default)]
pub struct Identities {
    pages: BTreeMap<String, Vec<Page>>,
}

impl Identities {
    /// The device of a batch, by its identifier and session: the identifier itself, or another one
    /// if two pages share it.
    pub fn device(&mut self, identifier: &str, session: &str, now: Instant) -> String {
        if !self.pages.contains_key(identifier) && self.pages.len() >= MOST_IDENTIFIERS {
            self.forget_the_oldest();
        }
        let pages = self.pages.entry(identifier.to_owned()).or_default();
        let Some(at) = pages.iter().position(|page| page.session == session) else {
            if pages.len() >= MOST_PAGES {
                pages.remove(0);
            }
            pages.push(Page {
                session: session.to_owned(),
                last: now,
                returns: 0,
                own: None,
            });
            return identifier.to_owned();
        };
        pages[at].last = now;
        if let Some(own) = &pages[at].own {
            return own.clone();
        }
        let newer = pages[at + 1..].iter().any(|page| page.shares(now));
        if newer {
            pages[at].returns += 1;
            if pages[at].returns >= RETURNS {
                split(identifier, &mut pages[at + 1..], now);
            }
        }
        identifier.to_owned()
    }

    /// The device that the batches of this page went to; `None` when there were none.
    pub fn known(&self, identifier: &str, session: &str) -> Option<String> {
        let mut pages = self.pages.get(identifier)?.iter();
        let page = pages.find(|page| page.session == session)?;
        Some(page.own.as_deref().unwrap_or(identifier).to_owned())
    }

    fn forget_the_oldest(&mut self) {
        let newest = |pages: &Vec<Page>| pages.iter().map(|page| page.last).max();
        let oldest = self.pages.iter().min_by_key(|(_, pages)| newest(pages));
        if let Some(identifier) = oldest.map(|(identifier, _)| identifier.clone()) {
            self.pages.remove(&identifier);
        }
    }
}

impl Page {
    /// Whether it delivers under the shared identifier.
    fn shares(&self, now: Instant) -> bool {
        self.own.is_none() && now.saturating_duration_since(self.last) < SILENCE
    }
}

/// Makes the newer pages devices of their own.
fn split(identifier: &str, newer: &mut [Page], now: Instant) {
    for page in newer.iter_mut().filter(|page| page.shares(now)) {
        let mark: String = page.session.chars().take(8).collect();
        page.own = Some(format!("{identifier}+{mark}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_pages_that_both_go_on_become_two_devices() {
        let (mut identities, start) = (Identities::default(), Instant::now());
        let mut at = |ms: u64, session: &str| {
            identities.device("anna", session, start + Duration::from_millis(ms))
        };
        assert_eq!(at(0, "first"), "anna");
        assert_eq!(at(100, "second"), "anna");
        for k in 0..3 {
            assert_eq!(at(200 + 100 * k, "first"), "anna");
        }
        assert_eq!(at(600, "second"), "anna+second");
        assert_eq!(at(700, "first"), "anna");
        assert_eq!(at(60_000, "second"), "anna+second");
        let known = |session| identities.known("anna", session);
        assert_eq!(known("first").as_deref(), Some("anna"));
        assert_eq!(known("second").as_deref(), Some("anna+second"));
        assert_eq!(known("third"), None);
        assert_eq!(identities.known("ben", "first"), None);
    }

    #[test]
    fn a_page_loaded_anew_stays_the_same_device() {
        let (mut identities, start) = (Identities::default(), Instant::now());
        let mut at = |ms: u64, session: &str| {
            identities.device("anna", session, start + Duration::from_millis(ms))
        };
        at(0, "before");
        at(1000, "after");
        // The last of the old page, late.
        assert_eq!(at(1050, "before"), "anna");
        for k in 0..100 {
            assert_eq!(at(1100 + k * 100, "after"), "anna");
        }
        // Back after the newer page has been closed.
        for k in 0..10 {
            assert_eq!(at(30_000 + k * 100, "before"), "anna");
        }
    }

    #[test]
    fn invented_identifiers_are_forgotten() {
        let (mut identities, start) = (Identities::default(), Instant::now());
        for k in 0..1000_u64 {
            let now = start + Duration::from_millis(k);
            identities.device(&format!("d{k}"), "s", now);
            identities.device("anna", &format!("s{k}"), now);
        }
        assert!(identities.pages.len() <= MOST_IDENTIFIERS);
        assert!(identities.pages["anna"].len() <= MOST_PAGES);
    }
}
