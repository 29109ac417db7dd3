//! Tables of text: for a terminal, and for Markdown.

use std::fmt;

/// A table whose first column names the rows. All rows are as long as the header.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Table {
    /// What the table shows.
    pub(crate) caption: String,
    /// Headings above the header, each with the number of columns it spans, from the second column on. May be empty.
    pub(crate) groups: Vec<(String, usize)>,
    pub(crate) header: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
    /// Sentences below the table.
    pub(crate) notes: Vec<String>,
}

impl Table {
    /// A table without rows.
    pub(crate) fn new<T: Into<String>>(
        caption: impl Into<String>,
        header: impl IntoIterator<Item = T>,
    ) -> Self {
        let header = header.into_iter().map(Into::into).collect();
        Self { caption: caption.into(), header, ..Self::default() }
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

    /// As Markdown: the table alone, without caption and notes.
    pub(crate) fn to_markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = format!("|---|{}\n", "---:|".repeat(self.header.len().saturating_sub(1)));
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("{}{rule}{rows}", line(&self.flat_header()))
    }

    /// The header with each column's group before its name.
    fn flat_header(&self) -> Vec<String> {
        let groups = self.groups.iter().flat_map(|(name, span)| std::iter::repeat_n(name, *span));
        let mut header = self.header.clone();
        for (cell, group) in header.iter_mut().skip(1).zip(groups) {
            *cell = format!("{group} {cell}").trim_end().to_owned();
        }
        header
    }
}

/// As a terminal shows it: the caption, then columns, the first flush left and the others flush right.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines = || std::iter::once(&self.header).chain(&self.rows);
        let width = |column: usize| {
            lines().map(|line| line[column].chars().count()).max().unwrap_or_default()
        };
        let mut widths: Vec<usize> = (0..self.header.len()).map(width).collect();
        let mut first = 1;
        for (name, span) in &self.groups {
            // A heading wider than its columns widens the last of them.
            let have = widths[first..first + span].iter().sum::<usize>() + 2 * (span - 1);
            widths[first + span - 1] += name.chars().count().saturating_sub(have);
            first += span;
        }

        writeln!(f, "{}", self.caption)?;
        if !self.groups.is_empty() {
            let mut text = " ".repeat(widths[0]);
            let mut first = 1;
            for (name, span) in &self.groups {
                let width = widths[first..first + span].iter().sum::<usize>() + 2 * (span - 1);
                text += &format!("  {name:>width$}");
                first += span;
            }
            writeln!(f, "  {}", text.trim_end())?;
        }
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
        self.notes.iter().try_for_each(|note| writeln!(f, "  {note}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new("Times", ["", "original", "paper", "original"]);
        table.push("direct", ["1.00".into(), "0.5 µs".into(), "2".into()]);
        table.push("all", ["10.00".into(), String::new(), "3".into()]);
        table
    }

    #[test]
    fn columns_line_up() {
        assert_eq!(
            table().to_string(),
            "Times\n          original   paper  original\n  direct      1.00  0.5 µs         2\n  all        10.00                 3\n"
        );
    }

    #[test]
    fn headings_end_with_their_columns() {
        let mut table = table();
        table.groups = vec![("128".into(), 2), ("a long heading".into(), 1)];
        table.notes.push("So it is.".into());
        let expected = [
            "Times",
            "                       128  a long heading",
            "          original   paper        original",
            "  direct      1.00  0.5 µs               2",
            "  all        10.00                       3",
            "  So it is.",
        ];
        assert_eq!(table.to_string().lines().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn markdown() {
        let mut table = table();
        table.groups = vec![("128".into(), 2), ("256".into(), 1)];
        assert_eq!(
            table.to_markdown(),
            "|  | 128 original | 128 paper | 256 original |\n|---|---:|---:|---:|\n\
             | direct | 1.00 | 0.5 µs | 2 |\n| all | 10.00 |  | 3 |\n"
        );
    }
}
