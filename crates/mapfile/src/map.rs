//! The bytes of a file, mapped into memory where that can be done.

use std::fmt;
use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::ops::Deref;
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};

use bytemuck::{Pod, Zeroable};
use memmap2::Mmap;
use nix::libc;
use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};

/// Arrays begin at multiples of this, in the file and so in memory.
pub(crate) const ALIGNMENT: usize = 64;

/// The bytes of a file. The first lies at a multiple of [`ALIGNMENT`].
pub(crate) enum Bytes {
    /// In the system's cache, brought in page by page when touched.
    Mapped(Watched),
    /// Read, because the file could not be mapped.
    Read { blocks: Vec<Block>, len: usize },
}

/// The unit of memory that is aligned as arrays need it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Block([u8; ALIGNMENT]);

impl Bytes {
    /// The bytes of the file at `path`, or nothing if it doesn't begin with `magic`.
    pub(crate) fn open(path: &Path, magic: &[u8]) -> io::Result<Option<Self>> {
        let mut file = File::open(path)?;
        let bytes = match Watched::new(&file, path) {
            Some(mapped) => Self::Mapped(mapped),
            None => return read(&mut file, magic),
        };
        Ok(bytes.starts_with(magic).then_some(bytes))
    }

    /// Whether the file is as it was, as far as its length and the time of its last change tell.
    pub(crate) fn is_untouched(&self) -> bool {
        let Self::Mapped(Watched { file, then, .. }) = self else { return true };
        // What can't be asked any more is still mapped.
        let is_same =
            |now: Metadata| now.len() == then.len() && now.modified().ok() == then.modified().ok();
        file.metadata().map_or(true, is_same)
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Mapped(bytes) => &bytes.bytes,
            Self::Read { blocks, len } => &bytemuck::cast_slice(blocks)[..*len],
        }
    }
}

impl fmt::Debug for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = match self {
            Self::Mapped(_) => "mapped",
            Self::Read { .. } => "read",
        };
        write!(f, "{} bytes, {how}", self.len())
    }
}

#[expect(unsafe_code, reason = "a map of many megabytes is to be used where it lies, not copied")]
fn map(file: &File) -> Option<Mmap> {
    if !file.metadata().ok()?.is_file() {
        return None;
    }
    // SAFETY: the bytes must not change while they are mapped. Maps are replaced by renaming a finished file, never
    // written in place (see `atomic_file::write`), and the crate documents that nobody else may. The mapping is private
    // and read-only, so nothing changes through it. What else happens to the file, `Watched` and `Bytes::is_untouched`
    // find out.
    unsafe { Mmap::map(file) }.ok()
}

/// A mapping of which the process knows what to say when its bytes can't be had any more.
pub(crate) struct Watched {
    bytes: Mmap,
    file: File,
    /// What the system said of the file when it was mapped.
    then: Metadata,
    slot: &'static Slot,
}

/// Where a mapping lies, for a signal handler: it may neither wait nor allocate, so it finds them in a fixed place.
struct Slot {
    start: AtomicUsize,
    /// 0 where nothing is mapped.
    end: AtomicUsize,
    /// The last words of the process.
    words: AtomicPtr<String>,
    is_taken: AtomicUsize,
}

/// More maps than any program opens at once. What doesn't fit is read instead of mapped.
static SLOTS: [Slot; 64] = [const {
    Slot {
        start: AtomicUsize::new(0),
        end: AtomicUsize::new(0),
        words: AtomicPtr::new(std::ptr::null_mut()),
        is_taken: AtomicUsize::new(0),
    }
}; 64];

/// Who was asked before about bytes that can't be had.
static BEFORE: OnceLock<Option<SigAction>> = OnceLock::new();

impl Watched {
    /// Nothing if the process can't watch over another mapping.
    fn new(file: &File, path: &Path) -> Option<Self> {
        BEFORE.get_or_init(handle_lost_bytes).as_ref()?;
        let (file, then) = (file.try_clone().ok()?, file.metadata().ok()?);
        let bytes = map(&file)?;
        let take = |slot: &&Slot| {
            slot.is_taken.compare_exchange(0, 1, Ordering::AcqRel, Ordering::Relaxed).is_ok()
        };
        let slot = SLOTS.iter().find(take)?;
        let words = format!(
            "cannot read {}: it was shortened while it was in use, or its disk or network failed; put it back or make \
             it anew\n",
            path.display()
        );
        slot.words.store(Box::into_raw(Box::new(words)), Ordering::Release);
        slot.start.store(bytes.as_ptr() as usize, Ordering::Release);
        slot.end.store(bytes.as_ptr() as usize + bytes.len(), Ordering::Release);
        Some(Self { bytes, file, then, slot })
    }
}

impl Drop for Watched {
    #[expect(unsafe_code, reason = "the words were given away as a pointer")]
    fn drop(&mut self) {
        self.slot.end.store(0, Ordering::Release);
        let words = self.slot.words.swap(std::ptr::null_mut(), Ordering::AcqRel);
        // SAFETY: they were a box in `new`, nobody else takes them, and no thread reads the mapping any more, which
        // is the only time when the handler looks at them.
        drop(unsafe { Box::from_raw(words) });
        self.slot.is_taken.store(0, Ordering::Release);
    }
}

/// From now on [`on_lost_bytes`] is called instead of what was there, which is returned. Nothing if the system refuses.
#[expect(unsafe_code, reason = "the system tells of bytes that can't be had by a signal only")]
fn handle_lost_bytes() -> Option<SigAction> {
    let action = SigAction::new(
        SigHandler::SigAction(on_lost_bytes),
        SaFlags::SA_SIGINFO | SaFlags::SA_ONSTACK,
        SigSet::empty(),
    );
    // SAFETY: the handler reads atomics, writes, exits, and sets an action: all of that may be done in a signal handler.
    unsafe { sigaction(Signal::SIGBUS, &action) }.ok()
}

/// Says what has happened and ends the process: whoever reads a mapping can't go on without its bytes, and must not
/// go on with others.
#[expect(unsafe_code, reason = "a signal handler stands outside of what the compiler checks")]
extern "C" fn on_lost_bytes(_: libc::c_int, info: *mut libc::siginfo_t, _: *mut libc::c_void) {
    // SAFETY: the system calls this for SIGBUS only, with a `siginfo_t` that holds the address.
    let address = unsafe { (*info).si_addr() } as usize;
    let is_there = |slot: &&Slot| {
        slot.start.load(Ordering::Acquire) <= address && address < slot.end.load(Ordering::Acquire)
    };
    if let Some(slot) = SLOTS.iter().find(is_there) {
        // SAFETY: the words live as long as their mapping, in which a thread is just reading; the text is a live string.
        // `write` and `_exit` may be called here.
        unsafe {
            if let Some(words) = slot.words.load(Ordering::Acquire).as_ref() {
                libc::write(libc::STDERR_FILENO, words.as_ptr().cast(), words.len());
            }
            libc::_exit(1);
        }
    }
    // Not of ours. The instruction is tried again, and whoever was there before is asked.
    if let Some(Some(before)) = BEFORE.get() {
        // SAFETY: the action is the one that this handler took the place of.
        let _ = unsafe { sigaction(Signal::SIGBUS, before) };
    }
}

/// Reads to the end, but no further than a start that is wrong: some things that can be opened never end.
fn read(file: &mut impl Read, magic: &[u8]) -> io::Result<Option<Bytes>> {
    let mut blocks = vec![Block::zeroed(); 1024];
    let mut len = 0;
    loop {
        if len == blocks.len() * ALIGNMENT {
            blocks.resize(blocks.len() * 2, Block::zeroed());
        }
        match file.read(&mut bytemuck::cast_slice_mut(&mut blocks)[len..]) {
            Ok(0) => break,
            Ok(n) => len += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
        let start = &bytemuck::cast_slice::<_, u8>(&blocks)[..len.min(magic.len())];
        if !magic.starts_with(start) {
            return Ok(None);
        }
    }
    Ok((len >= magic.len()).then_some(Bytes::Read { blocks, len }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_what_is_there() {
        for len in [0, 1, 2, 3, 65_535, 65_536, 65_537, 300_000] {
            let content: Vec<u8> = (0..len).map(|i| i as u8).collect();
            let bytes = read(&mut &content[..], &[0, 1]).unwrap();
            if len < 2 {
                assert!(bytes.is_none());
            } else {
                let bytes = bytes.unwrap();
                assert_eq!(*bytes, content);
                assert_eq!(bytes.as_ptr() as usize % ALIGNMENT, 0);
            }
        }
    }

    #[test]
    fn a_wrong_start_ends_the_reading() {
        assert!(read(&mut io::repeat(7), b"\x07\x07\x08").unwrap().is_none());
        let path = Path::new("/dev/zero");
        if path.exists() {
            assert!(Bytes::open(path, b"#").unwrap().is_none());
        }
    }

    #[test]
    fn regular_files_are_mapped() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), b"#abc").unwrap();
        let bytes = Bytes::open(file.path(), b"#a").unwrap().unwrap();
        assert_eq!(format!("{bytes:?}"), "4 bytes, mapped");
        assert_eq!(*bytes, *b"#abc");
        assert!(Bytes::open(file.path(), b"#b").unwrap().is_none());
    }
}
