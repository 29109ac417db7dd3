//! Textures of the scene file.

use glam::{Affine2, Mat2, Vec2};
use toml::Spanned;

use super::keys::{Typed, span};
use super::source::Source;
use super::tables::TextureTable;
use super::transform::sin_cos;
use crate::{Error, Pattern, Texture};

/// Factors and offsets of texture coordinates beyond this are typing errors, and single precision has no digits left for
/// the places between texels.
const MAX_PLACEMENT: f64 = 1e5;

/// The texture of a table.
pub(super) fn texture(source: &Source, name: &str, table: &TextureTable) -> Result<Texture, Error> {
    let object = format!("texture `{name}`");
    let typed = Typed { source, object: &object, kind: &table.kind };
    let given = [
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
        _ => return Err(typed.unknown(&["checkerboard"])),
    };
    Ok(Texture { placement: placement(source, &object, table)?, pattern })
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
