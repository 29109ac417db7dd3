//! The program as its users meet it: command lines, files, messages, exit codes.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]
#![cfg(target_os = "linux")] // Full devices, small disks and limits are made in its ways.

mod bench;
mod damage;
mod endings;
mod maps;
mod memory;
mod outputs;
mod resume;
mod shards;
mod usage;
