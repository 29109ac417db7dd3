//! Where photons start and whereto they go, against the densities that follow from radiance and intensity.

use std::f64::consts::PI;

use base::{Frame, Rgb, Rng, Stream};
use geometry::Bounds;
use glam::{Vec2, Vec3, Vec3A};
use scene::{AreaLight, Emission, Light, LightKind, Spot};

const N: usize = 200_000;

const BOUNDS: Bounds = Bounds { min: Vec3::new(-1.0, 2.0, 0.5), max: Vec3::new(3.0, 2.5, 1.5) };

fn light(kind: LightKind) -> Light {
    Light { name: "l".into(), kind }
}

fn emissions(light: &Light, seed: u64) -> Vec<Emission> {
    let mut rng = Rng::new(seed, Stream::Test, 0);
    (0..N)
        .map(|_| light.emit(&BOUNDS, [0; 4].map(|_| rng.next_f32())))
        .inspect(|e| assert!((e.dir.length() - 1.0).abs() < 1e-5, "{e:?}"))
        .collect()
}

/// Numbers in [0, 1), which are to be uniform and independent in pairs: chi-square with 255 degrees of freedom, of which
/// 99.997 % lie below 357.
fn assert_uniform(pairs: impl Iterator<Item = [f64; 2]>, what: &str) {
    const SIDE: usize = 16;
    let mut counts = [0_u32; SIDE * SIDE];
    for pair in pairs {
        let [x, y] = pair.map(|x| {
            assert!((-1e-4..1.0001).contains(&x), "{what}: {x} lies outside");
            ((x * SIDE as f64) as usize).min(SIDE - 1)
        });
        counts[y * SIDE + x] += 1;
    }
    let n: u32 = counts.iter().sum();
    let expected = f64::from(n) / counts.len() as f64;
    let chi2: f64 = counts.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
    assert!(chi2 < 357.0, "{what}: chi-square {chi2}");
}

fn azimuth(v: Vec3A) -> f64 {
    f64::from(v.y).atan2(f64::from(v.x)) / (2.0 * PI) + 0.5
}

/// Directions around a normal, mapped to numbers that are uniform if their density is the cosine.
fn assert_cosine(emissions: &[Emission], normal: Vec3A, what: &str) {
    let Frame { s, t, n } = Frame::new(normal);
    let pairs = emissions.iter().map(|e| {
        let d = Vec3A::new(e.dir.dot(s), e.dir.dot(t), e.dir.dot(n));
        assert!(d.z >= 0.0, "{what}: {} leaves behind", e.dir);
        [1.0 - f64::from(d.z).powi(2), azimuth(d)]
    });
    assert_uniform(pairs, what);
}

/// Coordinates of a point in units of two edges.
fn coordinates(point: Vec3A, corner: Vec3, a: Vec3, b: Vec3) -> [f64; 2] {
    let d = (Vec3::from(point) - corner).as_dvec3();
    let (a, b) = (a.as_dvec3(), b.as_dvec3());
    let n = a.cross(b);
    [d.cross(b).dot(n), a.cross(d).dot(n)].map(|x| x / n.length_squared())
}

/// The quad of a light that looks obliquely.
const CORNER: Vec3 = Vec3::new(0.5, 2.2, 1.0);
const A: Vec3 = Vec3::new(1.1, 0.1, 0.4);
const B: Vec3 = Vec3::new(0.3, 0.2, -0.7);

#[test]
fn quads_emit_evenly_and_by_the_cosine() {
    let triangles = [[CORNER, CORNER + A, CORNER + A + B], [CORNER, CORNER + A + B, CORNER + B]];
    let light = light(LightKind::Area(AreaLight::new(&triangles, Rgb::ONE)));
    let emissions = emissions(&light, 1);
    let at = |e: &Emission| coordinates(e.origin, CORNER, A, B);
    assert_uniform(emissions.iter().map(at), "positions");
    assert_cosine(&emissions, A.cross(B).normalize().into(), "directions");
    // Position and direction don't know of each other.
    let mixed = emissions.iter().map(|e| [at(e)[0], azimuth(e.dir)]);
    let mixed: Vec<[f64; 2]> = mixed.collect();
    let mean = |f: &dyn Fn(&[f64; 2]) -> f64| mixed.iter().map(f).sum::<f64>() / N as f64;
    let (x, y) = (mean(&|p| p[0]), mean(&|p| p[1]));
    let covariance = mean(&|p| (p[0] - x) * (p[1] - y));
    assert!(covariance.abs() < 4.0 / 12.0 / (N as f64).sqrt(), "{covariance}");
    for e in &emissions {
        let height = (e.origin - Vec3A::from(CORNER)).dot(A.cross(B).normalize().into());
        assert!((0.0..1e-5).contains(&height), "{height}");
    }
}

/// Where a point of a triangle would come from, if positions were made from the square root of a uniform number.
fn unfold([x, y]: [f64; 2]) -> [f64; 2] {
    let sum = x + y;
    [sum * sum, if sum > 0.0 { x / sum } else { 0.5 }]
}

#[test]
fn triangles_emit_evenly_and_by_the_cosine() {
    let triangle = [CORNER, CORNER + A, CORNER + B];
    let light = light(LightKind::Area(AreaLight::new(&[triangle], Rgb::ONE)));
    let emissions = emissions(&light, 2);
    let at = |e: &Emission| unfold(coordinates(e.origin, CORNER, A, B));
    assert_uniform(emissions.iter().map(at), "positions");
    assert_cosine(&emissions, A.cross(B).normalize().into(), "directions");
}

#[test]
fn meshes_emit_evenly_over_pieces_of_any_size() {
    // A square, then triangles that become smaller and smaller, each at a height of its own.
    let mut triangles = vec![[Vec3::ZERO, Vec3::X, Vec3::ONE.with_z(0.0)]];
    triangles.push([Vec3::ZERO, Vec3::ONE.with_z(0.0), Vec3::Y]);
    let size = |i: usize| 0.8_f32.powi(i as i32);
    let corner = |i: usize| Vec3::new(2.0, 0.0, 1.0 + i as f32);
    for i in 0..20 {
        triangles.push([corner(i), corner(i) + Vec3::X * size(i), corner(i) + Vec3::Y * size(i)]);
    }
    let light = light(LightKind::Area(AreaLight::new(&triangles, Rgb::ONE)));
    let emissions = emissions(&light, 3);
    assert_cosine(&emissions, Vec3A::Z, "directions");

    let on_piece = |z: f32| {
        emissions.iter().map(|e| e.origin).filter(move |origin| (origin.z - z).abs() < 0.1)
    };
    let square = on_piece(0.0).map(|p| coordinates(p, Vec3::ZERO, Vec3::X, Vec3::Y));
    assert_uniform(square, "positions on the square");
    let area: f64 = 1.0 + (0..20).map(|i| 0.5 * f64::from(size(i)).powi(2)).sum::<f64>();
    let (mut chi2, mut n_square) = (0.0, N as f64);
    for i in 0..20 {
        let piece: Vec<Vec3A> = on_piece(corner(i).z).collect();
        let expected = 0.5 * f64::from(size(i)).powi(2) / area * N as f64;
        chi2 += (piece.len() as f64 - expected).powi(2) / expected;
        n_square -= piece.len() as f64;
        if i < 4 {
            let (a, b) = (Vec3::X * size(i), Vec3::Y * size(i));
            let at = piece.iter().map(|p| unfold(coordinates(*p, corner(i), a, b)));
            assert_uniform(at, &format!("positions on triangle {i}"));
        }
    }
    chi2 += (n_square - N as f64 / area).powi(2) / (N as f64 / area);
    // 20 degrees of freedom: 99.997 % lie below 55.
    assert!(chi2 < 55.0, "shares of the pieces: chi-square {chi2}");
}

#[test]
fn points_emit_into_all_directions_alike() {
    let position = Vec3A::new(1.0, -2.0, 3.0);
    let light = light(LightKind::Point { position, intensity: Rgb::ONE });
    let emissions = emissions(&light, 4);
    assert!(emissions.iter().all(|e| e.origin == position));
    let pairs = emissions.iter().map(|e| [0.5 + 0.5 * f64::from(e.dir.z), azimuth(e.dir)]);
    assert_uniform(pairs, "directions");
}

#[test]
fn spots_emit_by_their_falloff() {
    for (cos_outer, cos_inner) in [(0.5, 0.9), (0.0, 0.01), (0.9, 0.9), (-0.5, 0.999), (0.97, 1.0)]
    {
        let direction = Vec3A::new(0.6, 0.0, -0.8);
        let position = Vec3A::new(1.0, -2.0, 3.0);
        let intensity = Rgb::new(1.0, 2.0, 4.0);
        let spot = Spot { position, direction, intensity, cos_outer, cos_inner };
        let what = format!("spot {cos_outer} {cos_inner}");

        // The flux inside an angle, by small steps of its cosine.
        const STEPS: usize = 100_000;
        let step = f64::from(1.0 - cos_outer) / STEPS as f64;
        let mut inside = vec![0.0; STEPS + 1];
        for i in 0..STEPS {
            let cos = 1.0 - (i as f64 + 0.5) * step;
            inside[i + 1] = inside[i] + 2.0 * PI * step * f64::from(spot.falloff(cos as f32));
        }
        let light = light(LightKind::Spot(spot));
        let flux = light.flux(&BOUNDS);
        let expected = Rgb::new(1.0, 2.0, 4.0) * inside[STEPS] as f32;
        let off = (flux - expected).map(f32::abs).max_channel() / expected.b;
        assert!(off < 3e-5, "{what}: {flux:?}, not {expected:?}");

        let Frame { s, t, .. } = Frame::new(direction);
        let pairs = emissions(&light, 5).into_iter().map(|e| {
            assert_eq!(e.origin, position);
            let around = Vec3A::new(e.dir.dot(s), e.dir.dot(t), 0.0);
            let at = (1.0 - f64::from(e.dir.dot(direction))) / step;
            assert!(at < STEPS as f64 * (1.0 + 1e-4), "{what}: {} lies outside", e.dir);
            [inside[(at as usize).min(STEPS)] / inside[STEPS], azimuth(around)]
        });
        assert_uniform(pairs.collect::<Vec<_>>().into_iter(), &what);
    }
}

/// Where a ray from beyond crosses the disc around the middle of the scene, in units of its radius.
fn on_disc(e: &Emission) -> Vec2 {
    let radius = BOUNDS.diagonal() * 0.5;
    let from_center = e.origin - Vec3A::from(BOUNDS.center());
    // Photons start on the disc that touches the sphere around the scene.
    assert!((from_center.dot(e.dir) + radius).abs() < 1e-4, "{e:?}");
    let Frame { s, t, .. } = Frame::new(e.dir);
    Vec2::new(from_center.dot(s), from_center.dot(t)) / radius
}

fn disc_pair(e: &Emission) -> [f64; 2] {
    let p = on_disc(e).as_dvec2();
    [p.length_squared(), p.y.atan2(p.x) / (2.0 * PI) + 0.5]
}

#[test]
fn light_from_beyond_covers_the_scene_evenly() {
    let direction = Vec3A::new(0.48, -0.6, 0.64);
    let sun = light(LightKind::Directional { direction, irradiance: Rgb::ONE });
    let emissions_of_sun = emissions(&sun, 6);
    assert!(emissions_of_sun.iter().all(|e| (e.dir - direction).length() < 1e-6));
    assert_uniform(emissions_of_sun.iter().map(disc_pair), "parallel light");

    let sky = light(LightKind::Environment { radiance: Rgb::ONE });
    let emissions_of_sky = emissions(&sky, 7);
    assert_uniform(emissions_of_sky.iter().map(disc_pair), "the sky's positions");
    let directions = emissions_of_sky.iter();
    let directions = directions.map(|e| [0.5 + 0.5 * f64::from(e.dir.z), azimuth(e.dir)]);
    assert_uniform(directions, "the sky's directions");
    let mixed = emissions_of_sky.iter().map(|e| [disc_pair(e)[0], 0.5 + 0.5 * f64::from(e.dir.z)]);
    assert_uniform(mixed, "the sky's positions and directions");
}
