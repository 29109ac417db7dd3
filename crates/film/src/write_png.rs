//! PNG files: what a screen shows.

use std::io;
use std::path::Path;

use atomic_file::Existing;
use base::{Grid, Rgb};
use rayon::prelude::*;

use crate::Error;
use crate::srgb::{self, exposure_factor};

/// Writes linear `image` as 8-bit sRGB: scaled by 2^`exposure_ev`, clamped, through the sRGB curve. Returns the number of bytes.
///
/// The file says that it is sRGB. There is no dithering and no tone curve.
///
/// # Errors
/// When a value is NaN or infinite, when the image has no pixels, or when the file cannot be written.
pub fn write_png(
    path: &Path,
    existing: Existing,
    image: &Grid<Rgb>,
    exposure_ev: f32,
) -> Result<u64, Error> {
    let size = image.size();
    if size.n_pixels() == 0 {
        return Err(Error::NoPixels { path: path.into() });
    }
    if let Some(index) = image.values().iter().position(|c| !c.is_finite()) {
        let color = image.values()[index].to_array();
        let (channel, value) = ["R", "G", "B"]
            .into_iter()
            .zip(color)
            .find(|(_, v)| !v.is_finite())
            .expect("the color is not finite, so one of its channels is not");
        return Err(Error::NotFinite {
            path: path.into(),
            channel: channel.into(),
            pixel: size.pixel(index),
            value,
        });
    }

    let factor = exposure_factor(exposure_ev);
    let srgb = srgb::Bytes::new();
    let to_bytes = |&c: &Rgb| (c * factor).to_array().map(|v| srgb.of(v));
    let bytes: Vec<[u8; 3]> = image.values().par_iter().map(to_bytes).collect();
    Ok(atomic_file::write(path, existing, |out| {
        let mut encoder = png::Encoder::new(out, size.width, size.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        // A seventeenth of the time of the default, for files a quarter larger: else it is a sixth of a short run.
        encoder.set_compression(png::Compression::Fast);
        encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
        let mut writer = encoder.write_header().map_err(io_error)?;
        writer.write_image_data(bytes.as_flattened()).map_err(io_error)?;
        writer.finish().map_err(io_error)
    })?)
}

fn io_error(error: png::EncodingError) -> io::Error {
    match error {
        png::EncodingError::IoError(cause) => cause,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::io::BufReader;

    use base::ImageSize;

    use super::*;

    fn row(values: &[f32]) -> Grid<Rgb> {
        let size = ImageSize { width: values.len() as u32, height: 1 };
        Grid::from_values(size, values.iter().map(|&v| Rgb::splat(v)).collect())
    }

    #[test]
    fn values_go_through_exposure_and_curve() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let image = row(&[-1.0, 0.0, 0.0015, 0.09, 0.25, 0.5, 9.0]);
        let written = write_png(&path, Existing::Refuse, &image, 1.0).unwrap();
        assert_eq!(written, fs::metadata(&path).unwrap().len());

        let mut reader =
            png::Decoder::new(BufReader::new(File::open(&path).unwrap())).read_info().unwrap();
        assert_eq!(reader.info().color_type, png::ColorType::Rgb);
        assert_eq!(reader.info().bit_depth, png::BitDepth::Eight);
        assert_eq!(reader.info().srgb, Some(png::SrgbRenderingIntent::RelativeColorimetric));
        let mut pixels = vec![0; 21];
        reader.next_frame(&mut pixels).unwrap();
        let gray: Vec<u8> = pixels.chunks(3).map(|c| c[0]).collect();
        assert!(pixels.chunks(3).all(|c| c[0] == c[1] && c[1] == c[2]), "{pixels:?}");
        // Twice the values above; 0.003 lies on the straight part of the curve.
        assert_eq!(gray, [0, 0, 10, 118, 188, 255, 255]);
    }

    #[test]
    fn the_same_image_gives_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let image = Grid::from_fn(ImageSize { width: 67, height: 41 }, |p| {
            Rgb::new(p.x as f32 / 67.0, p.y as f32 / 41.0, ((p.x * p.y) % 7) as f32 / 7.0)
        });
        let bytes = |name: &str, threads| {
            let path = folder.path().join(name);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| write_png(&path, Existing::Refuse, &image, 0.0)).unwrap();
            fs::read(path).unwrap()
        };
        let first = bytes("a.png", 1);
        assert_eq!(bytes("b.png", 2), first);
        assert_eq!(bytes("c.png", 3), first);
    }

    #[test]
    fn refusals() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let write = |image: &Grid<Rgb>| {
            let error = write_png(&path, Existing::Refuse, image, 0.0).unwrap_err().to_string();
            assert!(!path.exists(), "something was written: {error}");
            error.replace(&path.display().to_string(), "a.png")
        };
        let mut image = row(&[0.0, 1.0]);
        image.values_mut()[1].g = f32::INFINITY;
        assert_eq!(
            write(&image),
            "cannot write a.png: G is inf at pixel (1, 0), which is a fault of the renderer; please report it"
        );
        assert_eq!(write(&row(&[])), "cannot write a.png: the picture has no pixels");
    }
}
