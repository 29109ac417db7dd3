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

/// "a, b and c".
pub(super) fn list(words: &[&str]) -> String {
    match words {
        [] => "none".into(),
        [word] => (*word).into(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
