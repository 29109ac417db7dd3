//! Every function of `base::warp` against its density.

use std::f64::consts::PI;

use base::{Rng, Stream, warp};
use glam::{Vec2, Vec3A};

const N: usize = 400_000;

/// Chi-square of counts against what is expected, which 99.997 % of samples pass (Wilson and Hilferty 1931).
fn assert_fits(counts: &[u32], expected: &[f64], what: &str) {
    let total: f64 = expected.iter().sum();
    assert!(
        (total / N as f64 - 1.0).abs() < 1e-4,
        "{what}: the density has integral {total} / {N}"
    );
    let (mut chi2, mut freedom) = (0.0, -1.0);
    for (&n, &e) in counts.iter().zip(expected) {
        assert!(e > 0.0 || n == 0, "{what}: {n} where the density is 0");
        // Bins that expect a handful aren't normally distributed.
        if e > 10.0 {
            chi2 += (f64::from(n) - e).powi(2) / e;
            freedom += 1.0;
        }
    }
    let spread = 2.0 / (9.0 * freedom);
    let limit = freedom * (1.0 - spread + 4.0 * f64::sqrt(spread)).powi(3);
    assert!(chi2 < limit, "{what}: chi-square {chi2} with {freedom} degrees of freedom");
}

fn points(stream: u64) -> impl Iterator<Item = Vec2> {
    let mut rng = Rng::new(0, Stream::Test, stream);
    (0..N).map(move |_| rng.next_2d())
}

/// Directions over bins of height `z_min..1` and azimuth, whose density per steradian is a function of height.
fn check_directions(
    z_min: f32,
    sample: impl Fn(Vec2) -> Vec3A,
    pdf: impl Fn(f32) -> f32,
    what: &str,
) {
    const ROWS: usize = 24;
    const COLUMNS: usize = 32;
    const STEPS: usize = 16;
    let mut counts = vec![0; ROWS * COLUMNS];
    for u in points(1) {
        let d = sample(u);
        assert!((d.length() - 1.0).abs() < 1e-5, "{what}: {d} from {u}");
        let azimuth = f64::from(d.y).atan2(f64::from(d.x)) / (2.0 * PI) + 0.5;
        let row = (d.z - z_min) / (1.0 - z_min) * ROWS as f32;
        assert!(row > -1e-3, "{what}: {d} lies outside");
        let column = (azimuth * COLUMNS as f64) as usize;
        counts[(row as usize).min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)] += 1;
    }
    let height = f64::from(1.0 - z_min) / ROWS as f64;
    let expected: Vec<f64> = (0..ROWS * COLUMNS)
        .map(|bin| {
            let mean: f64 = (0..STEPS)
                .map(|i| (i as f64 + 0.5) / STEPS as f64)
                .map(|x| pdf((f64::from(z_min) + ((bin / COLUMNS) as f64 + x) * height) as f32))
                .map(f64::from)
                .sum();
            mean / STEPS as f64 * height * 2.0 * PI / COLUMNS as f64 * N as f64
        })
        .collect();
    assert_fits(&counts, &expected, what);
}

#[test]
fn directions_follow_their_densities() {
    check_directions(-1.0, warp::uniform_sphere, |_| warp::UNIFORM_SPHERE_PDF, "sphere");
    check_directions(0.0, warp::cosine_hemisphere, warp::cosine_hemisphere_pdf, "hemisphere");
    for cos in [-0.5, 0.0, 0.9, 0.999] {
        let what = format!("cone of cosine {cos}");
        let sample = |u| warp::uniform_cone(u, cos);
        check_directions(cos, sample, |_| warp::uniform_cone_pdf(cos), &what);
    }
}

/// Points over a square of bins around the origin, or from it to (1, 1).
fn check_points(from: f32, sample: impl Fn(Vec2) -> Vec2, pdf: impl Fn(Vec2) -> f64, what: &str) {
    const SIDE: usize = 24;
    const STEPS: usize = 96;
    let size = (1.0 - from) / SIDE as f32;
    let mut counts = vec![0; SIDE * SIDE];
    for u in points(2) {
        let at = (sample(u) - from) / size;
        assert!(at.min_element() > -1e-3 && at.max_element() < SIDE as f32 + 1e-3, "{what}: {at}");
        let at = at.clamp(Vec2::ZERO, Vec2::splat(SIDE as f32 - 0.5));
        counts[at.y as usize * SIDE + at.x as usize] += 1;
    }
    let expected: Vec<f64> = (0..SIDE * SIDE)
        .map(|bin| {
            let corner = Vec2::new((bin % SIDE) as f32, (bin / SIDE) as f32);
            let sum: f64 = (0..STEPS * STEPS)
                .map(|i| Vec2::new((i % STEPS) as f32, (i / STEPS) as f32) + 0.5)
                .map(|step| pdf((corner + step / STEPS as f32) * size + from))
                .sum();
            sum * f64::from(size * size) / (STEPS * STEPS) as f64 * N as f64
        })
        .collect();
    assert_fits(&counts, &expected, what);
}

#[test]
fn points_follow_their_densities() {
    let disc = |p: Vec2| if p.length_squared() < 1.0 { 1.0 / PI } else { 0.0 };
    check_points(-1.0, warp::uniform_disc, disc, "disc");
    // The diagonal runs through the middle of steps: half of those count.
    let triangle = |p: Vec2| match (p.x + p.y - 1.0).abs() < 1e-5 {
        true => 1.0,
        false => f64::from(u8::from(p.x + p.y < 1.0)) * 2.0,
    };
    check_points(0.0, warp::uniform_triangle, triangle, "triangle");
}

#[test]
fn smoothstep_inverts_its_integral() {
    const BINS: usize = 64;
    let mut counts = vec![0; BINS];
    for u in points(3) {
        let x = warp::smoothstep(u.x);
        let integral = x * x * x * (2.0 - x);
        assert!((integral - u.x).abs() < 1e-6, "{} became {x}", u.x);
        counts[((x * BINS as f32) as usize).min(BINS - 1)] += 1;
    }
    let integral = |bin: usize| {
        let x = bin as f64 / BINS as f64;
        x * x * x * (2.0 - x) * N as f64
    };
    let expected: Vec<f64> = (0..BINS).map(|bin| integral(bin + 1) - integral(bin)).collect();
    assert_fits(&counts, &expected, "smoothstep");
}

#[test]
fn the_corners_of_the_unit_square_are_no_exception() {
    let last = 1.0 - 1.0 / 16_777_216.0;
    for u in [0.0, 0.25, 0.5, 0.75, last] {
        assert!((0.0..=1.0).contains(&warp::smoothstep(u)), "{u}");
        for v in [0.0, 0.25, 0.5, 0.75, last] {
            let u = Vec2::new(u, v);
            let directions =
                [warp::uniform_sphere(u), warp::cosine_hemisphere(u), warp::uniform_cone(u, 0.3)];
            for d in directions {
                assert!((d.length() - 1.0).abs() < 1e-6, "{u} became {d}");
            }
            assert!(warp::cosine_hemisphere(u).z >= 0.0 && warp::uniform_cone(u, 0.3).z >= 0.3);
            assert!(warp::uniform_disc(u).length() <= 1.0 + 1e-6, "{u}");
            let t = warp::uniform_triangle(u);
            assert!(t.min_element() >= 0.0 && t.element_sum() <= 1.0, "{u} became {t}");
        }
    }
}
