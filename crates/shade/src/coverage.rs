//! Near its edges a surface fills only a part of the disc from which an estimate takes its photons.
//!
//! Beyond the edge no photon could land, so the estimate lacks what the kernel has there: a half at an edge, three
//! quarters in a corner. Dividing by the part of the kernel that lies on the surface makes up for it (the simplest of the
//! boundary corrections of Silverman 1986, section 2.10). That part is known exactly for flat surfaces: each crease hides
//! a sector of the disc from its center. Creases of neighbors in the same plane hide negative sectors, so that what
//! several meshes tile comes out whole, and the bottom of a box that stands on a floor hides what it covers. Where the
//! surface goes on at an angle, the photons beyond count as long as the line to them is flat enough.
//!
//! A sheet that floats closely in front, as a rug, a lamp or a mirror, covers what it hides. Photons that fall on it, or on the surface
//! that it floats over, belong to another sheet, though the line to them is flat enough from some distance on: where two
//! sheets are seen, those count alone that lie nearer to that of the point.
//!
//! Surfaces that cut through each other away from their edges aren't seen, and neither are spheres.

use geometry::{Crease, Surface};
use photon_map::{Estimate, Gather, Kernel, PhotonSet};

use crate::{Shader, Work};

/// A crease belongs to the surface around a point if its normal is within this cosine, ...
const MIN_COS_NORMALS: f32 = 0.9;

/// ... and if the line to it rises by less than this sine: as for photons.
const MAX_SINE_HEIGHT: f32 = 0.25;

/// What is nearer than so much of the radius is one sheet.
const LEAST_HEIGHT: f32 = 1.0 / 256.0;

/// Where the surface around a point goes on at another height, its normal turns by twice the sine to that place. A sheet of its own
/// turns by less than so much of it.
const MAX_TURN: f32 = 0.25;

/// Less of the kernel can't lie on the surface. In the corner of a cube it is a quarter; only needles have less, and
/// little light is lost if theirs is not made up for in full.
const LEAST: f32 = 0.1;

/// Where so many creases lie within a kernel there is no surface to speak of, and looking at all would take longer than
/// the estimate.
const MAX_CREASES: u32 = 512;

/// What the creases around a point tell of its surface.
#[derive(Clone, Copy, Debug)]
struct Around {
    /// The part of a kernel that lies on it, in (0, 1].
    coverage: f32,
    /// Photons higher above it, or lower below, lie on another sheet; infinite where there is none.
    height: f32,
}

impl Shader<'_> {
    /// Irradiance from photons around a point, made up for what is lacking near the edges of its surface.
    pub(crate) fn estimate(
        &self,
        photons: &PhotonSet,
        surface: &Surface,
        gather: &Gather,
        guess: Option<f32>,
        work: &mut Work,
    ) -> Estimate {
        // The true normal: photons of this surface lie in its plane, however it is shaded.
        let Surface { position, geometric_normal: normal, .. } = *surface;
        self.made_up(surface, gather.kernel, |height| {
            let scratch = &mut work.scratch;
            let found =
                photons.irradiance_of_sheet(position, normal, height, gather, guess, scratch);
            work.counts.photons_visited += found.visited as u64;
            found
        })
    }

    /// Makes up for what an estimate lacks near the edges of its surface. It is told how high photons may lie.
    pub(crate) fn made_up(
        &self,
        surface: &Surface,
        kernel: Kernel,
        mut estimate: impl FnMut(f32) -> Estimate,
    ) -> Estimate {
        let mut height = f32::INFINITY;
        loop {
            let found = estimate(height);
            if found.irradiance.is_black() {
                return found;
            }
            let around = self.around(surface, found.radius, kernel, height);
            if height.is_finite() || around.height.is_infinite() {
                return Estimate { irradiance: found.irradiance / around.coverage, ..found };
            }
            height = around.height;
        }
    }

    /// What lies around a point, as far as a kernel reaches. What rises by less than `height` belongs to its surface.
    fn around(&self, surface: &Surface, radius: f32, kernel: Kernel, height: f32) -> Around {
        // By which side the triangles show: that of the point, or the other.
        let (mut hidden, mut hidden_behind) = (0.0, 0.0);
        // The same of sheets in front.
        let (mut covered, mut covered_behind) = (0.0, 0.0);
        let mut cover = |seen: &Seen| {
            // One that floats higher shades less closely.
            let closeness = (2.0 - 2.0 * seen.rise / (MAX_SINE_HEIGHT * radius)).min(1.0);
            if seen.rise > 0.0 {
                *(if seen.cos > 0.0 { &mut covered } else { &mut covered_behind }) +=
                    seen.part * closeness;
            }
        };
        let mut next_sheet = f32::INFINITY;
        let mut n_creases = 0;
        self.scene.creases.near(surface.position, radius, |crease| {
            n_creases += 1;
            let Some(seen) = see(crease, surface, radius, kernel) else {
                return n_creases < MAX_CREASES;
            };
            let Seen { part, cos, rise, distance, is_sheet } = seen;
            if is_sheet {
                if distance < radius {
                    next_sheet = rise.abs().min(next_sheet);
                }
                cover(&seen);
            } else if rise.abs() <= (MAX_SINE_HEIGHT * distance).min(height) + slack(surface) {
                *(if cos > 0.0 { &mut hidden } else { &mut hidden_behind }) += part;
            }
            n_creases < MAX_CREASES
        });
        self.scene.screens.near(surface.position, radius, |crease| {
            n_creases += 1;
            if let Some(seen) = see(crease, surface, radius, kernel).filter(|seen| seen.is_sheet) {
                cover(&seen);
            }
            n_creases < MAX_CREASES
        });
        if n_creases >= MAX_CREASES {
            return Around { coverage: 1.0, height: f32::INFINITY };
        }
        // A sheet may be seen from behind: then its own triangles, which hold the point and hide a positive part, are
        // those with the other side. What else shows the other side and doesn't hold the point lies on the surface and
        // covers it. (What shows the same side covers it as well, but has photons in place of those it hides.)
        let (own, others) = match hidden_behind > hidden.max(0.0) {
            true => (hidden_behind, hidden),
            false => (hidden, hidden_behind),
        };
        // Both sides of a box cover the same.
        let covering = (others.min(0.0) + covered_behind).min(covered).min(0.0);
        Around { coverage: (1.0 - own + covering).clamp(LEAST, 1.0), height: 0.5 * next_sheet }
    }
}

/// A crease, as a point sees it whose surface goes about the same way.
struct Seen {
    /// What of the kernel lies beyond it; negative if the point does, too.
    part: f32,
    /// Between the normals.
    cos: f32,
    /// Of its nearest place, above the surface.
    rise: f32,
    /// Of the same.
    distance: f32,
    /// Whether it ends a sheet of its own.
    is_sheet: bool,
}

/// Where the point itself lies on an edge, its distances are rounding errors below this.
fn slack(surface: &Surface) -> f32 {
    4.0 * surface.error
}

/// Nothing if the crease belongs to a surface that goes another way, or if its line is too far off.
#[inline]
fn see(crease: &Crease, surface: &Surface, radius: f32, kernel: Kernel) -> Option<Seen> {
    let cos = crease.normal.dot(surface.geometric_normal);
    let from = crease.from - surface.position;
    let h = -from.dot(crease.inward);
    if cos.abs() <= MIN_COS_NORMALS || h.abs() >= radius {
        return None;
    }
    let edge = crease.to - crease.from;
    let length = edge.length();
    let along = edge / length;
    let start = from.dot(along);
    let nearest = from + along * (-start).clamp(0.0, length);
    let (rise, distance) = (nearest.dot(surface.geometric_normal), nearest.length());
    // Beyond a line at distance s on a surface that turns away, photons up to distance t rise by less than the
    // limit if (t - s) * turn < limit * t: as if the line were farther away.
    let scale = 1.0 / radius / (1.0 - MAX_SINE_HEIGHT / crease.turn);
    let part = kernel.hidden(h.abs() * scale, start * scale, (start + length) * scale);
    let part = if h >= -slack(surface) { part } else { -part };
    let sine_of_turn = crease.normal.cross(surface.geometric_normal).length();
    let is_sheet = rise.abs() > LEAST_HEIGHT * radius
        && rise.abs() < MAX_SINE_HEIGHT * radius
        && crease.turn.is_infinite()
        && sine_of_turn * distance < MAX_TURN * rise.abs();
    Some(Seen { part, cos, rise, distance, is_sheet })
}
