//! Which format a name asks for.

use std::path::Path;

use crate::Error;

/// A format that pictures are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// OpenEXR: every layer, linear, 32 bits.
    Exr,
    /// PNG: what a screen shows, 8 bits.
    Png,
}

impl Format {
    /// The format that the ending of `path` names, in either case.
    ///
    /// # Errors
    /// When the ending is missing or names another format.
    pub fn of(path: &Path) -> Result<Self, Error> {
        let ending = path.extension().unwrap_or_default();
        if ending.eq_ignore_ascii_case("exr") {
            Ok(Self::Exr)
        } else if ending.eq_ignore_ascii_case("png") {
            Ok(Self::Png)
        } else {
            Err(Error::UnknownFormat { path: path.into() })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_name_formats() {
        assert_eq!(Format::of(Path::new("out/a.exr")).unwrap(), Format::Exr);
        assert_eq!(Format::of(Path::new("a.b.PNG")).unwrap(), Format::Png);
        for name in ["a", "a.", ".png", "a.exr.gz", "exr", ""] {
            let error = Format::of(Path::new(name)).unwrap_err();
            assert_eq!(
                error.to_string(),
                format!("cannot tell the format of {name}; end its name in .exr or .png")
            );
        }
    }
}
