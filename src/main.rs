//! The visage binary.
fn main() {}
