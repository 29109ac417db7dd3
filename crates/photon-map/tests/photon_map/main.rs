//! Trees, estimates and files of photons against slow and independent ways to the same numbers.

mod estimates;
mod fields;
mod files;
mod neighbors;
mod storage;
mod surfaces;
