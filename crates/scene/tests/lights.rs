//! Unshadowed irradiance in closed form, against known form factors and brute force.

use base::{Rgb, Rng, Stream, warp};
use glam::{DVec3, Vec2, Vec3, Vec3A};
use scene::{AreaLight, Light, LightKind, Spot, Toward, polygon_irradiance};
use std::f64::consts::PI;

fn rng(index: u64) -> Rng {
    Rng::new(0, Stream::Test, index)
}

fn area_light(triangles: &[[Vec3; 3]], radiance: Rgb) -> Light {
    Light { name: "l".into(), kind: LightKind::Area(AreaLight::new(triangles, radiance)) }
}

/// The two halves of a parallelogram.
fn quad(corner: Vec3, a: Vec3, b: Vec3) -> [[Vec3; 3]; 2] {
    [[corner, corner + a, corner + a + b], [corner, corner + a + b, corner + b]]
}

/// Irradiance at points of the unit square of z = 0, facing up, over pi, weighted to be its mean. `at` places 200 by 200
/// points of the unit square, and `weight` is the area that they stand for.
fn form_factor(corners: &[Vec3], at: impl Fn(Vec2) -> Vec3A, weight: impl Fn(Vec2) -> f64) -> f64 {
    const SIDE: usize = 200;
    let sum: f64 = (0..SIDE * SIDE)
        .map(|i| Vec2::new((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5) / SIDE as f32)
        .map(|u| weight(u) * f64::from(polygon_irradiance(at(u), Vec3A::Z, corners)))
        .sum();
    sum / (SIDE * SIDE) as f64 / PI
}

#[test]
fn form_factors_of_unit_squares_are_those_of_the_tables() {
    let square = |z: f32| [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| [x, y, z]);
    let facing = square(1.0).map(Vec3::from);
    let f = form_factor(&facing, |u| Vec3A::new(u.x, u.y, 0.0), |_| 1.0);
    assert!((f - 0.199_824_9).abs() < 1e-6, "{f}");
    // The wall stands on the edge y = 0, where points must be dense.
    let wall = square(0.0).map(|[x, z, _]| Vec3::new(x, 0.0, z));
    let f = form_factor(
        &wall,
        |u| Vec3A::new(u.x, u.y * u.y * u.y, 0.0),
        |u| 3.0 * f64::from(u.y * u.y),
    );
    assert!((f - 0.200_043_8).abs() < 3e-6, "{f}");
}

#[test]
fn a_disc_as_far_away_as_its_radius_fills_half_of_the_hemisphere() {
    const N: usize = 1000;
    let rim = |i: usize| {
        let angle = 2.0 * PI * i as f64 / N as f64;
        Vec3::new(angle.cos() as f32, angle.sin() as f32, 1.0)
    };
    let sum: f64 = (0..N)
        .map(|i| [Vec3::Z, rim(i), rim(i + 1)])
        .map(|corners| f64::from(polygon_irradiance(Vec3A::ZERO, Vec3A::Z, &corners)))
        .sum();
    // The polygon lacks 2 pi^2 / (3 N^2) of the disc's area.
    assert!((sum / PI - 0.5).abs() < 1e-5, "{}", sum / PI);
}

#[test]
fn the_middle_of_the_cornell_box_has_its_known_irradiance() {
    let corner = Vec3::new(-0.65, 5.478, -0.525);
    let (a, b) = (Vec3::X * 1.30, Vec3::Z * 1.05);
    let corners = [corner, corner + a, corner + a + b, corner + b];
    let f = f64::from(polygon_irradiance(Vec3A::ZERO, Vec3A::Y, &corners)) / PI;
    assert!((f / 0.014_258_08 - 1.0).abs() < 1e-6, "{f}");
    let light = area_light(&quad(corner, a, b), Rgb::new(17.0, 12.0, 4.0));
    let e = light.unshadowed_irradiance(Vec3A::ZERO, Vec3A::Y).unwrap();
    for (x, expected) in e.to_array().into_iter().zip([0.761_48, 0.537_52, 0.179_17]) {
        assert!((x - expected).abs() < 6e-6, "{x}, not {expected}");
    }
    let light = LightKind::Area(AreaLight::new(&quad(corner, a, b), Rgb::ONE));
    assert!(matches!(light, LightKind::Area(l) if (l.area() - 1.365).abs() < 1e-6));
}

/// A triangle or a parallelogram about the origin, of a size around 1.
fn random_polygon(rng: &mut Rng) -> Vec<Vec3> {
    let mut vector = || Vec3::from(warp::uniform_sphere(rng.next_2d()));
    let (corner, a, b) = (vector() * 0.5, vector() * 1.2, vector() * 1.2);
    match rng.next_u32() % 2 {
        0 => vec![corner, corner + a, corner + b],
        _ => vec![corner, corner + a, corner + a + b, corner + b],
    }
}

/// Mean irradiance of the points of a polygon of unit radiance, and its standard error.
fn brute_force(point: DVec3, normal: DVec3, corners: &[Vec3], rng: &mut Rng) -> (f64, f64) {
    const N: u32 = 100_000;
    let corner = corners[0].as_dvec3();
    let a = corners[1].as_dvec3() - corner;
    let b = corners[corners.len() - 1].as_dvec3() - corner;
    let cross = a.cross(b);
    let (mut sum, mut sum2) = (0.0, 0.0);
    for _ in 0..N {
        let u = rng.next_2d().as_dvec2();
        // The other half of the parallelogram turned onto the triangle.
        let fold = corners.len() == 3 && u.x + u.y > 1.0;
        let u = if fold { 1.0 - u } else { u };
        let d = corner + a * u.x + b * u.y - point;
        let dist2 = d.length_squared();
        let x = d.dot(normal).max(0.0) * d.dot(cross).abs() / (dist2 * dist2);
        sum += x;
        sum2 += x * x;
    }
    let share = if corners.len() == 3 { 0.5 } else { 1.0 };
    let (mean, mean2) = (sum / f64::from(N), sum2 / f64::from(N));
    (share * mean, share * ((mean2 - mean * mean) / f64::from(N)).sqrt())
}

#[test]
fn polygons_in_any_pose_agree_with_brute_force() {
    let mut rng = rng(1);
    let (mut n_cut, mut n_below, mut sum_z2) = (0, 0, 0.0);
    for pose in 0..1000 {
        let (corners, point, normal) = loop {
            let corners = random_polygon(&mut rng);
            let point = warp::uniform_sphere(rng.next_2d()) * rng.next_f32() * 2.0;
            let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            // Close to the plane of the light its single samples have no finite variance.
            if n.is_finite() && (Vec3::from(point) - corners[0]).dot(n).abs() > 0.1 {
                break (corners, point, warp::uniform_sphere(rng.next_2d()).normalize());
            }
        };
        let above = corners.iter().filter(|c| (Vec3A::from(**c) - point).dot(normal) > 0.0).count();
        n_cut += u32::from(above > 0 && above < corners.len());
        n_below += u32::from(above == 0);
        let e = f64::from(polygon_irradiance(point, normal, &corners));
        let (mean, sigma) = brute_force(point.as_dvec3(), normal.as_dvec3(), &corners, &mut rng);
        let z = (e - mean) / sigma.max(1e-6 * mean).max(1e-12);
        assert!(z.abs() < 4.0, "pose {pose}: {e}, not {mean} +- {sigma}; {above} corners above");
        sum_z2 += z * z;

        let mut turned = corners.clone();
        turned.reverse();
        turned.rotate_left(1);
        let turned = f64::from(polygon_irradiance(point, normal, &turned));
        assert!((turned - e).abs() <= 1e-6 * e, "pose {pose}: {e} and {turned}");
    }
    assert!(n_cut > 200 && n_below > 200, "{n_cut} cut, {n_below} below the horizon");
    // If the closed form is exact, the errors are those of brute force: no larger, no smaller.
    let n = f64::from(1000 - n_below);
    assert!((sum_z2 / n - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{}", sum_z2 / n);
}

/// Irradiance depends continuously on the pose: corners and edges exactly on the horizon are no exception.
#[test]
fn corners_on_the_horizon_count() {
    let diamond = [[0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]];
    let mut rng = rng(2);
    for turn in 0..4 {
        // Two corners on the horizon, or, cut obliquely, one.
        let mut on_horizon: Vec<Vec3> = diamond.map(|[x, z]| Vec3::new(x, 2.0, z)).into();
        on_horizon.rotate_left(turn);
        let mut oblique: Vec<Vec3> = [[0.0, 0.0], [1.0, 0.5], [1.3, -0.2], [0.3, -0.7]]
            .map(|[x, z]| Vec3::new(x, 2.0, z))
            .into();
        oblique.rotate_left(turn);
        let mut wall: Vec<Vec3> = [[-1.0, 0.0], [1.0, 0.0], [1.0, 2.0], [-1.0, 2.0]]
            .map(|[x, z]| Vec3::new(x, 1.0, z))
            .into();
        wall.rotate_left(turn);
        for corners in [on_horizon, oblique, wall] {
            let at = |height: f32| polygon_irradiance(Vec3A::Z * height, Vec3A::Z, &corners);
            let e = at(0.0);
            assert!(e > 0.0, "{corners:?}");
            for height in [-1e-5, 1e-5] {
                assert!((at(height) - e).abs() < 3e-5, "{e}, but {} at {height}", at(height));
            }
            let (mean, sigma) = brute_force(DVec3::ZERO, DVec3::Z, &corners, &mut rng);
            assert!((f64::from(e) - mean).abs() < 4.0 * sigma, "{e}, not {mean} +- {sigma}");
        }
    }
}

#[test]
fn in_the_plane_of_a_light_and_behind_it_is_no_light() {
    let (corner, a, b) = (Vec3::new(0.1, 0.2, 0.7), Vec3::X, Vec3::new(0.3, 1.1, 0.0));
    let triangles = quad(corner, a, b);
    let corners = [corner, corner + a, corner + a + b, corner + b];
    let mesh: Vec<[Vec3; 3]> = (0..50).flat_map(|_| triangles).collect();
    let mut rng = rng(3);
    let lights = [
        area_light(&triangles, Rgb::ONE),
        area_light(&triangles[..1], Rgb::ONE),
        area_light(&mesh, Rgb::ONE),
    ];
    for i in 0..2000 {
        let u = rng.next_2d() * if i % 2 == 0 { 1.0 } else { 5.0 };
        let mut point = Vec3A::from(corner + a * u.x + b * u.y);
        if i % 5 == 0 {
            point.z -= 10.0 * rng.next_f32();
        }
        for normal in [Vec3A::Z, -Vec3A::Z, Vec3A::X, warp::uniform_sphere(rng.next_2d())] {
            if point.z == corner.z && normal.z.abs() == 1.0 {
                assert_eq!(polygon_irradiance(point, normal, &corners), 0.0, "at {point}");
            }
            for light in &lights {
                let e = light.unshadowed_irradiance(point, normal);
                assert!(e.is_none_or(Rgb::is_black), "{e:?} at {point}");
                let sample = light.seen_from(point, normal).sample(rng.next_2d());
                assert!(sample.is_none(), "{sample:?} at {point}");
            }
        }
    }
    // The light's front is where its corners run counterclockwise.
    let front = lights[0].unshadowed_irradiance(Vec3A::Z * 2.0, -Vec3A::Z).unwrap();
    assert!(front.g > 0.1, "{front:?}");
}

fn every_kind() -> Vec<Light> {
    let light = |kind| Light { name: "l".into(), kind };
    let mut rng = rng(4);
    let mut flake = || {
        let corner = (rng.next_2d() * 2.0 - 1.0).extend(3.0);
        [corner, corner + Vec3::Y * rng.next_f32(), corner + Vec3::X]
    };
    let pieces: Vec<[Vec3; 3]> = (0..20).map(|_| flake()).collect();
    // Near and at right angles, so close that most of their points send next to nothing.
    let nearby = [
        quad(Vec3::new(-1.0, -1.0, 0.1), Vec3::Y * 2.0, Vec3::X),
        quad(Vec3::new(-1.0, 1.0, 0.0), Vec3::X * 2.0, Vec3::Z),
    ]
    .concat();
    let quad = quad(Vec3::new(0.0, 0.0, 2.0), Vec3::Y, Vec3::new(1.0, 0.0, 0.4));
    let spot = Spot {
        position: Vec3A::new(0.2, 0.1, 2.0),
        direction: Vec3A::new(0.0, 0.6, -0.8),
        intensity: Rgb::new(1.0, 2.0, 3.0),
        cos_outer: 0.6,
        cos_inner: 0.9,
    };
    vec![
        area_light(&quad, Rgb::new(1.0, 2.0, 3.0)),
        area_light(&quad[..1], Rgb::new(1.0, 2.0, 3.0)),
        area_light(&pieces, Rgb::new(1.0, 2.0, 3.0)),
        area_light(&nearby, Rgb::new(1.0, 2.0, 3.0)),
        light(LightKind::Point { position: Vec3A::Z * 1.5, intensity: Rgb::new(3.0, 2.0, 1.0) }),
        light(LightKind::Spot(spot)),
        light(LightKind::Directional {
            direction: Vec3A::new(0.6, 0.0, -0.8),
            irradiance: Rgb::new(3.0, 2.0, 1.0),
        }),
        light(LightKind::Environment { radiance: Rgb::new(3.0, 2.0, 1.0) }),
    ]
}

#[test]
fn samples_have_the_unshadowed_irradiance_as_their_mean() {
    const N: u32 = 20_000;
    for (i, light) in every_kind().iter().enumerate() {
        let mut rng = rng(10 + i as u64);
        let mut n_lit = 0;
        for pose in 0..200 {
            let point = Vec3A::from((rng.next_2d() * 2.0 - 1.0).extend(0.0));
            let normal = warp::uniform_sphere(rng.next_2d()).normalize();
            let e = light.unshadowed_irradiance(point, normal).unwrap();
            n_lit += u32::from(!e.is_black());
            let view = light.seen_from(point, normal);
            let (mut sum, mut sum2) = (0.0, 0.0);
            for _ in 0..N {
                let sample = view.sample(rng.next_2d());
                let x = sample.map_or(0.0, |s| f64::from(s.irradiance.b));
                sum += x;
                sum2 += x * x;
            }
            let (mean, mean2) = (sum / f64::from(N), sum2 / f64::from(N));
            let sigma = ((mean2 - mean * mean).max(0.0) / f64::from(N)).sqrt();
            let off = (f64::from(e.b) - mean).abs();
            let what = format!("light {i}, pose {pose}: {} not {mean} +- {sigma}", e.b);
            // Lights that just rise above the horizon are hit too rarely for a sigma.
            assert!(off <= 4.0 * sigma + 1e-5, "{what}");
            // Where one sample tells everything, all of them are the same.
            assert!(!light.is_delta() || sigma <= 1e-6 * mean, "{what}");
        }
        assert!(n_lit > 40, "light {i} reaches {n_lit} poses of 200 only");
    }
}

/// Lights of many pieces have no closed form; their samples are as good.
#[test]
fn meshes_are_sampled_by_area() {
    let n = 60;
    let strip = |i: usize| {
        // Strips that become wider and wider, each a triangle pair that isn't in a row.
        let (x0, x1) =
            ((i * i) as f32 / (n * n) as f32, ((i + 1) * (i + 1)) as f32 / (n * n) as f32);
        quad(Vec3::new(x0, 0.0, 1.0), Vec3::Y, Vec3::X * (x1 - x0))
    };
    let triangles: Vec<[Vec3; 3]> = (0..n).flat_map(strip).collect();
    let light = area_light(&triangles, Rgb::ONE);
    assert!(light.unshadowed_irradiance(Vec3A::ZERO, Vec3A::Z).is_none());
    let whole = quad(Vec3::Z, Vec3::Y, Vec3::X);
    let expected = area_light(&whole, Rgb::ONE).unshadowed_irradiance(Vec3A::ZERO, Vec3A::Z);
    let expected = f64::from(expected.unwrap().g);
    let mut rng = rng(30);
    let view = light.seen_from(Vec3A::ZERO, Vec3A::Z);
    let (mut sum, mut sum2, n) = (0.0, 0.0, 400_000);
    for _ in 0..n {
        let x = view.sample(rng.next_2d());
        let x = x.map_or(0.0, |s| f64::from(s.irradiance.g));
        sum += x;
        sum2 += x * x;
    }
    let mean = sum / f64::from(n);
    let sigma = ((sum2 / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
    assert!((mean - expected).abs() < 4.0 * sigma, "{mean} +- {sigma}, not {expected}");
}

/// Directions towards a light give the irradiance that points on it give, and their density that of the emitter.
#[test]
fn beams_agree_with_samples() {
    let point = Vec3A::new(0.2, -0.1, 0.3);
    let corner = Vec3::new(-0.5, -0.4, 1.5);
    let triangles = [
        quad(corner, Vec3::Y * 0.7, Vec3::X * 1.2),
        quad(Vec3::new(2.0, 0.0, 1.0), Vec3::Y, Vec3::new(0.1, 0.0, 0.8)),
    ];
    let area = area_light(triangles.as_flattened(), Rgb::new(3.0, 2.0, 1.0));
    let (position, intensity) = (Vec3A::new(1.0, 1.0, 2.0), Rgb::new(2.0, 1.0, 0.5));
    let direction = Vec3A::new(0.0, -0.6, -0.8);
    let spot = Spot { position, direction, intensity, cos_outer: 0.5, cos_inner: 0.9 };
    let kinds = [
        LightKind::Point { position, intensity },
        LightKind::Spot(spot),
        LightKind::Directional { direction, irradiance: intensity },
    ];
    let mut lights = vec![area];
    lights.extend(kinds.map(|kind| Light { name: "l".into(), kind }));
    let mut rng = rng(11);
    for light in &lights {
        let mut n = 0;
        for _ in 0..1000 {
            let u = rng.next_2d();
            let beam = light.beam(point, u);
            let sample = light.sample(point, Vec3A::Z, u);
            assert_eq!(beam.is_some(), sample.is_some(), "{light:?}");
            let (Some(beam), Some(sample)) = (beam, sample) else { continue };
            let irradiance = beam.irradiance.g * beam.dir.z;
            assert!((irradiance / sample.irradiance.g - 1.0).abs() < 1e-5, "{light:?}");
            if let LightKind::Area(area) = &light.kind {
                let Toward::Point(target) = beam.toward else { panic!("{beam:?}") };
                let normal = Vec3A::from(if target.x > 1.5 {
                    Vec3::Y.cross(Vec3::new(0.1, 0.0, 0.8)).normalize()
                } else {
                    -Vec3::Z
                });
                let pdf = light.beam_pdf(-beam.dir.dot(normal), (target - point).length());
                assert!((pdf / beam.pdf - 1.0).abs() < 1e-4, "{pdf}, {beam:?}");
                let radiance = beam.irradiance.g * pdf;
                assert!((radiance / area.mean_radiance().g - 1.0).abs() < 1e-4, "{radiance}");
            }
            n += 1;
        }
        assert!(n > 500, "{n} of {light:?}");
    }
    let sky = LightKind::Environment { radiance: Rgb::ONE };
    assert!(Light { name: "l".into(), kind: sky }.beam(point, Vec2::ZERO).is_none());
}
