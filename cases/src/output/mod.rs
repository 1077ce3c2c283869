//! What a run writes: VTK, CSV, plots, the summary.

pub mod folder;

pub use folder::OutputFolder;
