//! The paths that stand in a source text. It is read as tokens: comments, strings and characters don't count, and grouped
//! imports do (`use std::{fs, io}`).

/// A path as it stands in the source, a grouped import unfolded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Named {
    /// The line that it begins on, from 1.
    pub line: usize,
    /// Its names in order.
    pub segments: Vec<String>,
    /// Whether it is a macro that is called.
    pub is_macro: bool,
}

impl Named {
    /// As it is written.
    pub fn path(&self) -> String {
        self.segments.join("::")
    }

    /// Whether the path is `prefix` or something in it.
    pub fn is_in(&self, prefix: &str) -> bool {
        let mut segments = self.segments.iter();
        prefix.split("::").all(|wanted| segments.next().is_some_and(|segment| segment == wanted))
    }
}

/// Words and signs of a source text with their lines; comments, strings and characters left out.
fn tokens(source: &str) -> Vec<(usize, String)> {
    let text: Vec<char> = source.chars().collect();
    let at = |index: usize| text.get(index).copied().unwrap_or('\0');
    let (mut tokens, mut line, mut k) = (Vec::new(), 1, 0);
    while k < text.len() {
        let end = match (at(k), at(k + 1)) {
            ('/', '/') => until(&text, k, |i| at(i) == '\n'),
            ('/', '*') => end_of_block_comment(&text, k),
            ('"', _) => end_of_string(&text, k),
            ('r', '"' | '#') | ('b', '"' | 'r' | '\'') if is_literal(&text, k) => end_of_prefixed(&text, k),
            ('\'', _) => end_of_quote(&text, k),
            (':', ':') => {
                tokens.push((line, "::".to_owned()));
                k + 2
            }
            (c, _) if c.is_alphanumeric() || c == '_' => {
                let end = until(&text, k, |i| !(at(i).is_alphanumeric() || at(i) == '_'));
                tokens.push((line, text[k..end].iter().collect()));
                end
            }
            (c, _) => {
                if !c.is_whitespace() {
                    tokens.push((line, c.to_string()));
                }
                k + 1
            }
        };
        line += text[k..end.min(text.len())].iter().filter(|c| **c == '\n').count();
        k = end;
    }
    tokens
}

/// The first index from `start` on at which `stop` holds, or the end.
fn until(text: &[char], start: usize, stop: impl Fn(usize) -> bool) -> usize {
    (start..text.len()).find(|&index| stop(index)).unwrap_or(text.len())
}

fn end_of_block_comment(text: &[char], start: usize) -> usize {
    let (mut depth, mut k) = (0, start);
    while k + 1 < text.len() {
        match (text[k], text[k + 1]) {
            ('/', '*') => (depth, k) = (depth + 1, k + 2),
            ('*', '/') => (depth, k) = (depth - 1, k + 2),
            _ => k += 1,
        }
        if depth == 0 {
            return k;
        }
    }
    text.len()
}

/// The index after a string that begins with the quote at `start`.
fn end_of_string(text: &[char], start: usize) -> usize {
    let mut k = start + 1;
    while k < text.len() && text[k] != '"' {
        k += if text[k] == '\\' { 2 } else { 1 };
    }
    k + 1
}

/// Whether an `r` or `b` begins a literal, and not a word.
fn is_literal(text: &[char], start: usize) -> bool {
    let follows_a_word = start > 0 && (text[start - 1].is_alphanumeric() || text[start - 1] == '_');
    let quote = until(text, start, |i| !matches!(text[i], 'r' | 'b' | '#'));
    !follows_a_word && quote - start <= 10 && matches!(text.get(quote), Some('"' | '\''))
}

/// The index after a literal such as `r#"..."#`, `b"..."` or `b'x'`.
fn end_of_prefixed(text: &[char], start: usize) -> usize {
    let quote = until(text, start, |i| matches!(text[i], '"' | '\''));
    let prefix = &text[start..quote];
    if text[quote] == '\'' {
        return end_of_quote(text, quote);
    }
    if !prefix.contains(&'r') {
        return end_of_string(text, quote);
    }
    let hashes = prefix.iter().filter(|c| **c == '#').count();
    let closes =
        |i: usize| text[i] == '"' && text[i + 1..].iter().take(hashes).filter(|c| **c == '#').count() == hashes;
    until(text, quote + 1, closes) + 1 + hashes
}

/// The index after a character literal; after the quote alone if it is a lifetime.
fn end_of_quote(text: &[char], start: usize) -> usize {
    match (text.get(start + 1), text.get(start + 2)) {
        (Some('\\'), _) => until(text, start + 3, |i| text[i] == '\'') + 1,
        (Some(_), Some('\'')) => start + 3,
        _ => start + 1,
    }
}

/// All paths of a source text.
pub fn paths(source: &str) -> Vec<Named> {
    let tokens = tokens(source);
    let mut found = Vec::new();
    let mut k = 0;
    while k < tokens.len() {
        k = if is_word(&tokens[k].1) { read_path(&tokens, k, &[], &mut found) } else { k + 1 };
    }
    found
}

fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Reads the path that begins at `start`, unfolds its groups, and gives the index after it.
fn read_path(tokens: &[(usize, String)], start: usize, prefix: &[String], found: &mut Vec<Named>) -> usize {
    let token = |index: usize| tokens.get(index).map_or("", |(_, text)| text.as_str());
    let mut segments = prefix.to_vec();
    let mut k = start;
    loop {
        if token(k) == "{" {
            k += 1;
            while k < tokens.len() && token(k) != "}" {
                k = if is_word(token(k)) { read_path(tokens, k, &segments, found) } else { k + 1 };
            }
            return k + 1;
        }
        if !is_word(token(k)) {
            break;
        }
        segments.push(token(k).to_owned());
        k += 1;
        if token(k) != "::" {
            break;
        }
        k += 1;
    }
    let is_macro = token(k) == "!" && matches!(token(k + 1), "(" | "[" | "{");
    found.push(Named { line: tokens[start].0, segments, is_macro });
    k
}
