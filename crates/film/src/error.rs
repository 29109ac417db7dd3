//! What can go wrong with picture files, divided by what the user can do about it.

use std::io;
use std::path::PathBuf;

use base::{ImageSize, Pixel};

/// Why a picture could not be read, written or compared.
///
/// The messages hold their causes, so that one line says it all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The output could not be written, or may not be.
    #[error(transparent)]
    Output(#[from] atomic_file::Error),
    /// The system refused to give the file.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The picture.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// The file is something else.
    #[error("{} is not an OpenEXR file", path.display())]
    NotExr {
        /// The file.
        path: PathBuf,
    },
    /// The file breaks the rules of its format, most often because it is cut short.
    #[error("{} is damaged ({fault}); make it anew", path.display())]
    Damaged {
        /// The picture.
        path: PathBuf,
        /// Which rule.
        fault: String,
    },
    /// The file is sound and uses what this program does not read.
    #[error("cannot read {}: {feature}; save it as a flat ZIP-compressed file", path.display())]
    Unsupported {
        /// The picture.
        path: PathBuf,
        /// What it uses.
        feature: String,
    },
    /// The file claims more pixels than its bytes can hold.
    #[error(
        "{} is damaged (it claims {claimed} bytes of pixels, far more than the file can hold); make it anew",
        path.display()
    )]
    TooLarge {
        /// The picture.
        path: PathBuf,
        /// Bytes of pixels, uncompressed.
        claimed: u128,
    },
    /// The picture has no such channel.
    #[error("{} has no channel {channel}; it has {}", path.display(), present.join(", "))]
    NoChannel {
        /// The picture.
        path: PathBuf,
        /// The one that was asked for.
        channel: String,
        /// All that it has.
        present: Vec<String>,
    },
    /// The file is sound, and no part of a picture that this program has made.
    #[error("{} is not a part of a picture; make parts with render-cached --tile or --crop", path.display())]
    NotAPart {
        /// The file.
        path: PathBuf,
    },
    /// A picture with NaN or infinite values was to be written.
    #[error(
        "cannot write {}: {channel} is {value} at pixel ({}, {}), which is a fault of the renderer; please report it",
        path.display(), pixel.x, pixel.y
    )]
    NotFinite {
        /// The output.
        path: PathBuf,
        /// The first channel at fault.
        channel: String,
        /// Its first pixel at fault.
        pixel: Pixel,
        /// NaN or an infinity.
        value: f32,
    },
    /// A picture of no width or height was to be written.
    #[error("cannot write {}: the picture has no pixels", path.display())]
    NoPixels {
        /// The output.
        path: PathBuf,
    },
    /// The ending of an output's name is unknown.
    #[error("cannot tell the format of {}; end its name in .exr or .png", path.display())]
    UnknownFormat {
        /// The output.
        path: PathBuf,
    },
    /// Two pictures of different sizes were to be compared.
    #[error(
        "the pictures differ in size, {}x{} and {}x{}; compare pictures of the same resolution",
        a.width, a.height, b.width, b.height
    )]
    SizesDiffer {
        /// Of the first picture.
        a: ImageSize,
        /// Of the second picture.
        b: ImageSize,
    },
    /// A picture with NaN or infinite values was to be compared.
    #[error(
        "the {which} picture is {value} at pixel ({}, {}); only finite pictures can be compared",
        pixel.x, pixel.y
    )]
    NotComparable {
        /// "first" or "second".
        which: &'static str,
        /// The first pixel at fault.
        pixel: Pixel,
        /// NaN or an infinity.
        value: f32,
    },
    /// Two pictures of no width or height were to be compared.
    #[error("pictures without pixels cannot be compared")]
    NothingToCompare,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_say_what_to_do() {
        let path = || PathBuf::from("out/a.exr");
        let pixel = Pixel { x: 3, y: 4 };
        let says = |error: Error, text: &str| assert_eq!(error.to_string(), text);
        says(
            Error::Read { path: path(), cause: io::ErrorKind::NotFound.into() },
            "cannot read out/a.exr: entity not found",
        );
        says(Error::NotExr { path: path() }, "out/a.exr is not an OpenEXR file");
        says(
            Error::Damaged { path: path(), fault: "the bytes end too early".into() },
            "out/a.exr is damaged (the bytes end too early); make it anew",
        );
        says(
            Error::Unsupported { path: path(), feature: "channel RY is subsampled".into() },
            "cannot read out/a.exr: channel RY is subsampled; save it as a flat ZIP-compressed file",
        );
        says(
            Error::TooLarge { path: path(), claimed: 1 << 40 },
            "out/a.exr is damaged (it claims 1099511627776 bytes of pixels, far more than the file can hold); make it anew",
        );
        says(
            Error::NoChannel {
                path: path(),
                channel: "direct.R".into(),
                present: vec!["B".into(), "G".into()],
            },
            "out/a.exr has no channel direct.R; it has B, G",
        );
        says(
            Error::NotFinite { path: path(), channel: "direct.R".into(), pixel, value: f32::NAN },
            "cannot write out/a.exr: direct.R is NaN at pixel (3, 4), which is a fault of the renderer; please report it",
        );
        says(Error::NoPixels { path: path() }, "cannot write out/a.exr: the picture has no pixels");
        says(
            Error::UnknownFormat { path: "a.jpg".into() },
            "cannot tell the format of a.jpg; end its name in .exr or .png",
        );
        says(
            Error::SizesDiffer {
                a: ImageSize { width: 4, height: 3 },
                b: ImageSize { width: 5, height: 3 },
            },
            "the pictures differ in size, 4x3 and 5x3; compare pictures of the same resolution",
        );
        says(
            Error::NotComparable { which: "second", pixel, value: f32::NEG_INFINITY },
            "the second picture is -inf at pixel (3, 4); only finite pictures can be compared",
        );
        says(Error::NothingToCompare, "pictures without pixels cannot be compared");
    }
}
