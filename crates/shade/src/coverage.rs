//! Near its edges a surface fills only a part of the disc from which an estimate takes its photons.
//!
//! Beyond the edge no photon could land, so the estimate lacks what the kernel has there: a half at an edge, three
//! quarters in a corner. Dividing by the part of the kernel that lies on the surface makes up for it (the simplest of the
//! boundary corrections of Silverman 1986, section 2.10). That part is known exactly for flat surfaces: each crease hides
//! a sector of the disc from its center. Creases of neighbors in the same plane hide negative sectors, so that what
//! several meshes tile comes out whole, and the bottom of a box that stands on a floor hides what it covers. Where the
//! surface goes on at an angle, the photons beyond count as long as the line to them is flat enough.
//!
//! Surfaces that cut through each other away from their edges aren't seen, and neither are spheres.

use geometry::Surface;
use photon_map::{Estimate, Kernel};

use crate::Shader;

/// A crease belongs to the surface around a point if its normal is within this cosine, ...
const MIN_COS_NORMALS: f32 = 0.9;

/// ... and if the line to it rises by less than this sine: as for photons.
const MAX_SINE_HEIGHT: f32 = 0.25;

/// Less of the kernel can't lie on the surface. In the corner of a cube it is a quarter; only needles have less, and
/// little light is lost if theirs is not made up for in full.
const LEAST: f32 = 0.1;

/// Where so many creases lie within a kernel there is no surface to speak of, and looking at all would take longer than
/// the estimate.
const MAX_CREASES: u32 = 512;

impl Shader<'_> {
    /// Makes up for what an estimate lacks near the edges of its surface.
    pub(crate) fn made_up(
        &self,
        estimate: Estimate,
        surface: &Surface,
        kernel: Kernel,
    ) -> Estimate {
        if estimate.irradiance.is_black() {
            return estimate;
        }
        let coverage = self.coverage(surface, estimate.radius, kernel);
        Estimate { irradiance: estimate.irradiance / coverage, ..estimate }
    }

    /// The part of a kernel around a point that lies on its surface, in (0, 1].
    fn coverage(&self, surface: &Surface, radius: f32, kernel: Kernel) -> f32 {
        let scale = 1.0 / radius;
        // By which side the triangles show: that of the point, or the other.
        let (mut hidden, mut hidden_behind) = (0.0, 0.0);
        let mut n_creases = 0;
        self.scene.creases.near(surface.position, radius, |crease| {
            n_creases += 1;
            let cos = crease.normal.dot(surface.geometric_normal);
            let from = crease.from - surface.position;
            let h = -from.dot(crease.inward);
            if cos.abs() <= MIN_COS_NORMALS || h.abs() >= radius {
                return n_creases < MAX_CREASES;
            }
            let edge = crease.to - crease.from;
            let length = edge.length();
            let along = edge / length;
            let start = from.dot(along);
            let nearest = from + along * (-start).clamp(0.0, length);
            let height = nearest.dot(surface.geometric_normal);
            // Where the point itself lies on the edge, both are rounding errors.
            let slack = 4.0 * surface.error;
            if height.abs() <= MAX_SINE_HEIGHT * nearest.length() + slack {
                // Beyond a line at distance s on a surface that turns away, photons up to distance t rise by less than the
                // limit if (t - s) * turn < limit * t: as if the line were farther away.
                let scale = scale / (1.0 - MAX_SINE_HEIGHT / crease.turn);
                let part = kernel.hidden(h.abs() * scale, start * scale, (start + length) * scale);
                let part = if h >= -slack { part } else { -part };
                *(if cos > 0.0 { &mut hidden } else { &mut hidden_behind }) += part;
            }
            n_creases < MAX_CREASES
        });
        if n_creases >= MAX_CREASES {
            return 1.0;
        }
        // A sheet may be seen from behind: then its own triangles, which hold the point and hide a positive part, are
        // those with the other side. What else shows the other side and doesn't hold the point lies on the surface and
        // covers it. (What shows the same side covers it as well, but has photons in place of those it hides.)
        let (own, others) = match hidden_behind > hidden.max(0.0) {
            true => (hidden_behind, hidden),
            false => (hidden, hidden_behind),
        };
        (1.0 - own + others.min(0.0)).clamp(LEAST, 1.0)
    }
}
