//! `graintrap report`: the page holds the numbers of the summaries and the places of the tracks, and nothing comes of folders that
//! are not whole. What a browser makes of it is looked at by `.ci/browse_report.py`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use crate::harness::{Scratch, contents, graintrap, tiny};

/// The numbers of a page as they were computed.
fn numbers(page: &str) -> BTreeSet<String> {
    let values = page.split("<data value=\"").skip(1);
    values.flat_map(|rest| rest.split('"').next().unwrap().split(' ')).map(str::to_owned).collect()
}

fn scene(page: &str) -> Value {
    let (_, rest) = page.split_once("<script id=\"scene\" type=\"application/json\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

fn words<const N: usize>(text: &Value) -> Vec<[u8; N]> {
    STANDARD.decode(text.as_str().unwrap()).unwrap().chunks(N).map(|b| b.try_into().unwrap()).collect()
}

fn floats(text: &Value) -> Vec<f32> {
    words(text).into_iter().map(f32::from_le_bytes).collect()
}

/// Every number below these keys.
fn leaves(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Number(n) => found.push(n.to_string()),
        Value::Array(all) => all.iter().for_each(|one| leaves(one, found)),
        Value::Object(all) => all.values().for_each(|one| leaves(one, found)),
        _ => {}
    }
}

fn page_of(folder: &str) -> String {
    graintrap(&["report", folder]).done();
    fs::read_to_string(Path::new(folder).join("report.html")).unwrap()
}

/// Refused: a message that has these words, status 2, and not a file more or less than before.
fn refused(folder: &str, expected: &[&str]) {
    let before = contents(Path::new(folder));
    let said = graintrap(&["report", folder]);
    assert_eq!(said.status, Some(2), "{said:?}");
    expected.iter().for_each(|words| assert!(said.err.contains(words), "{words:?} is not in {said:?}"));
    assert!(said.out.is_empty() && contents(Path::new(folder)) == before, "{said:?}");
}

#[test]
fn cli_report_of_a_run_tells_its_numbers_and_places() {
    let scratch = Scratch::new();
    let out = scratch.at("out");
    let title = "title=\"A </script><b>bold</b> & \\\"quoted\\\" title\"";
    let run = graintrap(&["run", &tiny(), "--json", "-o", &out, "--set", title]).done().json();
    let before = contents(Path::new(&out));
    let page = page_of(&out);
    // The page is all that is new, and as little as its parts.
    let mut after = contents(Path::new(&out));
    assert_eq!(after.remove("report.html").map(|bytes| bytes.len()), Some(page.len()));
    assert!(after == before && page.len() < 3_000_000, "{}", page.len());

    let told = numbers(&page);
    let mut expected = Vec::new();
    for key in
        ["capacitance_matrix_farad", "voltages_at_start", "charges_at_start", "error_estimate", "field_error_estimate"]
    {
        leaves(&run[key], &mut expected);
    }
    for key in ["grains", "steps", "position_error_estimate", "outcomes"] {
        leaves(&run["trace"][key], &mut expected);
    }
    run["trace"]["final"].as_array().unwrap().iter().for_each(|end| leaves(&end["position"], &mut expected));
    leaves(&run["table"]["error_estimate"], &mut expected);
    assert!(expected.len() > 20, "{expected:?}");
    for number in expected.iter().filter(|number| *number != "0") {
        assert!(told.contains(number), "{number} is not in the page");
    }

    // The title is text, the case as it was read stands there, and nothing is loaded from anywhere.
    assert!(!page.contains("<b>bold") && page.contains("bold") && page.matches("</title>").count() == 1);
    let escaped =
        |text: &str| text.replace('&', "&#38;").replace('"', "&#34;").replace('<', "&#60;").replace('>', "&#62;");
    let line =
        fs::read_to_string(tiny()).unwrap().lines().find(|line| line.contains("wire_radius")).unwrap().to_owned();
    assert!(page.contains(&escaped(&line)), "{line}");
    assert!(page.contains("Content-Security-Policy\" content=\"default-src 'none'"));
    for load in ["src=\"http", "href=\"http", "src=\"//", "@import", "url("] {
        assert!(!page.contains(load), "{load}");
    }

    // The last place of each grain in the view is that of the summary, to what an f32 holds of the size of the picture.
    let scene = scene(&page);
    let (tracks, size) = (&scene["tracks"], scene["size"].as_f64().unwrap());
    let lengths: Vec<u32> = words(&tracks["lengths"]).into_iter().map(u32::from_le_bytes).collect();
    let (points, times) = (floats(&tracks["points"]), floats(&tracks["times"]));
    let finals = run["trace"]["final"].as_array().unwrap();
    assert_eq!((lengths.len(), times.len() * 3), (finals.len(), points.len()));
    let mut end = 0;
    for (end_of, length) in finals.iter().zip(&lengths) {
        end += *length as usize;
        for k in 0..3 {
            let shown = scene["center"][k].as_f64().unwrap() + size * f64::from(points[3 * (end - 1) + k]);
            let told = end_of["position"][k].as_f64().unwrap();
            assert!((shown - told).abs() < 2e-7 * size, "{shown} {told}");
        }
    }
    // Every panel of the solution is drawn, in the range of its electrode.
    let electrodes = scene["electrodes"].as_array().unwrap();
    assert_eq!(electrodes.iter().map(|e| e["count"].as_u64().unwrap()).sum::<u64>(), run["panels"].as_u64().unwrap());
    assert!(electrodes.iter().map(|e| &e["name"]).eq(run["electrodes"].as_array().unwrap()));
    // All plots are there, each in an image of its own.
    let plots = before.keys().filter(|name| name.ends_with(".svg")).count();
    assert_eq!(page.matches("src=\"data:image/svg+xml;base64,").count(), plots);
    assert!(plots > 3);

    // Elsewhere, under another name; the same page.
    let elsewhere = scratch.at("elsewhere.html");
    let said = graintrap(&["report", &out, "-o", &elsewhere, "--json"]).done().json();
    assert_eq!((said["page"].as_str(), said["bytes"].as_u64()), (Some(&*elsewhere), Some(page.len() as u64)));
    assert!(fs::read_to_string(&elsewhere).unwrap() == page);

    // What is no longer there is left out, and it is said.
    for name in ["trajectories.vtp", "tracks.svg"] {
        fs::remove_file(Path::new(&out).join(name)).unwrap();
    }
    let said = graintrap(&["report", &out]).done();
    assert!(said.err.contains("left out: trajectories.vtp") && said.err.contains("tracks.svg"), "{said:?}");

    // Damaged files.
    fs::remove_file(Path::new(&out).join("report.html")).unwrap();
    let path = |name: &str| Path::new(&out).join(name);
    let damage = |name: &str, bytes: &[u8], expected: &[&str]| {
        fs::write(path(name), bytes).unwrap();
        refused(&out, &[&[name, "is damaged"], expected].concat());
        fs::write(path(name), &before[name]).unwrap();
    };
    let half = |name: &str| &before[name][..before[name].len() / 2];
    damage("electrodes.vtu", half("electrodes.vtu"), &["do the run again"]);
    damage("electrodes.vtu", b"nonsense", &["VTKFile"]);
    damage("trajectories.vtp", half("trajectories.vtp"), &["cut short"]);
    damage("coordinates.svg", half("coordinates.svg"), &["</svg>"]);
    damage("summary.json", half("summary.json"), &["EOF"]);
}

#[test]
fn cli_report_of_a_folder_that_holds_no_results_is_refused() {
    let scratch = Scratch::new();
    let (missing, empty, other) = (scratch.at("missing"), scratch.at("empty"), scratch.at("other"));
    refused(&missing, &["does not exist", "graintrap report out/two_rings"]);
    refused(&scratch.file("file.txt", "words"), &["is a file"]);
    fs::create_dir(&empty).unwrap();
    refused(&empty, &["holds no results of graintrap", "graintrap run CASE"]);
    fs::create_dir(&other).unwrap();
    scratch.file("other/summary.json", "{\"files\": []}");
    refused(&other, &["summary.json is not graintrap's"]);
    scratch.file("other/summary.json", "{\"command\": \"run\", \"version\": \"1\", \"files\": [\"../file.svg\", 7]}");
    graintrap(&["report", &other]).done();

    let said = |place: &str| graintrap(&["report", &other, "-o", place]);
    let summary = scratch.at("other/summary.json");
    assert!(said(&summary).err.contains("ends in .html") && said(&summary).status == Some(2));
    fs::create_dir(scratch.at("folder.html")).unwrap();
    assert!(said(&scratch.at("folder.html")).err.contains("is a folder"));
    let nowhere = said(&scratch.at("nowhere/page.html"));
    assert!(nowhere.status == Some(1) && nowhere.err.contains("cannot be written"), "{nowhere:?}");
}

#[test]
fn cli_report_of_a_mesh_a_solution_a_study_and_an_analysis() {
    let scratch = Scratch::new();
    let (mesh, solve, swept) = (scratch.at("mesh"), scratch.at("solve"), scratch.at("study"));
    graintrap(&["mesh", &tiny(), "-q", "-o", &mesh]).done();
    let page = page_of(&mesh);
    let of_mesh = scene(&page);
    // No voltages, no charge: parts by their numbers.
    assert_eq!((of_mesh["electrodes"][1]["name"].as_str(), &of_mesh["tracks"]), (Some("electrode 2"), &Value::Null));
    assert_eq!(of_mesh["densities"].as_array().map(Vec::len), Some(0));

    graintrap(&["solve", &tiny(), "-q", "-o", &solve]).done();
    let of_solve = scene(&page_of(&solve));
    assert_eq!((of_solve["electrodes"][1]["name"].as_str(), &of_solve["tracks"]), (Some("right"), &Value::Null));
    let density = floats(&of_solve["densities"][0]["values"]);
    let panels: u64 = of_solve["electrodes"].as_array().unwrap().iter().map(|e| e["count"].as_u64().unwrap()).sum();
    assert_eq!(density.len() as u64, panels);

    // Nothing flies in this one: weights on one solution.
    let text = fs::read_to_string(tiny()).unwrap();
    let still = text.split_once("[[grains]]").unwrap().0;
    let case = scratch.file(
        "swept.toml",
        &format!("{still}\n[sweep]\n\"electrode.left.dc\" = {{ from = \"-2 V\", to = \"2 V\", steps = 5 }}\n"),
    );
    let study = graintrap(&["study", &case, "--json", "-o", &swept]).done().json();
    let page = page_of(&swept);
    let told = numbers(&page);
    let (rows, columns) = (study["rows"].as_array().unwrap(), study["columns"].as_array().unwrap());
    let is_error = |name: &&str| !name.ends_with("_error");
    for name in columns.iter().filter_map(|column| column["name"].as_str()).filter(is_error) {
        for number in rows.iter().map(|row| &row[name]).filter(|cell| cell.is_number()) {
            assert!(told.contains(&number.to_string()), "{name} {number}");
        }
    }
    assert!(page.contains("class=\"sortable\"") && !page.contains("id=\"view\""));

    let ideal = scratch.file(
        "ideal.toml",
        "[[source]]\nname = \"trap\"\nkind = \"quadrupole\"\nr0 = \"1 mm\"\nrf = { amplitude = \"100 V\", frequency = \"1 kHz\" }\n\
         [[grains]]\ncount = 1\nmass = \"1e-12 kg\"\ncharge = \"1e-14 C\"\nplace = { kind = \"points\", points = [[0, 0, 0]] }\n\
         [trace]\nduration = \"1 ms\"\n[table]\nmin = [-1e-3, -1e-3, -1e-3]\nmax = [1e-3, 1e-3, 1e-3]\n",
    );
    let analysed = scratch.at("analysed");
    let analysis = graintrap(&["analyse", &ideal, "--json", "-o", &analysed]).done().json();
    let page = page_of(&analysed);
    let told = numbers(&page);
    let mut expected = Vec::new();
    ["a", "q"].iter().for_each(|key| leaves(&analysis["mathieu"][key], &mut expected));
    analysis["secular_hz"]["modes"].as_array().unwrap().iter().for_each(|m| leaves(&m["transition"], &mut expected));
    assert_eq!(expected.len(), 9, "{expected:?}");
    expected.iter().for_each(|number| assert!(told.contains(number), "{number} is not in the page"));
    // Neither electrodes nor tracks: no view, and no library for it.
    assert!(!page.contains("id=\"view\"") && page.len() < 1_000_000);
}
