//! Things that are chosen by name: what is said of a name that none of them has.

use strum::VariantArray;

/// The most of a name that a message repeats, in characters.
const SHOWN: usize = 40;

/// A text that names none of the things that there are.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is no {what}: use {names}")]
pub struct UnknownName {
    what: &'static str,
    text: String,
    names: String,
}

impl UnknownName {
    /// `text` where the name of a `T` should be, which messages call `what` ("unit").
    pub fn of<T: VariantArray + Copy + Into<&'static str>>(what: &'static str, text: &str) -> UnknownName {
        let names: Vec<&str> = T::VARIANTS.iter().map(|&variant| variant.into()).collect();
        let names = match names.as_slice() {
            [rest @ .., last] if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
            names => names.join(""),
        };
        UnknownName { what, text: text.chars().take(SHOWN).collect(), names }
    }

    /// The names that there are, as a list in words.
    pub fn names(&self) -> &str {
        &self.names
    }
}

#[cfg(test)]
mod tests {
    use crate::Unit;

    #[test]
    fn the_message_repeats_the_beginning_and_says_what_there_is() {
        let refused = "yard".parse::<Unit>().expect_err("no such unit").to_string();
        assert_eq!(refused, "\"yard\" is no unit: use mm, cm, m, in or unknown");
        let long = "x".repeat(1000).parse::<Unit>().expect_err("no such unit").to_string();
        assert!(long.len() < 100, "{long}");
    }
}
