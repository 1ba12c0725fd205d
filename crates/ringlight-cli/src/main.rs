//! The `ringlight` command.
fn main() {}
