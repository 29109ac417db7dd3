//! How long work reports its progress and is stopped.

use std::fmt;

/// Told how many units of work have just been done, from any thread; answers whether to go on.
pub type Watch<'a> = &'a (dyn Fn(u64) -> bool + Sync);

/// The [`Watch`] asked for a stop; what was done is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

impl fmt::Display for Interrupted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("interrupted")
    }
}

impl std::error::Error for Interrupted {}
