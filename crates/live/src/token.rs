//! Tokens, such as the one that lets phones deliver: random, and compared in constant time.

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use subtle::ConstantTimeEq as _;

/// 128 random bits as text that fits into an address.
#[derive(Clone)]
pub struct Token(String);

/// Whoever prints what holds a token prints no secret.
impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token(..)")
    }
}

impl Token {
    /// A new token from the system's random numbers.
    ///
    /// # Errors
    /// The system has none.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes)?;
        Ok(Self(URL_SAFE_NO_PAD.encode(bytes)))
    }

    /// A token that was kept as text; `None` when this is none.
    #[must_use]
    pub fn of(text: &str) -> Option<Self> {
        let bytes = URL_SAFE_NO_PAD.decode(text).ok()?;
        (bytes.len() == 16).then(|| Self(text.to_owned()))
    }

    /// The token as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Whether `text` is this token; takes as long for every text of the same length.
    #[must_use]
    pub fn matches(&self, text: &str) -> bool {
        self.0.as_bytes().ct_eq(text.as_bytes()).into()
    }
}

#[cfg(test)]
mod tests {
    use super::Token;

    #[test]
    fn tokens_differ_and_match_themselves_alone() {
        let (a, b) = (Token::random().unwrap(), Token::random().unwrap());
        assert_eq!(a.as_str().len(), 22);
        assert!(a.matches(a.as_str()) && !a.matches(b.as_str()));
        assert!(Token::of(a.as_str()).is_some_and(|kept| kept.matches(a.as_str())));
        for bad in ["", "AAAA", "!", &a.as_str()[1..]] {
            assert!(Token::of(bad).is_none(), "{bad}");
        }
        assert!(!a.matches("") && !a.matches(&a.as_str()[..21]));
    }
}
