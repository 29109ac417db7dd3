//! glTF: both containers, every feature that is taken, every message.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

mod faults;
mod file;
mod materials;
mod shapes;
