//! Lines of OBJ and MTL files.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::Error;

/// The text of a file in whatever encoding: bytes that aren't UTF-8, common in comments, become replacement characters.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
}

/// One statement, perhaps continued over several lines.
#[derive(Debug)]
pub(super) struct Statement<'a> {
    /// The number of its first line, counted from 1.
    pub(super) line: usize,
    text: Cow<'a, str>,
}

impl Statement<'_> {
    /// Its first word; empty for empty lines and comments.
    pub(super) fn keyword(&self) -> &str {
        let word = self.text.split_ascii_whitespace().next().unwrap_or("");
        if word.starts_with('#') { "" } else { word }
    }

    /// The words after the first, up to a comment.
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        let text = self.text.split('#').next().unwrap_or("");
        text.split_ascii_whitespace().skip(1)
    }

    /// All that follows the first word: a name may hold blanks and `#`.
    pub(super) fn name(&self) -> &str {
        let text = self.text.trim();
        text[self.keyword().len()..].trim()
    }
}

/// The statements of a text.
pub(super) fn statements(text: &str) -> impl Iterator<Item = Statement<'_>> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (i, first) = lines.next()?;
        let mut text = Cow::Borrowed(first);
        while let Some(head) = text.trim_end().strip_suffix('\\') {
            let next = lines.next().map_or("", |(_, next)| next);
            text = Cow::Owned(format!("{head} {next}"));
        }
        Some(Statement { line: i + 1, text })
    })
}

/// A text file under examination.
#[derive(Clone, Debug)]
pub(super) struct TextFile {
    pub(super) path: PathBuf,
}

impl TextFile {
    pub(super) fn new(path: &Path) -> Self {
        Self { path: path.to_path_buf() }
    }

    /// Something is wrong with a line.
    pub(super) fn fault(&self, line: usize, fault: impl Into<String>) -> Error {
        Error::at(&self.path, line, 1, fault)
    }

    /// Something about a line that the user should know.
    pub(super) fn warning(&self, line: usize, warning: impl Into<String>) -> String {
        self.fault(line, warning).to_string()
    }

    /// Something is wrong with the file as a whole.
    pub(super) fn whole(&self, fault: impl Into<String>) -> Error {
        Error::whole(&self.path, fault)
    }

    /// Finite numbers, as many as asked for; more words may follow.
    pub(super) fn numbers<const N: usize>(
        &self,
        statement: &Statement<'_>,
        limit: f32,
    ) -> Result<[f64; N], Error> {
        let mut numbers = [0.0; N];
        let mut words = statement.words();
        for number in &mut numbers {
            let word = words.next().ok_or_else(|| {
                let fault = format!("`{}` needs {N} numbers", statement.keyword());
                self.fault(statement.line, fault)
            })?;
            *number = self.number(statement, word)?;
            if number.abs() > f64::from(limit) {
                let fault = format!("{word} is too large; keep numbers within {limit:e}");
                return Err(self.fault(statement.line, fault));
            }
        }
        Ok(numbers)
    }

    /// A word as a finite number.
    pub(super) fn number(&self, statement: &Statement<'_>, word: &str) -> Result<f64, Error> {
        let number: f64 = word.parse().map_err(|_| {
            let fault = format!("`{word}` after `{}` is no number", statement.keyword());
            self.fault(statement.line, fault)
        })?;
        if number.is_finite() {
            Ok(number)
        } else {
            let fault = format!("`{}` holds {number}; give finite numbers", statement.keyword());
            Err(self.fault(statement.line, fault))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statements_span_lines() {
        let text = "# a \\\nb\nf 1 \\\r\n  2 \\\n 3 # end\n\n usemtl  a #1 \nlast \\";
        let found: Vec<_> = statements(text)
            .map(|s| (s.line, s.keyword().to_string(), s.words().collect::<Vec<_>>().join(" ")))
            .collect();
        let expect = |line, keyword: &str, words: &str| (line, keyword.into(), words.into());
        assert_eq!(
            found,
            [
                expect(1, "", ""),
                expect(3, "f", "1 2 3"),
                expect(6, "", ""),
                expect(7, "usemtl", "a"),
                expect(8, "last", ""),
            ]
        );
        assert_eq!(statements(text).nth(3).unwrap().name(), "a #1");
    }
}
