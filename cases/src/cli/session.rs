//! A case that is open, and what every verb needs beside it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::arguments::Common;
use super::progress::Progress;
use super::{interrupt, print};
use crate::CaseSource;
use crate::cache::{Cache, Unusable};
use crate::case::Case;
use crate::output::summary::CaseText;
use crate::output::{OutputFolder, Summary};
use crate::pipeline::{Failure, memory};

/// An open case.
pub(super) struct Session {
    pub case: Case,
    pub source: CaseSource,
    pub progress: Arc<Progress>,
    /// Where results go.
    pub folder: PathBuf,
    /// Where solutions and tables are kept.
    pub cache: Cache,
    quiet: bool,
    json: bool,
}

impl Session {
    /// Reads the case.
    pub fn open(common: &Common) -> Result<Self, Failure> {
        let (case, source) = Case::read(&common.case, &common.set)?;
        let folder = common.output.clone().unwrap_or_else(|| Path::new("out").join(name(&common.case)));
        let cache = match &common.cache {
            Some(shared) => Cache::shared(shared, common.fresh),
            None => Cache::of_output(&folder, common.fresh),
        };
        Ok(Self {
            case,
            source,
            progress: Arc::new(Progress::new(common.quiet)),
            folder,
            cache,
            quiet: common.quiet,
            json: common.json,
        })
    }

    /// The title of the case, or its name.
    pub fn title(&self) -> String {
        if self.case.title.is_empty() { name(&self.source.path) } else { self.case.title.clone() }
    }

    /// Makes the output folder, and has interrupts clean it up.
    pub fn output(&self) -> Result<OutputFolder, Failure> {
        self.cache.prepare()?;
        let out = OutputFolder::create(&self.folder)?;
        interrupt::clean_up_in(self.folder.clone())?;
        Ok(out)
    }

    /// A summary with what is the same for every verb.
    pub fn summary(&self, command: &'static str) -> Summary {
        Summary {
            version: env!("CARGO_PKG_VERSION"),
            command,
            title: self.title(),
            case: Some(CaseText::new(&self.source)),
            threads: rayon::current_num_threads(),
            ..Summary::default()
        }
    }

    /// Writes the summary, gives all files their names, and prints.
    pub fn finish(&self, mut out: OutputFolder, mut summary: Summary) -> Result<(), Failure> {
        summary.peak_memory_bytes = memory::peak();
        summary.warnings = self.progress.warnings();
        summary.files = out.names().to_vec();
        summary.files.push("summary.json".to_owned());
        out.write("summary.json", |w| serde_json::to_writer_pretty(w, &summary))?;
        out.commit()?;
        self.say(&summary, || summary.text(&self.case, &self.folder));
        Ok(())
    }

    /// Prints an object as JSON, or its words, whatever was asked for.
    pub fn say(&self, object: &impl serde::Serialize, words: impl FnOnce() -> String) {
        self.progress.finish();
        if self.json {
            print(&format!("{}\n", serde_json::to_string(object).unwrap_or_default()));
        } else if !self.quiet {
            print(&words());
        }
    }

    /// A word to the user that is no warning.
    pub fn remark(&self, text: &str) {
        if !self.quiet {
            eprintln!("{text}");
        }
    }

    /// What was kept, with a word to the user if a file is there that is of no use.
    pub fn kept<T>(&self, read: Result<Option<T>, (PathBuf, Unusable)>) -> Option<T> {
        read.unwrap_or_else(|(path, why)| {
            if !self.quiet {
                eprintln!("warning: {} {why}: computing the field anew", path.display());
            }
            None
        })
    }
}

/// The name of a case: its folder's where the file is `case.toml` or `study.toml`, else the file's.
fn name(path: &Path) -> String {
    let of = |part: Option<&std::ffi::OsStr>| part.map(|p| p.to_string_lossy().into_owned());
    let stem = of(path.file_stem()).unwrap_or_else(|| "case".to_owned());
    if stem != "case" && stem != "study" {
        return stem;
    }
    let folder = path.parent().and_then(|folder| of(folder.file_name()));
    // `case.toml` in the current folder.
    let here = || std::env::current_dir().ok().and_then(|folder| of(folder.file_name()));
    folder.or_else(here).unwrap_or(stem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_is_named_after_its_folder_or_its_file() {
        assert_eq!(name(Path::new("cases/two_rings/case.toml")), "two_rings");
        assert_eq!(name(Path::new("cases/optimal_rings/study.toml")), "optimal_rings");
        assert_eq!(name(Path::new("designs/trap3.toml")), "trap3");
        assert!(!name(Path::new("case.toml")).is_empty());
    }
}
