//! How many files and connections the system lets this process have open, and how they are shared out.

/// Files of the lab itself: listeners, the recording, lists of recordings, reports, serial lines.
const OWN_FILES: usize = 64;
/// Connections of phones and apps; more are of no use: a lab has 64 devices.
const MOST_PHONES: usize = 512;
/// Connections of lab pages.
const MOST_PAGES: usize = 128;
/// No listener has fewer, whatever the system says: then the system refuses some.
const FEWEST: usize = 8;

/// Places for connections.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shares {
    /// Of phones and apps together.
    pub(crate) phones: usize,
    /// Of lab pages, which phones cannot take from them.
    pub(crate) pages: usize,
}

impl Shares {
    /// What is left of so many files: a quarter for the lab pages.
    const fn of(files: usize) -> Self {
        let left = files.saturating_sub(OWN_FILES);
        Self {
            phones: clamped(left / 4 * 3, MOST_PHONES),
            pages: clamped(left / 4, MOST_PAGES),
        }
    }

    /// Raises the limit of this process as far as it may, and shares out what it then is.
    pub(crate) fn raised() -> Self {
        Self::of(raise())
    }
}

const fn clamped(places: usize, most: usize) -> usize {
    if places > most {
        most
    } else if places < FEWEST {
        FEWEST
    } else {
        places
    }
}

/// Raises the limit of open files to what all places need, and returns what it is then.
#[cfg(unix)]
fn raise() -> usize {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let wanted = (OWN_FILES + 4 * MOST_PHONES / 3 + 4) as u64;
    let limit = getrlimit(Resource::Nofile);
    let is_less = |current: Option<u64>| current.is_some_and(|current| current < wanted);
    if is_less(limit.current) {
        let current = limit.maximum.map_or(wanted, |most| most.min(wanted));
        // Where that is refused, what there is has to do.
        let _ = setrlimit(
            Resource::Nofile,
            Rlimit {
                current: Some(current),
                ..limit
            },
        );
    }
    let current = getrlimit(Resource::Nofile).current;
    current.map_or(usize::MAX, |current| {
        usize::try_from(current).unwrap_or(usize::MAX)
    })
}

/// Sockets are no files here, and there are enough of them.
#[cfg(not(unix))]
fn raise() -> usize {
    usize::MAX
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_fit_into_the_limit_and_pages_have_theirs() {
        for files in [0, 10, 64, 128, 256, 512, 1024, usize::MAX] {
            let Shares { phones, pages } = Shares::of(files);
            assert!(phones >= FEWEST && pages >= FEWEST);
            assert!(phones <= MOST_PHONES && pages <= MOST_PAGES);
            if files >= 128 {
                assert!(phones + pages + OWN_FILES <= files, "{files}");
            }
        }
        let of_a_mac = Shares::of(256);
        assert_eq!((of_a_mac.phones, of_a_mac.pages), (144, 48));
    }

    #[cfg(unix)]
    #[test]
    fn the_limit_is_raised() {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        let before = getrlimit(Resource::Nofile);
        if before.maximum.is_some_and(|most| most < 1024) {
            return;
        }
        let low = Rlimit {
            current: Some(256),
            ..before
        };
        setrlimit(Resource::Nofile, low).unwrap();
        let shares = Shares::raised();
        assert_eq!((shares.phones, shares.pages), (MOST_PHONES, MOST_PAGES));
    }
}
