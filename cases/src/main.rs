//! The `graintrap` command.

fn main() {}
