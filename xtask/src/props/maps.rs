//! What is around the scenes: a hazy sky with a low sun, and the lamps of a studio.

use base::{Rgb, math};
use glam::Vec3A;

/// Towards the sun.
const SUN: Vec3A = Vec3A::new(-0.74, 0.6, 0.3);

/// Half of what the sun spans, in degrees. It is wider than ours (0.27), so that a path tracer, too, meets it by chance.
const SUN_RADIUS: f32 = 4.0;

/// A sky above brown land.
pub(super) fn sky(dir: Vec3A) -> Rgb {
    let (zenith, horizon) = (Rgb::new(0.22, 0.42, 0.85), Rgb::new(0.9, 0.95, 1.0));
    if dir.y < 0.0 {
        return Rgb::new(0.2, 0.17, 0.13);
    }
    let sun = SUN.normalize();
    if math::acos(dir.dot(sun).min(1.0)) < SUN_RADIUS.to_radians() {
        return Rgb::new(590.0, 490.0, 370.0);
    }
    let up = 1.0 - math::pow(1.0 - dir.y, 3.0);
    // Haze brightens the sky around the sun.
    let glow = 1.5 * math::pow(dir.dot(sun).max(0.0), 40.0);
    horizon * (1.0 - up) + zenith * up + Rgb::new(1.0, 0.9, 0.7) * glow
}

/// A lamp of a studio: a soft box that looks at the origin.
struct Box {
    /// From the origin to its middle.
    toward: Vec3A,
    /// Half its width and height, as seen from the origin at distance 1.
    half: [f32; 2],
    radiance: Rgb,
}

/// Lamps in a room of dark gray.
pub(super) fn studio(dir: Vec3A) -> Rgb {
    let boxes = [
        Box {
            toward: Vec3A::new(0.2, 1.0, 0.25),
            half: [0.7, 0.45],
            radiance: Rgb::new(5.0, 5.0, 5.2),
        },
        Box {
            toward: Vec3A::new(-1.0, 0.45, 0.35),
            half: [0.16, 0.7],
            radiance: Rgb::new(7.0, 8.0, 10.0),
        },
        Box {
            toward: Vec3A::new(0.9, 0.35, -0.6),
            half: [0.3, 0.3],
            radiance: Rgb::new(16.0, 11.0, 6.5),
        },
    ];
    let mut radiance = Rgb::splat(0.06 + 0.05 * (1.0 + dir.y));
    for Box { toward, half, radiance: own } in boxes {
        let forward = toward.normalize();
        let right = forward.cross(Vec3A::Y).normalize();
        let up = right.cross(forward);
        let depth = dir.dot(forward);
        if depth <= 0.0 {
            continue;
        }
        // Bright in the middle, with soft rims.
        let inside = |x: f32, half: f32| ((half - x.abs() / depth) / (0.25 * half)).clamp(0.0, 1.0);
        radiance += own * (inside(dir.dot(right), half[0]) * inside(dir.dot(up), half[1]));
    }
    radiance
}
