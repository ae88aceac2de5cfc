//! What a request shows of who it is from: a key in `Authorization`, or the cookie of a browser that has signed in.

use axum::http::{HeaderMap, header};
use visage_service::app::access::{NoToken, Shown, Token};

/// The name of the cookie.
pub const SESSION_COOKIE: &str = "visage_session";

/// Why what is shown can't be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Unreadable {
    /// The header.
    #[error("the header Authorization has to be sent once, as `Bearer KEY`")]
    Scheme,
    /// The key in it.
    #[error(transparent)]
    Token(#[from] NoToken),
}

/// What a request shows. A key counts before a session: a program that shows one means it. A cookie that is none of
/// ours says nothing: other services of the same host may have set it.
pub fn shown(headers: &HeaderMap) -> Result<Option<Shown>, Unreadable> {
    let mut given = headers.get_all(header::AUTHORIZATION).iter();
    match (given.next(), given.next()) {
        (None, _) => Ok(session_of(headers).map(Shown::Session)),
        (Some(value), None) => {
            let text = value.to_str().map_err(|_| Unreadable::Scheme)?;
            let (scheme, key) = text.split_once(' ').ok_or(Unreadable::Scheme)?;
            if !scheme.eq_ignore_ascii_case("bearer") {
                return Err(Unreadable::Scheme);
            }
            Ok(Some(Shown::Key(key.trim().parse()?)))
        }
        (Some(_), Some(_)) => Err(Unreadable::Scheme),
    }
}

/// The session that a request shows.
pub fn session_of(headers: &HeaderMap) -> Option<Token> {
    let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    let mut pairs = cookies.flat_map(|value| value.split(';')).filter_map(|pair| pair.trim().split_once('='));
    pairs.find_map(|(name, value)| (name == SESSION_COOKIE).then(|| value.parse().ok()).flatten())
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::{HeaderName, HeaderValue};

    fn headers(lines: &[(&str, &str)]) -> HeaderMap {
        let line = |(name, value): &(&str, &str)| {
            let name = HeaderName::try_from(*name).expect("a name");
            (name, HeaderValue::try_from(*value).expect("a value"))
        };
        lines.iter().map(line).collect()
    }

    #[test]
    fn a_key_counts_before_a_session_and_other_cookies_say_nothing() {
        let [key, session] = [1, 2].map(|id| Token::new(id).expect("random"));
        let (bearer, cookie) = (format!("bearer {key}"), format!("a=b; visage_session=x; visage_session={session}"));
        let both = headers(&[("authorization", &bearer), ("cookie", &cookie)]);
        assert_eq!(shown(&both), Ok(Some(Shown::Key(key))));
        assert_eq!(shown(&headers(&[("cookie", "c=d"), ("cookie", &cookie)])), Ok(Some(Shown::Session(session))));
        assert_eq!(shown(&headers(&[("cookie", "visage_session=x; a")])), Ok(None));
    }

    #[test]
    fn what_is_no_key_is_refused() {
        let key = Token::new(1).expect("random").to_string();
        for value in ["", "Bearer", "Bearer ", "Bearer x", &key, &format!("Basic {key}"), &format!("Bearer {key}{key}")]
        {
            assert!(shown(&headers(&[("authorization", value)])).is_err(), "{value}");
        }
        let bearer = format!("Bearer {key}");
        assert_eq!(shown(&headers(&[("authorization", &bearer), ("authorization", &bearer)])), Err(Unreadable::Scheme));
    }
}
