//! Rays against surfaces: exact where double precision is, closed where surfaces are, at any size and place.

mod brute_force;
mod leaving;
mod shapes;
mod special_cases;
mod texture_coordinates;
mod watertight;
