//! What a panic said.

/// The text of a panic, as far as it has one.
pub fn panic_message(payload: &(dyn std::any::Any + Send)) -> &str {
    payload
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_of_both_kinds_have_a_text() {
        let formatted = std::panic::catch_unwind(|| panic!("number {}", 7)).expect_err("it panics");
        assert_eq!(panic_message(&*formatted), "number 7");
        let literal = std::panic::catch_unwind(|| panic!("plain")).expect_err("it panics");
        assert_eq!(panic_message(&*literal), "plain");
        assert_eq!(panic_message(&5_u8), "no message");
    }
}
