//! Addresses to listen on.

use std::net::{IpAddr, SocketAddr, ToSocketAddrs as _};

/// `HOST:PORT`, or the port alone on this computer.
pub(crate) fn host_and_port(text: &str) -> Result<SocketAddr, String> {
    if let Ok(port) = text.parse::<u16>() {
        return Ok(SocketAddr::new(IpAddr::from([127, 0, 0, 1]), port));
    }
    let found = text.to_socket_addrs().ok().and_then(|mut all| all.next());
    found.ok_or_else(|| {
        "expected an address of this computer and a port, e.g. 127.0.0.1:8765".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_alone_is_of_this_computer() {
        assert_eq!(host_and_port("8766").unwrap().to_string(), "127.0.0.1:8766");
        assert_eq!(host_and_port("[::1]:80").unwrap().to_string(), "[::1]:80");
        assert_eq!(host_and_port("0.0.0.0:1").unwrap().to_string(), "0.0.0.0:1");
        for bad in ["", "70000", "127.0.0.1", "a b:1"] {
            assert!(
                host_and_port(bad)
                    .unwrap_err()
                    .starts_with("expected an address")
            );
        }
    }
}
