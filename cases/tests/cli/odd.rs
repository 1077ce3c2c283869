//! Odd cases that are not wrong, and what is done with them.
