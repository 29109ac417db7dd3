//! Tests that cross crates.

mod architecture;
mod path_tracer;
mod scenes;
