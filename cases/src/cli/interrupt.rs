//! What happens on Ctrl-C: nothing half written stays, and what was there before is left alone.

use std::path::PathBuf;

use crate::checkpoint::CHECKPOINT;
use crate::output::folder::{remove_all_partial, undisturbed};
use crate::pipeline::Failure;
use crate::study::journal::JOURNAL;

/// From now on an interrupt removes what is unfinished in a folder and ends the process with status 1. While files get their
/// names it waits: either all of them do or none.
pub(super) fn clean_up_in(folder: PathBuf) -> Result<(), Failure> {
    let handler = move || {
        let committed = undisturbed();
        remove_all_partial(&folder);
        let study = folder.join(JOURNAL).is_file();
        let left = match (*committed, folder.join(CHECKPOINT).is_file()) {
            (true, _) => "all files were written",
            (false, _) if study => "the rows so far are kept; the same command goes on from there",
            (false, true) => "no results were written; --resume goes on from the checkpoint",
            (false, false) => "no file was written",
        };
        eprintln!("\nstopped: {left}");
        std::process::exit(1);
    };
    ctrlc::set_handler(handler)
        .map_err(|error| Failure::run(format!("interrupts cannot be caught: {error}"), "start the run again"))
}
