//! Content digests that tie a saved map to what it was made from.

use std::fmt;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// A 64-bit digest (xxh3) of the inputs of a map. Shown as 16 hex digits.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Fingerprint(pub u64);

impl Fingerprint {
    /// The digest of `bytes`.
    pub fn of(bytes: &[u8]) -> Self {
        Self(xxh3_64(bytes))
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// Digests values one after another. Lengths go in with slices, so that neighbours cannot run together.
#[derive(Default)]
pub struct FingerprintBuilder {
    state: Xxh3,
}

impl fmt::Debug for FingerprintBuilder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "FingerprintBuilder({:016x})", self.state.digest())
    }
}

impl FingerprintBuilder {
    /// Nothing digested yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds `bytes`, with their length.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.state.update(&(bytes.len() as u64).to_le_bytes());
        self.state.update(bytes);
        self
    }

    /// Adds plain old data, with its length.
    pub fn pod<T: bytemuck::NoUninit>(&mut self, values: &[T]) -> &mut Self {
        self.bytes(bytemuck::cast_slice(values))
    }

    /// The digest of all that was added.
    pub fn finish(&self) -> Fingerprint {
        Fingerprint(self.state.digest())
    }
}

/// The named parts that a map depends on, each with its digest: what lets a refusal say *what* changed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inventory {
    parts: Vec<(String, Fingerprint)>,
}

impl Inventory {
    /// No parts.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a part, such as ``material `glass` ``.
    pub fn add(&mut self, name: impl Into<String>, digest: Fingerprint) {
        self.parts.push((name.into(), digest));
    }

    /// The parts with their digests, in order.
    pub fn parts(&self) -> impl Iterator<Item = (&str, Fingerprint)> {
        self.parts.iter().map(|(name, digest)| (name.as_str(), *digest))
    }

    /// One digest of all parts, names and order included.
    pub fn fingerprint(&self) -> Fingerprint {
        let mut builder = FingerprintBuilder::new();
        for (name, digest) in &self.parts {
            builder.bytes(name.as_bytes()).pod(&[digest.0]);
        }
        builder.finish()
    }

    /// What differs between `self`, the older, and `now`: one phrase a part, such as ``material `glass` changed``.
    pub fn changes(&self, now: &Self) -> Vec<String> {
        let find = |parts: &[(String, Fingerprint)], name: &str| {
            parts.iter().find(|(n, _)| n == name).map(|(_, digest)| *digest)
        };
        let mut changes = Vec::new();
        for (name, digest) in &self.parts {
            match find(&now.parts, name) {
                None => changes.push(format!("{name} is gone")),
                Some(d) if d != *digest => changes.push(format!("{name} changed")),
                Some(_) => {}
            }
        }
        for (name, _) in &now.parts {
            if find(&self.parts, name).is_none() {
                changes.push(format!("{name} is new"));
            }
        }
        if changes.is_empty() && self != now {
            changes.push("the order of the parts changed".into());
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digest_is_pinned() {
        assert_eq!(
            Fingerprint::of(b"tetralux").to_string(),
            format!("{:016x}", xxh3_64(b"tetralux"))
        );
        assert_eq!(Fingerprint::of(b"").to_string(), "2d06800538d394c2");
    }

    #[test]
    fn changes_name_the_part() {
        let mut old = Inventory::new();
        old.add("mesh a", Fingerprint(1));
        old.add("light 0", Fingerprint(2));
        let mut new = Inventory::new();
        new.add("mesh a", Fingerprint(3));
        new.add("light 1", Fingerprint(2));
        assert_eq!(old.changes(&new), ["mesh a changed", "light 0 is gone", "light 1 is new"]);
        assert!(old.changes(&old.clone()).is_empty());
        assert_ne!(old.fingerprint(), new.fingerprint());
    }
}
