//! The page itself.

use askama::Template;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use super::scene::Scene;
use super::table::{Key, Section};
use super::{Found, of_analysis, of_run, of_study};
use crate::output::electrodes;
use crate::pipeline::Failure;

/// three.js; `assets/three/README.md` says which, and how the file was made.
const THREE: &str = include_str!("../../assets/three/three.min.js");
const THREE_LICENCE: &str = include_str!("../../assets/three/LICENSE");
/// What draws the scene and moves it.
const VIEW: &str = include_str!("../../assets/report/view.js");
const SORT: &str = include_str!("../../assets/report/sort.js");
const STYLE: &str = include_str!("../../assets/report/style.css");

/// Numbers that stand above everything at most.
const KEYS: usize = 6;

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    title: String,
    commands: Vec<String>,
    version: &'a str,
    warnings: Vec<&'a str>,
    keys: Vec<Key>,
    scene: Option<&'a Scene>,
    pictures: Vec<Picture>,
    sections: Vec<Section>,
    cases: Vec<CaseCopy<'a>>,
    files: &'a [String],
    left_out: &'a [String],
    paraview: Vec<&'a str>,
    style: &'a str,
    three: &'a str,
    licence: &'a str,
    view: &'a str,
    sort: &'a str,
}

struct Picture {
    name: String,
    caption: &'static str,
    data: String,
}

/// A case, as one or several commands read it.
struct CaseCopy<'a> {
    of: Vec<&'a str>,
    file: &'a str,
    set: Vec<&'a str>,
    text: &'a str,
}

/// The page of what was found.
///
/// # Errors
/// None that results of ours can cause.
pub fn page(found: &Found) -> Result<String, Failure> {
    let scene = Scene::new(found);
    let first = found.summaries().next();
    let text = |key: &str| first.and_then(|summary| summary[key].as_str());
    let mut keys: Vec<Key> = found.study.iter().flat_map(of_study::keys).collect();
    keys.extend(found.run.iter().flat_map(of_run::keys));
    keys.extend(found.analysis.iter().flat_map(of_analysis::keys));
    keys.truncate(KEYS);
    let mut sections: Vec<Section> = found.study.iter().flat_map(of_study::sections).collect();
    sections.extend(found.analysis.iter().flat_map(of_analysis::sections));
    sections.extend(found.run.iter().flat_map(of_run::sections));
    sections.retain(|section| !section.tables.is_empty());
    let mut warnings: Vec<&str> = Vec::new();
    for warning in found.summaries().filter_map(|s| s["warnings"].as_array()).flatten().filter_map(Value::as_str) {
        if !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }
    let is_there = |name: &&str| found.files.iter().any(|file| file == name);
    let page = Page {
        title: text("title").filter(|title| !title.is_empty()).unwrap_or("A mesh of electrodes").to_owned(),
        commands: found.summaries().filter_map(|s| s["command"].as_str()).map(str::to_owned).collect(),
        version: text("version").unwrap_or(env!("CARGO_PKG_VERSION")),
        warnings,
        keys,
        scene: scene.as_ref(),
        pictures: found.pictures.iter().map(|(name, svg)| Picture::new(name, svg)).collect(),
        sections,
        cases: cases(found),
        files: &found.files,
        left_out: &found.left_out,
        paraview: [electrodes::FILE, "field.vti", "trajectories.vtp"].into_iter().filter(is_there).collect(),
        style: STYLE,
        three: THREE,
        licence: THREE_LICENCE,
        view: VIEW,
        sort: SORT,
    };
    page.render()
        .map_err(|error| Failure::run(format!("the page cannot be made: {error}"), "this is a fault of graintrap"))
}

impl Picture {
    fn new(name: &str, svg: &str) -> Self {
        let caption = match name {
            "tracks" => "Tracks between the electrodes",
            "coordinates" => "Coordinates against time",
            "phase_planes" => "Velocity over position",
            "spectrum" => "Lines in the motion",
            "potential" => "Potential along the axis",
            "analysis_map" => "Potentials in a plane through the centre",
            "analysis_axes" => "Potentials along the axes",
            "stability_chart" => "Stability",
            "front" => "Grids that none surpasses",
            "study" => "Numbers over what was varied",
            "history" => "The objective, evaluation after evaluation",
            "strikes" => "Where grains strike the cell of the grid",
            _ => "",
        };
        let data = format!("data:image/svg+xml;base64,{}", STANDARD.encode(svg));
        Self { name: name.to_owned(), caption, data }
    }
}

/// The cases of all commands, each once.
fn cases(found: &Found) -> Vec<CaseCopy<'_>> {
    let mut cases: Vec<CaseCopy> = Vec::new();
    for summary in found.summaries() {
        let case = &summary["case"];
        let (Some(file), Some(text)) = (case["file"].as_str(), case["text"].as_str()) else { continue };
        let set: Vec<&str> = case["set"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let command = summary["command"].as_str().unwrap_or_default();
        match cases.iter_mut().find(|known| known.text == text && known.set == set) {
            Some(known) => known.of.push(command),
            None => cases.push(CaseCopy { of: vec![command], file, set, text }),
        }
    }
    cases
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// What would break a page if it were not escaped.
    const HOSTILE: &str = "</script></title></pre><img src=x onerror=alert(1)>\"'&{{ title }}<!--";

    fn hostile() -> Found {
        let h = HOSTILE;
        let summary = |command: &str| {
            json!({
                "command": command, "version": h, "title": h, "warnings": [h], "files": [h],
                "case": { "file": h, "set": [h], "text": h },
            })
        };
        let with = |command: &str, more: Value| {
            let mut summary = summary(command);
            summary.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
            summary
        };
        let run = json!({
            "electrodes": [h], "capacitance_matrix_farad": [[1e-12]], "solver": h, "solver_reason": h, "reused": [h],
            "trace": { "grains": 1, "outcomes": { "time_up": 0, "struck": { h: 1 } }, "integrator": h,
                       "final": [{ "outcome": "struck", "electrode": h, "time": 1.0 }] },
        });
        let species = json!([{ "name": h, "center_is": h, "depth_ev": { "opening": h, "value": 1.0 },
                               "effective": [{ "kind": "minimum", "position": [0, 0, 0] }] }]);
        let nulls = json!([{ "of": h, "kind": h, "position": [0.0, 0.0, 0.0] }]);
        let study = json!({ h: h, "columns": [{ "name": h, "unit": h }], "rows": [{ h: h }] });
        Found {
            run: Some(with("run", run)),
            analysis: Some(with("analyse", json!({ "nulls": nulls, "species": species, "center_is": h }))),
            study: Some(with("study", study)),
            surface: Some(meshes::import::DataSet {
                points: vec![meshes::Vec3::zeros(), meshes::Vec3::x(), meshes::Vec3::y()],
                corners: vec![0, 1, 2],
                ends: vec![3],
                cell_arrays: vec![("electrode".into(), vec![0.0]), (format!("unit_charge_density {h}"), vec![1.0])],
                ..Default::default()
            }),
            pictures: vec![(h.to_owned(), "<svg></svg>".to_owned())],
            files: vec![h.to_owned()],
            left_out: vec![h.to_owned()],
            ..Found::default()
        }
    }

    #[test]
    fn nothing_that_a_user_wrote_is_markup() {
        let page = page(&hostile()).unwrap();
        assert!(!page.contains("<img src=x") && !page.contains("<!--"), "{HOSTILE}");
        // As many as the template has: the scene, three.js, the view, sorting.
        assert_eq!((page.matches("<script").count(), page.matches("</script>").count()), (4, 4));
        assert_eq!((page.matches("</title>").count(), page.matches("</style>").count()), (1, 1));
        // And all of it is there, to be read.
        assert!(
            page.matches("&lt;img src=x onerror=alert(1)&gt;").count() + page.matches("&#60;img src=x").count() > 20
        );
        assert!(page.contains("\\u003cimg src=x"), "the electrode's name in the scene");
    }

    #[test]
    fn a_page_of_nothing_is_a_page() {
        let page = page(&Found { run: Some(json!({})), ..Found::default() }).unwrap();
        assert!(page.contains("</html>") && !page.contains("THREE"));
    }

    #[test]
    fn what_is_shipped_in_a_page_is_small_and_stays_in_its_element() {
        assert!(THREE.len() < 1_000_000 && THREE_LICENCE.contains("three.js authors"));
        for script in [THREE, VIEW, SORT] {
            assert!(!script.contains("</script") && !script.contains("<!--"));
        }
        assert!(!STYLE.contains("</style") && !STYLE.contains("url("));
    }
}
