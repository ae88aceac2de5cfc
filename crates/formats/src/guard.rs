//! A guard around parsers of other crates, which may trust bytes that no writer makes.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// What it gives, or nothing if it panics: such bytes are no file of its format.
pub(crate) fn guarded<T>(parse: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(parse)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_no_answer() {
        assert_eq!(guarded(|| 7), Some(7));
        assert_eq!(guarded(|| [7][usize::from(std::hint::black_box(true))]), None);
    }
}
