//! OpenEXR files: ours come back bit for bit and are the same every time; those of others are read.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

use std::fs;
use std::path::Path;

use base::{Grid, ImageSize, Rgb, Rng, Stream};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, Text, Vec2, WritableImage, f16,
};
use film::{Existing, Picture, read_exr, read_rgb, write_exr};

const SIZE: ImageSize = ImageSize { width: 37, height: 41 };

/// A picture of `n_layers` layers, with values of every magnitude and sign.
fn wild_picture(n_layers: u32) -> Picture {
    let mut picture = Picture::new(SIZE, r#"{"command": "render-cached Büro.toml"}"#.into());
    for layer in 0..n_layers {
        let name = if layer == 0 { String::new() } else { format!("layer{layer}") };
        let values = Grid::from_fn(SIZE, |p| {
            let mut rng = Rng::new(layer.into(), Stream::Test, SIZE.index(p) as u64);
            Rgb::from([0; 3].map(|_| {
                loop {
                    let value = f32::from_bits(rng.next_u32());
                    if value.is_finite() {
                        break value;
                    }
                }
            }))
        });
        picture.push_rgb(&name, &values);
    }
    let special = [0.0, -0.0, f32::MIN_POSITIVE, f32::from_bits(1), -f32::from_bits(77), f32::MAX];
    picture.push("Z", special.into_iter().cycle().take(SIZE.n_pixels()).collect());
    picture
}

fn bits(picture: &Picture) -> Vec<(String, Vec<u32>)> {
    let mut channels: Vec<_> = picture
        .channels()
        .map(|(name, values)| (name.to_owned(), values.iter().map(|v| v.to_bits()).collect()))
        .collect();
    channels.sort();
    channels
}

#[test]
fn what_is_written_comes_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let picture = wild_picture(2);
    let written = write_exr(&path, Existing::Refuse, &picture).unwrap();
    assert_eq!(written, fs::metadata(&path).unwrap().len());
    let back = read_exr(&path).unwrap();
    assert_eq!(bits(&back), bits(&picture));
    assert_eq!((back.size(), back.metadata()), (picture.size(), picture.metadata()));
    assert_eq!(read_rgb(&path, "layer1").unwrap(), picture.rgb("layer1").unwrap());

    let names: Vec<_> = back.channels().map(|(name, _)| name.to_owned()).collect();
    assert_eq!(names, ["B", "G", "R", "Z", "layer1.B", "layer1.G", "layer1.R"]);
}

#[test]
fn the_same_picture_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    for n_layers in [1, 10] {
        let picture = wild_picture(n_layers);
        let bytes = |threads| {
            let path = folder.path().join(format!("{n_layers} {threads}.exr"));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| write_exr(&path, Existing::Refuse, &picture)).unwrap();
            let first = fs::read(&path).unwrap();
            pool.install(|| write_exr(&path, Existing::Replace, &picture)).unwrap();
            assert_eq!(fs::read(&path).unwrap(), first, "a second time");
            first
        };
        let first = bytes(1);
        assert_eq!(bytes(2), first, "2 threads");
        assert_eq!(bytes(3), first, "3 threads");
    }
}

#[test]
fn nothing_is_written_when_something_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let says = |picture: &Picture| {
        let error = write_exr(&path, Existing::Refuse, picture).unwrap_err().to_string();
        assert!(fs::read_dir(folder.path()).unwrap().next().is_none(), "{error}");
        error.replace(&path.display().to_string(), "a.exr")
    };
    let size = ImageSize { width: 2, height: 2 };
    let mut picture = Picture::new(size, String::new());
    picture.push_rgb("", &Grid::from_fn(size, |_| Rgb::ONE));
    picture.push("direct.G", vec![0.0, 1.0, f32::NAN, f32::INFINITY]);
    assert_eq!(
        says(&picture),
        "cannot write a.exr: direct.G is NaN at pixel (0, 1), which is a fault of the renderer; please report it"
    );
    let empty = Picture::new(ImageSize { width: 3, height: 0 }, String::new());
    assert_eq!(says(&empty), "cannot write a.exr: the picture has no pixels");

    fs::write(&path, "kept").unwrap();
    let picture = wild_picture(1);
    let error = write_exr(&path, Existing::Refuse, &picture).unwrap_err().to_string();
    assert_eq!(
        error,
        format!("{} exists; give another name or --force to replace it", path.display())
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), "kept");
}

#[test]
fn missing_files_and_channels_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let says = |layer: &str| {
        let error = read_rgb(&path, layer).unwrap_err().to_string();
        error.replace(&path.display().to_string(), "a.exr")
    };
    let error = says("");
    assert!(error.starts_with("cannot read a.exr: "), "{error}");
    fs::write(&path, "P6 1 1 255").unwrap();
    assert_eq!(says(""), "a.exr is not an OpenEXR file");
    fs::write(&path, "").unwrap();
    assert_eq!(says(""), "a.exr is not an OpenEXR file");

    let size = ImageSize { width: 1, height: 1 };
    let mut picture = Picture::new(size, String::new());
    picture.push_rgb("", &Grid::from_fn(size, |_| Rgb::ONE));
    picture.push("direct.R", vec![0.0]);
    write_exr(&path, Existing::Replace, &picture).unwrap();
    assert_eq!(says("direct"), "a.exr has no channel direct.G; it has B, G, R, direct.R");
}

/// A file of another program: half, float and integer channels.
fn write_foreign(path: &Path, compression: Compression, blocks: Blocks, origin: Vec2<i32>) {
    let n = 50 * 45;
    let half = (0..n).map(|i| f16::from_f32(i as f32 / 8.0)).collect();
    let float = (0..n).map(|i| i as f32 * 0.25).collect();
    let channels = AnyChannels::sort(
        [
            AnyChannel::new("half", FlatSamples::F16(half)),
            AnyChannel::new("float", FlatSamples::F32(float)),
            AnyChannel::new("id", FlatSamples::U32((0..n).collect())),
        ]
        .into_iter()
        .collect(),
    );
    let layer = Layer::new(
        (50, 45),
        LayerAttributes { layer_position: origin, ..LayerAttributes::default() },
        Encoding { compression, blocks, line_order: LineOrder::Increasing },
        channels,
    );
    Image::from_layer(layer).write().non_parallel().to_file(path).unwrap();
}

#[test]
fn foreign_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let tiles = Blocks::Tiles(Vec2(16, 20));
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
    ] {
        for blocks in [Blocks::ScanLines, tiles] {
            write_foreign(&path, compression, blocks, Vec2(-7, 12));
            let picture = read_exr(&path).unwrap();
            assert_eq!(picture.size(), ImageSize { width: 50, height: 45 });
            assert_eq!(picture.metadata(), "");
            for (i, &half) in picture.channel("half").unwrap().iter().enumerate() {
                let expected = f16::from_f32(i as f32 / 8.0).to_f32();
                assert_eq!(half, expected, "half {i}, {compression} {blocks:?}");
            }
            for (i, &float) in picture.channel("float").unwrap().iter().enumerate() {
                assert_eq!(float, i as f32 * 0.25, "float {i}, {compression} {blocks:?}");
            }
            for (i, &id) in picture.channel("id").unwrap().iter().enumerate() {
                assert_eq!(id, i as f32, "id {i}, {compression} {blocks:?}");
            }
        }
    }
}

#[test]
fn lossy_compression_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for (compression, name) in [
        (Compression::B44, "b44"),
        (Compression::B44A, "b44a"),
        (Compression::DWAA(None), "dwaa"),
        (Compression::DWAB(None), "dwab"),
    ] {
        write_foreign(&path, compression, Blocks::ScanLines, Vec2(0, 0));
        assert_eq!(
            read_exr(&path).unwrap_err().to_string(),
            format!(
                "cannot read {}: {name} compression is lossy; save it as a flat ZIP-compressed file",
                path.display()
            )
        );
    }
}

#[test]
fn a_picture_larger_than_its_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    write_foreign(&path, Compression::ZIP16, Blocks::ScanLines, Vec2(0, 0));
    let mut bytes = fs::read(&path).unwrap();
    // The window goes from (0, 0) to (49, 44), and is there as the display's and as the data's.
    let window: Vec<u8> = [0_i32, 0, 49, 44].iter().flat_map(|v| v.to_le_bytes()).collect();
    let places: Vec<usize> =
        (0..bytes.len() - 16).filter(|&at| bytes[at..at + 16] == window).collect();
    assert_eq!(places.len(), 2);
    for at in places {
        bytes[at + 8..at + 12].copy_from_slice(&999_999_i32.to_le_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&99_999_i32.to_le_bytes());
    }
    // Keeps the file consistent otherwise: 100,000 lines are 6,250 blocks.
    let name = b"chunkCount\0int\0\x04\0\0\0";
    let at = (0..bytes.len()).find(|&at| bytes[at..].starts_with(name)).unwrap() + name.len();
    bytes[at..at + 4].copy_from_slice(&6250_i32.to_le_bytes());
    fs::write(&path, bytes).unwrap();
    assert_eq!(
        read_exr(&path).unwrap_err().to_string(),
        format!(
            "{} is damaged (it claims 1200000000000 bytes of pixels, far more than the file can hold); make it anew",
            path.display()
        )
    );
}

#[test]
fn attributes_say_what_made_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    write_exr(&path, Existing::Refuse, &wild_picture(1)).unwrap();
    let meta = exr::meta::MetaData::read_from_file(&path, true).unwrap();
    let header = &meta.headers[0];
    assert_eq!((meta.headers.len(), header.compression), (1, Compression::ZIP16));
    assert_eq!(header.line_order, LineOrder::Increasing);
    let software = header.own_attributes.software_name.as_ref().unwrap().to_string();
    assert_eq!(software, concat!("Tetralux ", env!("CARGO_PKG_VERSION")));
    let others: Vec<&Text> = header.own_attributes.other.keys().collect();
    assert_eq!(others, [&Text::from("tetralux")]);
}
