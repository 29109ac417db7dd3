//! Textures: what of an image they show, and where.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use base::Rgb;
use film::decode_srgb;
use glam::{Affine2, Mat2, Vec2};

use super::Context;
use super::tables::{Sampler, TextureInfo};
use crate::load::image;
use crate::{Error, Filter, Pattern, Texels, Texture, TextureId, Wrap};

/// How many texels textures may hold beside those of each image once: three bytes each, so 400 MB.
const MAX_COPIED: usize = 1 << 27;

/// Factors and offsets of texture coordinates beyond this leave no digits for the places between texels.
const MAX_PLACEMENT: f64 = 1e5;

/// What a texture is made from its image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    /// Its color.
    Color,
    /// Its alpha.
    Alpha,
    /// Where its alpha times the first number reaches the second.
    Mask(f32, f32),
}

/// An image of four bytes a texel: three of color in sRGB, and alpha.
struct Image {
    size: [u32; 2],
    texels: Vec<[u8; 4]>,
}

/// What an image comes to where only one value can be taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mean {
    /// Linear color, as of sRGB.
    pub(super) color: Rgb,
    /// Red, green and blue as they are stored, from 0 to 1.
    pub(super) channels: [f32; 3],
    /// Whether all texels have the same, channel by channel.
    pub(super) is_even: [bool; 3],
}

/// A texture, its role and its placement, in bits.
type Key = (usize, [u32; 3], [u32; 6]);

/// Textures and images that have been met.
#[derive(Default)]
pub(super) struct Known {
    textures: BTreeMap<Key, Option<TextureId>>,
    /// By image, since images are large.
    means: BTreeMap<usize, Mean>,
    /// The last image, which the next texture often shows, too.
    last: Option<(usize, Rc<Image>)>,
    /// Where images come from that textures hold.
    held: BTreeSet<Origin>,
    n_copied: usize,
}

/// Where an image comes from: a file, a place in a buffer, or a URI of its own.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    File(String),
    Buffer(usize, usize),
    Own(usize),
}

/// The texture that a material shows, and the number of the texture coordinates that it needs. `None` for the first if it
/// would be white everywhere.
pub(super) fn texture(
    context: &mut Context<'_>,
    info: &TextureInfo,
    role: Role,
    place: &str,
) -> Result<(Option<TextureId>, usize), Error> {
    let placement = placement(info).map_err(|text| context.file.fault(place, text))?;
    let set = set(info);
    let bits = match role {
        Role::Color => [0; 3],
        Role::Alpha => [1, 0, 0],
        Role::Mask(factor, cutoff) => [2, factor.to_bits(), cutoff.to_bits()],
    };
    let key = (info.index, bits, placement.to_cols_array().map(f32::to_bits));
    if let Some(id) = context.textures.textures.get(&key) {
        return Ok((*id, set));
    }
    let image = image(context, info, place)?;
    let gray = |value: &dyn Fn(u8) -> u8| -> Vec<[u8; 3]> {
        image.texels.iter().map(|texel| [value(texel[3]); 3]).collect()
    };
    let (bytes, is_srgb) = match role {
        Role::Color => (image.texels.iter().map(|&[r, g, b, _]| [r, g, b]).collect(), true),
        Role::Alpha => (gray(&|alpha| alpha), false),
        Role::Mask(factor, cutoff) => {
            let is_there = |alpha: u8| f32::from(alpha) / 255.0 * factor >= cutoff;
            (gray(&|alpha| if is_there(alpha) { 255 } else { 0 }), false)
        }
    };
    let bytes: Vec<[u8; 3]> = bytes;
    let origin = origin(context, info, place)?;
    if !context.textures.held.insert(origin) {
        context.textures.n_copied += bytes.len();
        if context.textures.n_copied > MAX_COPIED {
            let text = "too many textures show the same images in other ways; share textures, or use smaller images";
            return Err(context.file.fault(place, text));
        }
    }
    if bytes.iter().all(|texel| *texel == [255; 3]) {
        context.textures.textures.insert(key, None);
        return Ok((None, set));
    }
    let (filter, wrap) = sampling(context, info, place)?;
    let value = |byte: usize| {
        let v = byte as f32 / 255.0;
        if is_srgb { decode_srgb(v) } else { v }
    };
    let texels = Texels::Bytes(bytes, Box::new(std::array::from_fn(value)));
    let pattern = Pattern::Bitmap { size: image.size, texels, filter, wrap };
    let name = format!("texture {}", context.assembly.textures.len() + 1);
    let id = context.assembly.add_texture(name, Texture { placement, pattern });
    let id = id.ok_or_else(|| context.file.fault(place, "too many textures; use at most 65536"))?;
    context.textures.textures.insert(key, Some(id));
    Ok((Some(id), set))
}

/// What the image of a texture comes to.
pub(super) fn mean(
    context: &mut Context<'_>,
    info: &TextureInfo,
    place: &str,
) -> Result<Mean, Error> {
    let index = source(context, info, place)?;
    if let Some(mean) = context.textures.means.get(&index) {
        return Ok(*mean);
    }
    let image = image(context, info, place)?;
    let linear: [f32; 256] = std::array::from_fn(|byte| decode_srgb(byte as f32 / 255.0));
    let over = |channel: usize, value: &dyn Fn(u8) -> f64| {
        let sum: f64 = image.texels.iter().map(|texel| value(texel[channel])).sum();
        (sum / image.texels.len() as f64) as f32
    };
    let mean = Mean {
        color: [0, 1, 2].map(|i| over(i, &|byte| f64::from(linear[usize::from(byte)]))).into(),
        channels: [0, 1, 2].map(|i| over(i, &|byte| f64::from(byte) / 255.0)),
        is_even: [0, 1, 2].map(|i| image.texels.iter().all(|t| t[i] == image.texels[0][i])),
    };
    context.textures.means.insert(index, mean);
    Ok(mean)
}

/// The image of a texture.
fn image(context: &mut Context<'_>, info: &TextureInfo, place: &str) -> Result<Rc<Image>, Error> {
    let index = source(context, info, place)?;
    if let Some((last, image)) = &context.textures.last
        && *last == index
    {
        return Ok(Rc::clone(image));
    }
    let file = context.file;
    let table = file.get(&file.tables.images, "images", index, place)?;
    let place = format!("images[{index}]");
    let decoded = match (&table.uri, table.buffer_view) {
        (Some(uri), None) => {
            let name = if uri.starts_with("data:") { "its data URI" } else { uri.as_str() };
            image::rgba(name, &file.fetch(uri, &place)?)
        }
        (None, Some(view)) => image::rgba("its buffer view", file.view(view, &place)?.bytes),
        _ => return Err(file.fault(&place, "it needs either a `uri` or a `bufferView`")),
    };
    let (size, texels) = decoded.map_err(|text| file.fault(&place, text))?;
    let image = Rc::new(Image { size, texels });
    context.textures.last = Some((index, Rc::clone(&image)));
    Ok(image)
}

/// The number of the texture coordinates that a texture is looked up by.
pub(super) fn set(info: &TextureInfo) -> usize {
    let of_transform = info.extensions.transform.as_ref().and_then(|t| t.tex_coord);
    of_transform.unwrap_or(info.tex_coord)
}

/// The index of the image of a texture.
fn source(context: &Context<'_>, info: &TextureInfo, place: &str) -> Result<usize, Error> {
    let file = context.file;
    let table = file.get(&file.tables.textures, "textures", info.index, place)?;
    table.source.ok_or_else(|| {
        let text = "it has no image that is PNG or JPEG; save the file with such";
        file.fault(&format!("textures[{}]", info.index), text)
    })
}

fn origin(context: &Context<'_>, info: &TextureInfo, place: &str) -> Result<Origin, Error> {
    let index = source(context, info, place)?;
    let file = context.file;
    let table = file.get(&file.tables.images, "images", index, place)?;
    Ok(match (&table.uri, table.buffer_view) {
        (Some(uri), _) if !uri.starts_with("data:") => Origin::File(uri.clone()),
        (_, Some(view)) => {
            let (buffer, start) = file.view(view, place)?.start;
            Origin::Buffer(buffer, start)
        }
        _ => Origin::Own(index),
    })
}

/// Filter and wrap of a texture. Filters for smaller pictures mean nothing where pixels are averages.
fn sampling(
    context: &mut Context<'_>,
    info: &TextureInfo,
    place: &str,
) -> Result<(Filter, Wrap), Error> {
    let file = context.file;
    let texture = file.get(&file.tables.textures, "textures", info.index, place)?;
    let Some(index) = texture.sampler else { return Ok((Filter::Bilinear, Wrap::Repeat)) };
    let sampler = file.get(&file.tables.samplers, "samplers", index, place)?;
    let Sampler { mag_filter, wrap_s, wrap_t } = sampler;
    let place = format!("samplers[{index}]");
    let wrap = match wrap_s {
        10497 => Wrap::Repeat,
        33071 => Wrap::Clamp,
        33648 => Wrap::Mirror,
        other => return Err(file.fault(&place, format!("its wrapS {other} is unknown"))),
    };
    let filter = match mag_filter {
        None | Some(9729) => Filter::Bilinear,
        Some(9728) => Filter::Nearest,
        Some(other) => {
            return Err(file.fault(&place, format!("its magFilter {other} is unknown")));
        }
    };
    if wrap_s != wrap_t {
        let what = "a wrapT that differs from wrapS isn't supported";
        context.refuse(&place, what, "both are that of wrapS")?;
    }
    Ok((filter, wrap))
}

/// From texture coordinates of glTF, whose images have (0, 0) at the upper left, to those of our images.
fn placement(info: &TextureInfo) -> Result<Affine2, String> {
    let flip = Affine2::from_mat2_translation(Mat2::from_diagonal(Vec2::new(1.0, -1.0)), Vec2::Y);
    let Some(transform) = &info.extensions.transform else { return Ok(flip) };
    let numbers = [transform.offset, transform.scale];
    if numbers.as_flattened().iter().any(|x| x.abs() > MAX_PLACEMENT) {
        return Err(format!(
            "its texture transform is too large; keep it within {MAX_PLACEMENT:e}"
        ));
    }
    let vector = |v: [f64; 2]| Vec2::from_array(v.map(|x| x as f32));
    let (sin, cos) = libm::sincos(transform.rotation);
    // Counterclockwise as seen, where v points down.
    let rotation = Mat2::from_cols_array(&[cos, -sin, sin, cos].map(|x| x as f32));
    let linear = rotation * Mat2::from_diagonal(vector(transform.scale));
    Ok(flip * Affine2::from_mat2_translation(linear, vector(transform.offset)))
}

#[cfg(test)]
mod tests {
    use super::super::tables::{TextureInfoExtensions, TextureTransform};
    use super::*;

    #[test]
    fn coordinates_are_scaled_then_turned_then_moved() {
        let at = |transform: Option<([f64; 2], f64, [f64; 2])>| {
            let transform = transform.map(|(scale, rotation, offset)| TextureTransform {
                offset,
                rotation,
                scale,
                tex_coord: None,
            });
            let info = TextureInfo {
                index: 0,
                tex_coord: 0,
                extensions: TextureInfoExtensions { transform },
            };
            let at = placement(&info).unwrap().transform_point2(Vec2::new(0.25, 0.1));
            [at.x, 1.0 - at.y]
        };
        let near = |a: [f32; 2], b: [f32; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(near(at(None), [0.25, 0.1]));
        assert!(near(at(Some(([2.0, 3.0], 0.0, [1.0, -1.0]))), [1.5, -0.7]));
        // u cos + v sin, v cos - u sin: a quarter turn takes the u axis to where v is negative, above the image.
        let quarter = std::f64::consts::FRAC_PI_2;
        assert!(near(at(Some(([1.0, 1.0], quarter, [0.0, 0.0]))), [0.1, -0.25]));
        assert!(near(at(Some(([2.0, 1.0], quarter, [0.5, 0.5]))), [0.6, 0.0]));
    }
}
