//! A journal beside an output: finished pieces of work, on disk every so often, for a run that goes on after this one was
//! killed.
//!
//! ```text
//! #?tetralux-journal 1
//! "--seed" = "0"                  what the pieces depend on, one a line
//!                                 one blank line
//! xxh3-64 of all above            8 bytes, little-endian, as all numbers
//! length, stage, index: 4 bytes each; xxh3-64 of these and the piece; the piece; and so on
//! ```
//!
//! What a power cut leaves is a beginning of that, perhaps with rubbish behind it: pieces count up to the first that
//! doesn't match its digest. A journal is removed when its output is whole.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use base::Fingerprint;

use crate::{Common, Console};

const MAGIC: &str = "#?tetralux-journal 1\n";

/// The longest list of settings, in bytes.
const MAX_HEADER: usize = 1 << 26;

/// So many bytes don't wait in memory for the time of a checkpoint.
const MOST_PENDING: usize = 1 << 22;

/// Bytes before each piece.
const PREFIX: usize = 20;

/// Whether and how often finished work is kept.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct JournalOptions {
    /// Go on with what an interrupted run with the same settings has done
    #[arg(long)]
    pub resume: bool,
    /// Keep what is done in a journal beside the output so often; 0 never
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = parse_seconds)]
    pub checkpoint: f64,
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|s| (0.0..=1e6).contains(s));
    seconds.ok_or_else(|| "expected a number of seconds up to 1000000".into())
}

/// The journal of a run; all threads may use it at once.
#[derive(Debug)]
pub struct Journal {
    path: Option<PathBuf>,
    interval: Duration,
    header: Vec<u8>,
    console: Console,
    /// Where the pieces of the run before lie, by stage and index.
    known: BTreeMap<(u32, u32), (u64, usize)>,
    pending: Mutex<Pending>,
    file: Mutex<Option<File>>,
}

#[derive(Debug)]
struct Pending {
    bytes: Vec<u8>,
    /// The memory of bytes that were written.
    spare: Vec<u8>,
    since: Instant,
    is_broken: bool,
}

impl Journal {
    /// The journal of the run that makes `output` with these settings, by name: all that its pieces depend on.
    ///
    /// Nothing is written before the first pieces have waited for the time of a checkpoint. Outputs that are devices have
    /// no journal.
    ///
    /// # Errors
    /// When there is a journal and neither [`JournalOptions::resume`] nor `--force`, when it is that of other settings
    /// (named in the message), when another process is at work on it, or when it can't be read.
    pub fn open(
        output: Option<&Path>,
        options: JournalOptions,
        common: &Common,
        settings: &[(String, String)],
        console: Console,
    ) -> anyhow::Result<Self> {
        let is_device = |path: &Path| fs::metadata(path).is_ok_and(|metadata| !metadata.is_file());
        let path = output.filter(|path| options.checkpoint > 0.0 && !is_device(path)).map(beside);
        let lines: String = settings.iter().map(|(name, value)| line(name, value)).collect();
        let mut header = format!("{MAGIC}{lines}\n").into_bytes();
        header.extend(Fingerprint::of(&header).0.to_le_bytes());
        let mut journal = Self {
            path,
            interval: Duration::from_secs_f64(options.checkpoint),
            header,
            console,
            known: BTreeMap::new(),
            pending: Mutex::new(Pending {
                bytes: Vec::new(),
                spare: Vec::new(),
                since: Instant::now(),
                is_broken: false,
            }),
            file: Mutex::new(None),
        };
        let Some(path) = journal.path.clone().filter(|path| path.exists()) else {
            return Ok(journal);
        };
        let name = path.display();
        let cannot = || format!("cannot read {name}");
        let file = OpenOptions::new().read(true).write(true).open(&path).with_context(cannot)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) if common.force && !options.resume => {
                console.warn(format_args!(
                    "another run keeps its work in {name}; this one keeps none"
                ))?;
                journal.path = None;
                return Ok(journal);
            }
            Err(TryLockError::WouldBlock) => {
                bail!("another run is at work on {name}; wait for its end, or give another output")
            }
            // Some file systems know no locks.
            Err(TryLockError::Error(_)) | Ok(()) => {}
        }
        if !options.resume {
            if !common.force {
                bail!(
                    "{name} holds what an interrupted run has done; go on with --resume, or start anew with --force"
                );
            }
            fs::remove_file(&path).with_context(|| format!("cannot remove {name}"))?;
            return Ok(journal);
        }
        let end = journal.take_up(&file, &path)?;
        file.set_len(end).and_then(|()| seek(&file, end)).with_context(cannot)?;
        console.say(format_args!("{} pieces of work are taken from {name}", journal.known.len()));
        *journal.file() = Some(file);
        Ok(journal)
    }

    /// Where the good part of a journal ends, if it is of this run; its pieces are known from here on.
    fn take_up(&mut self, file: &File, path: &Path) -> anyhow::Result<u64> {
        let name = path.display();
        let file_bytes = file.metadata().with_context(|| format!("cannot read {name}"))?.len();
        let not_one = || format!("{name} is damaged or no journal; start anew with --force");
        let mut start = Vec::new();
        let most = MAX_HEADER.max(self.header.len() + 1) as u64;
        // What is longer than the header expected is only read to say what differs.
        file.take(most.min(self.header.len() as u64 * 2 + 4096))
            .read_to_end(&mut start)
            .with_context(|| format!("cannot read {name}"))?;
        if !start.starts_with(&self.header) {
            let text_end = start.windows(2).position(|w| w == b"\n\n").map(|at| at + 2);
            let (text, rest) = start.split_at(text_end.with_context(not_one)?);
            let text = std::str::from_utf8(text).ok().filter(|text| text.starts_with(MAGIC));
            let text = text.with_context(not_one)?;
            if rest.get(..8) != Some(&Fingerprint::of(text.as_bytes()).0.to_le_bytes()) {
                bail!(not_one());
            }
            let now = String::from_utf8_lossy(&self.header[..self.header.len() - 8]);
            bail!(
                "{name} is of a run with other settings: {}; give those, or start anew with --force",
                differences(text, &now)
            );
        }
        let mut at = self.header.len() as u64;
        let mut piece = Vec::new();
        loop {
            let mut prefix = [0; PREFIX];
            if file_bytes.saturating_sub(at) < PREFIX as u64
                || file.read_exact_at(&mut prefix, at).is_err()
            {
                return Ok(at);
            }
            let word = |i: usize| u32::from_le_bytes([0, 1, 2, 3].map(|k| prefix[4 * i + k]));
            let (len, from) = (word(0) as usize, at + PREFIX as u64);
            if len as u64 > file_bytes - from {
                return Ok(at);
            }
            piece.clear();
            piece.resize(len, 0);
            if file.read_exact_at(&mut piece, from).is_err()
                || prefix != prefix_of(word(1), word(2), &piece)
            {
                return Ok(at);
            }
            self.known.insert((word(1), word(2)), (from, len));
            at = from + len as u64;
        }
    }

    /// What the run before has kept, if it has.
    pub fn get(&self, stage: u32, index: u32) -> Option<Vec<u8>> {
        let &(from, len) = self.known.get(&(stage, index))?;
        let mut piece = vec![0; len];
        self.file().as_ref()?.read_exact_at(&mut piece, from).ok()?;
        Some(piece)
    }

    /// Keeps a piece of work, from the next checkpoint on.
    pub fn put(&self, stage: u32, index: u32, piece: &[u8]) {
        if self.path.is_none() {
            return;
        }
        let (is_due, is_much) = {
            let mut pending = self.pending();
            if pending.is_broken {
                return;
            }
            pending.bytes.extend(prefix_of(stage, index, piece));
            pending.bytes.extend(piece);
            (pending.since.elapsed() >= self.interval, pending.bytes.len() >= MOST_PENDING)
        };
        if is_due || is_much {
            self.pass_on(is_due);
        }
    }

    /// A checkpoint: all that was kept so far survives from here on.
    pub fn flush(&self) {
        self.pass_on(true);
    }

    /// Writes what is pending; a checkpoint waits until it is on the disk.
    fn pass_on(&self, is_checkpoint: bool) {
        let mut file = self.file();
        let mut bytes = {
            let mut pending = self.pending();
            if is_checkpoint {
                pending.since = Instant::now();
            }
            let spare = std::mem::take(&mut pending.spare);
            std::mem::replace(&mut pending.bytes, spare)
        };
        let result = match bytes.is_empty() {
            true => Ok(()),
            false => self.write(&mut file, &bytes),
        };
        let sync = |file: &File| if is_checkpoint { file.sync_data() } else { Ok(()) };
        let result = result.and_then(|()| file.as_ref().map_or(Ok(()), sync));
        bytes.clear();
        let mut pending = self.pending();
        pending.spare = bytes;
        if let Err(error) = result {
            pending.is_broken = true;
            let path = self.path.as_deref().unwrap_or(Path::new("")).display();
            // The run itself is sound: it goes on, whatever --strict says.
            let _ = self.console.warn(format_args!(
                "cannot write {path}: {error}; what is done from here on isn't kept"
            ));
        }
    }

    fn write(&self, file: &mut Option<File>, bytes: &[u8]) -> io::Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        if let Some(mut file) = file.as_ref() {
            return file.write_all(bytes);
        }
        let mut new = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
        match new.try_lock() {
            Err(TryLockError::WouldBlock) => return Err(io::ErrorKind::WouldBlock.into()),
            Err(TryLockError::Error(_)) | Ok(()) => {}
        }
        new.write_all(&self.header)?;
        new.write_all(bytes)?;
        new.sync_all()?;
        if let Some(folder) = path.parent() {
            let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            // Where folders cannot be synced, the file still is in its place.
            let _ = File::open(folder).and_then(|folder| folder.sync_all());
        }
        *file = Some(new);
        Ok(())
    }

    /// Makes a last checkpoint; says what wasn't done, and how to go on if anything is kept.
    pub fn farewell(&self, undone: &str) -> String {
        self.flush();
        match (&self.path, self.file().as_ref()) {
            (Some(path), Some(_)) => {
                let mut words: Vec<_> = std::env::args_os().collect();
                if !words.iter().any(|word| word == "--resume") {
                    words.push("--resume".into());
                }
                format!(
                    "{undone}, but what is done is kept in {}; go on with: {}",
                    path.display(),
                    crate::command_line(words)
                )
            }
            _ => undone.into(),
        }
    }

    /// To be called when the output is whole.
    pub fn remove(&self) {
        let had_file = self.file().take().is_some();
        self.pending().is_broken = true;
        if let Some(path) = self.path.as_ref().filter(|_| had_file) {
            // What remains does no harm: it is of the same settings.
            let _ = fs::remove_file(path);
        }
    }

    fn pending(&self) -> MutexGuard<'_, Pending> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn file(&self) -> MutexGuard<'_, Option<File>> {
        self.file.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The settings that a command line gives: what stands before the first option, and each option with its value.
pub fn settings_of(command: &str) -> Vec<(String, String)> {
    let mut parts = command.split(" --");
    let first = ("the scene".to_owned(), parts.next().unwrap_or_default().to_owned());
    let options = parts.map(|part| {
        let (name, value) = part.split_once(' ').unwrap_or((part, ""));
        (format!("--{name}"), value.to_owned())
    });
    std::iter::once(first).chain(options).collect()
}

fn beside(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".journal");
    name.into()
}

fn line(name: &str, value: &str) -> String {
    format!("{name:?} = {value:?}\n")
}

/// The first few lines that differ, by name.
fn differences(then: &str, now: &str) -> String {
    let lines = |text: &str| -> BTreeMap<String, String> {
        let pairs = text.lines().filter_map(|line| line.split_once(" = "));
        pairs
            .map(|(name, value)| (name.trim_matches('"').into(), value.trim_matches('"').into()))
            .collect()
    };
    let (then, now) = (lines(then), lines(now));
    let mut all: Vec<String> = Vec::new();
    for (name, value) in &then {
        match now.get(name) {
            Some(other) if other == value => {}
            Some(other) => all.push(format!("{name} was {value} and is {other}")),
            None => all.push(format!("{name} was {value} and is not given")),
        }
    }
    let is_new = |name: &&String| !then.contains_key(*name);
    all.extend(now.keys().filter(is_new).map(|name| format!("{name} was not given")));
    if all.is_empty() {
        return "their order".into();
    }
    let more = all.len().saturating_sub(3);
    all.truncate(3);
    let more = if more > 0 { format!(", and {more} more") } else { String::new() };
    format!("{}{more}", all.join(", "))
}

fn prefix_of(stage: u32, index: u32, piece: &[u8]) -> [u8; PREFIX] {
    let mut prefix = [0; PREFIX];
    let len = u32::try_from(piece.len()).unwrap_or(u32::MAX);
    for (i, word) in [len, stage, index].into_iter().enumerate() {
        prefix[4 * i..4 * i + 4].copy_from_slice(&word.to_le_bytes());
    }
    let mut digest = base::FingerprintBuilder::new();
    digest.bytes(&prefix[..12]).bytes(piece);
    prefix[12..].copy_from_slice(&digest.finish().0.to_le_bytes());
    prefix
}

fn seek(mut file: &File, to: u64) -> io::Result<()> {
    io::Seek::seek(&mut file, io::SeekFrom::Start(to)).map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALWAYS: JournalOptions = JournalOptions { resume: true, checkpoint: 1e-9 };

    fn open(
        output: &Path,
        seed: &str,
        options: JournalOptions,
        force: bool,
    ) -> Result<Journal, String> {
        let common = Common { force, quiet: true, ..Common::default() };
        let settings = settings_of(&format!("make scene.toml --seed {seed} --force"));
        let console = Console::new("test", &common);
        Journal::open(Some(output), options, &common, &settings, console)
            .map_err(|e| e.to_string().replace(&*output.to_string_lossy(), "a.exr"))
    }

    fn piece(i: u32) -> Vec<u8> {
        (0..i * 7).map(|k| (k ^ i) as u8).collect()
    }

    /// A folder, the output in it, and the bytes of its journal, which holds five pieces.
    fn example() -> (tempfile::TempDir, PathBuf, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("a.exr");
        let journal = open(&output, "1", ALWAYS, false).unwrap();
        (0..5).for_each(|i| journal.put(i % 2, i, &piece(i)));
        drop(journal);
        let bytes = fs::read(beside(&output)).unwrap();
        (folder, output, bytes)
    }

    #[test]
    fn what_is_kept_is_found_by_a_run_with_the_same_settings() {
        let (_folder, output, bytes) = example();
        let journal = open(&output, "1", ALWAYS, false).unwrap();
        (0..5).for_each(|i| assert_eq!(journal.get(i % 2, i), Some(piece(i))));
        assert_eq!(journal.get(2, 0), None);
        let busy =
            "another run is at work on a.exr.journal; wait for its end, or give another output";
        assert_eq!(open(&output, "1", ALWAYS, false).unwrap_err(), busy);
        drop(journal);
        assert_eq!(
            open(&output, "2", ALWAYS, false).unwrap_err(),
            "a.exr.journal is of a run with other settings: --seed was 1 and is 2; give those, or start anew with --force"
        );
        let anew = JournalOptions { resume: false, ..ALWAYS };
        assert_eq!(
            open(&output, "1", anew, false).unwrap_err(),
            "a.exr.journal holds what an interrupted run has done; go on with --resume, or start anew with --force"
        );
        assert_eq!(fs::read(beside(&output)).unwrap(), bytes);
        assert_eq!(open(&output, "2", anew, true).unwrap().get(0, 0), None);
        assert!(!beside(&output).exists());
        let never = JournalOptions { resume: true, checkpoint: 0.0 };
        let journal = open(&output, "1", never, false).unwrap();
        journal.put(0, 0, &piece(1));
        assert_eq!(journal.farewell("nothing was done"), "nothing was done");
        assert!(!beside(&output).exists());
    }

    #[test]
    fn of_a_damaged_journal_the_good_part_counts() {
        let (_folder, output, bytes) = example();
        let text_end = bytes.windows(2).position(|w| w == b"\n\n").unwrap() + 10;
        let check = |damaged: &[u8], sound_up_to: usize| {
            fs::write(beside(&output), damaged).unwrap();
            let opened = open(&output, "1", ALWAYS, false);
            let Ok(journal) = opened else {
                assert!(sound_up_to < text_end, "{sound_up_to}");
                return;
            };
            assert!(sound_up_to >= text_end);
            let mut end = text_end;
            for i in 0..5 {
                end += PREFIX + piece(i).len();
                let expected = (end <= sound_up_to).then(|| piece(i));
                assert_eq!(journal.get(i % 2, i), expected, "{i}, {sound_up_to}");
            }
            // It goes on from there.
            journal.put(9, 9, &piece(3));
            drop(journal);
            let again = open(&output, "1", ALWAYS, false).unwrap();
            assert_eq!(again.get(9, 9), Some(piece(3)));
        };
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << (at % 8);
            check(&flipped, at);
            check(&bytes[..at], at);
        }
        check(&[&bytes[..], &[255; 40]].concat(), bytes.len());
    }

    #[test]
    fn work_goes_on_where_a_journal_cannot() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("a.exr");
        let journal = open(&output, "1", ALWAYS, false).unwrap();
        fs::create_dir(beside(&output)).unwrap();
        journal.put(0, 0, &piece(1));
        journal.put(0, 1, &piece(1));
        assert_eq!(journal.farewell("nothing was done"), "nothing was done");
        let device = open(Path::new("/dev/null"), "1", ALWAYS, false).unwrap();
        device.put(0, 0, &piece(1));
        assert!(!Path::new("/dev/null.journal").exists());
    }
}
