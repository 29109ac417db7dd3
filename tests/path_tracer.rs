//! An unbiased path tracer, the reference for what the two passes compute.
//!
//! It shares with them the description of the scene and the nearest hit of a ray, and nothing else: random numbers,
//! Fresnel's formulas, sampling of lights and directions, and the bookkeeping of components are its own, in double
//! precision. At a diffuse or rough surface it samples both the lights and the directions, weighted by the balance heuristic
//! (Veach 1997, section 9.2), so that no emitter is too near; what specular surfaces show is found by following them.
//!
//! Point, spot and directional lights can't be hit, so light of theirs that comes through sharp mirrors or glass (caustics,
//! and indirect light behind them) is missing here: compare such scenes without it, or by flux.

mod checks;
mod coats;
mod lights;
mod optics;
mod random;
mod rough;

use std::f64::consts::{FRAC_1_PI, PI};

use base::{Component, Components, Grid, ImageSize, Ray, Rgb};
use geometry::Surface;
use glam::{DVec3, Vec2};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use scene::{Material, Parts, Scene};

use coats::Coats;
use lights::Lights;
use random::Random;

/// A picture with what is known of its error.
#[derive(Debug, PartialEq)]
pub(crate) struct Reference {
    /// Radiance emitted towards the eye, the background included; exact.
    pub(crate) emission: Grid<Rgb>,
    /// Mean radiance of the samples of each pixel.
    pub(crate) mean: Components<Grid<Rgb>>,
    /// Variance of `mean`, per channel.
    pub(crate) variance: Components<Grid<Rgb>>,
    /// Variance of the sum of all components, which aren't independent.
    pub(crate) total_variance: Grid<Rgb>,
}

impl Reference {
    /// The picture: emission and all components.
    pub(crate) fn total(&self) -> Grid<Rgb> {
        let size = self.emission.size();
        Grid::from_fn(size, |at| {
            self.emission[at] + Component::ALL.map(|c| self.mean[c][at]).into_iter().sum()
        })
    }
}

/// Renders what the scene's camera sees, every sample through the middle of its pixel, and anywhere through its lens.
///
/// `scene` is made of `parts`. The result depends on the arguments alone.
pub(crate) fn render(
    parts: &Parts,
    scene: &Scene,
    size: ImageSize,
    samples_per_pixel: u32,
    seed: u64,
) -> Reference {
    let tracer = Tracer::new(parts, scene);
    let row = |y: u32| -> Vec<PixelSums> {
        let pixel = |x: u32| {
            let mut random = Random::new(seed, u64::from(y) << 32 | u64::from(x));
            let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let mut sums = PixelSums::default();
            for _ in 0..samples_per_pixel {
                let eye_ray = if scene.camera.is_pinhole() {
                    scene.camera.ray(size, at)
                } else {
                    let u = [random.uniform(), random.uniform()].map(|u| u as f32);
                    scene.camera.lens_ray(size, at, Vec2::from_array(u))
                };
                sums.add(&tracer.path(eye_ray, &mut random));
            }
            sums
        };
        (0..size.width).map(pixel).collect()
    };
    let pixels: Vec<_> = (0..size.height).into_par_iter().flat_map_iter(row).collect();
    let n = f64::from(samples_per_pixel);
    let grid = |value: &dyn Fn(&PixelSums) -> DVec3| {
        Grid::from_values(size, pixels.iter().map(|p| rgb(value(p))).collect())
    };
    Reference {
        emission: grid(&|p| p.emission.mean(n)),
        mean: Components::from_fn(|c| grid(&|p| p.components[c].mean(n))),
        variance: Components::from_fn(|c| grid(&|p| p.components[c].variance_of_mean(n))),
        total_variance: grid(&|p| p.total.variance_of_mean(n)),
    }
}

#[derive(Default)]
struct PixelSums {
    emission: Sums,
    components: Components<Sums>,
    total: Sums,
}

impl PixelSums {
    fn add(&mut self, found: &Found) {
        self.emission.add(found.emission);
        Component::ALL.into_iter().for_each(|c| self.components[c].add(found.components[c]));
        self.total.add(Component::ALL.into_iter().map(|c| found.components[c]).sum());
    }
}

#[derive(Clone, Copy, Default)]
struct Sums {
    values: DVec3,
    squares: DVec3,
}

impl Sums {
    fn add(&mut self, value: DVec3) {
        self.values += value;
        self.squares += value * value;
    }

    fn mean(&self, n: f64) -> DVec3 {
        self.values / n
    }

    fn variance_of_mean(&self, n: f64) -> DVec3 {
        let mean = self.mean(n);
        (self.squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0)
    }
}

/// The light that one path found.
#[derive(Default)]
struct Found {
    emission: DVec3,
    components: Components<DVec3>,
}

impl Found {
    fn add(&mut self, component: Option<Component>, radiance: DVec3) {
        match component {
            None => self.emission += radiance,
            Some(component) => self.components[component] += radiance,
        }
    }
}

struct Tracer<'a> {
    parts: &'a Parts,
    scene: &'a Scene,
    lights: Lights<'a>,
    coats: Coats,
}

/// Where a path has arrived. Both normals are on the side it came from.
struct Vertex<'a> {
    surface: Surface,
    material: &'a Material,
    position: DVec3,
    geometric_normal: DVec3,
    shading_normal: DVec3,
    w_o: DVec3,
    /// Whether it came from the front.
    front: bool,
}

impl<'a> Tracer<'a> {
    fn new(parts: &'a Parts, scene: &'a Scene) -> Self {
        Self { parts, scene, lights: Lights::new(parts, scene), coats: Coats::new(parts) }
    }

    /// The light along an eye ray, one estimate.
    fn path(&self, eye_ray: Ray, random: &mut Random) -> Found {
        let mut found = Found::default();
        let mut ray = eye_ray;
        // What is left of radiance on its way to the eye: that lost to surfaces and media, and apart from it, since it
        // must not bear on roulette, that gained or lost as rays are squeezed by refraction.
        let (mut beta, mut squeeze) = (DVec3::ONE, 1.0);
        // To which component emitted light would belong, if the path ended at the next surface.
        let mut component = None;
        // The density per steradian at which a surface that isn't sharp chose the ray.
        let mut followed_pdf = None;
        // The glass that the path has entered.
        let mut medium = None;
        for length in 1.. {
            let Some((vertex, distance)) = self.arrive(&ray, random) else {
                found.add(component, beta * squeeze * self.lights.beyond(ray.dir()));
                break;
            };
            let ends_inside = !vertex.front && vertex.material.is_glass();
            let through = if ends_inside { Some(vertex.material) } else { medium };
            beta *= optics::transmittance(through, distance);

            let emitted = color(self.scene.emitted(&vertex.surface, -ray.dir()));
            if emitted != DVec3::ZERO {
                let weight = followed_pdf.map_or(1.0, |pdf| {
                    let cos = vertex.w_o.dot(vertex.geometric_normal);
                    pdf / (pdf + self.lights.emitter_pdf(vertex.material, cos, distance))
                });
                found.add(component, beta * squeeze * emitted * weight);
            }

            // Either the diffuse or the specular part, by chance.
            let cos = vertex.shading_normal.dot(vertex.w_o).max(0.0);
            let material = usize::from(vertex.surface.material.0);
            let coated = |cos: f64| self.coats.of(material, cos, self.base_albedo(&vertex));
            let (passes_out, passes_in, albedo) = coated(cos);
            // What is scattered diffusely of light from all sides; by its direction it is more or less.
            let albedo = albedo * passes_out * passes_in;
            let passage = |dir: DVec3| coated(dir.dot(vertex.shading_normal)).0 / passes_in;
            let reflectance = optics::specular_reflectance(&vertex);
            let (diffuse, specular) = (albedo.max_element(), reflectance.max_element());
            if diffuse + specular == 0.0 {
                break;
            }
            let p_diffuse = diffuse / (diffuse + specular);
            let dir = if random.uniform() < p_diffuse {
                beta *= albedo / p_diffuse;
                component = Some(match component {
                    None => Component::Direct,
                    Some(Component::Specular) => Component::Specular,
                    Some(_) => Component::Indirect,
                });
                let scatter = |dir: DVec3| {
                    let above = dir.dot(vertex.geometric_normal) > 0.0;
                    let cos = dir.dot(vertex.shading_normal) * FRAC_1_PI;
                    (above && cos > 0.0).then(|| (DVec3::splat(cos * passage(dir)), cos))
                };
                let lit = self.lights.scattered(&vertex, medium, random, scatter);
                found.add(component, beta * squeeze * lit);
                let dir = cosine_direction(vertex.shading_normal, random);
                if dir.dot(vertex.geometric_normal) <= 0.0 {
                    break;
                }
                beta *= passage(dir);
                followed_pdf = Some(dir.dot(vertex.shading_normal) * FRAC_1_PI);
                dir
            } else {
                component = Some(match component {
                    None | Some(Component::Specular) => Component::Specular,
                    Some(Component::Direct | Component::Caustic) => Component::Caustic,
                    Some(Component::Indirect) => Component::Indirect,
                });
                if vertex.material.is_rough() {
                    beta /= 1.0 - p_diffuse;
                    let scatter = |dir: DVec3| {
                        rough::value(&vertex, dir).map(|(value, pdf, s)| (value * s, pdf))
                    };
                    let lit = self.lights.scattered(&vertex, medium, random, scatter);
                    found.add(component, beta * squeeze * lit);
                    let Some(bounce) = rough::bounce(&vertex, random) else { break };
                    if bounce.dir.dot(vertex.geometric_normal) < 0.0 {
                        medium = vertex.front.then_some(vertex.material);
                    }
                    beta *= bounce.weight;
                    squeeze *= bounce.squeeze;
                    followed_pdf = Some(bounce.pdf);
                    bounce.dir
                } else {
                    beta *= reflectance / (1.0 - p_diffuse);
                    followed_pdf = None;
                    let bounce = optics::specular_bounce(&vertex, random);
                    if bounce.transmitted && vertex.material.is_glass() {
                        medium = vertex.front.then_some(vertex.material);
                    }
                    squeeze *= bounce.squeeze;
                    bounce.dir
                }
            };

            if length > 4 {
                let survival = beta.max_element().min(0.95);
                if random.uniform() >= survival {
                    break;
                }
                beta /= survival;
            }
            let dir = dir.as_vec3a().normalize();
            ray = Ray::unbounded(vertex.surface.leave(dir), dir);
        }
        found
    }

    /// The diffuse albedo without a coat.
    fn base_albedo(&self, at: &Vertex<'_>) -> DVec3 {
        let texel = at.material.albedo_texture.map_or(Rgb::ONE, |id| {
            let uv = self.scene.accel.uv(&at.surface).unwrap_or_default();
            self.parts.textures[usize::from(id.0)].1.at(uv)
        });
        color(at.material.albedo) * color(texel)
    }

    /// Where a ray arrives, past what masks let pass, and after what distance.
    fn arrive(&self, ray: &Ray, random: &mut Random) -> Option<(Vertex<'a>, f64)> {
        let (mut ray, mut distance) = (*ray, 0.0);
        loop {
            let hit = self.scene.accel.closest_hit(&ray)?;
            let surface = self.scene.accel.surface(&ray, &hit);
            distance += f64::from(hit.t);
            let opacity = f64::from(self.scene.opacity(&surface));
            if opacity == 1.0 || random.uniform() < opacity {
                return Some((self.vertex(surface, &ray), distance));
            }
            ray = Ray::unbounded(surface.leave(ray.dir()), ray.dir());
        }
    }

    fn vertex(&self, surface: Surface, ray: &Ray) -> Vertex<'a> {
        let w_o = -ray.dir().as_dvec3();
        let front = w_o.dot(surface.geometric_normal.as_dvec3()) > 0.0;
        let side = if front { 1.0 } else { -1.0 };
        Vertex {
            surface,
            material: &self.parts.materials[usize::from(surface.material.0)],
            position: surface.position.as_dvec3(),
            geometric_normal: surface.geometric_normal.as_dvec3() * side,
            shading_normal: surface.shading_normal.as_dvec3() * side,
            w_o,
            front,
        }
    }
}

/// A direction around `n` with density proportional to its cosine: a point of the unit sphere around the tip of `n`,
/// seen from the foot of `n`.
fn cosine_direction(n: DVec3, random: &mut Random) -> DVec3 {
    let z = 1.0 - 2.0 * random.uniform();
    let (sin, cos) = (2.0 * PI * random.uniform()).sin_cos();
    let r = (1.0 - z * z).sqrt();
    (n + DVec3::new(r * cos, r * sin, z)).normalize_or(n)
}

fn color(c: Rgb) -> DVec3 {
    DVec3::from_array(c.to_array().map(f64::from))
}

fn rgb(c: DVec3) -> Rgb {
    Rgb::from(c.as_vec3().to_array())
}
