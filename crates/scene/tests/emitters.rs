//! Spheres that emit, and textured emitters: closed forms, samples, densities and photons agree.

use std::f64::consts::PI;
use std::sync::Arc;

use base::{Rgb, Rng, Stream, warp};
use geometry::{Bounds, MaterialId, Sphere};
use glam::{Affine2, Quat, Vec2, Vec3, Vec3A};
use scene::{
    AreaLight, Filter, Light, LightKind, Pattern, SphereLight, Texels, Texture, Toward, Wrap,
};

fn rng(index: u64) -> Rng {
    Rng::new(0, Stream::Test, index)
}

fn ball(center: Vec3, radius: f32) -> Sphere {
    let rotation = Quat::from_rotation_x(0.7) * Quat::from_rotation_y(0.4);
    Sphere { center, radius, rotation, material: MaterialId(0) }
}

fn sphere_light(center: Vec3, radius: f32, texture: Option<Arc<Texture>>) -> Light {
    let light = SphereLight::new(&ball(center, radius), Rgb::new(3.0, 2.0, 1.0), texture);
    Light { name: "l".into(), kind: LightKind::Sphere(light) }
}

/// A dim image with a few bright texels, of which one lies at the edge.
fn spotted() -> Arc<Texture> {
    let texel = |i: usize| match i {
        3 => Rgb::new(20.0, 10.0, 5.0),
        21 => Rgb::new(0.0, 8.0, 8.0),
        _ => Rgb::splat(0.05 * (i % 5) as f32),
    };
    let texels = Texels::Floats((0..32).map(texel).collect());
    let pattern =
        Pattern::Bitmap { size: [8, 4], texels, filter: Filter::Bilinear, wrap: Wrap::Repeat };
    let placement =
        Affine2::from_scale_angle_translation(Vec2::new(1.0, 1.0), 0.3, Vec2::splat(0.2));
    Arc::new(Texture { placement, pattern })
}

fn board() -> Arc<Texture> {
    let pattern = Pattern::Checkerboard([Rgb::BLACK, Rgb::new(1.0, 2.0, 4.0)]);
    Arc::new(Texture { placement: Affine2::from_scale(Vec2::new(1.5, 2.5)), pattern })
}

fn textured_quad(texture: Arc<Texture>) -> Light {
    let (o, a, b) = (Vec3::new(-0.6, 0.5, 1.1), Vec3::Y * -0.9, Vec3::new(1.2, 0.0, 0.2));
    let first = ([o, o + b, o + a], [Vec2::ZERO, Vec2::X, Vec2::Y]);
    let second = ([o + b, o + a + b, o + a], [Vec2::X, Vec2::ONE, Vec2::Y]);
    let light = AreaLight::textured(&[first, second], Rgb::new(1.0, 0.5, 2.0), texture);
    Light { name: "l".into(), kind: LightKind::Area(light) }
}

/// Mean and its standard error.
fn mean(n: u32, mut value: impl FnMut() -> f64) -> (f64, f64) {
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..n {
        let x = value();
        sum += x;
        squares += x * x;
    }
    let (n, mean) = (f64::from(n), sum / f64::from(n));
    (mean, ((squares / n - mean * mean).max(0.0) / n).sqrt())
}

#[test]
fn spheres_light_as_the_formula_of_the_form_factor_says() {
    let light = sphere_light(Vec3::new(0.0, 0.0, 2.0), 0.5, None);
    let e = light.unshadowed_irradiance(Vec3A::ZERO, Vec3A::Z).unwrap();
    assert!((f64::from(e.g) / (2.0 * PI / 16.0) - 1.0).abs() < 1e-5, "{e:?}");
    // In poses of all kinds, cut by the horizon or not, against points of the whole surface.
    let mut rng = rng(1);
    let (mut n_cut, mut n_below) = (0, 0);
    for pose in 0..300 {
        let (center, radius) = (warp::uniform_sphere(rng.next_2d()), 0.1 + 0.85 * rng.next_f32());
        let light = sphere_light(center.into(), radius, None);
        let normal = warp::uniform_sphere(rng.next_2d()).normalize();
        let height = center.dot(normal) / radius;
        (n_cut, n_below) =
            (n_cut + u32::from(height.abs() < 1.0), n_below + u32::from(height < -1.0));
        let e = f64::from(light.unshadowed_irradiance(Vec3A::ZERO, normal).unwrap().g);
        let area = 4.0 * PI * f64::from(radius).powi(2);
        let (expected, sigma) = mean(20_000, || {
            let out = warp::uniform_sphere(rng.next_2d());
            let to = (center + out * radius).as_dvec3();
            let cosines = to.dot(normal.as_dvec3()).max(0.0) * -to.dot(out.as_dvec3()).min(0.0);
            2.0 * area * cosines / to.length_squared().powi(2)
        });
        assert!(
            (e - expected).abs() < 4.5 * sigma + 1e-9,
            "pose {pose}: {e}, {expected} +- {sigma}"
        );
        let (sampled, sigma) = mean(4000, || {
            let sample = light.seen_from(Vec3A::ZERO, normal).sample(rng.next_2d());
            sample.map_or(0.0, |s| f64::from(s.irradiance.g))
        });
        let what = format!("pose {pose}: {e}, sampled {sampled} +- {sigma}");
        assert!((e - sampled).abs() <= 4.5 * sigma + 1e-4 * e, "{what}");
    }
    assert!(n_cut > 60 && n_below > 30, "{n_cut} {n_below}");
}

#[test]
fn inside_a_sphere_and_on_it_is_no_light() {
    let light = sphere_light(Vec3::new(1.0, 2.0, 3.0), 0.5, None);
    for at in [Vec3A::new(1.0, 2.0, 3.0), Vec3A::new(1.2, 2.1, 2.8), Vec3A::new(1.5, 2.0, 3.0)] {
        for normal in [Vec3A::X, -Vec3A::X, Vec3A::Z] {
            assert_eq!(light.unshadowed_irradiance(at, normal), Some(Rgb::BLACK));
            assert!(light.sample(at, normal, Vec2::splat(0.3)).is_none());
            assert!(light.beam(at, Vec2::splat(0.3)).is_none());
        }
    }
}

/// Directions fall evenly on bins of the cone's solid angle, and their density is told alike from both ends.
#[test]
fn beams_to_spheres_have_their_density() {
    let mut rng = rng(2);
    for (distance, radius) in [(1.0, 0.999), (2.0, 0.7), (40.0, 0.1)] {
        let axis = warp::uniform_sphere(rng.next_2d()).normalize();
        let center = axis * distance;
        let light = sphere_light(center.into(), radius, None);
        let solid_angle = {
            let sin2 = (f64::from(radius) / f64::from(distance)).powi(2);
            2.0 * PI * sin2 / (1.0 + (1.0 - sin2).sqrt())
        };
        let frame = base::Frame::new(axis);
        const BINS: usize = 64;
        let mut counts = [0_u32; BINS];
        let n = 64_000;
        for _ in 0..n {
            let beam = light.beam(Vec3A::ZERO, rng.next_2d()).unwrap();
            assert!((f64::from(beam.pdf) * solid_angle - 1.0).abs() < 1e-4, "{beam:?}");
            assert!((beam.irradiance.g * beam.pdf / 2.0 - 1.0).abs() < 1e-4);
            let Toward::Point(target) = beam.toward else { panic!("{beam:?}") };
            assert!(((target - center).length() / radius - 1.0).abs() < 1e-3, "{target}");
            assert!((target.normalize() - beam.dir).length() < 2e-3 * radius / distance + 1e-5);
            let cos = -beam.dir.dot((target - center).normalize());
            if cos > 0.05 {
                let pdf = light.beam_pdf(cos, beam.distance);
                assert!((pdf / beam.pdf - 1.0).abs() < 0.01, "{pdf} of {}", beam.pdf);
            }
            let local = frame.to_local(beam.dir);
            let across = f64::from(local.truncate().length_squared());
            // 1 - cos, as a share of that at the edge of the cone.
            let height = across / (1.0 + f64::from(local.z)) / (solid_angle / (2.0 * PI));
            let turn = (f64::from(local.y).atan2(f64::from(local.x)) / (2.0 * PI)).rem_euclid(1.0);
            let (ring, part) = ((height * 8.0) as usize, (turn * 8.0) as usize);
            counts[ring.min(7) * 8 + part.min(7)] += 1;
        }
        let expected = f64::from(n) / BINS as f64;
        let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
        // 63 degrees of freedom: one in 100,000 is beyond 122.
        assert!(chi2 < 122.0, "chi-square {chi2} at distance {distance}");
    }
}

/// What photons bring to a square is what shadow rays expect there, whatever emits.
#[test]
fn photons_bring_what_shadow_rays_expect() {
    let lights = [
        sphere_light(Vec3::new(0.3, 0.2, 0.9), 0.4, None),
        sphere_light(Vec3::new(0.3, 0.2, 0.9), 0.4, Some(spotted())),
        sphere_light(Vec3::new(-0.4, 0.1, 0.8), 0.5, Some(board())),
        textured_quad(spotted()),
        textured_quad(board()),
    ];
    let bounds = Bounds { min: -Vec3::ONE, max: Vec3::ONE };
    for (i, light) in lights.iter().enumerate() {
        let mut rng = rng(20 + i as u64);
        for channel in 0..3 {
            let (brought, sigma) = mean(300_000, || {
                let u = [0; 4].map(|_| rng.next_f32());
                let start = light.emit(&bounds, u);
                let t = -start.origin.z / start.dir.z;
                let at = start.origin + start.dir * t;
                let lands = t > 0.0 && at.x.abs() < 1.0 && at.y.abs() < 1.0;
                if lands { f64::from(start.flux.to_array()[channel]) } else { 0.0 }
            });
            let (expected, sigma_expected) = mean(300_000, || {
                let at = (rng.next_2d() * 2.0 - 1.0).extend(0.0);
                let sample = light.seen_from(at.into(), Vec3A::Z).sample(rng.next_2d());
                4.0 * sample.map_or(0.0, |s| f64::from(s.irradiance.to_array()[channel]))
            });
            let (beams, sigma_beams) = mean(300_000, || {
                let at = (rng.next_2d() * 2.0 - 1.0).extend(0.0);
                let beam = light.beam(at.into(), rng.next_2d());
                4.0 * beam.map_or(0.0, |b| {
                    f64::from((b.irradiance * b.dir.z.max(0.0)).to_array()[channel])
                })
            });
            let what = format!(
                "light {i}: photons {brought} +- {sigma}, rays {expected} +- {sigma_expected}, beams {beams} +- {sigma_beams}"
            );
            let off = |a: f64, b: f64, sigma: f64| (a - b).abs() < 4.0 * (sigma + sigma_expected);
            assert!(off(brought, expected, sigma) && off(beams, expected, sigma_beams), "{what}");
            assert!(sigma < 0.03 * brought, "{what}");
        }
        let flux = light.flux(&bounds);
        let (told, sigma) = mean(100_000, || {
            f64::from(light.emit(&bounds, [0; 4].map(|_| rng.next_f32())).flux.mean())
        });
        assert!((told / f64::from(flux.mean()) - 1.0).abs() < 0.01 + 4.0 * sigma / told, "{told}");
    }
}
