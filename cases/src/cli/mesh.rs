//! `graintrap mesh`: the electrodes as triangles, and how good these are.

use meshes::MeshReport;
use serde_json::json;

use super::session::Session;
use crate::output::electrodes;
use crate::output::summary::MeshSummary;
use crate::pipeline::ready::ready;
use crate::pipeline::{Failure, solution};

pub(super) fn mesh(session: &Session) -> Result<(), Failure> {
    let mut out = session.output()?;
    let ready = ready(&session.case, &session.source, &*session.progress)?;
    let mesh = solution::starting_mesh(&session.case, &session.source, &ready)?;
    let report = MeshReport::new(&mesh);
    let summary = MeshSummary::new(&report, &mesh);
    out.write(electrodes::FILE, |w| electrodes::write_mesh(w, &mesh))?;
    let files = out.names().to_vec();
    out.commit()?;
    let object = json!({
        "command": "mesh",
        "title": session.title(),
        "mesh": summary,
        "warnings": session.progress.warnings(),
        "files": files,
    });
    session.say(&object, || format!("{report}\nfiles: {}: {}\n", session.folder.display(), files.join(", ")));
    Ok(())
}
