//! What makes the reference trusted: answers known on paper.

use std::f64::consts::PI;

use base::{Component, Grid, ImageSize, Rgb};
use glam::{DVec3, Vec2, Vec3, Vec3A};
use scene::{LightKind, Material, Parts, Scene, Specular, Spot};

use super::{Reference, color, optics, render};
use crate::scenes::{
    add_light, add_mesh, add_sphere, black, cuboid, diffuse, emissive, empty, furnace, glass,
    mirror, quad, room,
};

const SMALL: ImageSize = ImageSize { width: 8, height: 8 };

fn reference(parts: &Parts, size: ImageSize, samples_per_pixel: u32) -> Reference {
    render(parts, &Scene::assemble(parts.clone()), size, samples_per_pixel, 1)
}

/// The mean of all pixels.
fn mean(grid: &Grid<Rgb>) -> DVec3 {
    grid.values().iter().map(|&c| color(c)).sum::<DVec3>() / grid.values().len() as f64
}

/// Asserts that the mean of all pixels is the expected one within four standard deviations, and that these are below
/// `precision`, so that the assertion says something.
fn assert_mean(what: &str, grid: &Grid<Rgb>, variance: &Grid<Rgb>, expected: f64, precision: f64) {
    let sigma = (mean(variance) / variance.values().len() as f64).map(f64::sqrt);
    let error = (mean(grid) - expected).abs();
    assert!(sigma.max_element() <= precision, "{what}: standard deviation {sigma}");
    // Pictures are rounded to single precision.
    let allowed = sigma * 4.0 + 1e-6 * expected.abs();
    assert!(error.cmple(allowed).all(), "{what}: {} for {expected}, sigma {sigma}", mean(grid));
}

fn assert_component(reference: &Reference, component: Component, expected: f64, precision: f64) {
    let (mean, variance) = (&reference.mean[component], &reference.variance[component]);
    assert_mean(component.name(), mean, variance, expected, precision);
}

/// All walls emit 1 and reflect `rho`: radiance is `1 + rho + rho^2 + ... = 1 / (1 - rho)`.
#[test]
fn furnace_of_diffuse_walls() {
    for rho in [0.25, 0.5, 0.73, 0.9_f32] {
        let walls = Material { albedo: Rgb::splat(rho), ..emissive(Rgb::ONE) };
        let reference = reference(&furnace(walls), SMALL, 1500);
        let rho = f64::from(rho);
        assert_eq!(mean(&reference.emission), DVec3::ONE);
        let total = 1.0 / (1.0 - rho);
        assert_component(&reference, Component::Direct, rho, 1e-3);
        assert_component(&reference, Component::Indirect, total - 1.0 - rho, 4e-3 * total);
        assert_component(&reference, Component::Specular, 0.0, 0.0);
        assert_component(&reference, Component::Caustic, 0.0, 0.0);
        let precision = 4e-3 * total;
        assert_mean("total", &reference.total(), &reference.total_variance, total, precision);
    }
}

/// Walls that also mirror `r`: what they show of mirrors alone is `r + r^2 + ...`, and of that and all else the share
/// `rho` is scattered diffusely.
#[test]
fn furnace_of_half_mirrors() {
    let (rho, r) = (0.4, 0.3);
    let walls = Material { albedo: Rgb::splat(rho), emission: Rgb::ONE, ..mirror(r) };
    let reference = reference(&furnace(walls), SMALL, 3000);
    let (rho, r) = (f64::from(rho), f64::from(r));
    let total = 1.0 / (1.0 - rho - r);
    let (direct, caustic, specular) = (rho, rho * r / (1.0 - r), r * total);
    assert_component(&reference, Component::Direct, direct, 2e-3);
    assert_component(&reference, Component::Caustic, caustic, 2e-3);
    assert_component(&reference, Component::Specular, specular, 0.01);
    assert_component(
        &reference,
        Component::Indirect,
        total - 1.0 - direct - caustic - specular,
        0.01,
    );
}

#[test]
fn mirror_box() {
    let walls = Material { emission: Rgb::ONE, ..mirror(0.5) };
    let reference = reference(&furnace(walls), SMALL, 1000);
    assert_eq!(mean(&reference.emission), DVec3::ONE);
    assert_component(&reference, Component::Specular, 1.0, 2e-3);
    assert_component(&reference, Component::Caustic, 0.0, 0.0);
}

/// A large floor of albedo 0.6 seen obliquely.
fn floor() -> Parts {
    let mut parts = empty(Vec3::new(0.0, 2.0, 6.0), Vec3::new(0.0, 0.0, 0.3), 25.0);
    let corner = Vec3::new(-50.0, 0.0, -50.0);
    add_mesh(&mut parts, quad(corner, Vec3::Z * 100.0, Vec3::X * 100.0), diffuse(Rgb::splat(0.6)));
    parts
}

/// Compares each pixel of the floor with irradiance known on paper: `f(point)` times the albedo over pi.
fn assert_floor(parts: &Parts, samples_per_pixel: u32, f: impl Fn(DVec3) -> f64) {
    let scene = Scene::assemble(parts.clone());
    let reference = render(parts, &scene, SMALL, samples_per_pixel, 1);
    let (mut chi2, mut brightest) = (0.0, 0.0_f64);
    for i in 0..SMALL.n_pixels() {
        let at = SMALL.pixel(i);
        let ray = scene.camera.ray(SMALL, Vec2::new(at.x as f32 + 0.5, at.y as f32 + 0.5));
        let point = ray.at(-ray.origin().y / ray.dir().y).as_dvec3();
        let expected = f(point) * 0.6 / PI;
        let radiance = f64::from(reference.mean.direct[at].g);
        let variance = f64::from(reference.variance.direct[at].g);
        brightest = brightest.max(expected);
        let rounding = 1e-5 * expected + 1e-9;
        let error2 = (radiance - expected).powi(2);
        assert!(
            error2 <= 30.0 * variance + rounding * rounding,
            "{radiance} for {expected} at {point}"
        );
        chi2 += error2 / (variance + rounding * rounding);
    }
    assert!(brightest > 0.01, "the picture is dark");
    // 64 degrees of freedom: 99.99 % lie below 115.
    assert!(chi2 < 115.0, "chi-square {chi2}");
    for component in [Component::Indirect, Component::Specular, Component::Caustic] {
        assert_component(&reference, component, 0.0, 0.0);
    }
}

/// Form factor from a differential patch to a parallel rectangle at height `h`, one corner above the patch.
fn form_factor(a: f64, b: f64, h: f64) -> f64 {
    let (a, b) = (a / h, b / h);
    let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / ra * (b / ra).atan() + b / rb * (a / rb).atan()) / (2.0 * PI)
}

#[test]
fn rectangle_over_a_floor() {
    let mut parts = floor();
    let (x, z, h) = ((-0.5, 1.5), (-1.0, 2.0), 2.5);
    let light = quad(Vec3::new(-0.5, 2.5, -1.0), Vec3::X * 2.0, Vec3::Z * 3.0);
    add_mesh(&mut parts, light, emissive(Rgb::splat(3.0)));
    assert_floor(&parts, 4000, |p| {
        let corner = |x: f64, z: f64| form_factor(x - p.x, z - p.z, h);
        3.0 * PI * (corner(x.1, z.1) - corner(x.0, z.1) - corner(x.1, z.0) + corner(x.0, z.0))
    });
}

/// Its front looks up: the floor gets nothing.
#[test]
fn a_rectangle_turned_away() {
    let mut parts = floor();
    let light = quad(Vec3::new(-0.5, 2.5, -1.0), Vec3::Z * 3.0, Vec3::X * 2.0);
    add_mesh(&mut parts, light, emissive(Rgb::splat(3.0)));
    let reference = reference(&parts, SMALL, 100);
    assert_eq!(mean(&reference.total()), DVec3::ZERO);
}

#[test]
fn points_spots_and_directions_over_a_floor() {
    let position = DVec3::new(0.4, 0.9, -0.2);
    let toward = |p: DVec3| (position - p, (position - p).length());
    let mut parts = floor();
    let intensity = Rgb::splat(2.0);
    add_light(&mut parts, LightKind::Point { position: position.as_vec3a(), intensity });
    assert_floor(&parts, 2, |p| toward(p).0.y * 2.0 / toward(p).1.powi(3));

    let mut parts = floor();
    let axis = Vec3A::new(-0.3, -1.0, 0.2).normalize();
    let (cos_outer, cos_inner) = (0.6_f32, 0.9_f32);
    let position_f32 = position.as_vec3a();
    let spot = Spot { position: position_f32, direction: axis, intensity, cos_outer, cos_inner };
    add_light(&mut parts, LightKind::Spot(spot));
    assert_floor(&parts, 2, |p| {
        let (to_light, distance) = toward(p);
        let cos = -to_light.dot(axis.as_dvec3()) / distance;
        let (outer, inner) = (f64::from(cos_outer), f64::from(cos_inner));
        let x = ((cos - outer) / (inner - outer)).clamp(0.0, 1.0);
        to_light.y * 2.0 / distance.powi(3) * (3.0 * x * x - 2.0 * x * x * x)
    });

    let mut parts = floor();
    let irradiance = Rgb::splat(2.0);
    add_light(&mut parts, LightKind::Directional { direction: axis, irradiance });
    assert_floor(&parts, 2, |_| -2.0 * f64::from(axis.y));
}

/// Looks at a glass slab from `eye`, with light of radiance 1 from all that lies behind it or, mirrored, before it.
fn slab(eye: Vec3, absorption: f32, lit_side: f32) -> Parts {
    let mut parts = empty(eye, Vec3::ZERO, 1.0);
    let material = Material {
        specular: Specular::Glass { ior: 1.5, absorption: Rgb::splat(absorption) },
        ..black()
    };
    add_mesh(&mut parts, cuboid(Vec3::new(-1e3, -1e3, -0.5), Vec3::new(1e3, 1e3, 0.5)), material);
    let corner = Vec3::new(-1e3, -1e3, 20.0) * Vec3::new(lit_side, 1.0, lit_side);
    let light = quad(corner, Vec3::Y * 2e3, Vec3::X * 2e3 * lit_side);
    add_mesh(&mut parts, light, emissive(Rgb::ONE));
    parts
}

/// With `F` reflected at each face and `tau` left after each crossing, `(1-F)^2 tau / (1 - F^2 tau^2)` passes and
/// `F + F (1-F)^2 tau^2 / (1 - F^2 tau^2)` returns.
#[test]
fn glass_slab() {
    for (eye, absorption) in
        [(Vec3::Z * 4.0, 0.0_f32), (Vec3::new(4.0, 1.0, 3.0), 0.0), (Vec3::new(4.0, 1.0, 3.0), 0.4)]
    {
        let cos = f64::from(eye.normalize().z);
        let cos_t = (1.0 - (1.0 - cos * cos) / 2.25).sqrt();
        let s = (cos - 1.5 * cos_t) / (cos + 1.5 * cos_t);
        let p = (1.5 * cos - cos_t) / (1.5 * cos + cos_t);
        let f = 0.5 * (s * s + p * p);
        let tau = (-f64::from(absorption) / cos_t).exp();
        let passes = (1.0 - f).powi(2) * tau / (1.0 - (f * tau).powi(2));
        let size = ImageSize { width: 1, height: 1 };
        let behind = reference(&slab(eye, absorption, -1.0), size, 200_000);
        assert_component(&behind, Component::Specular, passes, 2e-3);
        let before = reference(&slab(eye, absorption, 1.0), size, 200_000);
        assert_component(&before, Component::Specular, f + f * tau * passes, 2e-3);
    }
}

/// A mirror of roughness 1 seen head on. Of light from everywhere its microfacets send on the share 1 - ln 2; light from
/// where the eye is scatters by the distribution of normals alone, `D / 4 = 1 / (4 pi)`.
#[test]
fn rough_mirror() {
    let size = ImageSize { width: 1, height: 1 };
    let mut parts = empty(Vec3::Z * 4.0, Vec3::ZERO, 0.01);
    let plate = quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    add_mesh(&mut parts, plate, Material { roughness: 1.0, ..mirror(0.8) });
    let mut sky = parts.clone();
    add_light(&mut sky, LightKind::Environment { radiance: Rgb::splat(3.0) });
    let shown = 3.0 * f64::from(0.8_f32) * (1.0 - 2.0_f64.ln());
    assert_component(&reference(&sky, size, 200_000), Component::Specular, shown, 4e-3);
    let intensity = Rgb::splat(5.0);
    add_light(&mut parts, LightKind::Point { position: Vec3A::Z * 2.0, intensity });
    let shown = 5.0 / 4.0 * f64::from(0.8_f32) / (4.0 * PI);
    assert_component(&reference(&parts, size, 100), Component::Specular, shown, 1e-6);
}

/// Radiance 1 from everywhere beyond the scene; nothing in it loses any. Then it can't be seen.
#[test]
fn open_furnace() {
    let mut parts = empty(Vec3::new(0.5, 1.5, 6.0), Vec3::Y, 50.0);
    add_light(&mut parts, LightKind::Environment { radiance: Rgb::ONE });
    add_mesh(
        &mut parts,
        quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0),
        diffuse(Rgb::ONE),
    );
    add_mesh(&mut parts, cuboid(Vec3::new(1.0, 0.2, -1.0), Vec3::new(2.0, 2.0, 0.5)), glass(1.5));
    add_sphere(&mut parts, Vec3::new(-0.2, 0.9, 0.5), 0.8, glass(1.33));
    add_sphere(&mut parts, Vec3::new(-1.8, 0.7, -0.5), 0.7, mirror(1.0));
    add_sphere(&mut parts, Vec3::new(-0.9, 0.3, 1.5), 0.3, diffuse(Rgb::ONE));
    let size = ImageSize { width: 24, height: 16 };
    let reference = reference(&parts, size, 500);
    assert_mean("all", &reference.total(), &reference.total_variance, 1.0, 2e-3);
    for (i, (c, v)) in
        reference.total().values().iter().zip(reference.total_variance.values()).enumerate()
    {
        let allowed = 5.0 * v.g.sqrt() + 1e-5;
        assert!((c.g - 1.0).abs() < allowed, "{} in pixel {i}, allowed {allowed}", c.g);
    }
    for component in Component::ALL {
        assert!(mean(&reference.mean[component]).y > 0.01, "nothing {component} to be seen");
    }
}

/// Light that passes a sphere of index 1 counts as specular or as a caustic, yet it is the same light. The lamp is large,
/// so that paths find it often enough for the normal distribution.
#[test]
fn glass_of_index_1_is_invisible() {
    let size = ImageSize { width: 16, height: 16 };
    let without = reference(&room(1.6), size, 1000);
    let mut parts = room(1.6);
    add_sphere(&mut parts, Vec3::new(0.1, 1.0, 0.2), 0.6, glass(1.0));
    let with = reference(&parts, size, 1000);
    let [caustic, specular] = [&with.mean.caustic, &with.mean.specular].map(|g| mean(g).y);
    assert!(caustic > 0.01 && specular > 0.01, "caustic {caustic}, specular {specular}");
    let (a, b) = (without.total(), with.total());
    let mut chi2 = 0.0;
    for i in 0..size.n_pixels() {
        let at = size.pixel(i);
        let error = color(a[at]) - color(b[at]);
        let variance = color(without.total_variance[at]) + color(with.total_variance[at]);
        assert!(
            (error * error).cmple(variance * 25.0 + 1e-10).all(),
            "{error} at {at:?}, variance {variance}"
        );
        chi2 += error.y * error.y / (variance.y + 1e-10);
    }
    // About 240 degrees of freedom, the light's own pixels aside: 99.99 % lie below 326.
    assert!(chi2 < 326.0, "chi-square {chi2}");
}

#[test]
fn seeds_tell_results_and_threads_do_not() {
    let parts = room(0.5);
    let scene = Scene::assemble(parts.clone());
    let run = |n_threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| render(&parts, &scene, SMALL, 10, seed))
    };
    assert_eq!(run(1, 3), run(3, 3));
    assert_ne!(run(1, 3), run(1, 4));
}

/// At normal incidence `((n-1)^2 + k^2) / ((n+1)^2 + k^2)`; without absorption metals are glass; at Brewster's angle
/// half of `cos^2(2 theta)` remains.
#[test]
fn fresnel() {
    let gold = optics::conductor_reflectance(1.0, 0.2, 3.0);
    assert!((gold - 9.64 / 10.44).abs() < 1e-12);
    for cos in [1.0, 0.9, 0.5, 0.1, 1e-3] {
        let (a, b) = (
            optics::conductor_reflectance(cos, 1.5, 0.0),
            optics::dielectric_reflectance(cos, 1.5),
        );
        assert!((a - b).abs() < 1e-9, "{a} {b} at {cos}");
        let sin = (1.0 - cos * cos).sqrt();
        let cos_t = (1.0 - sin * sin / 2.25).sqrt();
        let back = optics::dielectric_reflectance(cos_t, 1.0 / 1.5);
        assert!((b - back).abs() < 1e-9, "{b} in, {back} out");
    }
    let brewster = (1.0 / 3.25_f64).sqrt();
    let expected = 0.5 * (2.0 * brewster * brewster - 1.0).powi(2);
    assert!((optics::dielectric_reflectance(brewster, 1.5) - expected).abs() < 1e-12);
    assert_eq!(optics::dielectric_reflectance(0.7, 1.0 / 1.5), 1.0);
}
