//! The numbers of a segment, in one flat array: made here, or lent by whoever holds the bytes of a file.

use std::fmt;
use std::ops::Deref;

use bytemuck::{NoUninit, Pod};
use bytes::Bytes;

/// An array that is either owned or a part of bytes that are shared, such as a mapped file.
pub(super) struct Column<T>(Kept<T>);

enum Kept<T> {
    Owned(Vec<T>),
    /// Never empty, aligned, and whole items.
    Shared(Bytes),
}

impl<T: Pod> Column<T> {
    /// The items that bytes hold; `None` if they end within one. Bytes that lie askew are copied.
    pub fn from_bytes(bytes: Bytes) -> Option<Column<T>> {
        if !bytes.len().is_multiple_of(size_of::<T>()) {
            return None;
        }
        let kept = match bytemuck::try_cast_slice::<u8, T>(&bytes) {
            Ok(items) if !items.is_empty() => Kept::Shared(bytes),
            _ => Kept::Owned(bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()),
        };
        Some(Column(kept))
    }

    /// Adds an item; what is shared is copied first.
    pub fn push(&mut self, item: T) {
        self.owned().push(item);
    }

    /// Gives back what was reserved but not used.
    pub fn shrink(&mut self) {
        if let Kept::Owned(items) = &mut self.0 {
            items.shrink_to_fit();
        }
    }

    fn owned(&mut self) -> &mut Vec<T> {
        if let Kept::Shared(_) = self.0 {
            self.0 = Kept::Owned(self.to_vec());
        }
        match &mut self.0 {
            Kept::Owned(items) => items,
            Kept::Shared(_) => unreachable!("it was just copied"),
        }
    }
}

impl<T: NoUninit> Column<T> {
    /// Its items as they are kept.
    pub fn as_bytes(&self) -> &[u8] {
        match &self.0 {
            Kept::Owned(items) => bytemuck::cast_slice(items),
            Kept::Shared(bytes) => bytes,
        }
    }
}

impl<T: Pod> Deref for Column<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        match &self.0 {
            Kept::Owned(items) => items,
            Kept::Shared(bytes) => bytemuck::cast_slice(bytes),
        }
    }
}

impl<T> Default for Column<T> {
    fn default() -> Self {
        Column(Kept::Owned(Vec::new()))
    }
}

impl<T> From<Vec<T>> for Column<T> {
    fn from(items: Vec<T>) -> Self {
        Column(Kept::Owned(items))
    }
}

impl<T> FromIterator<T> for Column<T> {
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> Self {
        Column(Kept::Owned(items.into_iter().collect()))
    }
}

impl<T: Pod> Extend<T> for Column<T> {
    fn extend<I: IntoIterator<Item = T>>(&mut self, items: I) {
        self.owned().extend(items);
    }
}

impl<T: Pod> fmt::Debug for Column<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let whose = if matches!(self.0, Kept::Shared(_)) { "lent" } else { "own" };
        write!(f, "{} items, {whose}", self.len())
    }
}

impl<T: Pod + PartialEq> PartialEq for Column<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_lent_where_they_lie_straight_and_copied_where_they_do_not() {
        let items: Vec<u64> = (0..9).collect();
        let whole = Bytes::copy_from_slice(&[&[0u8; 8], bytemuck::cast_slice::<u64, u8>(&items)].concat());
        let start = whole.as_ptr().align_offset(8);
        for shift in [start, start + 1] {
            let bytes = Bytes::copy_from_slice(&[&vec![0u8; shift + 8], bytemuck::cast_slice(&items)].concat());
            let from = bytes.as_ptr().align_offset(8) + usize::from(shift != start);
            let aligned = bytes.slice(from..from + 40);
            let column = Column::<u64>::from_bytes(aligned.clone()).expect("whole items");
            assert_eq!(column.as_bytes(), &aligned[..]);
            assert_eq!(column.len(), 5);
            assert_eq!(matches!(column.0, Kept::Shared(_)), shift == start);
        }
        assert!(Column::<u64>::from_bytes(whole.slice(1..10)).is_none(), "it ends within an item");
        assert!(Column::<u64>::from_bytes(Bytes::new()).expect("none at all").is_empty());
    }

    #[test]
    fn what_is_lent_can_be_added_to() {
        let mut column = Column::<u8>::from_bytes(Bytes::from_static(&[1, 2])).expect("whole items");
        column.push(3);
        column.extend([4]);
        assert_eq!(*column, [1, 2, 3, 4]);
    }
}
