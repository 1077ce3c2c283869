//! One HTML page of what a run, an analysis or a study left in a folder.
//!
//! * **found**: what is in the folder and belongs to its `summary.json`, `analysis.json` or `study.json`;
//! * **tables**: its numbers with their errors, for people and, in `<data value>`, as they were computed;
//! * **scene**: electrodes, tracks and null points as the 3D view draws them, of bounded size;
//! * **page**: all of that in one file, with the library that draws it ([`page`](page())).
//!
//! *Why three.js.* It is maintained, its licence is MIT, and the parts that are needed are 0.6 MB; vtk.js, which could read the
//! VTK files themselves, is 1.3 MB, and files beside a page are what a browser does not let it read.
//!
//! *Why base64 of f32.* JSON of numbers is three times as large and loses nothing but time; a pixel needs no more than
//! seven digits of the size of the picture, about whose middle places are told.

mod found;
mod numeral;
mod of_analysis;
mod of_run;
mod of_study;
mod page;
mod scene;
mod simplify;
mod table;

pub use found::Found;
pub use page::page;

/// Name of the page in the folder.
pub const FILE: &str = "report.html";
