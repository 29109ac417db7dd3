//! FLIP against the authors' own program, and on several threads.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

use base::{Grid, ImageSize, Pixel, Rgb};
use film::{FlipStats, flip};

/// What `flip-evaluator` 1.7 gives for the clamped pictures, by `evaluate(a, b, "LDR", inputsRGB=False)`.
struct Expected {
    mean: f64,
    max: f32,
    p99: f64,
    worst_block_8x8: f64,
    share_above_0_1: f64,
    /// At the four corners, in the middle, and at a third of the width and a fifth of the height.
    pixels: [f32; 6],
}

/// A value in 0..=255 for pixel and channel, which is divided by 255. Integers come out the same in every language.
type Formula = fn(u32, u32, u32) -> u32;

fn picture(size: ImageSize, formula: Formula) -> Grid<Rgb> {
    Grid::from_fn(size, |p| {
        Rgb::from([0, 1, 2].map(|channel| formula(p.x, p.y, channel) as f32 / 255.0))
    })
}

fn noise(x: u32, y: u32, channel: u32, seed: u32) -> u32 {
    let mut h = x.wrapping_mul(73_856_093)
        ^ y.wrapping_mul(19_349_663)
        ^ channel.wrapping_mul(83_492_791)
        ^ seed.wrapping_mul(2_654_435_761);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2c1b_3c6d);
    h ^= h >> 12;
    h = h.wrapping_mul(0x297a_2d39);
    (h ^ (h >> 15)) & 255
}

fn blocks(x: u32, y: u32, channel: u32) -> u32 {
    (x / 12 + y / 9 + channel) % 3 * 100
}

fn ramp(x: u32, y: u32, channel: u32) -> u32 {
    (5 * x + 3 * y + 40 * channel) % 256
}

fn check(size: ImageSize, a: Formula, b: Formula, exposure_ev: f32, expected: &Expected) {
    let (a, b) = (picture(size, a), picture(size, b));
    let map = flip(&a, &b, exposure_ev).unwrap();
    let stats = FlipStats::of(&map);
    let near = |what: &str, ours: f64, theirs: f64, tolerance: f64| {
        assert!((ours - theirs).abs() < tolerance, "{what}: {ours}, not {theirs}");
    };
    near("mean", stats.mean, expected.mean, 1e-5);
    near("p99", stats.p99, expected.p99, 1e-4);
    near("worst block", stats.worst_block_8x8, expected.worst_block_8x8, 1e-4);
    near("share above 0.1", stats.share_above_0_1, expected.share_above_0_1, 1e-6);
    let max = map.values().iter().copied().fold(0.0, f32::max);
    near("max", max.into(), expected.max.into(), 1e-4);
    let ImageSize { width: w, height: h } = size;
    let places = [(0, 0), (w - 1, 0), (0, h - 1), (w - 1, h - 1), (w / 2, h / 2), (w / 3, h / 5)];
    for ((x, y), theirs) in places.into_iter().zip(expected.pixels) {
        near(&format!("pixel ({x}, {y})"), map[Pixel { x, y }].into(), theirs.into(), 1e-4);
    }
    assert_eq!(flip(&b, &a, exposure_ev).unwrap(), map, "the order of the pictures matters");
}

const SIZE: ImageSize = ImageSize { width: 80, height: 60 };

#[test]
fn noise_against_noise() {
    let expected = Expected {
        mean: 0.395_394_9,
        max: 0.917_036_3,
        p99: 0.736_583_8,
        worst_block_8x8: 0.507_477_6,
        share_above_0_1: 0.995,
        pixels: [0.778_541_5, 0.704_116_4, 0.443_876, 0.917_036_3, 0.740_710_3, 0.288_711_2],
    };
    check(SIZE, |x, y, c| noise(x, y, c, 1), |x, y, c| noise(x, y, c, 2), 0.0, &expected);
}

#[test]
fn edges_moved_by_a_pixel() {
    let expected = Expected {
        mean: 0.227_189_5,
        max: 0.830_122_2,
        p99: 0.806_469_6,
        worst_block_8x8: 0.471_537_1,
        share_above_0_1: 0.642_708_3,
        pixels: [0.0, 0.007_453_2, 0.0, 0.006_626_7, 0.017_349_2, 0.092_600_7],
    };
    check(SIZE, blocks, |x, y, c| blocks(x + 1, y, c), 0.0, &expected);
}

#[test]
fn bright_points() {
    let expected = Expected {
        mean: 0.023_848_7,
        max: 0.465_924_7,
        p99: 0.255_579,
        worst_block_8x8: 0.126_591_4,
        share_above_0_1: 0.058_541_7,
        pixels: [0.006_545_2, 0.000_525_5, 0.053_612_9, 0.001_486_1, 0.029_779_7, 0.001_584_2],
    };
    let dots: Formula = |x, y, c| if x % 17 == 3 && y % 13 == 5 { 255 } else { ramp(x, y, c) };
    check(SIZE, ramp, dots, 0.0, &expected);
}

#[test]
fn exposed_until_it_clips() {
    let expected = Expected {
        mean: 0.109_788_8,
        max: 0.180_306_7,
        p99: 0.179_88,
        worst_block_8x8: 0.166_438_3,
        share_above_0_1: 0.439_166_7,
        pixels: [0.146_308_6, 0.150_275_3, 0.158_531_7, 0.158_496_6, 0.172_826_8, 0.174_431],
    };
    check(SIZE, blocks, |x, y, c| blocks(x, y, c) * 7 / 8, 1.5, &expected);
}

#[test]
fn noise_in_the_dark() {
    let expected = Expected {
        mean: 0.049_529_6,
        max: 0.100_462_9,
        p99: 0.089_337_4,
        worst_block_8x8: 0.082_142_3,
        share_above_0_1: 0.000_208_3,
        pixels: [0.091_973_5, 0.033_545_6, 0.053_375_9, 0.023_408_5, 0.053_278_1, 0.045_873_9],
    };
    let noisy: Formula = |x, y, c| (ramp(x, y, c) * 9 + noise(x, y, c, 3)) / 10;
    check(SIZE, ramp, noisy, -4.0, &expected);
}

#[test]
fn smaller_than_the_filters() {
    let expected = Expected {
        mean: 0.488_212_1,
        max: 0.654_863_8,
        p99: 0.654_863_8,
        worst_block_8x8: 0.488_212_1,
        share_above_0_1: 1.0,
        pixels: [0.561_401_8, 0.645_143_6, 0.654_863_8, 0.442_088_2, 0.478_750_5, 0.433_976_9],
    };
    let size = ImageSize { width: 5, height: 3 };
    check(size, |x, y, c| noise(x, y, c, 4), |x, y, c| noise(x, y, c, 5), 0.0, &expected);
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let (a, b) = (picture(SIZE, ramp), picture(SIZE, blocks));
    let compare = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (difference, map) = pool.install(|| film::compare(&a, &b, 0.5)).unwrap();
        (difference, map.values().iter().map(|v| v.to_bits()).collect::<Vec<u32>>())
    };
    let one = compare(1);
    assert_eq!(compare(2), one);
    assert_eq!(compare(3), one);
}
