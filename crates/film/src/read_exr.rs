//! Reads OpenEXR files, ours and others'.
//!
//! No input makes this panic. The memory taken is at most in proportion to the size of the file.

use std::collections::BTreeSet;
use std::fs;
use std::io::Cursor;
use std::path::Path;

use base::{Grid, ImageSize, Rgb};
use exr::block::UncompressedBlock;
use exr::block::reader::ChunksReader;
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, Compression, SampleType, Text};
use exr::meta::header::Header;

use crate::picture::rgb_names;
use crate::write_exr::METADATA_ATTRIBUTE;
use crate::{Error, Picture};

/// Reads the first part of an OpenEXR file at full resolution: scan lines or tiles, half, float or integer channels, any
/// compression. The picture is the data window.
///
/// # Errors
/// When the file cannot be read, is not an OpenEXR file, is damaged, or holds deep or subsampled data.
pub fn read_exr(path: &Path) -> Result<Picture, Error> {
    let bytes = fs::read(path).map_err(|cause| Error::Read { path: path.into(), cause })?;
    decode(&bytes).map_err(|fault| fault.at(path))
}

/// Reads the channels `R`, `G` and `B` of one layer; the layer `""` is the beauty.
///
/// # Errors
/// Those of [`read_exr`], and when one of the channels is missing.
pub fn read_rgb(path: &Path, layer: &str) -> Result<Grid<Rgb>, Error> {
    let picture = read_exr(path)?;
    picture.rgb(layer).ok_or_else(|| {
        let missing = rgb_names(layer).into_iter().find(|name| picture.channel(name).is_none());
        Error::NoChannel {
            path: path.into(),
            channel: missing.expect("a layer with all its channels would have been taken"),
            present: picture.channels().map(|(name, _)| name.into()).collect(),
        }
    })
}

/// What is wrong with a file, before it is named.
#[derive(Debug)]
pub(crate) enum Fault {
    NotExr,
    TooLarge(u128),
    Damaged(String),
    Unsupported(String),
}

impl Fault {
    /// The error for the file of this name.
    pub(crate) fn at(self, path: &Path) -> Error {
        let path = path.into();
        match self {
            Self::NotExr => Error::NotExr { path },
            Self::TooLarge(claimed) => Error::TooLarge { path, claimed },
            Self::Damaged(fault) => Error::Damaged { path, fault },
            Self::Unsupported(feature) => Error::Unsupported { path, feature },
        }
    }
}

impl From<exr::error::Error> for Fault {
    fn from(error: exr::error::Error) -> Self {
        match error {
            exr::error::Error::NotSupported(what) => Self::Unsupported(what.into_owned()),
            exr::error::Error::Invalid(what) => Self::Damaged(what.into_owned()),
            other => Self::Damaged(other.to_string()),
        }
    }
}

fn decode(bytes: &[u8]) -> Result<Picture, Fault> {
    if !bytes.starts_with(&exr::meta::magic_number::BYTES) {
        return Err(Fault::NotExr);
    }
    let reader = exr::block::read(Cursor::new(bytes), false)?;
    let header = &reader.headers()[0];
    check(header, bytes.len())?;
    let size = ImageSize {
        width: header.layer_size.width() as u32,
        height: header.layer_size.height() as u32,
    };
    let (metadata, names) = (metadata(header), names(header));
    let types: Vec<SampleType> =
        header.channels.list.iter().map(|channel| channel.sample_type).collect();

    let mut channels = vec![vec![0.0; size.n_pixels()]; names.len()];
    let mut starts = BTreeSet::new();
    let mut missing = size.n_pixels();
    let mut chunks = reader
        .filter_chunks(false, |_, _, block| block.layer == 0 && block.level == (0, 0).into())?;
    while let Some(chunk) = chunks.next() {
        let meta = chunks.meta_data();
        let block = UncompressedBlock::decompress_chunk(chunk?, meta, false)?;
        let index = block.index;
        if index.layer != 0 || index.level != (0, 0).into() {
            return Err(Fault::Damaged("a block is not where the table says".into()));
        }
        if !starts.insert((index.pixel_position.y(), index.pixel_position.x())) {
            return Err(Fault::Damaged("a block is there twice".into()));
        }
        for line in block.lines(&meta.headers[0].channels) {
            let location = line.location;
            let start = location.position.y() * size.width as usize + location.position.x();
            let values =
                channels[location.channel]
                    .get_mut(start..start + location.sample_count)
                    .ok_or_else(|| Fault::Damaged("a block lies outside the picture".into()))?;
            match types[location.channel] {
                SampleType::F32 => line.read_samples_into_slice(values)?,
                SampleType::F16 => {
                    for (value, sample) in
                        values.iter_mut().zip(line.read_samples::<exr::prelude::f16>())
                    {
                        *value = sample?.to_f32();
                    }
                }
                SampleType::U32 => {
                    for (value, sample) in values.iter_mut().zip(line.read_samples::<u32>()) {
                        *value = sample? as f32;
                    }
                }
            }
        }
        missing = missing.saturating_sub(index.pixel_size.area());
    }
    if missing > 0 {
        return Err(Fault::Damaged(format!("{missing} pixels are missing")));
    }

    let mut picture = Picture::new(size, metadata);
    for (name, values) in names.into_iter().zip(channels) {
        picture.push(name, values);
    }
    Ok(picture)
}

/// The text of our attribute; empty if there is none.
pub(crate) fn metadata(header: &Header) -> String {
    match header.own_attributes.other.get(&Text::from(METADATA_ATTRIBUTE)) {
        Some(AttributeValue::Text(json)) => String::from_utf8_lossy(json.as_slice()).into_owned(),
        _ => String::new(),
    }
}

/// The names of the channels, in the order of the file.
pub(crate) fn names(header: &Header) -> Vec<String> {
    let name = |text: &Text| String::from_utf8_lossy(text.as_slice()).into_owned();
    header.channels.list.iter().map(|channel| name(&channel.name)).collect()
}

/// Refuses what the exr crate would read wrongly, or would take any amount of memory for.
pub(crate) fn check(header: &Header, file_len: usize) -> Result<(), Fault> {
    /// Deflate, the strongest of the format's compressions on ordinary data, gives at most this many bytes for one.
    const MAX_RATIO: u128 = 1032;
    /// Constant pictures in wavelet compression surpass that ratio; up to this size they are read all the same.
    const ALWAYS_FINE: u128 = 256 << 20;

    let bytes_per_pixel = header.channels.bytes_per_pixel as u128;
    // The values are kept as 32-bit floats, whatever they are in the file.
    let bytes_per_pixel = bytes_per_pixel.max(4 * header.channels.list.len() as u128);
    let area = |width: usize, height: usize| width as u128 * height as u128 * bytes_per_pixel;
    let most = file_len as u128 * MAX_RATIO + ALWAYS_FINE;
    let claimed = area(header.layer_size.width(), header.layer_size.height());
    if claimed == 0 {
        return Err(Fault::Damaged("it has no pixels".into()));
    }
    if claimed > most {
        return Err(Fault::TooLarge(claimed));
    }
    if let BlockDescription::Tiles(tiles) = header.blocks {
        let claimed = area(tiles.tile_size.width(), tiles.tile_size.height());
        if claimed > most {
            return Err(Fault::TooLarge(claimed));
        }
    }
    // The exr crate overflows on damaged B44 blocks, and takes the sizes inside of DWA blocks at their word. Both lose
    // values, which no picture to compare with should.
    if matches!(
        header.compression,
        Compression::B44 | Compression::B44A | Compression::DWAA(_) | Compression::DWAB(_)
    ) {
        return Err(Fault::Unsupported(format!("{} is lossy", header.compression)));
    }
    let mut names = BTreeSet::new();
    for channel in &header.channels.list {
        let name = String::from_utf8_lossy(channel.name.as_slice()).into_owned();
        if channel.sampling != (1, 1).into() {
            return Err(Fault::Unsupported(format!("channel {name} is subsampled")));
        }
        if !names.insert(name.clone()) {
            return Err(Fault::Damaged(format!("channel {name} is there twice")));
        }
    }
    Ok(())
}
