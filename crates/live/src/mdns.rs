//! The lab's name on the local network (multicast DNS, RFC 6762): `northing.local`, so that nobody has to type an address.

use std::sync::{Arc, Weak};

use mdns_sd::{DaemonEvent, IfKind, RRType, ServiceDaemon, ServiceInfo};

use crate::addresses::Reach;

/// The name that is asked for; a second lab in the same network becomes `northing-2.local`.
pub const NAME: &str = "northing.local";
/// What is offered: pages over TLS.
const KIND: &str = "_https._tcp.local.";

/// Where the name is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Where {
    /// In every network that this computer is in.
    Networks,
    /// On this computer alone.
    Loopback,
}

/// Answers for the lab's name until it is dropped.
pub struct Announcement {
    daemon: ServiceDaemon,
}

impl std::fmt::Debug for Announcement {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Announcement")
    }
}

impl Announcement {
    /// Begins to answer for the pages on `port`, called `instance` in lists of services. `reach` learns the name once nobody else
    /// has claimed it, about a second later, and `told` is called then. `None` where this computer does not let multicast DNS
    /// run: the lab does without.
    pub fn begin(
        port: u16,
        instance: &str,
        place: Where,
        reach: &Arc<Reach>,
        told: impl Fn() + Send + 'static,
    ) -> Option<Self> {
        let daemon = ServiceDaemon::new().ok()?;
        let begun = || -> mdns_sd::Result<_> {
            match place {
                Where::Networks => {
                    daemon.disable_interface(vec![IfKind::LoopbackV4, IfKind::LoopbackV6])?;
                }
                Where::Loopback => {
                    daemon.disable_interface(IfKind::All)?;
                    daemon.enable_interface(IfKind::LoopbackV4)?;
                }
            }
            let events = daemon.monitor()?;
            let host = format!("{NAME}.");
            let service = ServiceInfo::new(KIND, instance, &host, "", port, None)?;
            daemon.register(service.enable_addr_auto())?;
            Ok(events)
        };
        let Ok(events) = begun() else {
            let _ = daemon.shutdown();
            return None;
        };
        let reach = Arc::downgrade(reach);
        tokio::spawn(async move {
            let mut name = NAME.to_owned();
            while let Ok(event) = events.recv_async().await {
                if !heard(&event, &mut name, &reach, &told) {
                    return;
                }
            }
        });
        Some(Self { daemon })
    }
}

/// Takes what the daemon tells; `false` once nobody listens any more.
fn heard(event: &DaemonEvent, name: &mut String, reach: &Weak<Reach>, told: &impl Fn()) -> bool {
    match event {
        DaemonEvent::NameChange(change) if change.rr_type == RRType::A => {
            change.new_name.trim_end_matches('.').clone_into(name);
        }
        DaemonEvent::Announce(..) => {
            let Some(reach) = reach.upgrade() else {
                return false;
            };
            if reach.answers_for(name) {
                told();
            }
        }
        _ => {}
    }
    true
}

impl Drop for Announcement {
    fn drop(&mut self) {
        // It says goodbye in a thread of its own.
        let _ = self.daemon.shutdown();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::addresses::Addresses;
    use crate::token::Token;
    use mdns_sd::HostnameResolutionEvent;
    use northing_recording::test_data::skipped;
    use std::time::Duration;

    fn reach() -> Arc<Reach> {
        let token = Arc::new(Token::random().unwrap());
        Arc::new(Reach::new(Addresses::default(), None, [7771, 7772], token))
    }

    #[tokio::test]
    async fn a_lab_is_found_by_its_name() {
        let reach = reach();
        assert!(!reach.is_own(NAME) && reach.named_url().is_none());
        let (tell, mut told) = tokio::sync::mpsc::unbounded_channel();
        let begun = Announcement::begin(7771, "Northing lab", Where::Loopback, &reach, move || {
            let _ = tell.send(());
        });
        let long = Duration::from_secs(20);
        let announced = begun.is_some()
            && tokio::time::timeout(long, told.recv())
                .await
                .is_ok_and(|told| told.is_some());
        if !announced {
            return skipped(
                "no multicast DNS on this computer",
                "a_lab_is_found_by_its_name",
            );
        }
        let url = reach.named_url().unwrap();
        let name = url.strip_prefix("https://").unwrap();
        let name = name.strip_suffix(":7771/join").unwrap();
        assert!(
            name.starts_with("northing") && name.ends_with(".local"),
            "{name}"
        );
        assert!(reach.is_own(name) && !reach.is_own("northing.local.evil.example"));

        let other = ServiceDaemon::new().unwrap();
        other.disable_interface(IfKind::All).unwrap();
        other.enable_interface(IfKind::LoopbackV4).unwrap();
        let answers = other
            .resolve_hostname(&format!("{name}."), Some(20_000))
            .unwrap();
        let mut found = false;
        while let Ok(answer) = answers.recv_async().await {
            if let HostnameResolutionEvent::AddressesFound(_, addresses) = answer {
                found = !addresses.is_empty();
                break;
            }
        }
        assert!(found, "nobody answers for {name}");
        let _ = other.shutdown();
    }
}
