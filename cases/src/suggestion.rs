//! "Did you mean ...?"

/// The name most like `typed`, if any is like it at all.
pub(crate) fn nearest<S: AsRef<str>>(typed: &str, known: impl IntoIterator<Item = S>) -> Option<String> {
    // One slip in short names, two in words, more in long ones: beyond that a suggestion confuses more than it helps.
    let slips = match typed.chars().count() {
        0 => return None,
        1..=4 => 1,
        5..=8 => 2,
        _ => 3,
    };
    let lower = typed.to_lowercase();
    known
        .into_iter()
        .map(|name| {
            let name = name.as_ref();
            let distance = strsim::osa_distance(&lower, &name.to_lowercase());
            // Among names that differ from the typed one by case alone, take the one with fewest changes.
            (distance, strsim::osa_distance(typed, name), name.to_owned())
        })
        .filter(|(distance, _, name)| *distance <= slips && *distance < name.chars().count())
        .min()
        .map(|(_, _, name)| name)
}

/// "a", "a and b", "a, b and c".
pub(crate) fn list<S: AsRef<str>>(items: &[S], last: &str) -> String {
    match items {
        [] => String::new(),
        [only] => only.as_ref().to_owned(),
        [first @ .., end] => {
            let first: Vec<&str> = first.iter().map(AsRef::as_ref).collect();
            format!("{} {last} {}", first.join(", "), end.as_ref())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suggests_what_is_near_and_nothing_else() {
        let keys = ["radius", "wire_radius", "center", "dc"];
        assert_eq!(nearest("radiu", keys).as_deref(), Some("radius"));
        assert_eq!(nearest("raduis", keys).as_deref(), Some("radius"));
        assert_eq!(nearest("centre", keys).as_deref(), Some("center"));
        assert_eq!(nearest("voltage", keys), None);
        assert_eq!(nearest("KV", ["kV", "MV", "V"]).as_deref(), Some("kV"));
    }

    #[test]
    fn lists_read_as_sentences() {
        assert_eq!(list(&["a"], "or"), "a");
        assert_eq!(list(&["a", "b", "c"], "or"), "a, b or c");
    }
}
