//! Specular chains: from the eye through mirrors and glass to surfaces that aren't.

use std::ops::ControlFlow;

use base::{Ray, Rgb, Rng, Stream};
use geometry::Surface;
use scene::{Material, SpecularBounce, Transport};

use crate::glossy::Chosen;
use crate::{Path, PixelStream, Shader, ShadingPoint, Work};

/// Branches that carry less than this are followed by chance, with their weight raised in return. A ray costs little, and
/// one that finds a lamp by chance is a bright dot: so this is small.
const FOLLOW_ALWAYS: f32 = 0.002;

/// Diffuse surfaces of which less than this is seen are shaded by chance, likewise. Shading costs as much as a hundred
/// rays, and diffuse surfaces are never as bright as lamps.
const SHADE_ALWAYS: f32 = 0.02;

/// The longest chain. Only surfaces that lose nothing make such; they are counted.
const MAX_LENGTH: u32 = 128;

/// Glossy chains of this length go on by chance: between rough walls of glass some would otherwise never end.
const CERTAIN_LENGTH: u32 = 12;
/// The chance that they do.
const GO_ON: f32 = 0.75;

/// A diffuse surface where a chain arrives, mirrors included: they may be diffuse as well.
#[derive(Clone, Copy, Debug)]
pub struct ChainLeaf<'a> {
    /// The surface.
    pub point: ShadingPoint<'a>,
    /// What is left of its diffusely scattered radiance on the way to the eye.
    pub weight: Rgb,
    /// The stream for shading it.
    pub stream: PixelStream,
    /// The way to it. Of the leaves of a pixel that aren't glossy no two share it.
    pub path: Path,
    /// Whether a rough surface lies on the way: then it is one of many, each by chance.
    pub is_glossy: bool,
    /// Whether it comes by a branch that carries little: see [`Shader::chain_by_parts`].
    pub is_faint: bool,
}

/// Radiance towards the eye that surfaces emit along chains or that comes from beyond the scene.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChainEmission {
    /// All of it.
    pub all: Rgb,
    /// The part of it that comes by branches that carry little.
    pub faint: Rgb,
}

/// Which branches are followed, and what is asked of them.
#[derive(Clone, Copy)]
pub(crate) struct Follow<'x> {
    /// Whether anyone asks for the light of emitters.
    pub(crate) is_lit: bool,
    /// Branches that carry less than this from sharp surfaces on are faint, and so is all that follows them.
    faint: f32,
    with_faint: bool,
    /// What comes by some paths, which aren't followed.
    known: &'x [(Path, Rgb)],
    /// The only path to be followed, to its end, whatever chance would do.
    only: Option<Path>,
}

const ALL: Follow<'_> =
    Follow { is_lit: true, faint: 0.0, with_faint: true, known: &[], only: None };

/// A ray yet to be followed.
struct Branch<'a> {
    ray: Ray,
    from: Origin<'a>,
    /// How a rough surface has chosen it, if it comes straight from one.
    chosen: Option<Chosen>,
}

/// What a surface passes on to the branches that leave it.
#[derive(Clone, Copy)]
pub(crate) struct Origin<'a> {
    pub(crate) weight: Rgb,
    pub(crate) medium: Option<&'a Material>,
    pub(crate) stream: PixelStream,
    pub(crate) is_glossy: bool,
    pub(crate) is_faint: bool,
    pub(crate) length: u32,
    pub(crate) path: Path,
}

/// The chains of a pixel that are being followed.
pub(crate) struct Chains<'a, 'x> {
    pub(crate) rng: Rng,
    pub(crate) follow: Follow<'x>,
    /// What comes by branches that weren't followed because it is known.
    known: Rgb,
    branches: Vec<Branch<'a>>,
}

impl<'a> Chains<'a, '_> {
    /// Adds a branch, unless it carries so little that chance ends it.
    pub(crate) fn push(
        &mut self,
        at: &ShadingPoint<'a>,
        from: &Origin<'a>,
        bounce: SpecularBounce,
        chosen: Option<Chosen>,
    ) {
        let mut weight = from.weight * bounce.weight;
        let Follow { faint, with_faint, known, only, .. } = self.follow;
        let is_faint = from.is_faint || !from.is_glossy && weight.max_channel() < faint;
        if is_faint && !with_faint {
            return;
        }
        let path = from.path.beyond(bounce.transmitted);
        if let Some((_, radiance)) = known.iter().find(|known| known.0 == path) {
            self.known += *radiance;
            return;
        }
        if only.is_some_and(|only| !only.may_begin_with(path)) {
            return;
        }
        if from.is_glossy && from.length >= CERTAIN_LENGTH {
            if self.rng.next_f32() >= GO_ON {
                return;
            }
            weight = weight / GO_ON;
        }
        if only.is_none() {
            let size = weight.max_channel();
            let Some(kept) = keep(weight, size, FOLLOW_ALWAYS, &mut self.rng) else { return };
            weight = kept;
        }
        let from = Origin {
            weight,
            medium: at.medium_beyond(bounce.transmitted, from.medium),
            is_faint,
            length: from.length + 1,
            path,
            ..*from
        };
        let ray = Ray::unbounded(at.surface.leave(bounce.dir), bounce.dir);
        self.branches.push(Branch { ray, from, chosen });
    }
}

impl<'a> Shader<'a> {
    /// Follows everything that the specular part of a surface shows, and calls `arrive` for each diffuse surface. Returns
    /// the radiance towards the eye that surfaces on the way emit or that comes from beyond the scene.
    pub fn chain(
        &self,
        at: &ShadingPoint<'a>,
        stream: PixelStream,
        work: &mut Work,
        arrive: impl FnMut(ChainLeaf<'a>, &mut Work),
    ) -> Rgb {
        self.follow_whole(at, stream, ALL, work, arrive).all
    }

    /// The same, telling apart the branches that carry little: less than `faint`, from sharp surfaces on, and all that follow
    /// them. Of glass, with 0.01, a reflection head on from the outside carries more, a second one within it less; there are as
    /// many of these as of the others.
    pub fn chain_by_parts(
        &self,
        at: &ShadingPoint<'a>,
        stream: PixelStream,
        faint: f32,
        work: &mut Work,
        arrive: impl FnMut(ChainLeaf<'a>, &mut Work),
    ) -> ChainEmission {
        self.follow_whole(at, stream, Follow { faint, ..ALL }, work, arrive)
    }

    /// The same without the branches that carry little. Nor are `known` paths followed, by each of which so much comes.
    pub fn bright_chain(
        &self,
        at: &ShadingPoint<'a>,
        stream: PixelStream,
        faint: f32,
        known: &[(Path, Rgb)],
        work: &mut Work,
        arrive: impl FnMut(ChainLeaf<'a>, &mut Work),
    ) -> Rgb {
        let follow = Follow { faint, with_faint: false, known, ..ALL };
        self.follow_whole(at, stream, follow, work, arrive).all
    }

    /// Calls `arrive` for the same surfaces as [`Shader::chain`] until it has seen enough, but asks no light.
    pub fn chain_ends(
        &self,
        at: &ShadingPoint<'a>,
        stream: PixelStream,
        work: &mut Work,
        arrive: impl FnMut(ChainLeaf<'a>, &mut Work) -> ControlFlow<()>,
    ) {
        self.follow(at, stream, Follow { is_lit: false, ..ALL }, work, arrive);
    }

    /// The surface at the end of a path that has no rough surfaces on it, which [`Shader::chain`] has come to; without the
    /// weight that chance gave it.
    pub fn chain_end(
        &self,
        at: &ShadingPoint<'a>,
        stream: PixelStream,
        path: Path,
        work: &mut Work,
    ) -> Option<ChainLeaf<'a>> {
        let mut end = None;
        // Of a path whose way isn't told all branches are followed, and chance must do what it did.
        let only = path.is_told().then_some(path);
        let follow = Follow { is_lit: false, only, ..ALL };
        self.follow(at, stream, follow, work, |leaf, _| {
            if leaf.path != path || leaf.is_glossy {
                return ControlFlow::Continue(());
            }
            let stream = stream.part(path.number());
            end = Some(ChainLeaf { stream, ..leaf });
            ControlFlow::Break(())
        });
        end
    }

    fn follow_whole(
        &self,
        at: &ShadingPoint<'a>,
        stream: PixelStream,
        follow: Follow<'_>,
        work: &mut Work,
        mut arrive: impl FnMut(ChainLeaf<'a>, &mut Work),
    ) -> ChainEmission {
        self.follow(at, stream, follow, work, |leaf, work| {
            arrive(leaf, work);
            ControlFlow::Continue(())
        })
    }

    fn follow(
        &self,
        at: &ShadingPoint<'a>,
        stream: PixelStream,
        follow: Follow<'_>,
        work: &mut Work,
        mut arrive: impl FnMut(ChainLeaf<'a>, &mut Work) -> ControlFlow<()>,
    ) -> ChainEmission {
        let rng = Rng::new(self.settings.seed, Stream::Chain, stream.0);
        let mut chains = Chains { rng, follow, known: Rgb::BLACK, branches: Vec::new() };
        let mut n_leaves = 0;
        let (weight, medium, is_glossy, is_faint) = (Rgb::ONE, None, false, false);
        let eye =
            Origin { weight, medium, stream, is_glossy, is_faint, length: 0, path: Path::EYE };
        let all = self.scatter(at, eye, &mut chains, work);
        let mut emission = ChainEmission { all, faint: Rgb::BLACK };
        while let Some(Branch { ray, mut from, chosen }) = chains.branches.pop() {
            work.counts.specular_rays += 1;
            n_leaves += 1;
            from.stream = stream.part(n_leaves);
            let Some((point, distance)) = self.arrive(&ray) else {
                let background = match chosen {
                    None => self.background(ray.dir()),
                    Some(chosen) => self.background_by_lobe(&chosen, ray.dir()),
                };
                emission.add(background * from.weight, from.is_faint);
                continue;
            };
            let inside = is_inside(&point.surface, &point);
            let through = if inside && point.material.is_glass() {
                Some(point.material)
            } else {
                from.medium
            };
            if let Some(glass) = through {
                from.weight *= glass.transmittance(distance);
            }
            let radiance = point.emitted;
            if !radiance.is_black() {
                let share = chosen.map_or(1.0, |c| self.share_of_lobe(&c, &point, distance));
                emission.add(radiance * from.weight * share, from.is_faint);
            }
            if point.material.is_diffuse() {
                let size = (from.weight * point.albedo).max_channel();
                let shade_always = if follow.only.is_some() { 0.0 } else { SHADE_ALWAYS };
                if let Some(weight) = keep(from.weight, size, shade_always, &mut chains.rng) {
                    let Origin { stream, path, is_glossy, is_faint, .. } = from;
                    let leaf = ChainLeaf { point, weight, stream, path, is_glossy, is_faint };
                    if arrive(leaf, work).is_break() {
                        break;
                    }
                }
            }
            if from.length < MAX_LENGTH {
                emission.add(self.scatter(&point, from, &mut chains, work), from.is_faint);
            } else if point.material.is_specular() {
                work.counts.chains_cut += 1;
            }
        }
        emission.all += chains.known;
        emission
    }

    /// Adds the branches that leave a surface; the radiance towards the eye of lights that a rough one shows.
    fn scatter(
        &self,
        at: &ShadingPoint<'a>,
        from: Origin<'a>,
        chains: &mut Chains<'a, '_>,
        work: &mut Work,
    ) -> Rgb {
        if let Some(lobe) = at.material.lobe(&at.surface, at.w_o, Transport::Radiance) {
            return self.scatter_by_lobe(&lobe, at, from, chains, work);
        }
        let bounces = at.material.specular_bounces(&at.surface, at.w_o, Transport::Radiance);
        bounces.into_iter().flatten().for_each(|bounce| chains.push(at, &from, bounce, None));
        Rgb::BLACK
    }
}

impl ChainEmission {
    #[inline]
    fn add(&mut self, radiance: Rgb, is_faint: bool) {
        self.all += radiance;
        if is_faint {
            self.faint += radiance;
        }
    }
}

impl<'a> ShadingPoint<'a> {
    /// What fills the space where light goes on, given what fills that where it comes from.
    pub(crate) fn medium_beyond(
        &self,
        transmitted: bool,
        medium: Option<&'a Material>,
    ) -> Option<&'a Material> {
        match transmitted && self.material.is_glass() {
            true if is_inside(&self.surface, self) => None,
            true => Some(self.material),
            false => medium,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seen::each_pixel;

    /// Calls `check` for pixels that show the rabbit of glass.
    fn each_pixel_of_glass(
        mut check: impl FnMut(&Shader<'_>, &ShadingPoint<'_>, PixelStream, &mut Work),
    ) {
        let mut n = 0;
        each_pixel("rabbit", 1, |shader, point, stream, work| {
            if point.material.is_specular() {
                check(shader, point, stream, work);
                n += 1;
            }
        });
        assert!(n > 100, "{n} pixels");
    }

    const FAINT: f32 = 0.01;

    #[test]
    fn known_paths_are_not_followed() {
        // Whether ends that carry less are shaded is up to chance.
        let is_sure = |leaf: &ChainLeaf<'_>| {
            (leaf.weight * leaf.point.albedo).max_channel() > 1.001 * SHADE_ALWAYS
        };
        let mut n_told = 0;
        each_pixel_of_glass(|shader, point, stream, work| {
            let mut leaves = Vec::new();
            let before = work.counts.specular_rays;
            let emitted =
                shader.bright_chain(point, stream, FAINT, &[], work, |l, _| leaves.push(l));
            let n_rays = work.counts.specular_rays - before;
            for leaf in &leaves {
                let others = leaves.iter().map(|leaf| leaf.path).filter(|&p| p != leaf.path);
                let others: Vec<Path> = others.collect();
                let Some(start) = leaf.path.apart_from(&others) else { continue };
                let known = [(start, Rgb::splat(1000.0))];
                let mut rest = Vec::new();
                let before = work.counts.specular_rays;
                let more =
                    shader.bright_chain(point, stream, FAINT, &known, work, |l, _| rest.push(l));
                assert!(work.counts.specular_rays - before < n_rays, "{start:?}");
                assert!((1000.0..=1000.01 + emitted.r).contains(&more.r), "{more:?} {emitted:?}");
                let paths = |all: &[ChainLeaf<'_>]| -> Vec<Path> {
                    let other = |l: &&ChainLeaf<'_>| is_sure(l) && !l.path.may_begin_with(start);
                    all.iter().filter(other).map(|leaf| leaf.path).collect()
                };
                assert_eq!(paths(&rest), paths(&leaves));
                assert!(!rest.iter().any(|leaf| leaf.path.may_begin_with(start)));
                n_told += 1;
            }
        });
        assert!(n_told > 300, "{n_told}");
    }

    #[test]
    fn the_end_of_a_path_is_found_by_it() {
        let (mut n_ends, mut n_all, mut n_found) = (0, 0, 0);
        each_pixel_of_glass(|shader, point, stream, work| {
            let mut leaves = Vec::new();
            let before = work.counts.specular_rays;
            shader.chain(point, stream, work, |leaf, _| leaves.push(leaf));
            let n_rays = work.counts.specular_rays - before;
            for leaf in &leaves {
                let before = work.counts.specular_rays;
                let end = shader.chain_end(point, stream, leaf.path, work).expect("an end");
                assert_eq!(format!("{:?}", end.point.surface), format!("{:?}", leaf.point.surface));
                n_found += work.counts.specular_rays - before;
                n_all += n_rays;
                n_ends += 1;
            }
        });
        assert!(n_ends > 500 && 2 * n_found < n_all, "{n_ends} ends by {n_found} rays of {n_all}");
    }
}
