//! Mode adaptive against mode original, on scenes that it wasn't made with.

mod bad_cases;
mod bench;
mod caustics;
mod cost;
mod honesty;
mod large;
mod lens;
mod lights;
mod materials;
mod rooms;
mod shadows;
mod subpixels;
