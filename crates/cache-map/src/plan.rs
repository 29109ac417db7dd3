//! Interpolate or trace: Eqs. (9) to (12), and Eq. (3).

use base::{Component, Pixel, Rgb};
use rayon::prelude::*;

use crate::candidates::Tile;
use crate::map::{CacheMap, Origin};
use crate::weight::error_between;

/// When a candidate fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Greatest error for direct light, Eq. (9).
    pub direct: f32,
    /// Greatest error for indirect light, Eq. (10).
    pub indirect: f32,
    /// Greatest error for specular light, Eq. (11).
    pub specular: f32,
    /// `R_0` of Eq. (2), in world units.
    pub r0: f32,
    /// Candidates lie at most this many pixels away, in rows and in columns.
    pub reach: u32,
}

impl Thresholds {
    fn tau(&self, component: Component) -> f32 {
        match component {
            Component::Direct => self.direct,
            Component::Indirect => self.indirect,
            Component::Specular => self.specular,
            Component::Caustic => self.direct.max(self.indirect).max(self.specular),
        }
    }
}

impl CacheMap {
    /// Decides for every pixel without a value whether it is interpolated, and names those that must be traced, tile by
    /// tile. Values known from a saved map are put in place instead of being traced again.
    pub fn plan(&mut self, component: Component, thresholds: &Thresholds) -> Vec<Pixel> {
        let this = &*self;
        let chosen: Vec<Vec<Pixel>> = (this.tiles.par_iter())
            .map(|tile| this.plan_tile(component, thresholds, tile))
            .collect();
        let mut to_trace = chosen.concat();
        to_trace.retain(|&pixel| {
            let known = self.origins(component)[pixel] == Origin::Known;
            if known {
                self.set(component, pixel, None, Origin::Traced);
            }
            !known
        });
        to_trace
    }

    fn plan_tile(&self, component: Component, thresholds: &Thresholds, tile: &Tile) -> Vec<Pixel> {
        let mut traced = vec![false; tile.n_pixels()];
        let mut to_trace = Vec::new();
        for pixel in tile.pixels() {
            let Some(surface) = &self.surfaces()[pixel] else { continue };
            if self.origins(component)[pixel] == Origin::Sampled {
                continue;
            }
            let tau = thresholds.tau(component);
            let fits = if component == Component::Caustic {
                let (mut any, mut all_black) = (false, true);
                self.for_candidates(
                    component,
                    pixel,
                    thresholds.reach,
                    |_| false,
                    |_, value| {
                        any = true;
                        all_black &= value.is_black();
                        all_black
                    },
                );
                any && all_black && tau > 0.0
            } else {
                let mut fits = false;
                let is_traced = |p: Pixel| tile.contains(p) && traced[tile.index(p)];
                self.for_candidates(
                    component,
                    pixel,
                    thresholds.reach,
                    is_traced,
                    |candidate, _| {
                        fits = error_between(surface, candidate, thresholds.r0) < tau;
                        !fits
                    },
                );
                fits
            };
            if !fits {
                traced[tile.index(pixel)] = true;
                to_trace.push(pixel);
            }
        }
        to_trace
    }

    /// Interpolates all pixels that have no value yet, Eq. (3), from the candidates that [`CacheMap::plan`] has found
    /// for them. Answers how many there were.
    pub fn interpolate(&mut self, component: Component, thresholds: &Thresholds) -> u64 {
        let this = &*self;
        let tiles: Vec<Vec<(Pixel, Rgb)>> = (this.tiles.par_iter())
            .map(|tile| this.interpolate_tile(component, thresholds, tile))
            .collect();
        let mut n = 0;
        for (pixel, value) in tiles.into_iter().flatten() {
            self.set(component, pixel, Some(value), Origin::Interpolated);
            n += 1;
        }
        n
    }

    fn interpolate_tile(
        &self,
        component: Component,
        thresholds: &Thresholds,
        tile: &Tile,
    ) -> Vec<(Pixel, Rgb)> {
        let origins = self.origins(component);
        let mut values = Vec::new();
        for pixel in tile.pixels() {
            let Some(surface) = &self.surfaces()[pixel] else { continue };
            if matches!(origins[pixel], Origin::Sampled | Origin::Traced) {
                continue;
            }
            if component == Component::Caustic {
                values.push((pixel, Rgb::BLACK));
                continue;
            }
            let tau = thresholds.tau(component);
            let before = |p: Pixel| (p.y, p.x) < (pixel.y, pixel.x);
            let is_traced =
                |p: Pixel| before(p) && tile.contains(p) && origins[p] == Origin::Traced;
            let (mut sum, mut weights) = (Rgb::BLACK, 0.0);
            let mut same = None;
            self.for_candidates(
                component,
                pixel,
                thresholds.reach,
                is_traced,
                |candidate, value| {
                    let error = error_between(surface, candidate, thresholds.r0);
                    if error == 0.0 {
                        // The weight is infinite: nothing else counts.
                        same = Some(value);
                    } else if error < tau {
                        sum += value / error;
                        weights += 1.0 / error;
                    }
                    same.is_none()
                },
            );
            values.push((pixel, same.unwrap_or(sum / weights)));
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SurfacePoint;
    use base::{Grid, ImageSize};
    use glam::Vec3;

    const SIZE: ImageSize = ImageSize { width: 100, height: 70 };
    const THRESHOLDS: Thresholds =
        Thresholds { direct: 1.0, indirect: 1.0, specular: 1.0, r0: 10.0, reach: 4 };

    /// A plane seen from above, with a wall on its right half if asked for.
    fn map(wall: bool) -> CacheMap {
        CacheMap::new(Grid::from_fn(SIZE, |p| {
            let normal = if wall && p.x >= 50 { Vec3::X } else { Vec3::Z };
            (p.x > 2).then_some(SurfacePoint {
                position: Vec3::new(p.x as f32, p.y as f32, 0.0),
                normal,
            })
        }))
    }

    fn sample(map: &mut CacheMap, component: Component, radiance: impl Fn(Pixel) -> f32) {
        let pixels = map.missing(component, &crate::choose_pixels(SIZE, 1.0 / 16.0, 0));
        let values: Vec<Rgb> = pixels.iter().map(|&p| Rgb::splat(radiance(p))).collect();
        map.record(component, &pixels, &values, Origin::Sampled);
    }

    fn all_values(
        map: &CacheMap,
        component: Component,
    ) -> impl Iterator<Item = (Pixel, f32, Origin)> {
        let size = map.size();
        (0..size.n_pixels()).map(move |i| {
            let pixel = size.pixel(i);
            (pixel, map.values(component)[pixel].g, map.origins(component)[pixel])
        })
    }

    #[test]
    fn a_constant_stays_constant_and_nothing_is_traced() {
        let mut map = map(false);
        sample(&mut map, Component::Direct, |_| 3.0);
        assert!(map.plan(Component::Direct, &THRESHOLDS).is_empty());
        map.interpolate(Component::Direct, &THRESHOLDS);
        for (pixel, value, origin) in all_values(&map, Component::Direct) {
            if pixel.x <= 2 {
                assert_eq!((value, origin), (0.0, Origin::None));
            } else {
                assert!((value - 3.0).abs() < 1e-5 && origin != Origin::None, "{pixel:?}: {value}");
            }
        }
    }

    #[test]
    fn the_mean_is_that_of_eq_3() {
        let mut map = map(false);
        let (a, b) = (Pixel { x: 20, y: 20 }, Pixel { x: 23, y: 20 });
        map.record(
            Component::Indirect,
            &[a, b],
            &[Rgb::splat(1.0), Rgb::splat(4.0)],
            Origin::Sampled,
        );
        map.interpolate(Component::Indirect, &THRESHOLDS);
        // Errors 0.1 and 0.2, weights 10 and 5.
        let value = map.values(Component::Indirect)[Pixel { x: 21, y: 20 }].g;
        assert!((value - 2.0).abs() < 1e-5, "{value}");
    }

    #[test]
    fn nothing_crosses_an_edge() {
        let mut map = map(true);
        sample(&mut map, Component::Direct, |p| if p.x < 50 { 1.0 } else { 100.0 });
        let traced = map.plan(Component::Direct, &Thresholds { direct: 0.99, ..THRESHOLDS });
        let values: Vec<Rgb> =
            traced.iter().map(|p| Rgb::splat(if p.x < 50 { 1.0 } else { 100.0 })).collect();
        map.record(Component::Direct, &traced, &values, Origin::Traced);
        map.interpolate(Component::Direct, &Thresholds { direct: 0.99, ..THRESHOLDS });
        for (pixel, value, _) in all_values(&map, Component::Direct).filter(|(p, ..)| p.x > 2) {
            let expected = if pixel.x < 50 { 1.0 } else { 100.0 };
            assert!((value / expected - 1.0).abs() < 1e-5, "{pixel:?}: {value}");
        }
    }

    #[test]
    fn thresholds_of_zero_trace_everything() {
        let off = Thresholds { direct: 0.0, indirect: 0.0, specular: 0.0, ..THRESHOLDS };
        for component in Component::ALL {
            let mut map = map(false);
            sample(&mut map, component, |_| 0.0);
            let n_sampled = all_values(&map, component).filter(|v| v.2 == Origin::Sampled).count();
            assert_eq!(map.plan(component, &off).len(), 97 * 70 - n_sampled, "{component}");
        }
    }

    #[test]
    fn caustics_are_traced_where_any_sample_around_is_lit() {
        let mut map = map(false);
        sample(&mut map, Component::Caustic, |p| if p.x > 60 && p.y > 40 { 1.0 } else { 0.0 });
        let traced = map.plan(Component::Caustic, &THRESHOLDS);
        assert!(!traced.is_empty() && traced.iter().all(|p| p.x > 56 && p.y > 36));
        let n_unlit_far = traced.iter().filter(|p| p.x > 66 && p.y > 46).count();
        let n_sampled_far = all_values(&map, Component::Caustic)
            .filter(|(p, _, o)| p.x > 66 && p.y > 46 && *o == Origin::Sampled)
            .count();
        assert_eq!(n_unlit_far + n_sampled_far, 33 * 23);
    }

    #[test]
    fn threads_change_nothing() {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut map = map(true);
                sample(&mut map, Component::Specular, |p| p.x as f32);
                let tight = Thresholds { specular: 0.25, ..THRESHOLDS };
                let traced = map.plan(Component::Specular, &tight);
                let values: Vec<Rgb> = traced.iter().map(|p| Rgb::splat(p.x as f32)).collect();
                map.record(Component::Specular, &traced, &values, Origin::Traced);
                map.interpolate(Component::Specular, &tight);
                (traced, map.into_values().specular)
            })
        };
        let one = run(1);
        assert!(!one.0.is_empty());
        assert_eq!(one, run(2));
        assert_eq!(one, run(3));
    }
}
