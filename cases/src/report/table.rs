//! Tables of a page.

use super::numeral::Cell;

/// A table.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// What it shows.
    pub title: String,
    /// Names of columns; empty: rows begin with their own names.
    pub head: Vec<String>,
    /// Rows, each of which begins with a name.
    pub rows: Vec<Vec<Cell>>,
    /// What must be said of it.
    pub note: String,
    /// Folded up until someone wants it.
    pub folded: bool,
    /// Rows can be sorted by a column.
    pub sortable: bool,
}

impl Table {
    /// One of names and values.
    pub fn of_values(title: &str) -> Self {
        Self { title: title.to_owned(), ..Self::default() }
    }

    /// One with columns.
    pub fn with_head(title: &str, head: &[&str]) -> Self {
        Self { title: title.to_owned(), head: head.iter().map(|h| (*h).to_owned()).collect(), ..Self::default() }
    }

    /// Adds a row of a name and a value, if there is one.
    pub fn put(&mut self, name: &str, cell: impl Into<Option<Cell>>) {
        if let Some(cell) = cell.into() {
            self.rows.push(vec![Cell::words(name), cell]);
        }
    }
}

/// Tables that belong together.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// Without those that have no rows.
    pub tables: Vec<Table>,
}

impl Section {
    /// Of the tables that have rows.
    pub fn new(title: &str, tables: impl IntoIterator<Item = Table>) -> Self {
        Self { title: title.to_owned(), tables: tables.into_iter().filter(|t| !t.rows.is_empty()).collect() }
    }
}

/// The most important of all, above everything.
#[derive(Clone, Debug, Default)]
pub struct Key {
    /// What it is.
    pub name: String,
    /// Its value.
    pub cell: Cell,
}
