//! Tests that cross crates.

mod architecture;
mod passes;
mod path_tracer;
mod scenes;
