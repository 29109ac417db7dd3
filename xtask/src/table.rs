//! Tables of text.

use std::fmt;

/// A table whose first column names the rows. All rows are as long as the header.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Table {
    /// What the table shows; a sentence or a name.
    pub(crate) caption: String,
    pub(crate) header: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub(crate) fn new<T: Into<String>>(
        caption: impl Into<String>,
        header: impl IntoIterator<Item = T>,
    ) -> Self {
        let header = header.into_iter().map(Into::into).collect();
        Self { caption: caption.into(), header, rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// When it isn't as long as the header.
    pub(crate) fn push(
        &mut self,
        name: impl Into<String>,
        cells: impl IntoIterator<Item = String>,
    ) {
        let mut row = vec![name.into()];
        row.extend(cells);
        assert_eq!(row.len(), self.header.len(), "row {:?} of {:?}", row[0], self.caption);
        self.rows.push(row);
    }
}

/// As a terminal shows it: the caption, then columns, the first flush left and the others flush right.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines = || std::iter::once(&self.header).chain(&self.rows);
        let width = |column: usize| {
            lines().map(|line| line[column].chars().count()).max().unwrap_or_default()
        };
        let widths: Vec<usize> = (0..self.header.len()).map(width).collect();
        writeln!(f, "{}", self.caption)?;
        for line in lines() {
            let mut text = String::new();
            for (column, (cell, &width)) in line.iter().zip(&widths).enumerate() {
                match column {
                    0 => text += &format!("{cell:width$}"),
                    _ => text += &format!("  {cell:>width$}"),
                }
            }
            writeln!(f, "  {}", text.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new("Times", ["", "original", "paper"]);
        table.push("direct", ["1.00".into(), "0.5 µs".into()]);
        table.push("all", ["10.00".into(), String::new()]);
        table
    }

    #[test]
    fn columns_line_up() {
        assert_eq!(
            table().to_string(),
            "Times\n          original   paper\n  direct      1.00  0.5 µs\n  all        10.00\n"
        );
    }
}
