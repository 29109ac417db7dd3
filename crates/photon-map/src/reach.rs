//! Where photons can't be felt.

use glam::{UVec3, Vec3, Vec3A};

use crate::PhotonSet;

/// A grid of cells that tells for a point whether any photon may lie within a distance of it. Never wrong where it
/// says no: an estimate with that greatest radius is exactly 0 there.
#[derive(Clone, Debug)]
pub struct Reach {
    origin: Vec3,
    inverse_side: f32,
    size: UVec3,
    bits: Vec<u64>,
}

/// The most cells along an axis.
const MAX_CELLS: f32 = 160.0;

impl Reach {
    /// Marks all cells within `radius` of the photons, or of the boxes of their leaves.
    pub fn new(photons: &PhotonSet, radius: f32) -> Self {
        let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (low, high) in photons.leaf_boxes() {
            min = min.min(low - radius);
            max = max.max(high + radius);
        }
        if photons.is_empty() {
            return Self {
                origin: Vec3::ZERO,
                inverse_side: 0.0,
                size: UVec3::ZERO,
                bits: Vec::new(),
            };
        }
        let side = (0.5 * radius).max((max - min).max_element() / MAX_CELLS).max(f32::MIN_POSITIVE);
        let size = ((max - min) / side).ceil().as_uvec3().max(UVec3::ONE);
        let n_cells = size.element_product() as usize;
        let mut this = Self {
            origin: min,
            inverse_side: 1.0 / side,
            size,
            bits: vec![0; n_cells.div_ceil(64)],
        };
        // Leaves that straddle a gap are taken photon by photon.
        let boxes = photons.leaf_boxes().enumerate().flat_map(|(leaf, (low, high))| {
            let is_wide = (high - low).max_element() > 4.0 * radius;
            let alone = photons.positions_of_leaf(leaf).filter(move |_| is_wide).map(|p| (p, p));
            alone.chain((!is_wide).then_some((low, high)))
        });
        for (low, high) in boxes {
            // One more cell each way pays for rounding.
            let first = this.cell_below(low - radius).saturating_sub(UVec3::ONE);
            let last = (this.cell_below(high + radius) + UVec3::ONE).min(size - UVec3::ONE);
            for z in first.z..=last.z {
                for y in first.y..=last.y {
                    for x in first.x..=last.x {
                        let i = this.index(UVec3::new(x, y, z));
                        this.bits[i / 64] |= 1 << (i % 64);
                    }
                }
            }
        }
        this
    }

    fn cell_below(&self, point: Vec3) -> UVec3 {
        ((point - self.origin) * self.inverse_side).max(Vec3::ZERO).as_uvec3()
    }

    fn index(&self, cell: UVec3) -> usize {
        (cell.z as usize * self.size.y as usize + cell.y as usize) * self.size.x as usize
            + cell.x as usize
    }

    /// Whether a photon may lie within the distance.
    #[inline]
    pub fn may_reach(&self, point: Vec3A) -> bool {
        let relative = (Vec3::from(point) - self.origin) * self.inverse_side;
        if relative.cmplt(Vec3::ZERO).any() {
            return false;
        }
        let cell = relative.as_uvec3();
        if cell.cmpge(self.size).any() {
            return false;
        }
        let i = self.index(cell);
        self.bits[i / 64] >> (i % 64) & 1 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Gather, Kernel, Scratch};
    use base::{Photon, Rgb, Rng, Stream, encode_octahedral};

    #[test]
    fn where_it_says_no_the_estimate_is_zero() {
        let mut rng = Rng::new(0, Stream::Test, 0);
        // Three small clusters on a plane.
        let photons: Vec<Photon> = (0..3000)
            .map(|i| {
                let center = Vec3::new((i % 3) as f32 * 2.0, (i % 2) as f32 * 3.0, 0.0);
                let offset = Vec3::new(rng.next_f32(), rng.next_f32() * 0.2, 0.0);
                Photon {
                    position: center + offset,
                    normal: encode_octahedral(Vec3A::Z),
                    flux: Rgb::ONE,
                }
            })
            .collect();
        let set = PhotonSet::build(&photons);
        let gather = Gather { k: 20, max_radius: 0.1, kernel: Kernel::Box };
        let reach = Reach::new(&set, gather.max_radius);
        let (mut n_dark, mut n_lit) = (0, 0);
        for _ in 0..100_000 {
            let point = Vec3A::new(rng.next_f32() * 7.0 - 1.0, rng.next_f32() * 5.0 - 1.0, 0.0);
            let estimate = set.irradiance(point, Vec3A::Z, &gather, None, &mut Scratch::default());
            if reach.may_reach(point) {
                n_lit += 1;
            } else {
                n_dark += 1;
                assert!(estimate.irradiance.is_black(), "photons reach {point}");
            }
        }
        assert!(n_dark > 5 * n_lit && n_lit > 1000, "{n_dark} dark, {n_lit} lit");
        assert!(!Reach::new(&PhotonSet::build(&[]), 1.0).may_reach(Vec3A::ZERO));
    }
}
