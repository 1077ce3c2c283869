//! Errors of TOML itself, in the words of the rest.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

/// A syntax error: what to say and where.
pub(crate) struct SyntaxFault {
    pub range: Range<usize>,
    /// The key path, where one can be told.
    pub key: Option<String>,
    pub problem: String,
    pub help: Option<String>,
}

/// Keys of more parts than this are refused before the parser sees them: it limits the depth of lists and tables, but not
/// of dotted keys, and tables within tables by the ten thousand exhaust the stack. Real cases need six.
pub(crate) const DEEPEST_KEY: usize = 50;

/// Where a key has too many parts, if one has.
pub(crate) fn too_deep(text: &str) -> Option<usize> {
    let (mut dots, mut quote) = (0, None);
    let mut letters = text.char_indices();
    while let Some((at, letter)) = letters.next() {
        match letter {
            '\n' => (dots, quote) = (0, None),
            '\\' if quote == Some('"') => drop(letters.next()),
            '"' | '\'' if quote.is_none() => quote = Some(letter),
            _ if quote == Some(letter) => quote = None,
            _ if quote.is_some() => {}
            '=' | ',' | '[' | ']' | '{' | '}' => dots = 0,
            '#' => quote = Some('\n'), // a comment, to the end of the line
            '.' => dots += 1,
            _ => {}
        }
        if dots > DEEPEST_KEY {
            return Some(at);
        }
    }
    None
}

/// Says what is wrong with a text that is not TOML.
///
/// `recovered` is what the parser could make of the rest: it tells where a duplicate key stood first.
pub(crate) fn fault(text: &str, error: &toml::de::Error, recovered: &DeTable) -> SyntaxFault {
    let range = error.span().unwrap_or(0..0);
    let range = range.start.min(text.len())..range.end.min(text.len());
    let written = text.get(range.clone()).unwrap_or("").trim();
    let message = error.message();
    if message == "duplicate key" {
        let first = first_of(recovered, text, range.start);
        let help = match &first {
            Some((_, line)) => format!("it stands in line {line} already: keep one of the two"),
            None => "keep one of the two".to_owned(),
        };
        let (key, problem) = match first {
            Some((path, _)) => (Some(path), format!("`{written}` is given twice")),
            None => (None, format!("`{written}` is given twice")),
        };
        return SyntaxFault { range, key, problem, help: Some(help) };
    }
    if message.starts_with("string values must be quoted") {
        let line_start = text[..range.start].rfind('\n').map_or(0, |at| at + 1);
        let before = text[line_start..range.start].trim();
        if written.is_empty() {
            let problem = match before.strip_suffix('=') {
                Some(key) => format!("`{}` has no value", key.trim()),
                None => "a value is missing".to_owned(),
            };
            return SyntaxFault {
                range,
                key: None,
                problem,
                help: Some("write a number, or a string in quotes".into()),
            };
        }
        let key = before.strip_suffix('=').map(str::trim).filter(|key| !key.contains(char::is_whitespace));
        let help = match key {
            Some(key) => format!("write {key} = \"{written}\""),
            None => format!("write \"{written}\""),
        };
        return SyntaxFault { range, key: None, problem: format!("`{written}` needs quotes"), help: Some(help) };
    }
    SyntaxFault { key: None, problem: rephrased(message, written), help: hint(message), range }
}

/// A message of the TOML parser as a sentence about the case file.
pub(crate) fn rephrased(message: &str, written: &str) -> String {
    if message.starts_with("string values must be quoted") && !written.is_empty() {
        return format!("`{written}` needs quotes");
    }
    if message.starts_with("invalid basic string") {
        return "the string is not closed".to_owned();
    }
    let message =
        message.replace(", expected nothing", "").replace("expected newline, `#`", "expected the end of the line");
    let about = if written.is_empty() || written.len() > 40 { String::new() } else { format!("`{written}`: ") };
    format!("this is not TOML: {about}{message}")
}

fn hint(message: &str) -> Option<String> {
    let hint = match message {
        m if m.starts_with("unexpected key or value") => {
            "one key = value in a line; decimal points are points; a number with a unit stands in quotes"
        }
        m if m.starts_with("key with no value") => "write key = value",
        m if m.starts_with("invalid boolean") => "write true or false, in small letters",
        m if m.starts_with("unexpected leading zero") => "write numbers without leading zeros",
        m if m.starts_with("invalid unquoted key") => "keys are made of letters, digits, `_` and `-`",
        m if m.starts_with("invalid mantissa") || m.starts_with("invalid fraction") => {
            "write a digit before and after the decimal point: 0.5, 5.0"
        }
        m if m.starts_with("invalid basic string") => "add a quote at its end, in the same line",
        m if m.starts_with("unclosed table") || m.starts_with("unclosed array table") => {
            "a table is headed by [name], one of several by [[name]]"
        }
        _ => return None,
    };
    Some(hint.to_owned())
}

/// The path and line of the key that a second one at `position` repeats.
fn first_of(table: &DeTable, text: &str, position: usize) -> Option<(String, usize)> {
    let name_at = |start: usize| {
        let rest = &text[start..];
        rest.split(['=', ']', '.', '\n', ' ']).next().unwrap_or("").trim_matches(['"', '\'']).to_owned()
    };
    let name = name_at(position);
    let mut best: Option<(String, usize)> = None;
    visit(table, "", &mut |path, key, start| {
        // The parser keeps the first and drops the second, so the nearest key of this name above is the one repeated.
        if key == name && start < position && best.as_ref().is_none_or(|(_, at)| *at < start) {
            best = Some((path.to_owned(), start));
        }
    });
    if let Some((path, start)) = best {
        return Some((path, text[..start].matches('\n').count() + 1));
    }
    // Of two tables with the same header the parser keeps the second.
    let line_start = text[..position].rfind('\n').map_or(0, |at| at + 1);
    let header = text[line_start..].lines().next().unwrap_or("").trim();
    let line = text[..line_start].lines().position(|line| line.trim() == header)?;
    Some((header.trim_matches(['[', ']']).trim().to_owned(), line + 1))
}

fn visit(table: &DeTable, prefix: &str, found: &mut impl FnMut(&str, &str, usize)) {
    for (key, value) in table.iter() {
        let path = if prefix.is_empty() { key.get_ref().to_string() } else { format!("{prefix}.{}", key.get_ref()) };
        found(&path, key.get_ref(), key.span().start);
        visit_value(value.get_ref(), &path, found);
    }
}

fn visit_value(value: &DeValue, path: &str, found: &mut impl FnMut(&str, &str, usize)) {
    match value {
        DeValue::Table(table) => visit(table, path, found),
        DeValue::Array(entries) => {
            for (n, entry) in entries.iter().enumerate() {
                let name = entry.get_ref().get("name").and_then(|name| name.get_ref().as_str().map(str::to_owned));
                visit_value(entry.get_ref(), &format!("{path}.{}", name.unwrap_or((n + 1).to_string())), found);
            }
        }
        _ => {}
    }
}
