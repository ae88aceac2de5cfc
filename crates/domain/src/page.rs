//! Lists, page by page.

/// One page of a list, newest first.
#[derive(Debug, Clone)]
pub struct Page<T> {
    /// The items.
    pub items: Vec<T>,
    /// Whether there are older ones.
    pub more: bool,
}

impl<T> Page<T> {
    /// From rows of which one more than `limit` was asked for.
    pub fn cut(mut items: Vec<T>, limit: usize) -> Self {
        let more = items.len() > limit;
        items.truncate(limit);
        Page { items, more }
    }

    /// Where the next page begins, if there is one.
    pub fn next_cursor(&self, id: impl Fn(&T) -> String) -> Option<String> {
        self.items.last().filter(|_| self.more).map(id)
    }
}

/// Which part of a list is wanted.
#[derive(Debug, Clone, Default)]
pub struct PageRequest {
    /// Only items older than this one.
    pub before: Option<String>,
    /// At most so many.
    pub limit: usize,
}
