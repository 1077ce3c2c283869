//! What a run writes: VTK, CSV, plots, the summary.

pub mod analysis_chart;
pub mod analysis_pictures;
pub mod analysis_text;
pub mod electrodes;
pub mod field_map;
pub mod folder;
pub mod pictures;
pub mod summary;
pub mod tracks;

pub use folder::OutputFolder;
pub use summary::Summary;
