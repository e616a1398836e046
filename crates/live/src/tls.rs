//! The certificate of the phone page: made here, kept between starts, accepted by phones with a tap.
//!
//! Phones refuse certificates that hold for more than 825 days or that do not name the address, so
//! this one holds for 397 days and names every address of this computer, now and lately; it is made
//! anew when an address is missing or when it has less than 30 days left. Browsers remember an
//! accepted certificate, hence it is kept in the data folder, the key readable by the user alone. Whoever
//! has a certificate that phones trust already (an institute's, or one of mkcert) gives it:
//! [`Certificate::read`].

use std::fs;
use std::io::{self, Write as _};
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rcgen::{
    CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, KeyPair,
    KeyUsagePurpose, SanType,
};
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use serde::{Deserialize, Serialize};
use time::{Duration, OffsetDateTime};

/// How long a certificate holds, days: what phones accept.
const DAYS: i64 = 397;
/// It is made anew when fewer days are left.
const RENEW_DAYS: i64 = 30;
/// Most addresses and names of each kind in a certificate, the newest kept.
const MOST_NAMES: usize = 32;

/// What can go wrong with the certificate.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file of the data folder.
    #[error("{path}: cannot {action}: {error}; choose another folder with --data-dir")]
    File {
        /// The file.
        path: String,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        error: io::Error,
    },
    /// The certificate could not be made.
    #[error("cannot make a certificate: {0}")]
    Make(#[from] rcgen::Error),
    /// The certificate could not be used.
    #[error("cannot use the certificate: {0}")]
    Use(String),
    /// A file that was given does not hold what it should.
    #[error("{path}: {problem}; expected PEM as mkcert or openssl write it")]
    Given {
        /// The file.
        path: String,
        /// What is wrong with it.
        problem: String,
    },
}

/// Files with a certificate that phones trust already.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CertificateFiles {
    /// The certificate, and those that lead to a trusted one, PEM.
    pub certificate: PathBuf,
    /// Its private key, PEM.
    pub key: PathBuf,
}

/// A certificate with its key.
#[derive(Debug)]
pub struct Certificate {
    /// The computer's own first, then those that lead to a trusted one.
    chain: Vec<CertificateDer<'static>>,
    key: PrivateKeyDer<'static>,
}

/// What is remembered of a certificate beside it.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Facts {
    addresses: Vec<IpAddr>,
    #[serde(default)]
    names: Vec<String>,
    not_after_unix_s: i64,
}

impl Facts {
    /// Of the kept certificate.
    fn read(folder: &Path) -> Option<Self> {
        let facts = fs::read(folder.join("certificate.json")).ok()?;
        serde_json::from_slice(&facts).ok()
    }
}

/// `present`, and behind it what was there before and is not among them.
fn union<T: Clone + PartialEq>(present: &[T], before: &[T]) -> Vec<T> {
    let mut all = present.to_vec();
    for old in before {
        if !all.contains(old) {
            all.push(old.clone());
        }
    }
    all.truncate(MOST_NAMES.max(present.len()));
    all
}

impl Certificate {
    /// The kept certificate if it still holds for all addresses and names, or a new one, which is
    /// kept. A new one also names what the one before did: whoever carries the computer between
    /// two networks is asked once in each.
    ///
    /// # Errors
    /// The folder cannot be written, or no certificate can be made.
    pub fn load_or_make(
        folder: &Path,
        addresses: &[IpAddr],
        names: &[String],
    ) -> Result<Self, TlsError> {
        let now = OffsetDateTime::now_utc();
        match Self::load(folder, addresses, names, now) {
            Some(kept) => Ok(kept),
            None => Self::make(folder, addresses, names, now),
        }
    }

    /// A certificate from files, for a lab whose phones trust it already.
    ///
    /// # Errors
    /// A file cannot be read or holds no PEM of its kind, or the key is another certificate's.
    pub fn read(files: &CertificateFiles) -> Result<Self, TlsError> {
        let given = |path: &Path, problem: &str| TlsError::Given {
            path: path.display().to_string(),
            problem: problem.to_owned(),
        };
        let bytes = |path: &Path| fs::read(path).map_err(|e| given(path, &e.to_string()));
        let chain: Result<Vec<_>, _> =
            CertificateDer::pem_slice_iter(&bytes(&files.certificate)?).collect();
        let chain = chain.map_err(|_| given(&files.certificate, "this is no certificate"))?;
        if chain.is_empty() {
            return Err(given(&files.certificate, "there is no certificate in it"));
        }
        let key = PrivateKeyDer::from_pem_slice(&bytes(&files.key)?)
            .map_err(|_| given(&files.key, "there is no private key in it"))?;
        let read = Self { chain, key };
        match read.server_config() {
            Ok(_) => Ok(read),
            Err(error) => Err(given(&files.key, &format!("it does not fit ({error})"))),
        }
    }

    fn load(
        folder: &Path,
        addresses: &[IpAddr],
        names: &[String],
        now: OffsetDateTime,
    ) -> Option<Self> {
        let facts = Facts::read(folder)?;
        let fresh = facts.not_after_unix_s > (now + Duration::days(RENEW_DAYS)).unix_timestamp();
        let covers = addresses.iter().all(|a| facts.addresses.contains(a))
            && names.iter().all(|n| facts.names.contains(n));
        if !fresh || !covers {
            return None;
        }
        let kept = Self {
            chain: vec![CertificateDer::from_pem_file(folder.join("certificate.pem")).ok()?],
            key: PrivateKeyDer::from_pem_file(folder.join("key.pem")).ok()?,
        };
        // Two starts at once, or a crash between two files, may have left what does not fit.
        kept.server_config().ok()?;
        Some(kept)
    }

    fn make(
        folder: &Path,
        addresses: &[IpAddr],
        names: &[String],
        now: OffsetDateTime,
    ) -> Result<Self, TlsError> {
        let before = Facts::read(folder);
        let (old_addresses, old_names) =
            before.map_or_else(Default::default, |old| (old.addresses, old.names));
        let (addresses, names) = (union(addresses, &old_addresses), union(names, &old_names));
        let not_after = now + Duration::days(DAYS - 1);
        let mut all_names = vec!["localhost".to_owned()];
        all_names.extend(names.iter().cloned());
        let mut params = CertificateParams::new(all_names)?;
        let local = [
            IpAddr::from([127, 0, 0, 1]),
            IpAddr::from([0, 0, 0, 0, 0, 0, 0, 1]),
        ];
        let named = local.iter().chain(&addresses);
        params
            .subject_alt_names
            .extend(named.map(|address| SanType::IpAddress(*address)));
        let mut name = DistinguishedName::new();
        name.push(DnType::CommonName, "Northing live lab");
        params.distinguished_name = name;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
        // A day of grace for clocks that are behind.
        params.not_before = now - Duration::days(1);
        params.not_after = not_after;
        let key = KeyPair::generate()?;
        let certificate = params.self_signed(&key)?;
        let facts = Facts {
            addresses,
            names,
            not_after_unix_s: not_after.unix_timestamp(),
        };
        let facts = serde_json::to_vec(&facts).map_err(|e| TlsError::Use(e.to_string()))?;
        crate::private::create_folder(folder)
            .map_err(|error| failed(folder, "make this folder", error))?;
        write(&folder.join("key.pem"), key.serialize_pem().as_bytes())?;
        write(
            &folder.join("certificate.pem"),
            certificate.pem().as_bytes(),
        )?;
        // Last: it vouches for the two others.
        write(&folder.join("certificate.json"), &facts)?;
        Ok(Self {
            chain: vec![certificate.der().clone()],
            key: PrivateKeyDer::try_from(key.serialize_der())
                .map_err(|e| TlsError::Use(e.to_owned()))?,
        })
    }

    /// SHA-256 of the certificate as browsers show it: pairs of digits with colons.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let own = self.chain.first().map_or(&[][..], |own| own.as_ref());
        let digest = ring::digest::digest(&ring::digest::SHA256, own);
        let pairs: Vec<String> = digest.as_ref().iter().map(|b| format!("{b:02X}")).collect();
        pairs.join(":")
    }

    /// The configuration of a server with this certificate: TLS 1.2 and 1.3, HTTP/1.1.
    ///
    /// # Errors
    /// Certificate and key do not fit.
    pub fn server_config(&self) -> Result<Arc<rustls::ServerConfig>, TlsError> {
        let failed = |error: rustls::Error| TlsError::Use(error.to_string());
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let mut config = rustls::ServerConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .map_err(failed)?
            .with_no_client_auth()
            .with_single_cert(self.chain.clone(), self.key.clone_key())
            .map_err(failed)?;
        config.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Arc::new(config))
    }
}

fn failed(path: &Path, action: &'static str, error: io::Error) -> TlsError {
    TlsError::File {
        path: path.display().to_string(),
        action,
        error,
    }
}

/// Writes a file that only the user can read, whole or not at all.
fn write(path: &Path, bytes: &[u8]) -> Result<(), TlsError> {
    let written = |error| failed(path, "write it", error);
    let folder = path.parent().unwrap_or(Path::new("."));
    // Temporary files are made for the user alone.
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(written)?;
    file.write_all(bytes).map_err(written)?;
    file.as_file().sync_all().map_err(written)?;
    let kept = file.persist(path);
    kept.map_err(|error| failed(path, "replace it", error.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use x509_parser::prelude::*;

    const LAN: [IpAddr; 1] = [IpAddr::V4(std::net::Ipv4Addr::new(192, 168, 7, 9))];

    #[test]
    fn phones_accept_its_dates_names_and_purpose() {
        let folder = tempfile::tempdir().unwrap();
        let made =
            Certificate::load_or_make(folder.path(), &LAN, &["laptop.local".to_owned()]).unwrap();
        let (_, x509) = X509Certificate::from_der(&made.chain[0]).unwrap();
        let validity = x509.validity();
        let days = (validity.not_after.timestamp() - validity.not_before.timestamp()) / 86_400;
        assert!(days <= 397, "{days}");
        assert!(validity.is_valid());
        let names = x509.subject_alternative_name().unwrap().unwrap().value;
        let has = |name: &GeneralName<'_>| names.general_names.contains(name);
        assert!(has(&GeneralName::DNSName("localhost")));
        assert!(has(&GeneralName::DNSName("laptop.local")));
        assert!(has(&GeneralName::IPAddress(&[127, 0, 0, 1])));
        assert!(has(&GeneralName::IPAddress(&[192, 168, 7, 9])));
        assert!(
            x509.extended_key_usage()
                .unwrap()
                .unwrap()
                .value
                .server_auth
        );
        assert_eq!(made.fingerprint().len(), 32 * 3 - 1);
    }

    #[test]
    fn it_is_kept_until_an_address_is_missing_or_it_runs_out() {
        let folder = tempfile::tempdir().unwrap();
        let make = |addresses: &[IpAddr]| {
            let made = Certificate::load_or_make(folder.path(), addresses, &[]).unwrap();
            made.server_config().unwrap();
            made.fingerprint()
        };
        let cafe = IpAddr::from([10, 0, 0, 7]);
        let home = make(&LAN);
        assert_eq!(make(&LAN), home);
        // Without a network nobody is asked again.
        assert_eq!(make(&[]), home);
        let moved = make(&[cafe]);
        assert_ne!(moved, home);
        // Back home, and with both: the new one names the old address too.
        assert_eq!(make(&LAN), moved);
        assert_eq!(make(&[LAN[0], cafe]), moved);
        let later = OffsetDateTime::now_utc() + Duration::days(DAYS - RENEW_DAYS);
        let load = |now| Certificate::load(folder.path(), &LAN, &[], now);
        assert!(load(later).is_none());
        assert!(load(later - Duration::days(3)).is_some());
    }

    #[test]
    fn a_key_that_does_not_fit_or_a_torn_file_is_made_anew() {
        let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let start = |folder: &Path| Certificate::load_or_make(folder, &LAN, &[]).unwrap();
        start(other.path());
        for file in ["key.pem", "certificate.pem"] {
            let first = start(folder.path()).fingerprint();
            fs::copy(other.path().join(file), folder.path().join(file)).unwrap();
            let mended = start(folder.path());
            mended.server_config().unwrap();
            assert_ne!(mended.fingerprint(), first);
            assert_eq!(start(folder.path()).fingerprint(), mended.fingerprint());
        }
        for file in ["key.pem", "certificate.pem", "certificate.json"] {
            fs::write(folder.path().join(file), b"-----BEGIN").unwrap();
            start(folder.path()).server_config().unwrap();
        }
        let left = fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 3, "temporary files are left behind");
    }

    #[test]
    fn a_certificate_that_is_given_is_used_and_mistakes_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let other = tempfile::tempdir().unwrap();
        let made = Certificate::load_or_make(folder.path(), &LAN, &[]).unwrap();
        Certificate::load_or_make(other.path(), &LAN, &[]).unwrap();
        let files = |certificate: PathBuf, key: PathBuf| CertificateFiles { certificate, key };
        let (pem, key) = (
            folder.path().join("certificate.pem"),
            folder.path().join("key.pem"),
        );
        let read = Certificate::read(&files(pem.clone(), key.clone())).unwrap();
        assert_eq!(read.fingerprint(), made.fingerprint());
        let mistakes = [
            (
                files(folder.path().join("none.pem"), key.clone()),
                "none.pem",
            ),
            (files(key.clone(), key), "no certificate in it"),
            (files(pem.clone(), pem.clone()), "no private key in it"),
            (files(pem, other.path().join("key.pem")), "does not fit"),
        ];
        for (files, words) in mistakes {
            let error = Certificate::read(&files).unwrap_err().to_string();
            assert!(error.contains(words) && !error.contains('\n'), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn only_the_user_reads_the_key() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        Certificate::load_or_make(folder.path(), &LAN, &["laptop.local".to_owned()]).unwrap();
        let mode = fs::metadata(folder.path().join("key.pem"))
            .unwrap()
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o600);
    }
}
