//! Why pixels were traced: the numbers in the layers `reason.*` of a picture, in words and colors.

use base::Rgb;

/// What a number means in a mode, in a few words.
pub(crate) fn text(mode: &str, reason: u8) -> String {
    let known = match mode {
        "original" => &["no surface here", "traced, as every pixel"][..],
        "paper" => {
            &["interpolated", "traced: a low-resolution sample", "traced: no candidate fits"][..]
        }
        _ => &[
            "interpolated",
            "traced: on the coarsest lattice",
            "traced: no neighbors on its surface",
            "traced: the error estimate is too large",
            "traced: the neighbors differ too much",
            "traced: a verification ray disagreed",
            "traced: held out to measure the error",
            "reused: a saved record lies at this point",
            "reused: the saved records around it agree",
            "traced: the whole picture was, since that is cheaper",
        ][..],
    };
    known
        .get(usize::from(reason))
        .map_or_else(|| format!("traced: reason {reason}"), |text| (*text).into())
}

/// A color for a number, as on a screen: dark for what was interpolated, and bright ones that tell from each other.
pub(crate) fn color(reason: u8) -> [u8; 3] {
    const COLORS: [[u8; 3]; 10] = [
        [38, 42, 50],
        [86, 180, 233],
        [230, 159, 0],
        [240, 228, 66],
        [204, 121, 167],
        [213, 94, 0],
        [0, 158, 115],
        [0, 114, 178],
        [148, 156, 168],
        [255, 255, 255],
    ];
    COLORS[usize::from(reason).min(COLORS.len() - 1)]
}

/// The linear color that a PNG file shows as these bytes.
pub(crate) fn linear([r, g, b]: [u8; 3]) -> Rgb {
    let decode = |byte: u8| {
        let v = f64::from(byte) / 255.0;
        (if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }) as f32
    };
    Rgb::new(decode(r), decode(g), decode(b))
}
