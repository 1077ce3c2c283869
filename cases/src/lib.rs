//! The case file, the pipeline that turns it into files, and the command line.

pub mod case;
mod case_source;
mod error;
mod explain;
mod key_path;
mod keys;
pub mod quantity;
mod reader;
mod resolve;
mod schema;
mod set;
mod suggestion;
mod syntax;
mod tree;

pub use case::Case;
pub use case_source::CaseSource;
pub use error::{CaseError, Details, Look};
pub use schema::schema;
