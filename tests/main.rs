//! Tests that cross crates.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

mod architecture;
mod passes;
mod path_tracer;
mod scenes;
