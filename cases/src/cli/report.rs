//! `graintrap report`: a page of what another command left.

use serde_json::json;

use super::arguments::ReportArguments;
use super::print;
use crate::output::folder::write_alone;
use crate::pipeline::Failure;
use crate::pipeline::memory::people;
use crate::report::{FILE, Found, page};

pub(super) fn report(arguments: &ReportArguments) -> Result<(), Failure> {
    let path = arguments.output.clone().unwrap_or_else(|| arguments.folder.join(FILE));
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    if !extension.is_some_and(|e| e == "html" || e == "htm") {
        let problem = format!("{} is no name of a page", path.display());
        return Err(Failure::usage(problem, "give a file that ends in .html after -o"));
    }
    if path.is_dir() {
        let problem = format!("{} is a folder", path.display());
        return Err(Failure::usage(problem, "give the name of a file after -o"));
    }
    let found = Found::read(&arguments.folder)?;
    let page = page(&found)?;
    write_alone(&path, page.as_bytes())?;
    if arguments.json {
        let object = json!({
            "command": "report",
            "folder": arguments.folder.display().to_string(),
            "page": path.display().to_string(),
            "bytes": page.len(),
            "left_out": found.left_out,
        });
        print(&format!("{object}\n"));
    } else if !arguments.quiet {
        found.left_out.iter().for_each(|text| eprintln!("left out: {text}"));
        print(&format!("report       {} ({})\n", path.display(), people(page.len() as u64)));
    }
    Ok(())
}
