//! Tests that cross crates.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]
#![expect(clippy::print_stdout, reason = "with --nocapture, tests tell how far pictures are off")]

mod adaptive;
mod agreement;
mod architecture;
mod convergence;
mod edges;
mod formats;
mod furnace;
mod gathering;
mod passes;
mod path_tracer;
mod renderer;
mod scenes;
mod table;
mod textures;
mod transport;
