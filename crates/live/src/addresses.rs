//! The addresses under which phones reach this computer, now and when a network comes later.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::{Arc, PoisonError, RwLock};

use crate::token::Token;

/// Interfaces of containers, virtual machines and tunnels: no phone is on the other side.
const VIRTUAL: [&str; 15] = [
    "docker",
    "veth",
    "br-",
    "virbr",
    "vmnet",
    "vbox",
    "tun",
    "tap",
    "utun",
    "wg",
    "tailscale",
    "zt",
    "cni",
    "podman",
    "lxc",
];
/// Longest label of a name.
const LONGEST_LABEL: usize = 63;

/// The addresses of this computer, the likeliest first.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Addresses {
    /// Those that phones are told.
    pub shown: Vec<IpAddr>,
    /// All of them: whoever comes this way has come to us.
    pub own: Vec<IpAddr>,
}

impl Addresses {
    /// Those of this moment: IPv4, loopback and self-assigned ones left out.
    #[must_use]
    pub fn now() -> Self {
        let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
        let found: Vec<(String, Ipv4Addr)> = interfaces
            .into_iter()
            .filter_map(|interface| match interface.ip() {
                IpAddr::V4(v4) => Some((interface.name, v4)),
                IpAddr::V6(_) => None,
            })
            .collect();
        Self::of(&found, default_route())
    }

    /// Of interfaces: first the one of the default route, then private networks; virtual interfaces
    /// are told only when there is nothing else.
    fn of(interfaces: &[(String, Ipv4Addr)], default: Option<Ipv4Addr>) -> Self {
        let mut own: Vec<_> = interfaces
            .iter()
            .filter(|(_, address)| !address.is_loopback() && !address.is_link_local())
            .collect();
        own.sort_by_key(|(name, address)| {
            let first = Some(*address) == default;
            (is_virtual(name), !first, !address.is_private(), *address)
        });
        own.dedup_by_key(|(_, address)| *address);
        let real = own.iter().filter(|(name, _)| !is_virtual(name)).count();
        let told = if real > 0 { real } else { own.len() };
        let own: Vec<IpAddr> = own.iter().map(|(_, v4)| IpAddr::V4(*v4)).collect();
        Self {
            shown: own.iter().take(told).copied().collect(),
            own,
        }
    }
}

fn is_virtual(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    VIRTUAL.iter().any(|start| name.starts_with(start))
}

/// The address from which this computer would speak to the world. Nothing is sent: connecting a
/// datagram socket only looks up the route.
fn default_route() -> Option<Ipv4Addr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    // An address that is kept for documentation.
    socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
    match socket.local_addr().ok()?.ip() {
        IpAddr::V4(v4) if !v4.is_unspecified() => Some(v4),
        _ => None,
    }
}

/// `NAME.local`, under which this computer is found where names are announced on the network.
#[must_use]
pub fn local_name() -> Option<String> {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("COMPUTERNAME").ok());
    let name = name.or_else(|| {
        let output = std::process::Command::new("hostname").output().ok()?;
        String::from_utf8(output.stdout).ok()
    });
    local_name_of(&name?)
}

fn local_name_of(host: &str) -> Option<String> {
    let label = host.trim().split('.').next()?.to_ascii_lowercase();
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '-';
    let usable = !label.is_empty() && label.len() <= LONGEST_LABEL && label.chars().all(fits);
    usable.then(|| format!("{label}.local"))
}

/// How phones reach the lab; shared by all who tell or check it.
#[derive(Debug)]
pub struct Reach {
    addresses: RwLock<Addresses>,
    local_name: Option<String>,
    /// The lab's own name on the network, while it answers for one.
    lab_name: RwLock<Option<String>>,
    /// Ports of the phone page and of apps.
    ports: [u16; 2],
    token: Arc<Token>,
}

impl Reach {
    /// For listeners on these ports: phone page, apps.
    #[must_use]
    pub fn new(
        addresses: Addresses,
        local_name: Option<String>,
        ports: [u16; 2],
        token: Arc<Token>,
    ) -> Self {
        Self {
            addresses: RwLock::new(addresses),
            local_name,
            lab_name: RwLock::default(),
            ports,
            token,
        }
    }

    /// The lab answers for this name on the network. Returns whether that is news.
    pub fn answers_for(&self, name: &str) -> bool {
        let mut present = self
            .lab_name
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        let is_news = present.as_deref() != Some(name);
        *present = Some(name.to_owned());
        is_news
    }

    fn lab_name(&self) -> Option<String> {
        let present = self.lab_name.read();
        present.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Address by name of the page where laptops come in; `None` while the lab answers for no name.
    #[must_use]
    pub fn named_url(&self) -> Option<String> {
        let name = self.lab_name()?;
        Some(format!("https://{name}:{}/join", self.ports[0]))
    }

    /// Takes over the addresses of this moment. Returns whether they are others than before.
    pub fn update(&self, addresses: Addresses) -> bool {
        let mut present = self
            .addresses
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        let changed = *present != addresses;
        *present = addresses;
        changed
    }

    fn addresses(&self) -> Addresses {
        let present = self
            .addresses
            .read()
            .unwrap_or_else(PoisonError::into_inner);
        present.clone()
    }

    /// Whether `host`, as browsers write it without a port, is an address or the name of this computer.
    #[must_use]
    pub fn is_own(&self, host: &str) -> bool {
        let lab_name = self.lab_name();
        let mut named = self.local_name.iter().chain(&lab_name);
        if named.any(|name| name.eq_ignore_ascii_case(host)) {
            return true;
        }
        let present = self
            .addresses
            .read()
            .unwrap_or_else(PoisonError::into_inner);
        present.own.iter().any(|address| host_of(*address) == host)
    }

    /// The addresses that phones are told, without ports.
    #[must_use]
    pub fn hosts(&self) -> Vec<String> {
        let shown = self.addresses().shown;
        shown.into_iter().map(host_of).collect()
    }

    /// Addresses of the phone page, token included, the likeliest first.
    #[must_use]
    pub fn phone_urls(&self) -> Vec<String> {
        self.urls("https", self.ports[0], "/p#t=")
    }

    /// Addresses for native apps, token included, the likeliest first.
    #[must_use]
    pub fn ingest_urls(&self) -> Vec<String> {
        self.urls("http", self.ports[1], "/in/")
    }

    /// Address of the lab page for a teacher elsewhere, with that one's token behind `#`, which browsers do not send.
    #[must_use]
    pub fn teacher_url(&self, token: &Token) -> String {
        let urls = self.urls_with("https", self.ports[0], "/join#t=", token);
        urls.into_iter().next().unwrap_or_default()
    }

    fn urls(&self, scheme: &str, port: u16, path: &str) -> Vec<String> {
        self.urls_with(scheme, port, path, &self.token)
    }

    fn urls_with(&self, scheme: &str, port: u16, path: &str, token: &Token) -> Vec<String> {
        let mut shown = self.addresses().shown;
        if shown.is_empty() {
            shown.push(IpAddr::V4(Ipv4Addr::LOCALHOST));
        }
        let url = |address: IpAddr| {
            let host = SocketAddr::new(address, port);
            format!("{scheme}://{host}{path}{}", token.as_str())
        };
        shown.into_iter().map(url).collect()
    }
}

fn host_of(address: IpAddr) -> String {
    match address {
        IpAddr::V4(v4) => v4.to_string(),
        IpAddr::V6(v6) => format!("[{v6}]"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interfaces(list: &[(&str, [u8; 4])]) -> Vec<(String, Ipv4Addr)> {
        let owned =
            |(name, address): &(&str, [u8; 4])| ((*name).to_owned(), Ipv4Addr::from(*address));
        list.iter().map(owned).collect()
    }

    fn shown(list: &[(&str, [u8; 4])], default: Option<[u8; 4]>) -> Vec<String> {
        let addresses = Addresses::of(&interfaces(list), default.map(Ipv4Addr::from));
        addresses.shown.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn phones_are_sent_to_the_network_they_are_in() {
        let list = [
            ("lo", [127, 0, 0, 1]),
            ("docker0", [172, 17, 0, 1]),
            ("tun0", [10, 8, 0, 2]),
            ("eth1", [10, 1, 0, 2]),
            ("wlan0", [192, 168, 1, 5]),
            ("eth0", [169, 254, 3, 4]),
        ];
        let wifi = Some([192, 168, 1, 5]);
        assert_eq!(shown(&list, wifi), ["192.168.1.5", "10.1.0.2"]);
        // All traffic goes through a tunnel: phones are still in the Wi-Fi.
        let tunnel = Some([10, 8, 0, 2]);
        assert_eq!(shown(&list, tunnel), ["10.1.0.2", "192.168.1.5"]);
        assert_eq!(shown(&list[..2], None), ["172.17.0.1"]);
        assert_eq!(shown(&list[..1], None), [""; 0]);
        let all = Addresses::of(&interfaces(&list), None).own;
        assert!(all.contains(&IpAddr::from([172, 17, 0, 1])) && all.len() == 4);
    }

    #[test]
    fn an_address_that_comes_later_is_known_and_told() {
        let token = Arc::new(Token::random().unwrap());
        let of = |list: &[(&str, [u8; 4])]| Addresses::of(&interfaces(list), None);
        let name = local_name_of("Laptop.example.org\n");
        let reach = Reach::new(of(&[]), name, [7771, 7772], token);
        assert!(reach.phone_urls()[0].starts_with("https://127.0.0.1:7771/p#t="));
        assert!(!reach.is_own("192.168.43.1") && !reach.update(of(&[])));
        assert!(reach.update(of(&[("ap0", [192, 168, 43, 1])])));
        assert!(reach.is_own("192.168.43.1") && reach.is_own("LAPTOP.local"));
        assert!(reach.phone_urls()[0].starts_with("https://192.168.43.1:7771/p#t="));
        assert!(reach.ingest_urls()[0].starts_with("http://192.168.43.1:7772/in/"));
        assert!(!reach.is_own("laptop.local.evil.example") && !reach.is_own("laptop"));
    }

    #[test]
    fn names_that_are_none_are_not_used() {
        for bad in ["", "\n", "a b", "a\"b", "-\u{e4}", &"x".repeat(64)] {
            assert_eq!(local_name_of(bad), None, "{bad}");
        }
    }
}
