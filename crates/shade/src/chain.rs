//! Specular chains: from the eye through mirrors and glass to surfaces that aren't.

use base::{Ray, Rgb, Rng, Stream, hash_u64};
use geometry::Surface;
use scene::{Material, Transport};

use crate::{PixelStream, Shader, ShadingPoint, Work};

/// Branches that carry less than this are followed by chance, with their weight raised in return. A ray costs little, and
/// one that finds a lamp by chance is a bright dot: so this is small.
const FOLLOW_ALWAYS: f32 = 0.001;

/// Diffuse surfaces of which less than this is seen are shaded by chance, likewise. Shading costs as much as a hundred
/// rays, and diffuse surfaces are never as bright as lamps.
const SHADE_ALWAYS: f32 = 0.02;

/// The longest chain. Only surfaces that lose nothing make such; they are counted.
const MAX_LENGTH: u32 = 128;

/// A place where a chain arrives.
#[derive(Clone, Copy, Debug)]
pub struct ChainLeaf<'a> {
    /// The surface, or nothing where the chain left the scene.
    pub point: Option<ShadingPoint<'a>>,
    /// What is left on the way to the eye of radiance that is emitted here, or comes from beyond the scene.
    pub weight: Rgb,
    /// The same for diffusely scattered radiance, if it is to be computed: this isn't always so where little is left.
    pub diffuse_weight: Option<Rgb>,
    /// The stream for shading it.
    pub stream: PixelStream,
    /// A digest of the reflections and transmissions on the way. Of the leaves of a pixel no two share it.
    pub path: u64,
}

/// A ray yet to be followed.
struct Branch<'a> {
    ray: Ray,
    weight: Rgb,
    medium: Option<&'a Material>,
    length: u32,
    path: u64,
}

impl<'a> Shader<'a> {
    /// Follows everything that the specular part of a surface shows, and calls `arrive` for each place, mirrors
    /// included: they may emit or be diffuse as well.
    pub fn chain(
        &self,
        at: &ShadingPoint<'a>,
        stream: PixelStream,
        work: &mut Work,
        mut arrive: impl FnMut(ChainLeaf<'a>, &mut Work),
    ) {
        let mut rng = Rng::new(self.settings.seed, Stream::Chain, stream.0);
        let mut branches = Vec::new();
        let mut n_leaves = 0;
        let eye = Origin { weight: Rgb::ONE, medium: None, length: 0, path: 0 };
        scatter(at, eye, &mut rng, &mut branches);
        while let Some(branch) = branches.pop() {
            work.counts.specular_rays += 1;
            n_leaves += 1;
            let stream = stream.part(n_leaves);
            let Some((point, distance)) = self.arrive(&branch.ray) else {
                let Branch { weight, path, .. } = branch;
                let leaf = ChainLeaf { point: None, weight, diffuse_weight: None, stream, path };
                arrive(leaf, work);
                continue;
            };
            let inside = is_inside(&point.surface, &point);
            let through = if inside && point.material.is_glass() {
                Some(point.material)
            } else {
                branch.medium
            };
            let weight =
                branch.weight * through.map_or(Rgb::ONE, |glass| glass.transmittance(distance));
            let diffuse_weight = if point.material.is_diffuse() {
                keep(weight, (weight * point.albedo).max_channel(), SHADE_ALWAYS, &mut rng)
            } else {
                None
            };
            let path = branch.path;
            arrive(ChainLeaf { point: Some(point), weight, diffuse_weight, stream, path }, work);
            if branch.length < MAX_LENGTH {
                let Branch { medium, length, path, .. } = branch;
                scatter(&point, Origin { weight, medium, length, path }, &mut rng, &mut branches);
            } else if point.material.is_specular() {
                work.counts.chains_cut += 1;
            }
        }
    }
}

fn is_inside(surface: &Surface, point: &ShadingPoint<'_>) -> bool {
    point.w_o.dot(surface.geometric_normal) < 0.0
}

/// Roulette on a weight of the given size: unchanged if it is large enough, else raised to that size, or nothing.
fn keep(weight: Rgb, size: f32, large_enough: f32, rng: &mut Rng) -> Option<Rgb> {
    if size >= large_enough {
        return Some(weight);
    }
    let p = size / large_enough;
    (rng.next_f32() < p).then(|| weight / p)
}

/// What a surface passes on to the branches that leave it.
struct Origin<'a> {
    weight: Rgb,
    medium: Option<&'a Material>,
    length: u32,
    path: u64,
}

/// Adds the branches that leave a surface.
fn scatter<'a>(
    at: &ShadingPoint<'a>,
    from: Origin<'a>,
    rng: &mut Rng,
    branches: &mut Vec<Branch<'a>>,
) {
    for bounce in
        at.material.specular_bounces(&at.surface, at.w_o, Transport::Radiance).into_iter().flatten()
    {
        let weight = from.weight * bounce.weight;
        let Some(weight) = keep(weight, weight.max_channel(), FOLLOW_ALWAYS, rng) else { continue };
        let medium = match bounce.transmitted {
            true if is_inside(&at.surface, at) => None,
            true => Some(at.material),
            false => from.medium,
        };
        branches.push(Branch {
            ray: Ray::unbounded(at.surface.leave(bounce.dir), bounce.dir),
            weight,
            medium,
            length: from.length + 1,
            path: hash_u64(from.path, u64::from(bounce.transmitted)),
        });
    }
}
