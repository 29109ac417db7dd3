//! Keys that only some types of a table take.

use std::ops::Range;

use toml::Spanned;

use super::source::Source;
use crate::Error;

/// A table whose `type` says which other keys it takes.
pub(super) struct Typed<'a> {
    pub(super) source: &'a Source,
    /// Such as ``material `glass` ``.
    pub(super) object: &'a str,
    pub(super) kind: &'a Spanned<String>,
}

impl Typed<'_> {
    /// Refuses the keys that are given but not among `allowed`. Both lists leave out `type` and `name`.
    pub(super) fn take_only(
        &self,
        given: &[(&str, Option<Range<usize>>)],
        allowed: &[&str],
    ) -> Result<(), Error> {
        for (key, span) in given {
            if let Some(span) = span
                && !allowed.contains(key)
            {
                let Self { object, kind, .. } = self;
                let kind = kind.get_ref();
                let fault = format!(
                    "{object} of type \"{kind}\" takes no `{key}`; its keys are {}",
                    list(allowed)
                );
                return Err(self.source.fault(span.clone(), fault));
            }
        }
        Ok(())
    }

    /// A key that this type must have.
    pub(super) fn need<'t, T>(&self, value: &'t Option<T>, key: &str) -> Result<&'t T, Error> {
        value.as_ref().ok_or_else(|| {
            let fault = format!(
                "{} of type \"{}\" needs the key `{key}`",
                self.object,
                self.kind.get_ref()
            );
            self.source.fault(self.kind.span(), fault)
        })
    }

    /// The type isn't known.
    pub(super) fn unknown(&self, known: &[&str]) -> Error {
        let fault = format!(
            "{} has the unknown type \"{}\"; the types are {}",
            self.object,
            self.kind.get_ref(),
            list(known)
        );
        self.source.fault(self.kind.span(), fault)
    }
}

/// Where a value stands, if it is given.
pub(super) fn span<T>(value: &Option<Spanned<T>>) -> Option<Range<usize>> {
    value.as_ref().map(Spanned::span)
}

/// "a, b and c"; of many words only the first ones.
pub(super) fn list(words: &[&str]) -> String {
    const MOST: usize = 12;
    match words {
        [] => "none".into(),
        [word] => (*word).into(),
        [first @ .., last] if words.len() <= MOST => format!("{} and {last}", first.join(", ")),
        _ => format!("{} and {} more", words[..MOST].join(", "), words.len() - MOST),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_read_like_sentences() {
        let words: Vec<String> = (1..=14).map(|i| i.to_string()).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        assert_eq!(list(&[]), "none");
        assert_eq!(list(&words[..1]), "1");
        assert_eq!(list(&words[..3]), "1, 2 and 3");
        assert_eq!(list(&words), "1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12 and 2 more");
    }
}
