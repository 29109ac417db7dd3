//! Seconds on the wall and in the processor.

use std::ops::AddAssign;
use std::time::Instant;

use nix::sys::resource::{Usage, UsageWho, getrusage};

/// Time taken by a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    /// By the clock on the wall.
    pub wall: f64,
    /// By all threads of the process together.
    pub cpu: f64,
}

impl AddAssign for Seconds {
    fn add_assign(&mut self, o: Self) {
        self.wall += o.wall;
        self.cpu += o.cpu;
    }
}

/// Measures stages that follow one another.
#[derive(Debug)]
pub struct Clock {
    start: (Instant, f64),
    lap: (Instant, f64),
}

impl Clock {
    /// Starts now; what the process did before counts for [`Clock::total`] in CPU seconds.
    pub fn start() -> Self {
        let now = (Instant::now(), cpu_seconds());
        Self { start: (now.0, 0.0), lap: now }
    }

    /// Time since the last lap, or since the start.
    pub fn lap(&mut self) -> Seconds {
        let now = (Instant::now(), cpu_seconds());
        let seconds = since(self.lap, now);
        self.lap = now;
        seconds
    }

    /// Time since the start.
    pub fn total(&self) -> Seconds {
        since(self.start, (Instant::now(), cpu_seconds()))
    }
}

fn since(then: (Instant, f64), now: (Instant, f64)) -> Seconds {
    Seconds { wall: (now.0 - then.0).as_secs_f64(), cpu: now.1 - then.1 }
}

fn usage() -> Option<Usage> {
    getrusage(UsageWho::RUSAGE_SELF).ok()
}

fn cpu_seconds() -> f64 {
    usage().map_or(0.0, |u| {
        let seconds = |t: nix::sys::time::TimeVal| t.tv_sec() as f64 + t.tv_usec() as f64 * 1e-6;
        seconds(u.user_time()) + seconds(u.system_time())
    })
}

/// The most memory that the process has held, mapped files included.
pub fn peak_rss_bytes() -> u64 {
    let unit = if cfg!(target_os = "macos") { 1 } else { 1024 };
    usage().map_or(0, |u| u.max_rss().unsigned_abs() * unit)
}
