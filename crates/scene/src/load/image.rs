//! Images for textures: PNG, JPEG, TGA, BMP and Radiance HDR by the image crate, OpenEXR by `film`.

use std::io::Cursor;
use std::path::Path;

use base::Rgb;
use film::decode_srgb;
use image::{DynamicImage, ImageFormat, ImageReader};

use super::reach::Reach;
use super::source::MAX_LIGHT;
use crate::Texels;

/// The largest side, in texels.
const MAX_SIDE: u32 = 32768;

/// As many as an image of 8192 x 8192 has.
const MAX_TEXELS: u64 = 1 << 26;

/// No format packs more texels into a byte: deflate at its best (1032 to 1) on one bit each.
const MAX_TEXELS_PER_BYTE: u64 = 8 * 1032;

/// Width, height and texels of a file in reach, in rows from above; or why not, in words that name the file.
///
/// Integers are taken as sRGB unless `raw`, and floats as linear. Alpha is left out.
pub(super) fn read(reach: &Reach, path: &Path, raw: bool) -> Result<([u32; 2], Texels), String> {
    let name = path.display();
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let format = match ending.as_deref() {
        Some("exr") => return read_exr(reach, path),
        Some("png") => ImageFormat::Png,
        Some("jpg" | "jpeg") => ImageFormat::Jpeg,
        Some("tga") => ImageFormat::Tga,
        Some("bmp") => ImageFormat::Bmp,
        Some("hdr" | "pic" | "rgbe") => ImageFormat::Hdr,
        _ => {
            return Err(format!(
                "the format of {name} is unknown; use .png, .jpg, .tga, .bmp, .hdr or .exr"
            ));
        }
    };
    let bytes = reach.bytes(path).map_err(|cause| format!("cannot read {name}: {cause}"))?;
    // The ending may lie. Targa files begin with nothing of their own.
    let format = image::guess_format(&bytes).unwrap_or(format);
    let decoded = decode(&name.to_string(), &bytes, format)?;
    let (width, height) = (decoded.width(), decoded.height());
    let texels = match decoded {
        image @ (DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_)) => {
            let value = |byte: usize| {
                let v = byte as f32 / 255.0;
                if raw { v } else { decode_srgb(v) }
            };
            let values = Box::new(std::array::from_fn(value));
            Texels::Bytes(image.into_rgb8().into_raw().as_chunks().0.to_vec(), values)
        }
        image @ (DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_)) => {
            let value = |word: u16| {
                let v = f32::from(word) / 65535.0;
                if raw { v } else { decode_srgb(v) }
            };
            let words = image.into_rgb16().into_raw();
            Texels::Floats(words.as_chunks().0.iter().map(|c| c.map(value).into()).collect())
        }
        image => {
            let floats = image.into_rgb32f().into_raw();
            linear(path, width, floats.as_chunks().0.iter().map(|&c| c.into()).collect())?
        }
    };
    Ok(([width, height], texels))
}

/// Width, height and texels of PNG or JPEG, in rows from above, of four bytes each: color as it is stored, and alpha. Or why
/// not, in words that begin with the name.
pub(super) fn rgba(name: &str, bytes: &[u8]) -> Result<([u32; 2], Vec<[u8; 4]>), String> {
    let format = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
        _ => return Err(format!("{name} is neither PNG nor JPEG; save the image as such")),
    };
    let image = decode(name, bytes, format)?.into_rgba8();
    Ok((image.dimensions().into(), image.into_raw().as_chunks().0.to_vec()))
}

fn decode(name: &str, bytes: &[u8], format: ImageFormat) -> Result<DynamicImage, String> {
    let damaged = |e: image::ImageError| format!("cannot read {name}: {e}; save the file anew");
    let reader = || {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        // The size is checked here, with words of our own.
        reader.no_limits();
        reader
    };
    let (width, height) = reader().into_dimensions().map_err(damaged)?;
    check_size(name, [width, height])?;
    if u64::from(width) * u64::from(height) > MAX_TEXELS_PER_BYTE * bytes.len() as u64 {
        return Err(format!("{name} promises {width}x{height} texels, for which it is too short"));
    }
    reader().decode().map_err(damaged)
}

/// What [`read`] gives, as linear values times a factor.
pub(super) fn read_linear(
    reach: &Reach,
    path: &Path,
    factor: Rgb,
) -> Result<([u32; 2], Vec<Rgb>), String> {
    let (size, texels) = read(reach, path, false)?;
    let colors: Vec<Rgb> = match texels {
        Texels::Bytes(bytes, values) => {
            let color = |c: &[u8; 3]| Rgb::from(c.map(|byte| values[usize::from(byte)])) * factor;
            bytes.iter().map(color).collect()
        }
        Texels::Floats(mut colors) => {
            colors.iter_mut().for_each(|c| *c *= factor);
            colors
        }
    };
    let largest = colors.iter().map(|c| c.max_channel()).fold(0.0, f32::max);
    if largest > MAX_LIGHT {
        return Err(format!(
            "the largest value of {} is {largest:e} after scaling; use at most {MAX_LIGHT:e}",
            path.display()
        ));
    }
    Ok((size, colors))
}

fn read_exr(reach: &Reach, path: &Path) -> Result<([u32; 2], Texels), String> {
    reach.real(path).map_err(|cause| format!("cannot read {}: {cause}", path.display()))?;
    let grid = film::read_rgb(path, "").map_err(|e| e.to_string())?;
    let size = [grid.size().width, grid.size().height];
    check_size(&path.display().to_string(), size)?;
    Ok((size, linear(path, size[0], grid.values().to_vec())?))
}

fn check_size(name: &str, [width, height]: [u32; 2]) -> Result<(), String> {
    let n_texels = u64::from(width) * u64::from(height);
    if n_texels > 0 && width.max(height) <= MAX_SIDE && n_texels <= MAX_TEXELS {
        return Ok(());
    }
    Err(format!(
        "{name} has {width}x{height} texels; use at least one, at most {MAX_SIDE} a side, and at most {MAX_TEXELS} in all"
    ))
}

/// Linear values as they are, if they are light.
fn linear(path: &Path, width: u32, colors: Vec<Rgb>) -> Result<Texels, String> {
    match colors.iter().position(|c| !c.is_finite() || c.min_channel() < 0.0) {
        None => Ok(Texels::Floats(colors)),
        Some(i) => {
            let (x, y, [r, g, b]) = (i as u32 % width, i as u32 / width, colors[i].to_array());
            Err(format!(
                "texel {x} {y} of {} is ({r}, {g}, {b}); values must be finite and not negative",
                path.display()
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, Luma, Rgb as Pixel, Rgba};

    /// Reads a file with these bytes.
    fn from_bytes(name: &str, bytes: &[u8], raw: bool) -> Result<([u32; 2], Texels), String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read(&Reach::Everything, &path, raw)
            .map_err(|e| e.replace(&format!("{}/", folder.path().display()), ""))
    }

    fn written(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    fn colors(texels: &Texels) -> Vec<[f32; 3]> {
        match texels {
            Texels::Bytes(bytes, values) => {
                bytes.iter().map(|c| c.map(|b| values[usize::from(b)])).collect()
            }
            Texels::Floats(colors) => colors.iter().map(|c| c.to_array()).collect(),
        }
    }

    #[test]
    fn integers_are_srgb_unless_raw() {
        let bytes = [[255, 0, 118], [10, 188, 64]];
        let image = ImageBuffer::from_fn(2, 1, |x, _| Pixel(bytes[x as usize]));
        let image = DynamicImage::ImageRgb8(image);
        // 18 % gray, half, and the straight part of the curve, as every table of sRGB has them.
        let linear = [[1.0, 0.0, 0.1812], [10.0 / 255.0 / 12.92, 0.5029, 0.0513]];
        for (name, format) in
            [("a.png", ImageFormat::Png), ("a.tga", ImageFormat::Tga), ("a.bmp", ImageFormat::Bmp)]
        {
            let file = written(&image, format);
            let (size, texels) = from_bytes(name, &file, false).unwrap();
            assert_eq!(size, [2, 1], "{name}");
            for (found, expected) in colors(&texels).iter().flatten().zip(linear.as_flattened()) {
                assert!((found - expected).abs() < 2e-4, "{name}: {found}, not {expected}");
            }
            let (_, texels) = from_bytes(name, &file, true).unwrap();
            assert_eq!(colors(&texels), bytes.map(|c| c.map(|b| f32::from(b) / 255.0)), "{name}");
        }
    }

    #[test]
    fn other_depths_and_channels() {
        let wide = ImageBuffer::from_pixel(1, 1, Pixel([65535u16, 0, 32768]));
        let file = written(&DynamicImage::ImageRgb16(wide), ImageFormat::Png);
        let found = colors(&from_bytes("a.png", &file, true).unwrap().1);
        assert_eq!(found, [[1.0, 0.0, 32768.0 / 65535.0]]);
        let found = colors(&from_bytes("a.png", &file, false).unwrap().1);
        assert!((found[0][2] - 0.2140).abs() < 1e-4, "{found:?}");
        // Alpha is left out, gray spread, and a wrong ending seen through.
        let clear = ImageBuffer::from_pixel(1, 1, Rgba([51u8, 102, 153, 0]));
        let file = written(&DynamicImage::ImageRgba8(clear), ImageFormat::Png);
        assert_eq!(colors(&from_bytes("a.jpg", &file, true).unwrap().1), [[0.2, 0.4, 0.6]]);
        let gray = ImageBuffer::from_pixel(16, 16, Luma([51u8]));
        let file = written(&DynamicImage::ImageLuma8(gray), ImageFormat::Jpeg);
        assert_eq!(colors(&from_bytes("a.JPEG", &file, true).unwrap().1), [[0.2; 3]; 256]);
    }

    #[test]
    fn floats_are_linear() {
        let value = [2.0, 0.5, 0.25];
        let image = DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(8, 2, Pixel(value)));
        let file = written(&image, ImageFormat::Hdr);
        for raw in [false, true] {
            let (size, texels) = from_bytes("a.hdr", &file, raw).unwrap();
            assert_eq!((size, colors(&texels)), ([8, 2], vec![value; 16]));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let write = |value: f32| {
            let size = base::ImageSize { width: 2, height: 1 };
            let mut picture = film::Picture::new(size, String::new());
            let colors = vec![Rgb::new(0.1, 3.0, 0.0), Rgb::splat(value)];
            picture.push_rgb("", &base::Grid::from_values(size, colors));
            film::write_exr(&path, film::Existing::Replace, &picture).unwrap();
            read(&Reach::Everything, &path, false)
                .map_err(|e| e.replace(&format!("{}/", folder.path().display()), ""))
        };
        assert_eq!(colors(&write(0.5).unwrap().1), [[0.1, 3.0, 0.0], [0.5; 3]]);
        assert_eq!(
            write(-1.0).unwrap_err(),
            "texel 1 0 of a.exr is (-1, -1, -1); values must be finite and not negative"
        );
        for bad in [f32::NAN, f32::INFINITY] {
            assert!(linear(&path, 2, vec![Rgb::BLACK, Rgb::new(0.0, bad, 0.0)]).is_err());
        }
    }

    #[test]
    fn faults_name_the_file() {
        // An uncompressed Targa of 24 bits, with a size of its own.
        let targa = |width: u16, height: u16| {
            let mut bytes = vec![0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0];
            bytes.extend(width.to_le_bytes());
            bytes.extend(height.to_le_bytes());
            bytes.extend([24, 0, 1, 2, 3]);
            bytes
        };
        let size = |size: &str| {
            format!(
                "a.tga has {size} texels; use at least one, at most 32768 a side, and at most 67108864 in all"
            )
        };
        let short = |name: &str, bytes: &[u8]| from_bytes(name, bytes, false).unwrap_err();
        assert_eq!(colors(&from_bytes("a.tga", &targa(1, 1), true).unwrap().1).len(), 1);
        assert_eq!(short("a.tga", &targa(40000, 1)), size("40000x1"));
        assert_eq!(short("a.tga", &targa(32000, 32000)), size("32000x32000"));
        assert_eq!(
            short("a.tga", &targa(8192, 8192)),
            "a.tga promises 8192x8192 texels, for which it is too short"
        );
        for cut in [targa(0, 5), targa(2, 2), vec![]] {
            assert!(short("a.tga", &cut).contains("a.tga"));
        }
        assert_eq!(
            short("a.gif", b"GIF89a"),
            "the format of a.gif is unknown; use .png, .jpg, .tga, .bmp, .hdr or .exr"
        );
        assert_eq!(short("a.exr", b"GIF89a"), "a.exr is not an OpenEXR file");
        let gone = read(&Reach::Everything, Path::new("gone.png"), false).unwrap_err();
        assert_eq!(gone, "cannot read gone.png: there is no such file");
    }

    #[test]
    fn damage_does_no_harm() {
        let image = ImageBuffer::from_fn(5, 3, |x, y| Pixel([x as u8 * 50, y as u8 * 80, 7]));
        let image = DynamicImage::ImageRgb8(image);
        for (name, format) in [
            ("a.png", ImageFormat::Png),
            ("a.jpg", ImageFormat::Jpeg),
            ("a.bmp", ImageFormat::Bmp),
            ("a.tga", ImageFormat::Tga),
            ("a.hdr", ImageFormat::Hdr),
        ] {
            let image = match format {
                ImageFormat::Hdr => DynamicImage::ImageRgb32F(image.to_rgb32f()),
                _ => image.clone(),
            };
            let file = written(&image, format);
            for at in 0..file.len() {
                for byte in [0, 1, 127, 255] {
                    let mut damaged = file.clone();
                    damaged[at] = byte;
                    // Whatever comes of it, it is an image of the size it tells or one message.
                    if let Ok(([width, height], texels)) = from_bytes(name, &damaged, false) {
                        assert_eq!(colors(&texels).len(), (width * height) as usize, "{name} {at}");
                    }
                }
            }
        }
    }

    #[test]
    fn cut_files_are_refused() {
        let image = ImageBuffer::from_fn(9, 7, |x, y| Pixel([x as u8 * 20, y as u8 * 30, 7]));
        for (name, format) in
            [("a.png", ImageFormat::Png), ("a.bmp", ImageFormat::Bmp), ("a.tga", ImageFormat::Tga)]
        {
            let file = written(&DynamicImage::ImageRgb8(image.clone()), format);
            for end in 0..file.len() {
                // What is cut behind the last texel may do without.
                if let Ok((size, _)) = from_bytes(name, &file[..end], false) {
                    assert!(size == [9, 7] && end + 40 > file.len(), "{name} of {end} bytes");
                }
            }
        }
    }
}
