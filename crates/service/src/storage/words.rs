//! Words that are sought in texts, as a list of patterns: no database knows large and small letters of all languages, so a letter
//! becomes a class of its forms.

use std::collections::BTreeSet;

/// The patterns of texts that hold these words, in large letters or small, as a JSON array; a word that is named twice once.
pub(super) fn patterns(words: &[String], pattern: impl Fn(&str) -> String) -> String {
    let patterns: BTreeSet<String> = words.iter().map(|word| pattern(word)).collect();
    serde_json::Value::from_iter(patterns).to_string()
}

/// A letter in all its forms.
pub(super) fn forms(letter: char) -> BTreeSet<char> {
    let (small, large) = (single(letter.to_lowercase()), single(letter.to_uppercase()));
    let forms = [Some(letter), small, large, large.and_then(|large| single(large.to_lowercase()))];
    forms.into_iter().flatten().collect()
}

/// The form of a letter, if it is one sign too.
fn single(mut form: impl ExactSizeIterator<Item = char>) -> Option<char> {
    (form.len() == 1).then(|| form.next()).flatten()
}
