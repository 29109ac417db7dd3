//! Tests that cross crates.

mod path_tracer;
mod scenes;
