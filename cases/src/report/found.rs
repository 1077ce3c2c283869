//! What there is in a folder of results.

use std::fs;
use std::path::Path;

use meshes::import::DataSet;
use serde_json::Value;

use crate::output::electrodes;
use crate::output::folder::plain;
use crate::pipeline::Failure;
use crate::study::files::JSON as STUDY;

/// Pictures in the order in which they are shown; others follow as they were written.
const PICTURES: [&str; 9] = [
    "tracks",
    "coordinates",
    "analysis_map",
    "analysis_axes",
    "stability_chart",
    "potential",
    "phase_planes",
    "spectrum",
    "front",
];

/// The results in a folder. Only files that its summaries name are looked at: others may be of another run.
#[derive(Debug, Default)]
pub struct Found {
    /// `summary.json` of `run`, `trace`, `solve` or `table`.
    pub run: Option<Value>,
    /// `analysis.json`.
    pub analysis: Option<Value>,
    /// `study.json`.
    pub study: Option<Value>,
    /// The electrodes: `electrode`, and charge densities.
    pub surface: Option<DataSet>,
    /// Where grains flew: `time`, `grain`, `outcome`.
    pub tracks: Option<DataSet>,
    /// Name and text of each picture, SVG.
    pub pictures: Vec<(String, String)>,
    /// Names of all files that summaries name.
    pub files: Vec<String>,
    /// What is named but not there any more.
    pub left_out: Vec<String>,
}

impl Found {
    /// Reads a folder.
    ///
    /// # Errors
    /// There is no such folder, it is not graintrap's, or a file in it is damaged.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        if !folder.is_dir() {
            let what = if folder.exists() { "is a file" } else { "does not exist" };
            let help = "give the folder that `graintrap run`, `analyse`, `solve` or `study` wrote, as in `graintrap report out/two_rings`";
            return Err(Failure::usage(format!("the folder {} {what}", folder.display()), help));
        }
        let mut found = Self {
            run: summary(folder, "summary.json")?,
            analysis: summary(folder, "analysis.json")?,
            study: summary(folder, STUDY)?,
            ..Self::default()
        };
        let summaries = [&found.run, &found.analysis, &found.study];
        let mut files: Vec<String> = Vec::new();
        for name in summaries.into_iter().flatten().filter_map(|s| s["files"].as_array()).flatten() {
            // A name in the folder, not a way out of it.
            let name = name.as_str().filter(|name| !name.contains(['/', '\\']));
            files.extend(name.map(str::to_owned).filter(|name| !files.contains(name)));
        }
        // `graintrap mesh` writes no summary.
        let bare = summaries.iter().all(|s| s.is_none()) && folder.join(electrodes::FILE).is_file();
        if bare {
            files.push(electrodes::FILE.to_owned());
        }
        if files.is_empty() && summaries.iter().all(|s| s.is_none()) {
            let problem = format!("{} holds no results of graintrap", folder.display());
            let help =
                "a folder with summary.json, analysis.json or study.json was expected: `graintrap run CASE` writes one";
            return Err(Failure::usage(problem, help));
        }
        found.surface = found.data_set(folder, &files, electrodes::FILE, |name| {
            name == "electrode" || name.ends_with("charge_density") || name.starts_with("unit_charge_density ")
        })?;
        if let Some(surface) = &found.surface {
            let triangles = surface.cells().all(|cell| cell.len() == 3);
            let is_one =
                |number: &f64| (0.0..=surface.ends.len() as f64 + 1e6).contains(number) && number.fract() == 0.0;
            if !triangles || !surface.cell_array("electrode").is_some_and(|numbers| numbers.iter().all(is_one)) {
                return Err(damaged(&folder.join(electrodes::FILE), "it holds no triangles of electrodes"));
            }
        }
        let wanted = |name: &str| matches!(name, "time" | "grain" | "outcome");
        found.tracks = found.data_set(folder, &files, "trajectories.vtp", wanted)?;
        if let Some(tracks) = &found.tracks
            && (tracks.point_array("time").is_none() || tracks.cell_array("outcome").is_none())
        {
            return Err(damaged(&folder.join("trajectories.vtp"), "it has no `time` or no `outcome`"));
        }
        let rank = |name: &str| PICTURES.iter().position(|known| *known == name).unwrap_or(PICTURES.len());
        let mut pictures: Vec<&str> = files.iter().filter_map(|name| name.strip_suffix(".svg")).collect();
        pictures.sort_by_key(|name| rank(name));
        for name in pictures {
            let path = folder.join(format!("{name}.svg"));
            let Some(bytes) = found.bytes(&path)? else { continue };
            let text = String::from_utf8(bytes).ok().filter(|text| text.trim_end().ends_with("</svg>"));
            let text = text.ok_or_else(|| damaged(&path, "it does not end with </svg>"))?;
            found.pictures.push((name.to_owned(), text));
        }
        found.files = files;
        Ok(found)
    }

    /// The summaries that are there.
    pub fn summaries(&self) -> impl Iterator<Item = &Value> {
        [&self.study, &self.run, &self.analysis].into_iter().flatten()
    }

    /// A VTK file, if it is named and there.
    fn data_set(
        &mut self,
        folder: &Path,
        files: &[String],
        name: &str,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<Option<DataSet>, Failure> {
        if !files.iter().any(|file| file == name) {
            return Ok(None);
        }
        let path = folder.join(name);
        let Some(bytes) = self.bytes(&path)? else { return Ok(None) };
        DataSet::read(&bytes, wanted).map(Some).map_err(|error| damaged(&path, &error.to_string()))
    }

    /// The content of a file that is named, unless it is no longer there.
    fn bytes(&mut self, path: &Path) -> Result<Option<Vec<u8>>, Failure> {
        let bytes = content(path)?;
        if bytes.is_none() {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            self.left_out.push(format!("{name}, which is no longer in the folder"));
        }
        Ok(bytes)
    }
}

/// A file's content, if there is one.
fn content(path: &Path) -> Result<Option<Vec<u8>>, Failure> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => {
            let problem = format!("{} cannot be read: {}", path.display(), plain(&error));
            Err(Failure::usage(problem, "look at who may read it"))
        }
    }
}

/// A summary, if there is one.
fn summary(folder: &Path, name: &str) -> Result<Option<Value>, Failure> {
    let path = folder.join(name);
    let Some(bytes) = content(&path)? else { return Ok(None) };
    let value: Value = serde_json::from_slice(&bytes).map_err(|error| damaged(&path, &error.to_string()))?;
    if value["command"].is_string() && value["version"].is_string() {
        Ok(Some(value))
    } else {
        let problem = format!("{} is not graintrap's: it names no command", path.display());
        Err(Failure::usage(problem, "give the folder that `graintrap run`, `analyse`, `solve` or `study` wrote"))
    }
}

fn damaged(path: &Path, problem: &str) -> Failure {
    Failure::usage(format!("{} is damaged: {problem}", path.display()), "do the run again, which writes it anew")
}
