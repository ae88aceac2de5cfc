//! What a key or a session is to its owner: `visage_` and 64 characters, which hold an id and 256 random bits.

use std::fmt;
use std::str::FromStr;

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use visage_domain::SecretHash;

/// By this tools that look for lost secrets know one of ours.
const PREFIX: &str = "visage_";
const ID_BYTES: usize = 16;
const SECRET_BYTES: usize = 32;

/// The id of a key or session with its secret.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Token {
    id: u128,
    secret: [u8; SECRET_BYTES],
}

/// The system has given no random numbers.
#[derive(Debug, thiserror::Error)]
#[error("the system gives no random numbers: {0}")]
pub struct NoRandomness(#[from] getrandom::Error);

/// A text that is no token. It does not hold the text, which may be a secret.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a key is `visage_` and 64 letters, digits, `-` and `_`")]
pub struct NoToken;

impl Token {
    /// A new secret for an id.
    pub fn new(id: u128) -> Result<Token, NoRandomness> {
        let mut secret = [0; SECRET_BYTES];
        getrandom::fill(&mut secret)?;
        Ok(Token { id, secret })
    }

    /// The id of what it is a token of.
    pub fn id(&self) -> u128 {
        self.id
    }

    /// What is stored in place of the secret.
    pub fn hash(&self) -> SecretHash {
        *blake3::hash(&self.secret).as_bytes()
    }

    /// Whether this is the hash of its secret, in a time that tells nothing of where they differ.
    pub fn is_of(&self, hash: &SecretHash) -> bool {
        // hashes are compared in constant time
        blake3::hash(&self.secret) == blake3::Hash::from_bytes(*hash)
    }
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut bytes = [0; ID_BYTES + SECRET_BYTES];
        let (id, secret) = bytes.split_at_mut(ID_BYTES);
        id.copy_from_slice(&self.id.to_be_bytes());
        secret.copy_from_slice(&self.secret);
        write!(f, "{PREFIX}{}", URL_SAFE_NO_PAD.encode(bytes))
    }
}

/// Without the secret: what is logged must not open anything.
impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Token({:032x})", self.id)
    }
}

impl FromStr for Token {
    type Err = NoToken;

    fn from_str(text: &str) -> Result<Token, NoToken> {
        let text = text.strip_prefix(PREFIX).ok_or(NoToken)?;
        // what is longer needs no decoding
        if text.len() != (ID_BYTES + SECRET_BYTES) / 3 * 4 {
            return Err(NoToken);
        }
        let bytes = URL_SAFE_NO_PAD.decode(text).map_err(|_| NoToken)?;
        let (id, secret) = bytes.split_first_chunk().ok_or(NoToken)?;
        Ok(Token { id: u128::from_be_bytes(*id), secret: secret.try_into().map_err(|_| NoToken)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_survives_text_and_is_known_by_its_hash_alone() {
        let token = Token::new(7).expect("random");
        let text = token.to_string();
        assert_eq!(text.len(), PREFIX.len() + 64);
        assert_eq!(text.parse(), Ok(token));
        assert!(token.is_of(&token.hash()));
        let mut hash = token.hash();
        for byte in 0..hash.len() {
            hash[byte] ^= 1;
            assert!(!token.is_of(&hash));
            hash[byte] ^= 1;
        }
        assert_ne!(Token::new(7).expect("random").hash(), token.hash());
    }

    #[test]
    fn what_is_shown_of_a_token_does_not_hold_its_secret() {
        let token = Token::new(7).expect("random");
        let secret = &token.to_string()[PREFIX.len() + 22..];
        assert!(!format!("{token:?}").contains(secret));
    }

    #[test]
    fn what_is_no_token_is_refused() {
        let good = Token::new(1).expect("random").to_string();
        let cut = &good[..good.len() - 1];
        for text in ["", "visage_", "secret", cut, &format!("{good}A"), &good.replace("visage_", "Visage_")] {
            assert_eq!(text.parse::<Token>(), Err(NoToken), "{text}");
        }
        assert_eq!(format!("{cut}!").parse::<Token>(), Err(NoToken));
        assert_eq!(format!("{PREFIX}{}", "\u{e9}".repeat(32)).parse::<Token>(), Err(NoToken));
    }
}
