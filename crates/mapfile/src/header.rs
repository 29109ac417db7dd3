//! The text at the start of a map.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use base::Fingerprint;
use toml::Value;
use xxhash_rust::xxh3::xxh3_64;

use crate::Error;

/// The version of the container.
pub(crate) const FORMAT: u32 = 1;
/// What a map begins with, before the version of the container.
pub(crate) const MAGIC: &str = "#?tetralux-map ";
/// The longest header, in bytes.
pub(crate) const MAX_BYTES: usize = 1 << 16;

/// What a map says about itself to people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// What it is, such as "photon map".
    pub kind: String,
    /// The version of what is in maps of this kind. Another layout needs another version.
    pub version: u32,
    /// Name and version of the program that made it.
    pub made_by: String,
    /// The command that makes it anew, as a shell takes it, with `{file}` for the name of the map: so the bytes of a map
    /// don't depend on its name. Messages quote it, so it should replace an existing file.
    pub command: String,
    /// Digest of the inputs it was made from.
    pub inputs: Fingerprint,
    /// Whatever else is worth knowing, such as the number of photons. Names are distinct.
    pub notes: Vec<(String, String)>,
}

impl Header {
    /// The command that makes the map at `path` anew.
    pub fn remedy(&self, path: &Path) -> String {
        self.command.replace("{file}", &path.to_string_lossy())
    }
}

/// The header of the map at `path`, whatever its kind. Nothing after the header is looked at.
///
/// # Errors
/// When the file cannot be read, is not a map, or has a damaged header.
pub fn read_header(path: &Path) -> Result<Header, Error> {
    let mut start = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_BYTES as u64).read_to_end(&mut start))
        .map_err(|cause| Error::Read { path: path.into(), cause })?;
    Ok(parse(path, &start)?.0)
}

/// What a header says about the binary block after it, which holds directory and metadata.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Block {
    /// Where it begins.
    pub(crate) start: usize,
    /// Its length.
    pub(crate) bytes: u64,
    /// Its digest.
    pub(crate) xxh3: u64,
}

/// The text of `header`, blank line included, for a file that goes on with `block`.
pub(crate) fn render(header: &Header, block: &[u8]) -> String {
    let mut text = format!("{MAGIC}{FORMAT}\n");
    let mut line = |key: &str, value: &str| {
        text.extend([key, " = ", value, "\n"]);
    };
    line("kind", &quote(&header.kind));
    line("version", &header.version.to_string());
    line("endian", &quote("little"));
    line("made_by", &quote(&header.made_by));
    line("command", &quote(&header.command));
    line("inputs", &quote(&header.inputs.to_string()));
    for (name, value) in &header.notes {
        line(&format!("note.{}", key(name)), &quote(value));
    }
    line("metadata_bytes", &block.len().to_string());
    line("metadata_xxh3", &quote(&hex(xxh3_64(block))));
    seal(text)
}

/// Adds the digest of all lines, and the blank line.
fn seal(mut text: String) -> String {
    let digest = xxh3_64(text.as_bytes());
    text.push_str(&digest_line(digest));
    text.push('\n');
    text
}

/// The header at the start of `bytes`.
pub(crate) fn parse(path: &Path, bytes: &[u8]) -> Result<(Header, Block), Error> {
    let corrupt = |(offset, what): (usize, String)| Error::Corrupt {
        path: path.into(),
        what,
        offset: Some(offset as u64),
        remedy: None,
    };
    let Some(rest) = bytes.strip_prefix(MAGIC.as_bytes()) else {
        return Err(Error::NotAMap { path: path.into() });
    };
    // A newer container may be sealed in another way: its version comes before all else.
    let format: Vec<u8> = rest.iter().copied().take_while(u8::is_ascii_digit).collect();
    let format = std::str::from_utf8(&format).ok().and_then(|digits| digits.parse().ok());
    match format {
        Some(FORMAT) => {}
        Some(found) => return Err(Error::OtherFormat { path: path.into(), found }),
        None => return Err(Error::NotAMap { path: path.into() }),
    }
    let bytes = &bytes[..bytes.len().min(MAX_BYTES)];
    let end =
        bytes.windows(2).position(|pair| pair == b"\n\n").map(|at| at + 2).ok_or_else(|| {
            corrupt((bytes.len(), "the header does not end with a blank line".into()))
        })?;
    let text = unseal(&bytes[..end]).map_err(corrupt)?;
    let (header, bytes, xxh3) = fields(text).map_err(corrupt)?;
    Ok((header, Block { start: end, bytes, xxh3 }))
}

/// The lines above the digest, if it is theirs.
fn unseal(bytes: &[u8]) -> Result<&str, (usize, String)> {
    let split = bytes.len().saturating_sub(digest_line(0).len() + 1);
    let (text, digest) = bytes.split_at(split);
    if digest != format!("{}\n", digest_line(xxh3_64(text))).as_bytes() {
        return Err((0, "the header does not match its digest".into()));
    }
    std::str::from_utf8(text).map_err(|e| (e.valid_up_to(), "the header is not text".into()))
}

/// What the lines above the digest say.
fn fields(text: &str) -> Result<(Header, u64, u64), (usize, String)> {
    let mut lines = Lines { text, at: 0 };
    if lines.next()? != format!("{MAGIC}{FORMAT}") {
        return Err((0, "the first line goes on after the format".into()));
    }
    let header = Header {
        kind: lines.string("kind")?,
        version: lines.integer("version")?,
        made_by: {
            let endian = lines.string("endian")?;
            if endian != "little" {
                return Err((lines.at, format!("its arrays are {endian}-endian")));
            }
            lines.string("made_by")?
        },
        command: lines.string("command")?,
        inputs: Fingerprint(lines.digest("inputs")?),
        notes: lines.notes()?,
    };
    let metadata_bytes = lines.integer("metadata_bytes")?;
    let metadata_xxh3 = lines.digest("metadata_xxh3")?;
    match lines.text[lines.at..].is_empty() {
        true => Ok((header, metadata_bytes, metadata_xxh3)),
        false => Err((lines.at, "the header goes on after `metadata_xxh3`".into())),
    }
}

/// The lines of a header, which have a fixed order. Each is TOML.
struct Lines<'a> {
    text: &'a str,
    /// Offset of the next line.
    at: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Result<&'a str, (usize, String)> {
        let rest = &self.text[self.at..];
        let (line, _) =
            rest.split_once('\n').ok_or((self.at, "the header ends too early".to_owned()))?;
        self.at += line.len() + 1;
        Ok(line)
    }

    /// The value on the next line, if its name is `key` and `read` can make sense of it.
    fn value<T>(
        &mut self,
        key: &str,
        read: impl FnOnce(&Value) -> Option<T>,
    ) -> Result<T, (usize, String)> {
        let at = self.at;
        let table = self.next()?.parse::<toml::Table>().ok();
        table
            .as_ref()
            .and_then(|table| read(table.get(key)?))
            .ok_or_else(|| (at, format!("the header has no proper `{key}` here")))
    }

    fn string(&mut self, key: &str) -> Result<String, (usize, String)> {
        self.value(key, |value| value.as_str().map(String::from))
    }

    fn integer<T: TryFrom<i64>>(&mut self, key: &str) -> Result<T, (usize, String)> {
        self.value(key, |value| T::try_from(value.as_integer()?).ok())
    }

    fn digest(&mut self, key: &str) -> Result<u64, (usize, String)> {
        self.value(key, |value| {
            let text = value.as_str()?;
            let digest = u64::from_str_radix(text, 16).ok()?;
            (hex(digest) == text).then_some(digest)
        })
    }

    fn notes(&mut self) -> Result<Vec<(String, String)>, (usize, String)> {
        let mut notes = Vec::new();
        while self.text[self.at..].starts_with("note.") {
            notes.push(self.value("note", |value| {
                let (name, value) = value.as_table()?.iter().next()?;
                Some((name.clone(), value.as_str()?.to_owned()))
            })?);
        }
        Ok(notes)
    }
}

fn digest_line(digest: u64) -> String {
    format!("digest = {}\n", quote(&hex(digest)))
}

fn hex(digest: u64) -> String {
    Fingerprint(digest).to_string()
}

/// `name` as a TOML key: bare where it can be.
fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) { name.into() } else { quote(name) }
}

/// `text` as a TOML basic string on one line. (The `toml` crate would spread line breaks over several.)
fn quote(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted.push_str(&format!("\\u{:04x}", u32::from(c))),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Header {
        Header {
            kind: "photon map".into(),
            version: 3,
            made_by: "photon-build 0.1.0".into(),
            command: "photon-build 'a \"b\".toml' -o é\\\n\u{7f}\u{1b}.photons".into(),
            inputs: Fingerprint(0x00ab),
            notes: vec![
                ("stored".into(), "12".into()),
                ("with a space, a . and a \"".into(), String::new()),
                ("emitted".into(), "34".into()),
            ],
        }
    }

    #[test]
    fn what_is_rendered_is_parsed() {
        let text = render(&example(), b"metadata");
        let parsed = parse(Path::new("a"), format!("{text}metadata\n\n").as_bytes()).unwrap();
        let block = Block { start: text.len(), bytes: 8, xxh3: xxh3_64(b"metadata") };
        assert_eq!(parsed, (example(), block));
    }

    #[test]
    fn the_header_is_toml_as_a_whole() {
        let table: toml::Table = render(&example(), b"").parse().unwrap();
        assert_eq!(table["command"].as_str(), Some(&*example().command));
        assert_eq!(table["note"]["stored"].as_str(), Some("12"));
        assert_eq!(table["metadata_bytes"].as_integer(), Some(0));
    }

    #[test]
    fn a_sealed_header_that_makes_no_sense_is_an_error() {
        let text = render(&example(), b"");
        let (good, _) = text.split_at(text.len() - digest_line(0).len() - 1);
        let check = |text: &str| parse(Path::new("a"), seal(text.into()).as_bytes());
        check(good).unwrap();

        let says = |text: String, message: &str| {
            let error = check(&text).unwrap_err().to_string();
            assert!(error.contains(message), "{error}\n{text}");
        };
        says(good.replace("version = 3", "version = -3"), "no proper `version` here (byte 37)");
        says(good.replace("version = 3", "version = 4294967296"), "no proper `version`");
        says(good.replace("version = 3", "version = 3\nversion = 3"), "no proper `endian`");
        says(good.replace("\"little\"", "\"big\""), "its arrays are big-endian");
        says(good.replace("0000000000000", "+00000000000"), "no proper `inputs`");
        says(good.replace("0000ab", "0000AB"), "no proper `inputs`");
        says(good.replace("\"12\"", "12"), "no proper `note`");
        says(
            good.replace("metadata_bytes = 0", "metadata_bytes = -1"),
            "no proper `metadata_bytes`",
        );
        says(good.replace("kind =", "kind"), "no proper `kind`");
        says(format!("{good}more = 1\n"), "goes on after `metadata_xxh3`");
        says(good.replace("map 1\n", "map 1.5\n"), "goes on after the format");
        says(format!("{MAGIC}1\n"), "ends too early");
        says(format!("{MAGIC}1\nkind = {}\n", "[".repeat(10_000)), "no proper `kind`");
        assert!(matches!(
            check(&good.replace("map 1\n", "map 21\n")),
            Err(Error::OtherFormat { found: 21, .. })
        ));
        for start in ["map x\n", "map \n", "map 99999999999999999999\n"] {
            let error = check(&good.replace("map 1\n", start));
            assert!(matches!(error, Err(Error::NotAMap { .. })), "{error:?}");
        }
    }
}
