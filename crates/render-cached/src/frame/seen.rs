//! What is kept of what the eye rays meet.

use std::num::NonZeroU32;
use std::sync::Arc;

use base::{Grid, Pixel};
use geometry::{MaterialId, Surface};
use glam::Vec3;

use super::NOTHING;

/// The first surface of each pixel.
#[derive(Debug)]
pub(super) enum Surfaces {
    Kept(Arc<Grid<Option<Seen>>>),
    /// Of most only the triangle or sphere, or [`NOTHING`]: of a pixel that others tell of little else is asked, and where its
    /// ray meets that is found anew. This is a twelfth of the memory.
    Named {
        primitives: Grid<u32>,
        /// All of every so many pixels, both ways, from the first on.
        some: Option<(u32, Arc<Grid<Option<Seen>>>)>,
    },
}

impl Surfaces {
    pub(super) fn kept(surfaces: Grid<Option<Seen>>) -> Self {
        Self::Kept(Arc::new(surfaces))
    }

    /// All of what a pixel shows, if it is kept.
    #[inline]
    pub(super) fn seen(&self, pixel: Pixel) -> Result<Option<Surface>, u32> {
        let surface = |seen: &Option<Seen>| seen.as_ref().map(Seen::surface);
        match self {
            Self::Kept(surfaces) => Ok(surface(&surfaces[pixel])),
            Self::Named { primitives, some } => {
                let Pixel { x, y } = pixel;
                match some {
                    Some((n, surfaces)) if x % n == 0 && y % n == 0 => {
                        Ok(surface(&surfaces[Pixel { x: x / n, y: y / n }]))
                    }
                    _ => Err(primitives[pixel]),
                }
            }
        }
    }
}

/// What is kept of the first surface of a pixel.
pub(super) trait Sight: Copy + Send + Sync {
    const NOTHING: Self;
    fn new(surface: &Surface) -> Self;
    fn primitive(self) -> u32;
    /// All of it, if the primitive is enough.
    fn by_primitive(primitive: u32) -> Option<Self>;
}

impl Sight for Option<Seen> {
    const NOTHING: Self = None;
    fn new(surface: &Surface) -> Self {
        Some(Seen::new(surface))
    }
    #[inline]
    fn primitive(self) -> u32 {
        self.map_or(NOTHING, |seen| seen.primitive)
    }
    fn by_primitive(_: u32) -> Option<Self> {
        None
    }
}

impl Sight for u32 {
    const NOTHING: Self = NOTHING;
    fn new(surface: &Surface) -> Self {
        surface.primitive
    }
    fn primitive(self) -> u32 {
        self
    }
    fn by_primitive(primitive: u32) -> Option<Self> {
        Some(primitive)
    }
}

/// A surface as it is kept for each pixel: 52 bytes instead of the 80 of an `Option<Surface>`, and the same to the bit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    position: Vec3,
    geometric_normal: Vec3,
    shading_normal: Vec3,
    /// One more than its number, so that there is a value for nothing.
    object: NonZeroU32,
    primitive: u32,
    error: f32,
    pub(super) material: MaterialId,
}

impl Seen {
    pub(super) fn new(surface: &Surface) -> Self {
        let &Surface { position, geometric_normal, shading_normal, material, .. } = surface;
        let &Surface { object, primitive, error, .. } = surface;
        Self {
            position: position.into(),
            geometric_normal: geometric_normal.into(),
            shading_normal: shading_normal.into(),
            object: NonZeroU32::MIN.saturating_add(object),
            primitive,
            error,
            material,
        }
    }

    #[inline]
    pub(super) fn surface(&self) -> Surface {
        Surface {
            position: self.position.into(),
            geometric_normal: self.geometric_normal.into(),
            shading_normal: self.shading_normal.into(),
            material: self.material,
            object: self.object.get() - 1,
            primitive: self.primitive,
            error: self.error,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3A;

    #[test]
    fn what_is_kept_of_a_surface_is_all_of_it() {
        assert_eq!(size_of::<Option<Seen>>(), 52);
        for (object, material) in [(0, 0), (7, 3), (u32::MAX - 1, u16::MAX)] {
            let surface = Surface {
                position: Vec3A::new(1.0, -0.0, f32::MIN_POSITIVE),
                geometric_normal: Vec3A::X,
                shading_normal: Vec3A::new(0.6, 0.8, 0.0),
                material: MaterialId(material),
                object,
                primitive: u32::MAX,
                error: 1e-30,
            };
            assert_eq!(format!("{:?}", Seen::new(&surface).surface()), format!("{surface:?}"));
        }
    }
}
