//! White furnaces: in a closed box whose walls all emit `L` and reflect `rho`, every direction at every point shows
//! `L (1 + rho + rho^2 + ...)`, whatever perfect mirrors and clear glass stand in it.

use base::{Component, Grid, ImageSize, Rgb};
use glam::{Vec2, Vec3};
use photon_map::{Gather, Kernel};
use photon_trace::{Budget, Config};
use scene::{LightKind, Material, Parts, Scene};
use shade::{Settings, Shader};

use crate::renderer::{self, Rendering};
use crate::scenes::{
    add_light, add_mesh, add_sphere, cuboid, diffuse, emissive, empty, furnace, glass, mirror,
    pane, quad, smooth_ball,
};

const N_PHOTONS: u64 = 1_000_000;
const SIZE: ImageSize = ImageSize { width: 48, height: 48 };
const EMISSION: [f32; 3] = [1.0, 2.0, 0.5];

/// What the programs do by default, in this box.
fn rendering(parts: Parts, shadow_rays: u32, seed: u64) -> Rendering {
    let scene = Scene::assemble(parts);
    let photons = renderer::photons(&scene, N_PHOTONS, seed);
    let diagonal = scene.bounds().diagonal();
    let gather = |k: usize, share: f32| Gather {
        k,
        max_radius: diagonal * share,
        kernel: Kernel::Epanechnikov,
    };
    let (indirect, caustic) = (gather(500, 0.05), gather(100, 0.01));
    let settings = Settings { shadow_rays, glossy_rays: 4, indirect, caustic, seed };
    renderer::original(&Shader::new(&scene, &photons, settings), SIZE)
}

fn walls(rho: f32) -> Material {
    Material { albedo: Rgb::splat(rho), ..emissive(Rgb::from(EMISSION)) }
}

/// Asserts that the mean of a picture is this multiple of what the walls emit, and says how far off pixels are.
fn assert_mean(what: &str, picture: &Grid<Rgb>, expected: f64, tolerance: f64) {
    for (channel, emission) in EMISSION.into_iter().enumerate() {
        let shares: Vec<f64> = (picture.values().iter())
            .map(|c| f64::from(c.to_array()[channel] / emission))
            .collect();
        let n = shares.len() as f64;
        let mean = shares.iter().sum::<f64>() / n;
        let rms = (shares.iter().map(|s| (s - expected).powi(2)).sum::<f64>() / n).sqrt();
        println!("{what}, channel {channel}: mean {mean:.5} of {expected:.5}, rms error {rms:.5}");
        assert!(
            (mean - expected).abs() <= tolerance * expected,
            "{what}: {mean} instead of {expected} in channel {channel}"
        );
        // The noise of 500 photons is 5 %, that of a quarter of them in a corner twice as much.
        assert!(rms <= 0.1 * expected, "{what}: rms error {rms} around {expected}");
    }
}

#[test]
fn boxes_of_every_albedo() {
    for (seed, rho) in [0.25, 0.5, 0.73, 0.9].into_iter().enumerate() {
        let picture = rendering(furnace(walls(rho)), 16, seed as u64);
        let rho = f64::from(rho);
        let c = &picture.components;
        let what = |name: &str| format!("albedo {rho:.2}, {name}");
        assert_mean(&what("total"), &picture.total(), 1.0 / (1.0 - rho), 0.005);
        assert_mean(&what("emission"), &picture.emission, 1.0, 1e-6);
        assert_mean(&what("direct"), &c.direct, rho, 0.005);
        assert_mean(&what("indirect"), &c.indirect, rho * rho / (1.0 - rho), 0.005);
        for component in [Component::Specular, Component::Caustic] {
            assert!(c[component].values().iter().all(|v| v.is_black()), "{component} light");
        }
    }
}

/// Mirrors and glass can't be told from the wall behind them.
#[test]
fn mirrors_and_glass_are_invisible() {
    let mut parts = furnace(walls(0.5));
    add_sphere(&mut parts, Vec3::new(-0.5, 0.3, -0.4), 0.35, mirror(1.0));
    add_sphere(&mut parts, Vec3::new(0.2, -0.3, -0.5), 0.35, glass(1.5));
    let prism = cuboid(Vec3::new(-0.8, -0.9, -0.8), Vec3::new(-0.3, -0.4, -0.3));
    add_mesh(&mut parts, prism, glass(1.3));
    let sheet = quad(Vec3::new(0.0, -0.8, 0.1), Vec3::X * 0.7, Vec3::Y * 0.5);
    add_mesh(&mut parts, sheet, pane(1.7));
    // Visibility is a ratio of two estimates, and too low by a share that falls with the number of rays. Nowhere is it
    // larger than here, where the light begins right beside what it lights: 0.2 % of direct light for 64 rays, and 1.6 %
    // if their places were uniform by area.
    let picture = rendering(parts, 64, 0);
    assert_mean("with mirrors and glass, total", &picture.total(), 2.0, 0.003);
    let speculars = picture.components.specular.values();
    let shown: Vec<f64> = speculars.iter().filter(|c| !c.is_black()).map(|c| c.r.into()).collect();
    let mean = shown.iter().sum::<f64>() / shown.len() as f64;
    println!("specular: {mean} in {} pixels", shown.len());
    assert!(shown.len() > 400, "{} pixels show a mirror or glass", shown.len());
    assert!((mean - 2.0).abs() < 0.01, "mirrors and glass show {mean} instead of 2");
    assert!(picture.components.caustic.values().iter().any(|c| !c.is_black()), "no caustics");
}

/// Under a sky of the same radiance everywhere, what loses no light can't be told from the sky.
#[test]
fn white_things_under_the_sky() {
    let mut parts = empty(Vec3::new(0.4, 1.6, 4.0), Vec3::new(0.0, 0.4, 0.0), 50.0);
    add_light(&mut parts, LightKind::Environment { radiance: Rgb::from(EMISSION) });
    let white = diffuse(Rgb::ONE);
    let floor = quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0);
    add_mesh(&mut parts, floor, white.clone());
    let block = cuboid(Vec3::new(-0.9, 0.0, -0.8), Vec3::new(0.0, 1.0, 0.0));
    add_mesh(&mut parts, block, white.clone());
    add_sphere(&mut parts, Vec3::new(0.7, 0.4, 0.0), 0.4, white);
    let picture = rendering(parts, 64, 0);
    assert_mean("under the sky", &picture.total(), 1.0, 0.005);
}

/// A shading normal that is off the true one by an angle `a` loses what lies below the surface: of a white sky
/// `(1 + cos a) / 2` is left. Eye rays and photons agree on it.
#[test]
fn smooth_balls_under_the_sky() {
    let mut parts = empty(Vec3::new(0.5, 0.4, 5.0), Vec3::ZERO, 20.0);
    add_light(&mut parts, LightKind::Environment { radiance: Rgb::ONE });
    let ball = smooth_ball(Vec3::ZERO, 1.0, 4);
    add_mesh(&mut parts, ball.clone(), diffuse(Rgb::ONE));
    let scene = Scene::assemble(parts.clone());

    let direct = rendering(parts, 256, 0).components.direct;
    let (mut n, mut squares) = (0.0, 0.0);
    for i in 0..SIZE.n_pixels() {
        let pixel = SIZE.pixel(i);
        let ray = scene.camera.ray(SIZE, Vec2::new(pixel.x as f32 + 0.5, pixel.y as f32 + 0.5));
        let Some(hit) = scene.accel.closest_hit(&ray) else { continue };
        let surface = scene.accel.surface(&ray, &hit);
        let left = 0.5 + 0.5 * surface.shading_normal.dot(surface.geometric_normal);
        (n, squares) = (n + 1.0, squares + (direct[pixel].g - left).powi(2));
    }
    let rms: f32 = (squares / n).sqrt();
    assert!(n > 500.0 && rms < 0.01, "rms error {rms} at {n} pixels");

    let config = Config {
        budget: Budget::Total(N_PHOTONS),
        seed: 0,
        max_bounces: 100,
        store_direct: true,
        aim: 0.0,
    };
    let traced = photon_trace::trace(&scene, &config, &|_| true).expect("nobody interrupts");
    let landed: f64 = traced.direct.iter().map(|photon| f64::from(photon.flux.g)).sum();
    let mut expected = 0.0;
    for (t, corners) in ball.triangles.iter().enumerate() {
        let [a, b, c] = ball.corners(t);
        let cross = (b - a).cross(c - a);
        // Over the middles of 32 x 32 equal parts of the triangle, upright or upside down.
        for (i, j) in (0..32_u8).flat_map(|i| (0..32_u8).map(move |j| (i, j))) {
            let third = if i + j < 32 { 1.0 / 3.0 } else { -1.0 / 3.0 };
            let [x, y] = if i + j < 32 { [i, j] } else { [32 - i, 32 - j] };
            let [x, y] = [x, y].map(|v| (f32::from(v) + third) / 32.0);
            let [na, nb, nc] = corners.map(|corner| ball.normals[corner as usize]);
            let normal = (na * (1.0 - x - y) + nb * x + nc * y).normalize();
            let left = 0.5 + 0.5 * normal.dot(cross.normalize());
            expected += f64::from(0.5 * cross.length() / 1024.0 * left) * std::f64::consts::PI;
        }
    }
    println!("photons bring {:.5} of what is expected", landed / expected);
    assert!((landed / expected - 1.0).abs() < 0.003, "{landed} instead of {expected}");
}
