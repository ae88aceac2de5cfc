//! Words that are sought in texts, as patterns of PostgreSQL.

use crate::storage::words;

/// The condition that a model has all words in its name or label; their [`patterns`] stand for the parameter.
macro_rules! has_words {
    ($patterns:literal) => {
        concat!(
            "NOT EXISTS (SELECT 1 FROM json_each(",
            $patterns,
            ") WHERE NOT (model.name ~ value OR coalesce(model.label, '') ~ value))"
        )
    };
}
pub(super) use has_words;

/// The patterns of words, as [`words::patterns`] lists them.
pub(super) fn patterns(words: &[String]) -> String {
    words::patterns(words, pattern)
}

fn pattern(word: &str) -> String {
    let mut pattern = String::new();
    for letter in word.chars() {
        let forms = words::forms(letter);
        if forms.len() > 1 {
            pattern.push('[');
            pattern.extend(forms);
            pattern.push(']');
        } else {
            if letter.is_ascii() && !letter.is_ascii_alphanumeric() {
                pattern.push('\\');
            }
            pattern.push(letter);
        }
    }
    pattern
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_met_in_all_their_forms_and_signs_as_they_are() {
        assert_eq!(pattern("aÄ-1"), r"[Aa][Ää]\-1");
        assert_eq!(pattern("***=.x"), r"\*\*\*\=\.[Xx]");
        assert_eq!(patterns(&["b".to_owned(), "1".to_owned(), "B".to_owned()]), r#"["1","[Bb]"]"#);
    }
}
