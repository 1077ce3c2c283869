//! The case file, the pipeline that turns it into files, and the command line.
//!
//! * **case file**: a TOML file that says what stands where, what drives it, and which grains fly between;
//! * **case**: the same in SI, complete and checked ([`Case`]);
//! * **key path**: where something stands in a case file, as `electrode.left.dc`; entries of lists by their `name`, or by
//!   number from 1. Errors speak of key paths, `--set` and `[sweep]` change them.
//!
//! ```
//! use cases::{Case, Look};
//!
//! let text = r#"
//! [[electrode]]
//! name        = "left"
//! shape       = "ring"
//! radius      = "20 mm"
//! wire_radius = "1 mm"
//! rf          = { amplitude = "300 V", frequency = "60 Hz" }
//! "#;
//! let (case, source) = Case::parse("case.toml", text, &["electrode.left.dc=7 V".to_owned()]).unwrap();
//! assert_eq!(case.electrodes[0].name, "left");
//!
//! // Whatever is found wrong later is shown where it was written.
//! let error = source.error_at("electrode.left.radius", "the ring touches the plate", "make it smaller");
//! assert!(error.report(Look::PLAIN).contains("case.toml:5:15"));
//! ```
//!
//! # From a case to files
//!
//! [`pipeline`] has one file for each stage: a checked case ([`pipeline::ready`]), unit solutions to the accuracy asked
//! ([`pipeline::solution`]), their table ([`pipeline::tables`]), the driven field ([`pipeline::drives`]) and the flights
//! ([`pipeline::flights`]). [`output`] writes what came of them, [`plots`] draws, [`cache`] keeps solutions for the next run,
//! [`study`] does it for many points of a sweep, [`report`] makes a page of what was written, and [`cli`] is the command.

pub mod cache;
pub mod case;
mod case_source;
pub mod checkpoint;
pub mod cli;
mod error;
mod explain;
mod key_path;
mod keys;
pub mod output;
pub mod pipeline;
pub mod plots;
pub mod quantity;
mod reader;
pub mod report;
mod resolve;
mod schema;
mod set;
pub mod study;
mod suggestion;
mod syntax;
mod tree;

pub use case::Case;
pub use case_source::CaseSource;
pub use error::{CaseError, Details, Look};
pub use schema::schema;
