//! Where a key stands in a case file.

use std::fmt;

use crate::syntax::DEEPEST_KEY;

/// One step down: a key of a table, or an entry of a list (counted from zero inside, shown from one).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Segment {
    /// A key of a table.
    Key(String),
    /// An entry of a list.
    Entry(usize),
}

impl fmt::Display for Segment {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Key(key) if is_bare(key) => f.write_str(key),
            Self::Key(key) => write!(f, "{key:?}"),
            Self::Entry(n) => write!(f, "{}", n + 1),
        }
    }
}

/// Whether a key can stand in a path without quotes.
pub(crate) fn is_bare(key: &str) -> bool {
    !key.is_empty() && key.chars().all(is_name_character)
}

/// What names of electrodes, sources, drives and groups of grains are made of: they become parts of key paths, of file
/// names and of the names of arrays in VTK files.
pub(crate) fn is_name_character(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '-')
}

/// The same for JSON Schema, with the other rules of names: no number, no `-` in front, at most 64 characters.
pub(crate) const NAME_PATTERN: &str = r"^(?![0-9]+$)[\p{L}\p{N}_][\p{L}\p{N}_\-]{0,63}$";

/// Splits `electrode.left.dc` at its points; parts in double or single quotes may contain points.
///
/// # Errors
/// A sentence that says what is wrong.
pub(crate) fn split(path: &str) -> Result<Vec<String>, String> {
    let mut parts = Vec::new();
    let mut rest = path.trim();
    loop {
        let end = match rest.chars().next() {
            Some(quote @ ('"' | '\'')) => {
                let Some(end) = rest[1..].find(quote) else {
                    return Err(format!("the quote {quote} in `{path}` is not closed"));
                };
                parts.push(rest[1..=end].to_owned());
                end + 2
            }
            _ => {
                let end = rest.find('.').unwrap_or(rest.len());
                let part = rest[..end].trim();
                if part.is_empty() {
                    return Err(format!("`{path}` has an empty part"));
                }
                parts.push(part.to_owned());
                end
            }
        };
        rest = rest[end..].trim_start();
        if rest.is_empty() {
            return Ok(parts);
        }
        if parts.len() > DEEPEST_KEY {
            return Err(format!("the key path has more than {DEEPEST_KEY} parts"));
        }
        rest = match rest.strip_prefix('.') {
            Some(rest) => rest.trim_start(),
            None => return Err(format!("`{path}` needs a point before `{rest}`")),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_at_points_outside_quotes() {
        assert_eq!(split("electrode.left.dc").unwrap(), ["electrode", "left", "dc"]);
        assert_eq!(split("sweep.\"electrode.cap.opening\".to").unwrap(), ["sweep", "electrode.cap.opening", "to"]);
        assert_eq!(split(" a . 'b.c' ").unwrap(), ["a", "b.c"]);
        for bad in ["", ".", "a.", "a..b", "\"a", "\"a\"b", "'"] {
            assert!(split(bad).is_err(), "{bad}");
        }
    }
}
