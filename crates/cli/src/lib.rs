//! What the programs share: how they are told things, how they say things, and how they end.

mod clock;
mod command;
mod console;
mod count;
mod ending;
mod interrupt;
mod journal;
mod memory;
mod options;
mod outputs;
mod stats;

pub use clock::{Clock, Seconds, peak_rss_bytes};
pub use command::command_line;
pub use console::Console;
pub use count::parse_count;
pub use ending::{WrongUsage, run};
pub use interrupt::Interrupt;
pub use journal::{Journal, JournalOptions, settings_of};
pub use memory::{MemoryOptions, Need, predict_memory, reuse_freed_memory};
pub use options::{Common, SceneOptions, Verbosity};
pub use outputs::check_outputs;
pub use stats::write_stats;
