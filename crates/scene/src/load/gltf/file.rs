//! The file itself: text or binary, its buffers, and places in it.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use super::tables::Tables;
use super::uri::{self, Uri};
use crate::Error;
use crate::load::reach::Reach;
use crate::load::source::Source;

/// The first bytes of a binary file.
const MAGIC: &[u8; 4] = b"glTF";

/// A glTF file with its buffers.
pub(super) struct File {
    pub(super) source: Source,
    pub(super) tables: Tables,
    buffers: Vec<Rc<Vec<u8>>>,
}

impl File {
    /// Reads a file and its buffers.
    pub(super) fn read(path: &Path, reach: &Reach) -> Result<Self, Error> {
        let bytes =
            reach.bytes(path).map_err(|cause| Error::Read { path: path.to_path_buf(), cause })?;
        let (json, binary) = if bytes.starts_with(MAGIC) {
            chunks(bytes).map_err(|fault| Error::whole(path, fault))?
        } else {
            (bytes, None)
        };
        let source = Source::new(path, json, reach)?;
        let tables: Tables = serde_json::from_str(source.text()).map_err(|e| {
            let message = e.to_string();
            let fault = message.rsplit_once(" at line ").map_or(message.as_str(), |(text, _)| text);
            source.fault_at_line(e.line(), e.column(), format!("{fault}; glTF 2.0 is expected"))
        })?;
        let mut file = Self { source, tables, buffers: Vec::new() };
        file.check_version()?;
        file.read_buffers(binary)?;
        Ok(file)
    }

    /// Something is wrong at a place, such as `meshes[0].primitives[1]`.
    pub(super) fn fault(&self, place: &str, fault: impl AsRef<str>) -> Error {
        self.source.fault_of_whole(format!("{place}: {}", fault.as_ref()))
    }

    /// What stands at an index that was read at a place.
    pub(super) fn get<'t, T>(
        &self,
        list: &'t [T],
        name: &str,
        index: usize,
        place: &str,
    ) -> Result<&'t T, Error> {
        list.get(index).ok_or_else(|| {
            let fault = format!("there is no {name}[{index}]; the file has {} of them", list.len());
            self.fault(place, fault)
        })
    }

    /// The bytes of a buffer view, where they begin in which buffer, and their stride.
    pub(super) fn view(&self, index: usize, place: &str) -> Result<View<'_>, Error> {
        let table = self.get(&self.tables.buffer_views, "bufferViews", index, place)?;
        let place = format!("bufferViews[{index}]");
        let buffer = self.get(&self.buffers, "buffers", table.buffer, &place)?;
        let end = table.byte_offset.checked_add(table.byte_length);
        let bytes = end.and_then(|end| buffer.get(table.byte_offset..end)).ok_or_else(|| {
            let fault = format!(
                "it ends behind buffers[{}], which has {} bytes",
                table.buffer,
                buffer.len()
            );
            self.fault(&place, fault)
        })?;
        Ok(View { bytes, start: (table.buffer, table.byte_offset), stride: table.byte_stride })
    }

    /// All bytes of all buffers.
    pub(super) fn n_bytes(&self) -> usize {
        self.buffers.iter().map(|buffer| buffer.len()).sum()
    }

    /// The bytes that a URI stands for.
    pub(super) fn fetch(&self, uri: &str, place: &str) -> Result<Vec<u8>, Error> {
        match uri::parse(uri).map_err(|fault| self.fault(place, fault))? {
            Uri::Data(bytes) => Ok(bytes),
            Uri::File(name) => {
                let path = self.source.resolve(&name);
                self.source.reach().bytes(&path).map_err(|cause| {
                    let fault = format!(
                        "cannot read {}: {cause}; paths are relative to the scene file",
                        path.display()
                    );
                    self.fault(place, fault)
                })
            }
        }
    }

    fn check_version(&self) -> Result<(), Error> {
        let asset = &self.tables.asset;
        let needed = asset.min_version.as_ref().unwrap_or(&asset.version);
        let is_known = match &asset.min_version {
            Some(least) => least == "2.0",
            None => asset.version.starts_with("2."),
        };
        if is_known {
            return Ok(());
        }
        Err(self.fault("asset", format!("version {needed} is needed to read it; save it as 2.0")))
    }

    fn read_buffers(&mut self, mut binary: Option<Vec<u8>>) -> Result<(), Error> {
        // Several buffers may lie in one file.
        let mut known: BTreeMap<&str, Rc<Vec<u8>>> = BTreeMap::new();
        let mut buffers = Vec::with_capacity(self.tables.buffers.len());
        for (i, table) in self.tables.buffers.iter().enumerate() {
            let place = format!("buffers[{i}]");
            let bytes = match &table.uri {
                Some(uri) => match known.get(uri.as_str()) {
                    Some(bytes) => Rc::clone(bytes),
                    None => {
                        let bytes = Rc::new(self.fetch(uri, &place)?);
                        known.insert(uri, Rc::clone(&bytes));
                        bytes
                    }
                },
                None => match binary.take() {
                    Some(bytes) if i == 0 => Rc::new(bytes),
                    _ => {
                        let fault = "it has no `uri`, and no chunk of a binary file stands for it";
                        return Err(self.fault(&place, fault));
                    }
                },
            };
            if bytes.len() < table.byte_length {
                let fault = format!(
                    "it promises {} bytes but holds {}; it may be cut off",
                    table.byte_length,
                    bytes.len()
                );
                return Err(self.fault(&place, fault));
            }
            buffers.push(bytes);
        }
        self.buffers = buffers;
        Ok(())
    }
}

/// A piece of a buffer.
#[derive(Clone, Copy)]
pub(super) struct View<'f> {
    pub(super) bytes: &'f [u8],
    /// The buffer, and where in it.
    pub(super) start: (usize, usize),
    pub(super) stride: Option<usize>,
}

/// JSON and, if there is one, the binary chunk of a binary file (glTF 2.0, section 4.4).
fn chunks(mut bytes: Vec<u8>) -> Result<(Vec<u8>, Option<Vec<u8>>), String> {
    let n_bytes = bytes.len();
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|b| b.try_into().ok());
        word.map(u32::from_le_bytes).ok_or_else(|| "the file is cut off in its header".to_owned())
    };
    let version = word(4)?;
    if version != 2 {
        return Err(format!("the binary file is of version {version}; save it as glTF 2.0"));
    }
    let end = word(8)? as usize;
    if end > n_bytes {
        return Err(format!("the file promises {end} bytes but holds {n_bytes}; it is cut off"));
    }
    let chunk = |at: usize, name: &[u8; 4]| {
        let length = word(at)? as usize;
        if word(at + 4)? != u32::from_le_bytes(*name) {
            return Err(format!("the chunk at byte {at} is of an unexpected kind"));
        }
        let range = at + 8..at + 8 + length;
        if range.end > end {
            return Err(format!("the chunk at byte {at} ends behind the file; it is cut off"));
        }
        Ok(range)
    };
    let json = chunk(12, b"JSON")?;
    let binary = if json.end + 8 <= end { Some(chunk(json.end, b"BIN\0")?) } else { None };
    let behind = binary.map(|range| {
        bytes.truncate(range.end);
        bytes.split_off(range.start)
    });
    bytes.truncate(json.end);
    Ok((bytes.split_off(json.start), behind))
}
