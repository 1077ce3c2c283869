//! The best case of an optimisation as a case file: the user's own text with other values.

use std::path::PathBuf;

use toml_edit::visit_mut::{VisitMut, visit_table_like_kv_mut};
use toml_edit::{DocumentMut, Item, KeyMut, Table, Value};

use super::points::{case_at, edits};
use crate::CaseSource;
use crate::case::{Case, Optimise};
use crate::key_path::split;
use crate::keys::study::OF_OPTIMISATION;

/// Name of the file.
pub const BEST: &str = "best.toml";

/// The text of the case at some values of what is varied, with a comment before it. It is the same case, but for the study.
///
/// # Errors
/// A key that cannot be written into the user's text.
pub fn best(
    case: &Case,
    source: &CaseSource,
    optimise: &Optimise,
    values: &[String],
    comment: &str,
) -> Result<String, String> {
    let mut document: DocumentMut = source.text.parse().map_err(|error| format!("{error}"))?;
    if let Some(study) = document.get_mut("study").and_then(Item::as_table_like_mut) {
        study.remove("kind");
        for key in OF_OPTIMISATION {
            study.remove(key);
        }
        if study.is_empty() {
            document.remove("study");
        }
    }
    let set = source
        .sets
        .iter()
        .filter_map(|set| set.split_once('='))
        .map(|(key, value)| (key.trim().to_owned(), value.to_owned()));
    let varied = edits(optimise, values).map_err(|(key, problem)| format!("{key}: {problem}"))?;
    for (key, value) in set.chain(varied) {
        if key == "study" || key.starts_with("study.") {
            continue;
        }
        let value: Value = match value.trim().parse() {
            Ok(value) => value,
            // A bare string of the command line.
            Err(_) => value.trim().into(),
        };
        write(document.as_item_mut(), &split(&key)?, value).ok_or_else(|| format!("`{key}` cannot be written"))?;
    }
    if !same(case, source, values, &document.to_string())? {
        return Err("the text that was written is another case".to_owned());
    }
    // A file named without a folder is in the current one.
    let folder = std::path::absolute(PathBuf::from(".").join(source.folder())).map_err(|error| format!("{error}"))?;
    Absolute(folder).visit_document_mut(&mut document);
    Ok(format!("{comment}\n{}", document.to_string().trim_start()))
}

/// Whether the text is the case at these values, with all that a run and an analysis look at.
fn same(case: &Case, source: &CaseSource, values: &[String], text: &str) -> Result<bool, String> {
    let (at, _) = case_at(case, source, values).map_err(|error| error.problem.clone())?;
    let (written, _) = Case::parse(&source.path, text, &[]).map_err(|error| error.problem.clone())?;
    let study = written.study.clone();
    Ok(written == Case { study, ..at })
}

/// Puts a value where a key path leads, and makes the tables that are not there.
fn write(item: &mut Item, path: &[String], value: Value) -> Option<()> {
    let Some((part, rest)) = path.split_first() else {
        // The user's spaces and comments stay.
        let decor = item.as_value().map(|old| old.decor().clone());
        let mut value = value;
        match decor {
            Some(decor) => *value.decor_mut() = decor,
            None => value.decor_mut().clear(),
        }
        *item = Item::Value(value);
        return Some(());
    };
    if let Some(list) = item.as_array_of_tables_mut() {
        let names: Vec<Option<String>> =
            list.iter().map(|table| table.get("name").and_then(Item::as_str).map(str::to_owned)).collect();
        let table = list.get_mut(place(&names, part)?)?;
        // A table is no item of its own: its entry is.
        let (key, rest) = rest.split_first()?;
        let entry = table.entry(key).or_insert(if rest.is_empty() { Item::None } else { Item::Table(Table::new()) });
        return write(entry, rest, value);
    }
    if let Some(list) = item.as_array_mut() {
        let names: Vec<Option<String>> = list
            .iter()
            .map(|v| v.as_inline_table().and_then(|t| t.get("name")).and_then(Value::as_str).map(str::to_owned))
            .collect();
        let at = place(&names, part)?;
        let mut inner = Item::Value(list.get(at)?.clone());
        write(&mut inner, rest, value)?;
        list.replace_formatted(at, inner.into_value().ok()?);
        return Some(());
    }
    let table = item.as_table_like_mut()?;
    if table.get(part).is_none() {
        table.insert(part, if rest.is_empty() { Item::None } else { Item::Table(Table::new()) });
    }
    if table.get(part).is_none_or(Item::is_none) && rest.is_empty() {
        table.insert(part, Item::Value(value));
        return Some(());
    }
    write(table.get_mut(part)?, rest, value)
}

/// The entry of a list that a part of a path names, as in `--set`.
fn place(names: &[Option<String>], part: &str) -> Option<usize> {
    let named = names.iter().position(|name| name.as_deref() == Some(part));
    named.or_else(|| {
        let digits = part.trim_start_matches("source").trim_start_matches("grains");
        digits.parse::<usize>().ok()?.checked_sub(1).filter(|n| *n < names.len())
    })
}

/// Makes the paths of files that the case reads absolute: the new file stands elsewhere.
struct Absolute(PathBuf);

impl VisitMut for Absolute {
    fn visit_table_like_kv_mut(&mut self, key: KeyMut<'_>, node: &mut Item) {
        if key.get() == "file"
            && let Some(Value::String(text)) = node.as_value()
        {
            let mut path = Value::from(self.0.join(text.value()).display().to_string());
            *path.decor_mut() = text.decor().clone();
            *node = Item::Value(path);
        }
        visit_table_like_kv_mut(self, key, node);
    }
}
