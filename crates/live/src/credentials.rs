//! The secrets of a lab: its own token, phones' own secrets, codes for laptops, the teacher's token, and the keys in cookies.
//!
//! Only the two tokens are kept as they are, because addresses are made of them; of everything else the lab keeps a SHA-256.

use std::net::IpAddr;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::guesses::{Guesses, TooMany};
use crate::lab::{MOST_DEVICES, lock};
use crate::persistence::{Persistence, SavedKey, SavedOwner, SavedTokens};
use crate::roles::Role;
use crate::token::Token;

/// A code for a laptop lives so long.
pub const CODE_LIFE: Duration = Duration::from_secs(300);
/// What codes are made of: capitals and digits that nobody takes for one another.
const CODE_ALPHABET: &[u8; 30] = b"23456789ABCDEFGHJKMNPQRSTVWXYZ";
/// Length of a code: 39 bits.
const CODE_LENGTH: usize = 8;
/// Shortest and longest secret of a phone.
const SECRET_LENGTH: [usize; 2] = [20, 64];
/// Devices whose secrets are kept; the oldest go first.
const MOST_OWNERS: usize = 4 * MOST_DEVICES;
/// Keys that one device, or the teacher, may have of codes or links; the oldest go first.
const MOST_KEYS: usize = 4;

/// Why somebody is not let in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Denied {
    /// It is not right.
    Wrong,
    /// There were too many wrong ones.
    TooMany,
    /// The device belongs to another secret.
    Taken,
    /// The system gives no random numbers.
    NoRandom,
}

impl From<TooMany> for Denied {
    fn from(_: TooMany) -> Self {
        Self::TooMany
    }
}

impl From<getrandom::Error> for Denied {
    fn from(_: getrandom::Error) -> Self {
        Self::NoRandom
    }
}

/// A SHA-256 in hexadecimal.
fn digest(secret: &str) -> String {
    let digest = ring::digest::digest(&ring::digest::SHA256, secret.as_bytes());
    digest.as_ref().iter().map(|b| format!("{b:02x}")).collect()
}

/// A code that was given out.
#[derive(Debug)]
struct Code {
    sha256: String,
    device: String,
    until: Instant,
}

#[derive(Debug, Default)]
struct State {
    /// The secret of each device, the newest last.
    owners: Vec<SavedOwner>,
    /// The keys in cookies, the newest last.
    keys: Vec<SavedKey>,
    codes: Vec<Code>,
}

/// The secrets of a lab.
#[derive(Debug)]
pub struct Credentials {
    lab: Arc<Token>,
    teacher: Option<Token>,
    state: Mutex<State>,
    guesses: Guesses,
    persistence: Option<Arc<Persistence>>,
}

impl Credentials {
    /// Those that a lab had that was killed, or new ones. A teacher elsewhere has a token only where one is wanted.
    /// Returns a sentence if those of before cannot be read.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub fn open(
        persistence: Option<Arc<Persistence>>,
        has_teacher: bool,
    ) -> Result<(Self, Option<String>), getrandom::Error> {
        let read = persistence.as_ref().map(|folder| folder.tokens());
        let (saved, note) = match read {
            Some(Err(note)) => (SavedTokens::default(), Some(note)),
            Some(Ok(saved)) => (saved.unwrap_or_default(), None),
            None => (SavedTokens::default(), None),
        };
        let known = |saved: Option<String>| saved.and_then(|text| Token::of(&text));
        let or_new = |known: Option<Token>| known.map_or_else(Token::random, Ok);
        let lab = Arc::new(or_new(known(saved.lab))?);
        let teacher = match has_teacher {
            true => Some(or_new(known(saved.teacher))?),
            false => None,
        };
        let mut keys = saved.keys;
        // Who came by a link that is no longer given has no key any more.
        keys.retain(|key| has_teacher || key.device.is_some());
        let credentials = Self {
            lab,
            teacher,
            state: Mutex::new(State {
                owners: saved.owners,
                keys,
                codes: Vec::new(),
            }),
            guesses: Guesses::new(Instant::now()),
            persistence,
        };
        credentials.save();
        Ok((credentials, note))
    }

    /// What lets phones deliver.
    #[must_use]
    pub fn lab(&self) -> &Arc<Token> {
        &self.lab
    }

    /// What a teacher elsewhere must know, where one may be.
    #[must_use]
    pub fn teacher(&self) -> Option<&Token> {
        self.teacher.as_ref()
    }

    /// Who has the key of a cookie.
    #[must_use]
    pub fn role(&self, key: &str) -> Option<Role> {
        let sha256 = digest(key);
        let state = lock(&self.state);
        let found = state.keys.iter().find(|known| known.sha256 == sha256)?;
        Some(match &found.device {
            None => Role::Teacher,
            Some(device) => Role::Student {
                device: device.as_str().into(),
            },
        })
    }

    /// A key for the phone that is this device, if its secret is the first one or the same again. Whoever calls has seen
    /// that the device is the one of the page that asks.
    ///
    /// # Errors
    /// The secret is another one, or is none.
    pub fn claim(&self, device: &str, secret: &str) -> Result<Token, Denied> {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let [shortest, longest] = SECRET_LENGTH;
        if !(shortest..=longest).contains(&secret.len()) || !secret.chars().all(plain) {
            return Err(Denied::Wrong);
        }
        let (sha256, key) = (digest(secret), Token::random()?);
        {
            let mut state = lock(&self.state);
            match state.owners.iter().find(|owner| owner.device == device) {
                Some(owner) if owner.sha256 != sha256 => return Err(Denied::Taken),
                Some(_) => {}
                None => {
                    let device = device.to_owned();
                    state.owners.push(SavedOwner { device, sha256 });
                    let excess = state.owners.len().saturating_sub(MOST_OWNERS);
                    let gone: Vec<_> = state.owners.drain(..excess).collect();
                    let is_gone = |device: &str| gone.iter().any(|owner| owner.device == device);
                    state
                        .keys
                        .retain(|key| !key.device.as_deref().is_some_and(is_gone));
                }
            }
            // A page that is loaded again has a new key in place of its old one.
            state.add(&key, Some(device), true);
        }
        self.save();
        Ok(key)
    }

    /// A code with which a laptop may see and steer this device; one that was given before is void.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub fn code(&self, device: &str, now: Instant) -> Result<String, Denied> {
        let text = random_code()?;
        let mut state = lock(&self.state);
        state
            .codes
            .retain(|code| code.until > now && code.device != device);
        state.codes.push(Code {
            sha256: digest(&text),
            device: device.to_owned(),
            until: now + CODE_LIFE,
        });
        Ok(text)
    }

    /// A key for whoever knows a code, once.
    ///
    /// # Errors
    /// There is no such code, or there were too many wrong ones.
    pub fn use_code(&self, code: &str, peer: IpAddr, now: Instant) -> Result<Token, Denied> {
        let key = Token::random()?;
        let typed = code.chars().filter(|c| c.is_ascii_alphanumeric());
        let sha256 = digest(&typed.collect::<String>().to_ascii_uppercase());
        let found = self.guesses.look(peer, now, || {
            let mut state = lock(&self.state);
            state.codes.retain(|code| code.until > now);
            let place = state.codes.iter().position(|code| code.sha256 == sha256)?;
            let code = state.codes.remove(place);
            state.add(&key, Some(&code.device), false);
            Some(())
        })?;
        found.ok_or(Denied::Wrong)?;
        self.save();
        Ok(key)
    }

    /// A key for a teacher elsewhere.
    ///
    /// # Errors
    /// This is not the token, there is none, or there were too many wrong ones.
    pub fn use_link(&self, token: &str, peer: IpAddr, now: Instant) -> Result<Token, Denied> {
        let key = Token::random()?;
        let is_right = || {
            let teacher = self.teacher.as_ref()?;
            teacher.matches(token).then_some(())
        };
        let found = self.guesses.look(peer, now, is_right)?;
        found.ok_or(Denied::Wrong)?;
        lock(&self.state).add(&key, None, false);
        self.save();
        Ok(key)
    }

    /// Whether `text` is the lab's token.
    ///
    /// # Errors
    /// There were too many wrong ones from this address.
    pub fn is_lab(&self, text: &str, peer: IpAddr, now: Instant) -> Result<(), Denied> {
        let is_right = || self.lab.matches(text).then_some(());
        self.guesses.look(peer, now, is_right)?.ok_or(Denied::Wrong)
    }

    /// Keeps what there is for a start after a crash. Whoever saves later saves what is newer.
    fn save(&self) {
        let Some(persistence) = &self.persistence else {
            return;
        };
        let now = || {
            let state = lock(&self.state);
            SavedTokens::new(
                self.lab.as_str(),
                self.teacher.as_ref().map(Token::as_str),
                &state.owners,
                &state.keys,
            )
        };
        persistence.save_tokens(now);
    }

    /// The lab ends: nothing of this is for the next one.
    pub fn forget(&self) {
        if let Some(persistence) = &self.persistence {
            persistence.forget_tokens();
        }
    }
}

impl State {
    /// Adds a key. A phone has one; of codes, and of links, a few are remembered.
    fn add(&mut self, key: &Token, device: Option<&str>, is_phone: bool) {
        let is_alike =
            |known: &SavedKey| known.device.as_deref() == device && known.is_phone == is_phone;
        let most = if is_phone { 1 } else { MOST_KEYS };
        while self.keys.iter().filter(|known| is_alike(known)).count() >= most {
            let Some(oldest) = self.keys.iter().position(is_alike) else {
                break;
            };
            self.keys.remove(oldest);
        }
        self.keys.push(SavedKey {
            sha256: digest(key.as_str()),
            device: device.map(str::to_owned),
            is_phone,
        });
    }
}

/// Every character as likely as any other.
fn random_code() -> Result<String, getrandom::Error> {
    let letters = CODE_ALPHABET.len();
    let fair = 256 / letters * letters;
    let mut code = String::new();
    while code.len() < CODE_LENGTH {
        let mut bytes = [0; 2 * CODE_LENGTH];
        getrandom::fill(&mut bytes)?;
        let usable = bytes.iter().map(|byte| usize::from(*byte));
        let usable = usable.filter(|byte| *byte < fair);
        let letters = usable.map(|byte| char::from(CODE_ALPHABET[byte % letters]));
        code.extend(letters.take(CODE_LENGTH - code.len()));
    }
    Ok(code)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PEER: [u8; 4] = [10, 0, 0, 1];
    const ANNA: &str = "the-secret-of-annas-phone";
    const BEN: &str = "the-secret-of-bens-phone";

    fn credentials() -> Credentials {
        Credentials::open(None, true).unwrap().0
    }

    fn student(device: &str) -> Option<Role> {
        Some(Role::Student {
            device: device.into(),
        })
    }

    #[test]
    fn the_first_secret_keeps_the_device() {
        let known = credentials();
        let key = known.claim("anna", ANNA).unwrap();
        assert_eq!(known.role(key.as_str()), student("anna"));
        assert_eq!(known.claim("anna", BEN).unwrap_err(), Denied::Taken);
        for bad in [
            "",
            "short",
            "with spaces in it, which none has",
            &"x".repeat(65),
        ] {
            assert_eq!(
                known.claim("carl", bad).unwrap_err(),
                Denied::Wrong,
                "{bad}"
            );
        }
        // Loaded again: a new key, and the old one is void.
        let again = known.claim("anna", ANNA).unwrap();
        assert_eq!(known.role(again.as_str()), student("anna"));
        assert_eq!(known.role(key.as_str()), None);
        assert_eq!(known.role(""), None);
        assert_eq!(known.role(ANNA), None);
    }

    #[test]
    fn a_code_is_for_one_use_within_five_minutes() {
        let (known, now, peer) = (credentials(), Instant::now(), IpAddr::from(PEER));
        let code = known.code("anna", now).unwrap();
        assert_eq!(code.len(), 8);
        let typed = format!("{} {}", code[..4].to_lowercase(), &code[4..]);
        let key = known.use_code(&typed, peer, now).unwrap();
        assert_eq!(known.role(key.as_str()), student("anna"));
        assert_eq!(known.use_code(&code, peer, now).unwrap_err(), Denied::Wrong);
        let late = known.code("anna", now).unwrap();
        let then = now + CODE_LIFE;
        assert_eq!(
            known.use_code(&late, peer, then).unwrap_err(),
            Denied::Wrong
        );
        // The newest counts.
        let [first, second] = [(); 2].map(|()| known.code("anna", now).unwrap());
        assert_eq!(
            known.use_code(&first, peer, now).unwrap_err(),
            Denied::Wrong
        );
        known.use_code(&second, peer, now).unwrap();
    }

    #[test]
    fn codes_are_not_found_by_trying() {
        let (known, now, peer) = (credentials(), Instant::now(), IpAddr::from(PEER));
        let code = known.code("anna", now).unwrap();
        let tries = (0..1000).map(|_| known.use_code("AAAAAAAA", peer, now).unwrap_err());
        let looked = tries.filter(|denied| *denied == Denied::Wrong).count();
        assert!(looked <= 20, "{looked}");
        // From there not even the right one, from elsewhere it is taken.
        assert_eq!(
            known.use_code(&code, peer, now).unwrap_err(),
            Denied::TooMany
        );
        known
            .use_code(&code, IpAddr::from([10, 0, 0, 2]), now)
            .unwrap();
    }

    #[test]
    fn codes_use_all_letters_alike() {
        let mut counts = [0_u32; 30];
        for _ in 0..3000 {
            for byte in random_code().unwrap().bytes() {
                counts[CODE_ALPHABET.iter().position(|c| *c == byte).unwrap()] += 1;
            }
        }
        // 800 of each on average, standard deviation 28.
        assert!(counts.iter().all(|n| (630..970).contains(n)), "{counts:?}");
    }

    #[test]
    fn a_teacher_elsewhere_needs_the_token_and_a_lab_that_gives_one() {
        let (known, now, peer) = (credentials(), Instant::now(), IpAddr::from(PEER));
        let token = known.teacher().unwrap().as_str().to_owned();
        let key = known.use_link(&token, peer, now).unwrap();
        assert_eq!(known.role(key.as_str()), Some(Role::Teacher));
        assert_eq!(known.use_link("", peer, now).unwrap_err(), Denied::Wrong);
        let lab = known.lab().as_str().to_owned();
        assert_eq!(known.use_link(&lab, peer, now).unwrap_err(), Denied::Wrong);
        let none = Credentials::open(None, false).unwrap().0;
        assert_eq!(none.use_link(&token, peer, now).unwrap_err(), Denied::Wrong);
        assert_eq!(none.use_link("", peer, now).unwrap_err(), Denied::Wrong);
    }

    #[test]
    fn what_is_remembered_is_bounded() {
        let (known, now) = (credentials(), Instant::now());
        for k in 0..2000_u32 {
            known.claim(&format!("d{k}"), ANNA).unwrap();
            let code = known.code("anna", now).unwrap();
            let peer = IpAddr::from(k.to_be_bytes());
            known.use_code(&code, peer, now).unwrap();
        }
        let state = lock(&known.state);
        assert!(state.owners.len() <= MOST_OWNERS && state.codes.len() <= 1);
        assert!(
            state.keys.len() <= MOST_OWNERS + MOST_KEYS,
            "{}",
            state.keys.len()
        );
    }
}
