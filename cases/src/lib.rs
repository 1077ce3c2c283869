//! The case file, the pipeline that turns it into files, and the command line.

pub mod quantity;
mod suggestion;
