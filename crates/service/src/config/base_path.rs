//! The path below which a proxy serves the service: `/visage`.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// The longest one, in bytes.
const LONGEST: usize = 200;
/// What is at the root already: a path that begins so would be taken for it.
const TAKEN: [&str; 8] = ["v1", "assets", "docs", "healthz", "readyz", "metrics", "openapi.yaml", "openapi.json"];

/// The path below which the service is served; empty at the root. Cheap to clone.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BasePath(Arc<str>);

/// A text that is no such path.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0:?} is no path to be served below: write one such as /visage, of letters, digits, `.`, `_` and `-`, which begins \
     with nothing that is at the root (v1, docs, metrics and so on)"
)]
pub struct NoBasePath(String);

impl BasePath {
    /// Without a slash at its end; empty at the root.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// What of a path is below it: `/v1/models` of `/visage/v1/models`; `None` for a path that is not.
    pub fn strip<'a>(&self, path: &'a str) -> Option<&'a str> {
        path.strip_prefix(self.as_str()).filter(|rest| rest.starts_with('/'))
    }
}

impl FromStr for BasePath {
    type Err = NoBasePath;

    fn from_str(text: &str) -> Result<BasePath, NoBasePath> {
        let refused = || NoBasePath(text.chars().take(100).collect());
        let path = text.strip_suffix('/').unwrap_or(text);
        if path.is_empty() {
            return Ok(BasePath::default());
        }
        let mut segments = path.strip_prefix('/').ok_or_else(refused)?.split('/');
        let is_plain = |segment: &str| {
            let is_word = segment.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte));
            is_word && !segment.trim_matches('.').is_empty()
        };
        let is_free = segments.clone().next().is_some_and(|first| !TAKEN.contains(&first));
        if text.len() > LONGEST || !is_free || !segments.all(is_plain) {
            return Err(refused());
        }
        Ok(BasePath(path.into()))
    }
}

impl fmt::Display for BasePath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_empty() { "/" } else { &self.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_plain_and_not_one_of_ours() {
        for (text, path) in [("/visage", "/visage"), ("/a/b-c.d/", "/a/b-c.d"), ("/", ""), ("", ""), ("/v1x", "/v1x")] {
            assert_eq!(text.parse::<BasePath>().expect(text).as_str(), path);
        }
        let long = format!("/{}", "x".repeat(200));
        for text in
            ["visage", "//", "/a//b", "/../a", "/a/.", "/a b", "/a?b", "/v1", "/docs/x", "/metrics", "/{id}", &long]
        {
            assert!(text.parse::<BasePath>().is_err(), "{text}");
        }
    }

    #[test]
    fn what_is_below_is_told_from_what_only_begins_so() {
        let base: BasePath = "/visage".parse().expect("a path");
        assert_eq!(base.strip("/visage/v1/models"), Some("/v1/models"));
        assert_eq!(base.strip("/visage/"), Some("/"));
        for path in ["/visage", "/visages/v1", "/v1/models", "/"] {
            assert_eq!(base.strip(path), None, "{path}");
        }
    }
}
