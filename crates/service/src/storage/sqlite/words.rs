//! Words that are sought in texts, as patterns of SQLite.
//!
//! `LIKE` knows large and small letters of English alone, and functions of our own can't be given to SQLite without unsafe code. So a
//! letter becomes a class of its forms in a pattern of `GLOB`, which takes every other sign as it is.

use crate::storage::words;

/// The condition that a model has all words in its name or label; their [`patterns`] stand for the parameter.
macro_rules! has_words {
    ($patterns:literal) => {
        concat!(
            "NOT EXISTS (SELECT 1 FROM json_each(",
            $patterns,
            ") WHERE NOT (model.name GLOB value OR ifnull(model.label, '') GLOB value))"
        )
    };
}
pub(super) use has_words;

/// The patterns of words, as [`words::patterns`] lists them.
pub(super) fn patterns(words: &[String]) -> String {
    words::patterns(words, pattern)
}

fn pattern(word: &str) -> String {
    let mut pattern = String::from("*");
    for letter in word.chars() {
        let forms = words::forms(letter);
        if forms.len() > 1 || matches!(letter, '*' | '?' | '[') {
            pattern.push('[');
            pattern.extend(forms);
            pattern.push(']');
        } else {
            pattern.push(letter);
        }
    }
    pattern.push('*');
    pattern
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_met_in_all_their_forms_and_signs_as_they_are() {
        assert_eq!(pattern("aÄ-1"), "*[Aa][Ää]-1*");
        assert_eq!(pattern("*?[x]^"), "*[*][?][[][Xx]]^*");
        assert_eq!(pattern("ς"), "*[Σςσ]*");
        // its large form is two letters
        assert_eq!(pattern("ß"), "*ß*");
        assert_eq!(patterns(&["b".to_owned(), "1".to_owned(), "B".to_owned()]), r#"["*1*","*[Bb]*"]"#);
    }
}
