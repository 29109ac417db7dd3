//! Damaged OpenEXR files give an error or a picture, never a panic, and never more memory than they are worth.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

use std::fs;
use std::path::Path;

use base::{ImageSize, Rng, Stream};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, Vec2, WritableImage, f16,
};
use film::{Existing, Picture, read_exr, write_exr};

/// Small files of every compression that is read, in scan lines and in tiles; the first one is ours.
fn files(folder: &Path) -> Vec<Vec<u8>> {
    let path = folder.join("sound.exr");
    let size = ImageSize { width: 9, height: 20 };
    let n = size.n_pixels();
    let mut picture = Picture::new(size, "{}".into());
    for name in ["R", "G", "B"] {
        picture.push(name, (0..n).map(|i| i as f32 * 0.37).collect());
    }
    write_exr(&path, Existing::Refuse, &picture).unwrap();
    let mut files = vec![fs::read(&path).unwrap()];
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
    ] {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(8, 8))] {
            let half = (0..n).map(|i| f16::from_f32(i as f32 * 0.1)).collect();
            let float = (0..n).map(|i| i as f32).collect();
            let channels = AnyChannels::sort(
                [
                    AnyChannel::new("G", FlatSamples::F16(half)),
                    AnyChannel::new("Z", FlatSamples::F32(float)),
                    AnyChannel::new("id", FlatSamples::U32((0..n as u32).collect())),
                ]
                .into_iter()
                .collect(),
            );
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            let size = (size.width as usize, size.height as usize);
            let layer = Layer::new(size, LayerAttributes::default(), encoding, channels);
            Image::from_layer(layer).write().non_parallel().to_file(&path).unwrap();
            files.push(fs::read(&path).unwrap());
        }
    }
    files
}

#[test]
fn cut_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.exr");
    for (i, file) in files(folder.path()).iter().enumerate() {
        for len in (0..file.len()).step_by(16).chain([file.len() - 1]) {
            fs::write(&path, &file[..len]).unwrap();
            let error = read_exr(&path).unwrap_err().to_string();
            let name = path.display().to_string();
            assert!(error.starts_with(&name), "file {i} cut to {len}: {error}");
            assert!(!error.contains('\n'), "file {i} cut to {len}: {error}");
        }
        fs::write(&path, file).unwrap();
        read_exr(&path).unwrap();
    }
}

#[test]
fn changed_bytes_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("changed.exr");
    for (i, file) in files(folder.path()).iter().enumerate() {
        for seed in 0..400 {
            let mut rng = Rng::new(i as u64, Stream::Test, seed);
            let mut file = file.clone();
            for _ in 0..=rng.next_u32() % 4 {
                let at = rng.next_u32() as usize % file.len();
                file[at] = match rng.next_u32() % 4 {
                    0 => 0,
                    1 => 0xff,
                    2 => file[at] ^ (1 << (rng.next_u32() % 8)),
                    _ => rng.next_u32() as u8,
                };
            }
            fs::write(&path, &file).unwrap();
            // Damage to pixels alone goes unseen: the format has no checksums.
            let _ = read_exr(&path);
        }
    }
}
