//! Textures of the scene file.

use glam::{Affine2, Mat2, Vec2};
use toml::Spanned;

use super::image;
use super::keys::{Typed, list, span};
use super::source::Source;
use super::tables::TextureTable;
use super::transform::sin_cos;
use crate::{Error, Filter, Pattern, Texture, Wrap};

/// Factors and offsets of texture coordinates beyond this are typing errors, and single precision has no digits left for
/// the places between texels.
const MAX_PLACEMENT: f64 = 1e5;

/// The texture of a table.
pub(super) fn texture(source: &Source, name: &str, table: &TextureTable) -> Result<Texture, Error> {
    let object = format!("texture `{name}`");
    let typed = Typed { source, object: &object, kind: &table.kind };
    let given = [
        ("file", span(&table.file)),
        ("raw", span(&table.raw)),
        ("filter", span(&table.filter)),
        ("wrap", span(&table.wrap)),
        ("colors", span_of_list(&table.colors)),
        ("scale", span(&table.scale)),
        ("rotate", span(&table.rotate)),
        ("offset", span(&table.offset)),
    ];
    let pattern = match table.kind.get_ref().as_str() {
        "checkerboard" => {
            typed.take_only(&given, &["colors", "scale", "rotate", "offset"])?;
            let [a, b] = typed.need(&table.colors, "colors")?;
            let what = format!("a color of {object}");
            Pattern::Checkerboard([source.amount(a, &what)?, source.amount(b, &what)?])
        }
        "bitmap" => {
            let keys = ["file", "raw", "filter", "wrap", "scale", "rotate", "offset"];
            typed.take_only(&given, &keys)?;
            bitmap(source, &typed, table)?
        }
        _ => return Err(typed.unknown(&["bitmap", "checkerboard"])),
    };
    Ok(Texture { placement: placement(source, &object, table)?, pattern })
}

fn bitmap(source: &Source, typed: &Typed<'_>, table: &TextureTable) -> Result<Pattern, Error> {
    let filter = choice(source, typed.object, "filter", &table.filter, &FILTERS)?;
    let wrap = choice(source, typed.object, "wrap", &table.wrap, &WRAPS)?;
    let file = typed.need(&table.file, "file")?;
    let raw = table.raw.as_ref().is_some_and(|raw| *raw.get_ref());
    let (size, texels) = image::read(source.reach(), &source.resolve(file.get_ref()), raw)
        .map_err(|fault| source.fault(file.span(), fault))?;
    Ok(Pattern::Bitmap { size, texels, filter, wrap })
}

/// The default comes first.
pub(super) const FILTERS: [(&str, Filter); 2] =
    [("bilinear", Filter::Bilinear), ("nearest", Filter::Nearest)];
/// The default comes first.
pub(super) const WRAPS: [(&str, Wrap); 3] =
    [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];

/// One of a few words, of which the first is the default.
fn choice<T: Copy>(
    source: &Source,
    object: &str,
    key: &str,
    written: &Option<Spanned<String>>,
    choices: &[(&str, T)],
) -> Result<T, Error> {
    let Some(written) = written else { return Ok(choices[0].1) };
    let found = choices.iter().find(|(word, _)| word == written.get_ref());
    found.map(|(_, choice)| *choice).ok_or_else(|| {
        let known: Vec<_> = choices.iter().map(|(word, _)| *word).collect();
        let fault = format!(
            "the {key} of {object} is \"{}\"; it may be one of {}",
            written.get_ref(),
            list(&known)
        );
        source.fault(written.span(), fault)
    })
}

fn span_of_list(
    list: &Option<[Spanned<super::source::Color>; 2]>,
) -> Option<std::ops::Range<usize>> {
    list.as_ref().map(|[a, b]| a.span().start..b.span().end)
}

/// From the coordinates of the surface to those of the pattern: scaled, turned, moved.
fn placement(source: &Source, object: &str, table: &TextureTable) -> Result<Affine2, Error> {
    let pair = |value: &Option<Spanned<[f64; 2]>>, key: &str, default: Vec2| match value {
        None => Ok(default),
        Some(value) => {
            let pair = *value.get_ref();
            if pair.iter().all(|x| x.abs() <= MAX_PLACEMENT) {
                Ok(Vec2::from_array(pair.map(|x| x as f32)))
            } else {
                let fault = format!(
                    "the {key} of {object} is [{}, {}]; keep both within {MAX_PLACEMENT:e}",
                    pair[0], pair[1]
                );
                Err(source.fault(value.span(), fault))
            }
        }
    };
    let scale = pair(&table.scale, "scale", Vec2::ONE)?;
    let offset = pair(&table.offset, "offset", Vec2::ZERO)?;
    let degrees = match &table.rotate {
        Some(degrees) => source.number(degrees, &format!("the rotation of {object}"))?,
        None => 0.0,
    };
    let (sin, cos) = sin_cos(f64::from(degrees));
    let rotation = Mat2::from_cols_array(&[cos, sin, -sin, cos].map(|x| x as f32));
    Ok(Affine2::from_mat2_translation(rotation * Mat2::from_diagonal(scale), offset))
}
