//! `graintrap check`: whether a case can run.

use serde_json::json;

use super::session::Session;
use crate::output::summary::grains_text;
use crate::pipeline::Failure;
use crate::pipeline::ready::ready;

pub(super) fn check(session: &Session) -> Result<(), Failure> {
    let case = &session.case;
    let ready = ready(case, &session.source, &*session.progress)?;
    let electrodes: Vec<&String> = case.electrodes.iter().map(|e| &e.name).collect();
    let sources: Vec<&String> = case.sources.iter().map(|s| &s.name).collect();
    let object = json!({
        "command": "check",
        "title": session.title(),
        "electrodes": electrodes,
        "sources": sources,
        "grains": ready.ensemble.len(),
        "warnings": session.progress.warnings(),
    });
    session.say(&object, || {
        let list = |names: &[&String]| match names {
            [] => "none".to_owned(),
            names => names.iter().map(|n| n.as_str()).collect::<Vec<_>>().join(", "),
        };
        format!(
            "{} can run\nelectrodes   {}\nsources      {}\ngrains       {}\n",
            session.source.path.display(),
            list(&electrodes),
            list(&sources),
            grains_text(case, &ready.ensemble)
        )
    });
    Ok(())
}
