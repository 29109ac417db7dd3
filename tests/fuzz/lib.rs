//! What the fuzz targets share: files in memory, and seals that vouch for what was changed.

pub mod programs;

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use xxhash_rust::xxh3::xxh3_64;

/// What the name of [`folder`] starts with; ten digits follow.
const STEM: &str = "tetralux-fuzz-";

/// A folder of this process, in memory where the system has such.
pub fn folder() -> PathBuf {
    let memory = Path::new("/dev/shm");
    let parent = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
    let folder = parent.join(format!("{STEM}{:010}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder for the inputs");
    folder
}

/// A file in [`folder`] with these bytes.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder().join(name);
    // Written anew, not in place: the last one may still be mapped.
    let _ = fs::remove_file(&path);
    fs::write(&path, bytes).expect("a file for the input");
    path
}

/// The bytes with the folder of another process, wherever they name it, replaced by that of this one.
pub fn at_home(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let number = format!("{:010}", std::process::id());
    for at in 0..bytes.len().saturating_sub(STEM.len() + number.len()) {
        if bytes[at..].starts_with(STEM.as_bytes()) {
            bytes[at + STEM.len()..at + STEM.len() + number.len()].copy_from_slice(number.as_bytes());
        }
    }
    bytes
}

/// The bytes with every digest of a map made to fit, as far as they still are one: what lies behind the digests is to
/// be tried, too.
pub fn seal(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let Some(text_end) = bytes.windows(2).position(|w| w == b"\n\n").map(|at| at + 2) else { return bytes };
    let number = |bytes: &[u8], key: &str| -> Option<(Range<usize>, u64)> {
        let start = find(&bytes[..text_end], key.as_bytes())? + key.len();
        let end = start + bytes[start..text_end].iter().position(|b| *b == b'\n')?;
        Some((start..end, std::str::from_utf8(&bytes[start..end]).ok()?.parse().ok()?))
    };
    if let Some((_, n)) = number(&bytes, "\nmetadata_bytes = ") {
        let end = text_end.saturating_add(n as usize).min(bytes.len());
        seal_sections(&mut bytes, text_end..end);
        let digest = xxh3_64(&bytes[text_end..end]);
        put(&mut bytes[..text_end], b"\nmetadata_xxh3 = \"", digest);
    }
    let Some(at) = find(&bytes[..text_end], b"\ndigest = \"") else { return bytes };
    let digest = xxh3_64(&bytes[..at + 1]);
    put(&mut bytes[..text_end], b"\ndigest = \"", digest);
    bytes
}

/// Makes the digests in the directory those of the sections.
fn seal_sections(bytes: &mut [u8], block: Range<usize>) {
    let word = |bytes: &[u8], at: usize| -> Option<u64> {
        let end = at.checked_add(8)?;
        Some(u64::from_le_bytes(bytes.get(at..end.min(block.end))?.try_into().ok()?))
    };
    let mut at = block.start;
    let Some(n) = word(bytes, at) else { return };
    at += 8;
    for _ in 0..n.min(64) {
        let Some(len) = word(bytes, at).filter(|len| *len < 1000) else { return };
        let fields = at + 8 + len as usize;
        let words = [0, 8, 16, 24].map(|offset| word(bytes, fields + offset));
        let [Some(size), Some(count), Some(offset), Some(_)] = words else { return };
        let range = size.checked_mul(count).and_then(|n| Some((offset, offset.checked_add(n)?)));
        let section = range.and_then(|(a, b)| bytes.get(a as usize..b as usize));
        if let Some(digest) = section.map(xxh3_64) {
            bytes[fields + 24..fields + 32].copy_from_slice(&digest.to_le_bytes());
        }
        at = fields + 32;
    }
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|w| w == what)
}

fn put(text: &mut [u8], key: &[u8], digest: u64) {
    let Some(at) = find(text, key).map(|at| at + key.len()) else { return };
    if let Some(place) = text.get_mut(at..at + 16) {
        place.copy_from_slice(format!("{digest:016x}").as_bytes());
    }
}
