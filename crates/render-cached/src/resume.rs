//! `--resume`: what was computed, chunk by chunk, in a journal.
//!
//! A run is a sequence of stages, each a list of items that follows from the stages before. So a chunk is known by the number
//! of its stage and its own, whatever the mode; and a run that finds chunks in its journal goes the way of the one that
//! computed them, to the bit, counts of work included.

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::Context;
use base::{Components, Fingerprint, Interrupted, Inventory, Rgb, Watch};
use cache_map::Reason;
use cli::{Console, Interrupt, Journal};
use rayon::prelude::*;
use shade::Counts;

use crate::frame::{CHUNK, join};
use crate::{Args, output};

/// What an interrupted run leaves undone.
pub(crate) const NOTHING_WRITTEN: &str = "no picture was written";

/// The journal of a picture, and the stage that it has come to.
pub(crate) struct Resume {
    journal: Arc<Journal>,
    stage: AtomicU32,
}

impl fmt::Debug for Resume {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Resume({:?})", self.stage)
    }
}

/// A value that a journal can hold.
pub(crate) trait Piece: Sized + Send {
    /// Adds its bytes.
    fn put(&self, out: &mut Vec<u8>);
    /// Takes it from the front of the bytes, if it is there.
    fn take(bytes: &mut &[u8]) -> Option<Self>;
}

impl Resume {
    /// Opens the journal beside the first output; an end of the program makes a last checkpoint.
    ///
    /// # Errors
    /// Those of [`Journal::open`].
    pub(crate) fn open(
        args: &Args,
        inputs: &Inventory,
        console: &Console,
        interrupt: &Interrupt,
    ) -> anyhow::Result<Self> {
        let mut settings = vec![("the program".into(), env!("CARGO_PKG_VERSION").into())];
        settings.extend(cli::settings_of(&output::command(args)));
        settings.extend(inputs.parts().map(|(name, digest)| (name.into(), digest.to_string())));
        // Whoever saves records always goes by the cache.
        let saves = args.paper.save_cache.is_some();
        settings.push(("--save-cache".into(), saves.to_string()));
        // No command in a picture tells of these: they change which pixels are computed, but none of them.
        settings.push(("--tile or --crop".into(), format!("{:?}", (args.tile, args.crop))));
        settings.push(("--from-layers".into(), args.paper.from_layers.is_some().to_string()));
        if let Some(path) = &args.paper.from_cache {
            settings.push(("the file of --from-cache".into(), digest_of_header(path)?.to_string()));
        }
        let output = args
            .output
            .first()
            .or(args.paper.save_cache.as_ref())
            .or(args.paper.save_layers.as_ref());
        let journal = Arc::new(Journal::open(
            output.map(|path| path.as_path()),
            args.journal,
            &args.common,
            &settings,
            *console,
        )?);
        let kept = Arc::clone(&journal);
        interrupt.at_end(move || kept.farewell(NOTHING_WRITTEN));
        Ok(Self { journal, stage: AtomicU32::new(0) })
    }

    /// `compute` of all items in chunks, in parallel, but for those chunks that the journal holds.
    pub(crate) fn chunks<I: Sync, T: Piece>(
        &self,
        items: &[I],
        watch: Watch<'_>,
        compute: impl Fn(&[I]) -> Result<(Vec<T>, Counts), Interrupted> + Sync,
    ) -> Result<(Vec<T>, Counts), Interrupted> {
        let stage = self.stage.fetch_add(1, Ordering::Relaxed);
        let chunks: Option<Vec<(Vec<T>, Counts)>> = items
            .par_chunks(CHUNK)
            .enumerate()
            .map(|(i, items)| {
                let index = i as u32;
                let found = self.journal.get(stage, index);
                if let Some(done) = found.and_then(|bytes| decode(&bytes, items.len())) {
                    return watch(items.len() as u64).then_some(done);
                }
                let done = compute(items).ok()?;
                self.journal.put(stage, index, &encode(&done));
                Some(done)
            })
            .collect();
        chunks.map(|chunks| join(chunks, items.len())).ok_or(Interrupted)
    }

    /// To be called when all outputs are written.
    pub(crate) fn done(&self) {
        self.journal.remove();
    }
}

/// More rays, or photons, than any chunk needs, and few enough that those of all chunks are a number.
const MOST_WORK: u64 = 1 << 40;

/// A digest of the text at the start of a map, which holds digests of the rest.
fn digest_of_header(path: &Path) -> anyhow::Result<Fingerprint> {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(1 << 16).read_to_end(&mut start));
    read.with_context(|| format!("cannot read {}", path.display()))?;
    let end = start.windows(2).position(|w| w == b"\n\n").unwrap_or(start.len());
    Ok(Fingerprint::of(&start[..end]))
}

fn encode<T: Piece>((values, counts): &(Vec<T>, Counts)) -> Vec<u8> {
    let Counts { eye_rays, specular_rays, shadow_rays, gather_rays, photons_visited, chains_cut } =
        *counts;
    let counts = [eye_rays, specular_rays, shadow_rays, gather_rays, photons_visited, chains_cut];
    let mut bytes: Vec<u8> = counts.into_iter().flat_map(u64::to_le_bytes).collect();
    values.iter().for_each(|value| value.put(&mut bytes));
    bytes
}

/// What [`encode`] was given, if that were `n` values. A journal may come from anywhere.
fn decode<T: Piece>(mut bytes: &[u8], n: usize) -> Option<(Vec<T>, Counts)> {
    let bytes = &mut bytes;
    let mut count = || Some(u64::from_le_bytes(take(bytes)?)).filter(|&n| n <= MOST_WORK);
    let counts = Counts {
        eye_rays: count()?,
        specular_rays: count()?,
        shadow_rays: count()?,
        gather_rays: count()?,
        photons_visited: count()?,
        chains_cut: count()?,
    };
    let values: Option<Vec<T>> = (0..n).map(|_| T::take(bytes)).collect();
    values.filter(|_| bytes.is_empty()).map(|values| (values, counts))
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(*first)
}

impl Piece for () {
    fn put(&self, _: &mut Vec<u8>) {}
    fn take(_: &mut &[u8]) -> Option<Self> {
        Some(())
    }
}

impl Piece for f32 {
    fn put(&self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        Some(Self::from_le_bytes(take(bytes)?))
    }
}

impl Piece for bool {
    fn put(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        let [byte] = take(bytes)?;
        (byte < 2).then_some(byte == 1)
    }
}

impl Piece for Reason {
    fn put(&self, out: &mut Vec<u8>) {
        out.push(*self as u8);
    }
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        let [byte] = take(bytes)?;
        Self::ALL.into_iter().find(|reason| *reason as u8 == byte)
    }
}

impl Piece for Rgb {
    fn put(&self, out: &mut Vec<u8>) {
        self.to_array().iter().for_each(|v| v.put(out));
    }
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        Some(Self::new(f32::take(bytes)?, f32::take(bytes)?, f32::take(bytes)?))
    }
}

impl<T: Piece> Piece for Components<T> {
    fn put(&self, out: &mut Vec<u8>) {
        [&self.direct, &self.indirect, &self.specular, &self.caustic]
            .iter()
            .for_each(|v| v.put(out));
    }
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        Some(Self {
            direct: T::take(bytes)?,
            indirect: T::take(bytes)?,
            specular: T::take(bytes)?,
            caustic: T::take(bytes)?,
        })
    }
}

impl<T: Piece> Piece for Option<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.is_some().put(out);
        self.iter().for_each(|value| value.put(out));
    }
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        if bool::take(bytes)? { T::take(bytes).map(Some) } else { Some(None) }
    }
}

impl<A: Piece, B: Piece> Piece for (A, B) {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        Some((A::take(bytes)?, B::take(bytes)?))
    }
}

impl<A: Piece, B: Piece, C: Piece> Piece for (A, B, C) {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
        self.2.put(out);
    }
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        Some((A::take(bytes)?, B::take(bytes)?, C::take(bytes)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_found_and_nothing_else_is_taken_for_it() {
        let values = vec![
            (Some((Components::from_fn(|_| Rgb::ONE), true)), Reason::Verification, 0.5_f32),
            (None, Reason::Lattice, -0.0),
        ];
        let counts = Counts { eye_rays: 1, chains_cut: 5, ..Counts::default() };
        let bytes = encode(&(values.clone(), counts));
        let found = decode::<(Option<(Components<Rgb>, bool)>, Reason, f32)>(&bytes, 2);
        let (found, of) = found.unwrap();
        assert_eq!((format!("{found:?}"), of), (format!("{values:?}"), counts));
        for n in [0, 1, 3, 1_000_000] {
            assert!(decode::<(Option<(Components<Rgb>, bool)>, Reason, f32)>(&bytes, n).is_none());
        }
        // More than a chunk can come to would overflow the sum.
        for i in 0..6 {
            let mut forged = bytes.clone();
            forged[8 * i + 7] = 1;
            assert!(decode::<(Option<(Components<Rgb>, bool)>, Reason, f32)>(&forged, 2).is_none());
        }
        for end in 0..bytes.len() {
            assert!(
                decode::<(Option<(Components<Rgb>, bool)>, Reason, f32)>(&bytes[..end], 2)
                    .is_none()
            );
        }
        assert!(
            decode::<f32>(&bytes, 2).is_none()
                && decode::<Reason>(&[&[0; 40][..], &[10]].concat(), 1).is_none()
        );
    }
}
