//! LDR-FLIP: the difference that a viewer sees who flips between two pictures.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild 2020, "FLIP: A Difference Evaluator for Alternating
//! Images". The filters are separated as in the authors' note on separable convolutions, so that each picture is read
//! once along its rows and once along its columns.
//!
//! The authors' `flip-evaluator` gives the same map for linear values when told so: `evaluate(reference, test, "LDR",
//! inputsRGB=False)`. By default it takes the values of an EXR file for sRGB, and its command line program compares EXR
//! files by HDR-FLIP; for PNG files the 8 bits of rounding make the whole difference to this map.

use std::array;

use base::math::{self, exp, pow};
use base::{Grid, Rgb};
use rayon::prelude::*;

use crate::Error;
use crate::srgb::{clamp, exposure_factor};

/// The authors' default viewer: 0.7 m from a screen 0.7 m wide with 3840 pixels.
const PIXELS_PER_DEGREE: f32 = 3840.0 * math::PI / 180.0;

/// Exponent of the color difference.
const Q_COLOR: f32 = 0.7;
/// Share of the largest color difference below which the range up to `P_T` is used.
const P_COLOR: f32 = 0.4;
/// The value that `P_COLOR` of the largest color difference is mapped to.
const P_T: f32 = 0.95;
/// Width of the feature detectors, in degrees.
const FEATURE_WIDTH: f32 = 0.082;

/// The per-pixel FLIP of two linear pictures, in [0, 1], for the default viewing conditions (67 pixels per degree).
///
/// The pictures are scaled by 2^`exposure_ev` and clamped to [0, 1] first. The order of the two does not matter.
///
/// # Errors
/// When the sizes differ, when a value is NaN or infinite, or when there are no pixels.
pub fn flip(a: &Grid<Rgb>, b: &Grid<Rgb>, exposure_ev: f32) -> Result<Grid<f32>, Error> {
    check_comparable(a, b)?;
    let size = a.size();
    let width = size.width as usize;
    let factor = exposure_factor(exposure_ev);
    let kernels = Kernels::new(PIXELS_PER_DEGREE);
    let rows = [a, b].map(|picture| filter_rows(picture, factor, &kernels));
    let max_color = max_color_difference();
    let mut map = vec![0.0_f32; size.n_pixels()];
    map.par_chunks_mut(width).enumerate().for_each_init(
        || array::from_fn(|_| Columns::new(width)),
        |columns: &mut [Columns; 2], (y, line)| {
            for (columns, rows) in columns.iter_mut().zip(&rows) {
                columns.filter(rows, y, &kernels);
            }
            let [a, b] = columns;
            for (x, value) in line.iter_mut().enumerate() {
                let color = color_difference(a.lab(x), b.lab(x), max_color);
                let feature = feature_difference(a.features(x), b.features(x));
                *value = pow(color, 1.0 - feature);
            }
        },
    );
    Ok(Grid::from_values(size, map))
}

/// FLIP of two linear colors as seen over a large area, in [0, 1]: what [`flip`] gives where both pictures are constant.
pub fn flip_of_colors(a: Rgb, b: Rgb, exposure_ev: f32) -> f32 {
    let factor = exposure_factor(exposure_ev);
    let [a, b] = [a, b].map(|c| hunt_lab(xyz(c.to_array().map(|v| clamp(v * factor)))));
    color_difference(a, b, max_color_difference())
}

/// Whether the two pictures can be told apart by numbers at all.
pub(crate) fn check_comparable(a: &Grid<Rgb>, b: &Grid<Rgb>) -> Result<(), Error> {
    if a.size() != b.size() {
        return Err(Error::SizesDiffer { a: a.size(), b: b.size() });
    }
    if a.size().n_pixels() == 0 {
        return Err(Error::NothingToCompare);
    }
    for (which, picture) in [("first", a), ("second", b)] {
        if let Some(index) = picture.values().iter().position(|c| !c.is_finite()) {
            let color = picture.values()[index].to_array();
            let value = color.into_iter().find(|v| !v.is_finite());
            return Err(Error::NotComparable {
                which,
                pixel: picture.size().pixel(index),
                value: value.expect("the color is not finite, so one of its channels is not"),
            });
        }
    }
    Ok(())
}

/// The filters along one axis. The two-dimensional ones are their products.
struct Kernels {
    /// What the eye resolves of luminance, of red against green, and of blue against yellow, whose filter is the sum
    /// of two products.
    color: [Vec<f32>; 4],
    /// A Gaussian with its first and second derivative.
    feature: [Vec<f32>; 3],
}

impl Kernels {
    fn new(pixels_per_degree: f32) -> Self {
        /// Weights and widths of the Gaussians (Table 1 of the paper), in degrees squared.
        const GAUSSIANS: [(f32, f32); 4] =
            [(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04), (13.5, 0.025)];
        let pi2 = math::PI * math::PI;
        let radius = (3.0 * (0.04 / (2.0 * pi2)).sqrt() * pixels_per_degree).ceil() as i32;
        let mut color = GAUSSIANS.map(|(a, b)| {
            let weight = (a * (math::PI / b).sqrt()).sqrt();
            let gaussian = |x: i32| {
                let x = x as f32 / pixels_per_degree;
                weight * exp(-pi2 * x * x / b)
            };
            (-radius..=radius).map(gaussian).collect::<Vec<f32>>()
        });
        // In two dimensions, each of the three filters sums to 1.
        let sums = color.each_ref().map(|kernel| kernel.iter().sum::<f32>());
        let both = (sums[2] * sums[2] + sums[3] * sums[3]).sqrt();
        for (kernel, sum) in color.iter_mut().zip([sums[0], sums[1], both, both]) {
            kernel.iter_mut().for_each(|weight| *weight /= sum);
        }

        let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let variance = deviation * deviation;
        let radius = (3.0 * deviation).ceil() as i32;
        let taps = || (-radius..=radius).map(|x| x as f32);
        let gaussian = |x: f32| exp(-x * x / (2.0 * variance));
        let feature = [
            taps().map(gaussian).collect(),
            taps().map(|x| -x * gaussian(x)).collect(),
            taps().map(|x| (x * x / variance - 1.0) * gaussian(x)).collect(),
        ];
        Self { color, feature: feature.map(balance) }
    }

    /// Pixels that a filter reaches to either side, at most.
    fn reach(&self) -> usize {
        self.color[0].len().max(self.feature[0].len()) / 2
    }
}

/// Scales the positive weights to sum to 1, and the negative ones to sum to -1.
fn balance(mut kernel: Vec<f32>) -> Vec<f32> {
    let positive: f32 = kernel.iter().filter(|&&w| w > 0.0).sum();
    let negative: f32 = kernel.iter().filter(|&&w| w < 0.0).sum();
    for weight in &mut kernel {
        *weight /= if *weight > 0.0 { positive } else { -negative };
    }
    kernel
}

/// Results of the filters along rows: four of color, then the Gaussian and its two derivatives of luminance.
const N_ROWS: usize = 7;

/// Filters the rows of a picture. Line y of the result holds its `N_ROWS` lines one after another.
fn filter_rows(picture: &Grid<Rgb>, factor: f32, kernels: &Kernels) -> Vec<f32> {
    let width = picture.size().width as usize;
    let reach = kernels.reach();
    let mut rows = vec![0.0; N_ROWS * picture.values().len()];
    rows.par_chunks_mut(N_ROWS * width).zip(picture.values().par_chunks(width)).for_each_init(
        || [const { Vec::new() }; 4],
        |planes: &mut [Vec<f32>; 4], (rows, pixels)| {
            for plane in planes.iter_mut() {
                plane.clear();
            }
            // The border is repeated.
            let inner = pixels.iter();
            let before = std::iter::repeat_n(&pixels[0], reach);
            let after = std::iter::repeat_n(&pixels[width - 1], reach);
            for &pixel in before.chain(inner).chain(after) {
                let [y, cx, cz] = opponent((pixel * factor).map(clamp));
                planes[0].push(y);
                planes[1].push(cx);
                planes[2].push(cz);
                planes[3].push((y + 16.0) / 116.0);
            }
            let [y, cx, cz, luminance] = planes;
            let sources = [&*y, cx, cz, cz, luminance, luminance, luminance];
            let filters = kernels.color.iter().chain(&kernels.feature);
            for ((row, source), kernel) in rows.chunks_mut(width).zip(sources).zip(filters) {
                let source = &source[reach - kernel.len() / 2..];
                for (tap, &weight) in kernel.iter().enumerate() {
                    add_scaled(row, &source[tap..], weight);
                }
            }
        },
    );
    rows
}

/// One line of a picture filtered along both axes.
struct Columns {
    /// Luminance, red-green, and the two parts of blue-yellow.
    color: [Vec<f32>; 4],
    /// First and second derivative of luminance along x, then along y.
    derivatives: [Vec<f32>; 4],
}

impl Columns {
    fn new(width: usize) -> Self {
        let lines = || array::from_fn(|_| vec![0.0; width]);
        Self { color: lines(), derivatives: lines() }
    }

    /// Filters along the columns, for line `y`. The border is repeated.
    fn filter(&mut self, rows: &[f32], y: usize, kernels: &Kernels) {
        let width = self.color[0].len();
        let n_lines = rows.len() / (N_ROWS * width);
        let source = |tap: usize, taps: usize, row: usize| {
            let line = (y + tap).saturating_sub(taps / 2).min(n_lines - 1);
            &rows[(line * N_ROWS + row) * width..][..width]
        };
        let [gaussian, first, second] = &kernels.feature;
        let color = self.color.iter_mut().zip(0..).zip(&kernels.color);
        // A derivative along one axis is smoothed along the other.
        let derivatives =
            self.derivatives.iter_mut().zip([5, 6, 4, 4]).zip([gaussian, gaussian, first, second]);
        for ((line, row), kernel) in color.chain(derivatives) {
            line.fill(0.0);
            for (tap, &weight) in kernel.iter().enumerate() {
                add_scaled(line, source(tap, kernel.len(), row), weight);
            }
        }
    }

    /// The color that is seen at `x`: CIELAB with the Hunt effect.
    fn lab(&self, x: usize) -> [f32; 3] {
        let [y, cx, cz_wide, cz_narrow] = self.color.each_ref().map(|line| line[x]);
        let rgb = linear_from_opponent([y, cx, cz_wide + cz_narrow]).map(clamp);
        hunt_lab(xyz(rgb))
    }

    /// How much of an edge, and how much of a point there is at `x`.
    fn features(&self, x: usize) -> [f32; 2] {
        let [dx, ddx, dy, ddy] = self.derivatives.each_ref().map(|line| line[x]);
        [(dx * dx + dy * dy).sqrt(), (ddx * ddx + ddy * ddy).sqrt()]
    }
}

/// Adds `weight` times `source`, which may be longer.
#[inline]
fn add_scaled(line: &mut [f32], source: &[f32], weight: f32) {
    for (sum, value) in line.iter_mut().zip(source) {
        *sum += weight * value;
    }
}

/// The distance of two colors in [0, 1]: `HyAB`, compressed so that small differences take most of the range.
fn color_difference(a: [f32; 3], b: [f32; 3], max: f32) -> f32 {
    let difference = pow(hyab(a, b), Q_COLOR);
    let knee = P_COLOR * max;
    if difference < knee {
        difference * P_T / knee
    } else {
        P_T + (difference - knee) / (max - knee) * (1.0 - P_T)
    }
}

/// The largest color difference there is: between green and blue.
fn max_color_difference() -> f32 {
    let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|rgb| hunt_lab(xyz(rgb)));
    pow(hyab(green, blue), Q_COLOR)
}

/// The larger of the differences in edges and in points, in [0, 1].
fn feature_difference(a: [f32; 2], b: [f32; 2]) -> f32 {
    let larger = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
    (larger * std::f32::consts::FRAC_1_SQRT_2).sqrt()
}

/// City block in lightness, Euclid in chroma (Abasi et al. 2019).
fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [l, u, v] = array::from_fn(|i| a[i] - b[i]);
    l.abs() + (u * u + v * v).sqrt()
}

/// The white of D65, and its reciprocal.
const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];
const WHITE_RECIPROCAL: [f32; 3] = [1.052_156_9, 1.0, 0.918_357_7];

/// CIE XYZ of linear Rec. 709.
#[inline]
fn xyz(rgb: [f32; 3]) -> [f32; 3] {
    const M: [[f32; 3]; 3] = [
        [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
        [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
        [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
    ];
    multiply(&M, rgb)
}

/// `YCxCz` of linear Rec. 709: a linear space of opponent colors.
#[inline]
fn opponent(rgb: Rgb) -> [f32; 3] {
    let xyz = xyz(rgb.to_array());
    let [x, y, z] = array::from_fn(|i| xyz[i] * WHITE_RECIPROCAL[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Linear Rec. 709 of `YCxCz`.
#[inline]
fn linear_from_opponent([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    const M: [[f32; 3]; 3] = [
        [3.241_003_3, -1.537_399, -0.498_615_86],
        [-0.969_224_33, 1.875_930_1, 0.041_554_224],
        [0.055_639_423, -0.204_011_2, 1.057_148_9],
    ];
    let y = (y + 16.0) / 116.0;
    let xyz = [y + cx / 500.0, y, y - cz / 200.0];
    multiply(&M, array::from_fn(|i| xyz[i] * WHITE[i]))
}

#[inline]
fn multiply(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// CIELAB, its chroma scaled by lightness: bright colors look more colorful (Hunt 1952).
#[inline]
fn hunt_lab(xyz: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let [x, y, z] = array::from_fn(|i| {
        let t = xyz[i] * WHITE_RECIPROCAL[i];
        if t > DELTA * DELTA * DELTA {
            cube_root(t)
        } else {
            t / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    });
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    [lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z)]
}

/// The cube root of a positive number. Six of them a pixel make this worth its lines: `pow` takes ten times as long.
#[inline]
fn cube_root(t: f32) -> f32 {
    // A third of the exponent is right to 5 %, each of Halley's steps triples the number of digits.
    let mut root = f32::from_bits(t.to_bits() / 3 + 0x2a51_19f2);
    for _ in 0..2 {
        let cube = root * root * root;
        root *= (cube + 2.0 * t) / (2.0 * cube + t);
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_right_to_the_last_digits() {
        for i in 1..100_000 {
            let t = i as f32 * 1e-5;
            let exact = f64::from(t).cbrt();
            let error = (f64::from(cube_root(t)) / exact - 1.0).abs();
            assert!(error < 3e-7, "cube root of {t}: off by {error}");
        }
    }

    #[test]
    fn filters_pass_a_constant_picture_unchanged() {
        let kernels = Kernels::new(PIXELS_PER_DEGREE);
        let [y, cx, wide, narrow] = kernels.color.each_ref().map(|k| k.iter().sum::<f32>());
        let [gaussian, first, second] = kernels.feature.each_ref().map(|k| k.iter().sum::<f32>());
        for (sum, expected) in [
            (y, 1.0),
            (cx, 1.0),
            (wide * wide + narrow * narrow, 1.0),
            (gaussian, 1.0),
            (first, 0.0),
            (second, 0.0),
        ] {
            assert!((sum - expected).abs() < 1e-6, "{sum} is not {expected}");
        }
        assert_eq!((kernels.color[0].len(), kernels.feature[0].len()), (21, 19));
    }

    #[test]
    fn opponent_colors_come_back() {
        let color = Rgb::new(0.2, 0.5, 0.9);
        let back = linear_from_opponent(opponent(color));
        for (a, b) in color.to_array().into_iter().zip(back) {
            assert!((a - b).abs() < 1e-5, "{a} became {b}");
        }
    }
}
