//! Photons against closed forms: what becomes of them, where they land, and how much flux they carry.

mod account;
mod aim;
mod caustics;
mod classes;
mod glass;
mod rough;
mod world;
