//! The way that light comes along a specular chain.

use base::hash_u64;

/// The reflections and transmissions of a specular chain, one after the other from the eye on.
///
/// Each is a bit below a leading one. A path longer than [`Path::LONGEST`] is a digest, whose beginning can't be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Path(u64);

const DIGEST: u64 = 1 << 63;

impl Path {
    /// What the eye sees directly.
    pub const EYE: Self = Self(1);

    /// The most reflections and transmissions that can be told apart.
    pub const LONGEST: u32 = 62;

    /// This path and one more reflection or transmission.
    pub fn beyond(self, transmitted: bool) -> Self {
        let Self(bits) = self;
        match bits >> Self::LONGEST {
            0 => Self(bits << 1 | u64::from(transmitted)),
            _ => Self(hash_u64(bits, u64::from(transmitted)) | DIGEST),
        }
    }

    /// The number of reflections and transmissions, unless these are too many.
    fn length(self) -> Option<u32> {
        (self.0 & DIGEST == 0).then(|| self.0.ilog2())
    }

    /// Whether it is short enough for its beginning to be told.
    pub fn is_told(self) -> bool {
        self.length().is_some()
    }

    /// Whether this path begins so. A path that is too long may, for all that is known.
    pub fn may_begin_with(self, start: Self) -> bool {
        let Some(length) = self.length() else { return true };
        start
            .length()
            .and_then(|n| length.checked_sub(n))
            .is_some_and(|rest| self.0 >> rest == start.0)
    }

    /// The shortest beginning of this path with which none of some others begins; nothing if there is none, or if any of them
    /// is too long.
    pub fn apart_from(self, others: &[Self]) -> Option<Self> {
        let length = self.length()?;
        let mut shared = 0;
        for other in others {
            let n = other.length()?;
            let bits = self.0 << (63 - length) ^ other.0 << (63 - n);
            // Both begin with a one that isn't part of the path.
            shared = shared.max((bits.leading_zeros() - 1).min(length).min(n));
        }
        length.checked_sub(shared + 1).map(|rest| Self(self.0 >> rest))
    }

    /// A number that no other path of a chain has, unless both are too long.
    pub(crate) fn number(self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(bounces: &str) -> Path {
        bounces.chars().fold(Path::EYE, |path, bounce| path.beyond(bounce == 'T'))
    }

    #[test]
    fn paths_know_how_they_begin() {
        for (whole, start, expected) in [
            ("TRT", "", true),
            ("TRT", "T", true),
            ("TRT", "TR", true),
            ("TRT", "TRT", true),
            ("TRT", "TT", false),
            ("TRT", "R", false),
            ("TRT", "TRTR", false),
            ("RRT", "R", true),
            ("", "R", false),
        ] {
            assert_eq!(path(whole).may_begin_with(path(start)), expected, "{whole} {start}");
        }
        let long = "TR".repeat(40);
        assert!(path(&long).may_begin_with(path("R")) && path(&long) != path(&long[2..]));
        assert!(!path("TR").may_begin_with(path(&long)));
        let longest = &long[..Path::LONGEST as usize];
        assert!(
            path(longest).may_begin_with(path("TR")) && !path(longest).may_begin_with(path("R"))
        );
    }

    #[test]
    fn paths_are_told_apart_as_early_as_can_be() {
        let apart = |whole: &str, others: &[&str]| {
            let others: Vec<Path> = others.iter().map(|other| path(other)).collect();
            path(whole).apart_from(&others)
        };
        assert_eq!(apart("TRT", &[]), Some(path("T")));
        assert_eq!(apart("TRT", &["RT"]), Some(path("T")));
        assert_eq!(apart("TRT", &["TTR", "R"]), Some(path("TR")));
        assert_eq!(apart("TRT", &["TRR"]), Some(path("TRT")));
        assert_eq!(apart("TRT", &["T"]), Some(path("TR")));
        assert_eq!(apart("TRT", &["TRTT"]), None);
        assert_eq!(apart("TRT", &["TRT"]), None);
        assert_eq!(apart("", &[]), None);
        let long = "R".repeat(70);
        assert_eq!(apart("TRT", &[&long]), None);
        assert_eq!(apart(&long, &["T"]), None);
    }
}
