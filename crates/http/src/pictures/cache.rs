//! The last pictures that were drawn.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

use bytes::Bytes;

use crate::conditions::ETag;

/// Bytes that are kept: some two thousand thumbnails.
const MOST_BYTES: usize = 48 << 20;
/// Pictures that are kept, whatever their size: all are looked through.
const MOST: usize = 4096;

/// Pictures by their tags, the one that was asked for last at the end.
#[derive(Debug, Default)]
pub struct Drawn {
    kept: Mutex<VecDeque<(ETag, Bytes)>>,
}

impl Drawn {
    /// The picture of this tag, if it is kept.
    pub fn get(&self, etag: &ETag) -> Option<Bytes> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let place = kept.iter().rposition(|(known, _)| known == etag)?;
        let entry = kept.remove(place)?;
        let bytes = entry.1.clone();
        kept.push_back(entry);
        Some(bytes)
    }

    /// Keeps a picture in the place of those that nobody has asked for the longest.
    pub fn put(&self, etag: ETag, bytes: Bytes) {
        if bytes.len() > MOST_BYTES / 4 {
            return;
        }
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push_back((etag, bytes));
        let mut held: usize = kept.iter().map(|(_, bytes)| bytes.len()).sum();
        while held > MOST_BYTES || kept.len() > MOST {
            let Some((_, oldest)) = kept.pop_front() else { break };
            held -= oldest.len();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_asks_for_goes_first() {
        let drawn = Drawn::default();
        let tag = |name: u32| ETag::of_checksum(&name.to_string());
        let large = Bytes::from(vec![0; MOST_BYTES / 4]);
        for name in 0..4 {
            drawn.put(tag(name), large.clone());
        }
        assert!(drawn.get(&tag(0)).is_some());
        drawn.put(tag(4), large.clone());
        let kept = [0, 1, 2, 3, 4].map(|name| drawn.get(&tag(name)).is_some());
        assert_eq!(kept, [true, false, true, true, true]);
        drawn.put(tag(9), Bytes::from(vec![0; MOST_BYTES / 4 + 1]));
        assert!(drawn.get(&tag(9)).is_none(), "one alone must not drive all others out");
        for name in 10..10 + MOST as u32 + 5 {
            drawn.put(tag(name), Bytes::from_static(b"x"));
        }
        assert!(drawn.get(&tag(0)).is_none() && drawn.get(&tag(14)).is_none() && drawn.get(&tag(20)).is_some());
    }
}
