//! The program as its users meet it: command lines, files, messages, exit codes, pictures.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]
#![cfg(target_os = "linux")] // Full devices, small disks and limits are made in its ways.

mod adaptive;
mod bench;
mod caches;
mod degenerate;
mod diff;
mod endings;
mod faults;
mod gather;
mod maps;
mod memory;
mod mitsuba;
mod outputs;
mod parts;
mod pictures;
mod records;
mod resume;
mod supersample;
mod usage;
