//! Photons aimed at specular surfaces: the projection map of Jensen 1996, section 4.1.
//!
//! A photon's start is four uniform numbers, whatever the light. The cube of these numbers is divided into cells, a few
//! rays through each tell which lead to mirrors, metals or glass first, and *aimed* photons start in such cells only. They
//! tell of caustics and end where they are scattered diffusely. Nothing is lost or counted twice: a cell that no ray has
//! shown is served by the other photons, and where both start, caustic photons of either carry the flux of the cell
//! over the number of both that start there in the mean.

use base::{OwenSobol, Ray, Stream, hash_u64};
use rayon::prelude::*;
use scene::{Light, LightKind, Scene};

/// Rays that look into each cell.
const RAYS_A_CELL: u64 = 4;

/// Rays that one task traces.
const BATCH: u64 = 4096;

/// Where photons of a light start that meet a specular surface first.
#[derive(Debug)]
pub(crate) struct Aim {
    /// Into how many parts each of the four numbers is divided.
    sides: [u32; 4],
    /// The cells that lead to specular surfaces, rising.
    cells: Vec<u32>,
}

impl Aim {
    /// Looks for specular surfaces with at most so many rays; `None` where there are none, or so many that aiming gains
    /// nothing.
    pub(crate) fn find(scene: &Scene, light: &Light, seed: u64, rays: u64) -> Option<Self> {
        if !scene.materials.iter().any(scene::Material::is_specular) {
            return None;
        }
        let sides = sides(&light.kind, rays)?;
        let points = OwenSobol::new(hash_u64(seed, Stream::Aim as u64));
        let n_cells = n_cells(sides);
        let found = (0..(n_cells * RAYS_A_CELL).div_ceil(BATCH)).into_par_iter().map(|batch| {
            let start = batch * BATCH;
            let rays = start..(start + BATCH).min(n_cells * RAYS_A_CELL);
            let starts = rays.map(|i| points.point::<4>(i));
            starts.filter(|u| meets_specular(scene, light, *u, seed)).collect::<Vec<_>>()
        });
        let found: Vec<Vec<[f32; 4]>> = found.collect();
        let mut cells = Vec::new();
        for u in found.into_iter().flatten() {
            let cell = parts(sides, u);
            cells.push(number(sides, cell));
            // What lies at the edge of a cell is easily missed, and would be left to photons of much more flux.
            for dimension in 0..4 {
                for neighbor in [cell[dimension].checked_sub(1), Some(cell[dimension] + 1)] {
                    if let Some(part) = neighbor.filter(|&part| part < sides[dimension]) {
                        let mut beside = cell;
                        beside[dimension] = part;
                        cells.push(number(sides, beside));
                    }
                }
            }
        }
        cells.sort_unstable();
        cells.dedup();
        let gains = !cells.is_empty() && cells.len() as u64 * 2 < n_cells;
        gains.then_some(Self { sides, cells })
    }

    /// The share of all starts that lies in the cells.
    pub(crate) fn share(&self) -> f32 {
        self.cells.len() as f32 / n_cells(self.sides) as f32
    }

    /// Whether a start lies in one of the cells.
    pub(crate) fn holds(&self, u: [f32; 4]) -> bool {
        self.cells.binary_search(&number(self.sides, parts(self.sides, u))).is_ok()
    }

    /// A start in one of the cells, from five uniform numbers.
    pub(crate) fn start(&self, [choice, u @ ..]: [f32; 5]) -> [f32; 4] {
        let chosen = (choice * self.cells.len() as f32) as usize;
        let mut rest = self.cells[chosen.min(self.cells.len() - 1)];
        std::array::from_fn(|dimension| {
            let side = self.sides[dimension];
            let part = rest % side;
            rest /= side;
            // Rounding must not lead into the next part.
            ((part as f32 + u[dimension]) / side as f32)
                .min(((part + 1) as f32 / side as f32).next_down())
        })
    }
}

/// How the start of a light's photons is divided, coarser if there are few rays; `None` if there are too few.
fn sides(kind: &LightKind, rays: u64) -> Option<[u32; 4]> {
    let mut sides = match kind {
        // Place, then direction.
        LightKind::Area(_) | LightKind::Sphere(_) => [4, 4, 16, 16],
        LightKind::Environment { .. } | LightKind::EnvironmentMap(_) => [8, 8, 8, 8],
        // The direction, or the place on a disc.
        LightKind::Point { .. } | LightKind::Spot(_) | LightKind::Directional { .. } => {
            [64, 64, 1, 1]
        }
    };
    while n_cells(sides) * RAYS_A_CELL > rays {
        sides = sides.map(|side| (side / 2).max(1));
    }
    (n_cells(sides) > 1).then_some(sides)
}

fn n_cells(sides: [u32; 4]) -> u64 {
    sides.into_iter().map(u64::from).product()
}

fn parts(sides: [u32; 4], u: [f32; 4]) -> [u32; 4] {
    std::array::from_fn(|d| ((u[d] * sides[d] as f32) as u32).min(sides[d] - 1))
}

fn number(sides: [u32; 4], parts: [u32; 4]) -> u32 {
    sides.into_iter().zip(parts).rev().fold(0, |number, (side, part)| number * side + part)
}

fn meets_specular(scene: &Scene, light: &Light, u: [f32; 4], seed: u64) -> bool {
    let start = light.emit(&scene.bounds(), u);
    let ray = Ray::unbounded(start.origin, start.dir);
    scene.arrive(&ray, seed).is_some_and(|(surface, _)| scene.material(&surface).is_specular())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_lie_in_the_cells_and_fill_them_evenly() {
        let aim = Aim { sides: [4, 4, 16, 16], cells: vec![0, 7, 300, 301, 4095] };
        let points = OwenSobol::new(5);
        let (mut counts, n) = (std::collections::BTreeMap::new(), 50_000_u32);
        for i in 0..u64::from(n) {
            let u = aim.start(points.point::<5>(i));
            assert!(aim.holds(u), "{u:?}");
            *counts.entry(number(aim.sides, parts(aim.sides, u))).or_insert(0_u32) += 1;
        }
        assert_eq!(counts.keys().copied().collect::<Vec<_>>(), aim.cells);
        assert!(counts.values().all(|&c| c.abs_diff(n / 5) < n / 500), "{counts:?}");
        assert!(aim.start([1.0 - f32::EPSILON; 5]).iter().all(|&u| u < 1.0));
        assert!((aim.share() - 5.0 / 4096.0).abs() < 1e-9);
    }
}
