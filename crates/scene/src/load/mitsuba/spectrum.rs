//! Spectra as colors: integrated with the color matching functions, in linear Rec. 709.
//!
//! As in Mitsuba, a spectrum of light that is 1 everywhere has a luminance of 1, and a reflectance is one under daylight,
//! so that what reflects everything is white.

use base::Rgb;

/// Wavelengths of the tables, in nanometers.
const FIRST: f64 = 380.0;
const STEP: f64 = 5.0;

/// The color matching functions of the CIE 1931 standard observer, 2 degrees (CIE 15:2004).
const OBSERVER: [[f64; 3]; 81] = [
    [0.001_368, 0.000_039, 0.006_45],
    [0.002_236, 0.000_064, 0.010_55],
    [0.004_243, 0.000_12, 0.020_05],
    [0.007_65, 0.000_217, 0.036_21],
    [0.014_31, 0.000_396, 0.067_85],
    [0.023_19, 0.000_64, 0.110_2],
    [0.043_51, 0.001_21, 0.207_4],
    [0.077_63, 0.002_18, 0.371_3],
    [0.134_38, 0.004, 0.645_6],
    [0.214_77, 0.007_3, 1.039_05],
    [0.283_9, 0.011_6, 1.385_6],
    [0.328_5, 0.016_84, 1.622_96],
    [0.348_28, 0.023, 1.747_06],
    [0.348_06, 0.029_8, 1.782_6],
    [0.336_2, 0.038, 1.772_11],
    [0.318_7, 0.048, 1.744_1],
    [0.290_8, 0.06, 1.669_2],
    [0.251_1, 0.073_9, 1.528_1],
    [0.195_36, 0.090_98, 1.287_64],
    [0.142_1, 0.112_6, 1.041_9],
    [0.095_64, 0.139_02, 0.812_95],
    [0.057_95, 0.169_3, 0.616_2],
    [0.032_01, 0.208_02, 0.465_18],
    [0.014_7, 0.258_6, 0.353_3],
    [0.004_9, 0.323, 0.272],
    [0.002_4, 0.407_3, 0.212_3],
    [0.009_3, 0.503, 0.158_2],
    [0.029_1, 0.608_2, 0.111_7],
    [0.063_27, 0.71, 0.078_25],
    [0.109_6, 0.793_2, 0.057_25],
    [0.165_5, 0.862, 0.042_16],
    [0.225_75, 0.914_85, 0.029_84],
    [0.290_4, 0.954, 0.020_3],
    [0.359_7, 0.980_3, 0.013_4],
    [0.433_45, 0.994_95, 0.008_75],
    [0.512_05, 1.0, 0.005_75],
    [0.594_5, 0.995, 0.003_9],
    [0.678_4, 0.978_6, 0.002_75],
    [0.762_1, 0.952, 0.002_1],
    [0.842_5, 0.915_4, 0.001_8],
    [0.916_3, 0.87, 0.001_65],
    [0.978_6, 0.816_3, 0.001_4],
    [1.026_3, 0.757, 0.001_1],
    [1.056_7, 0.694_9, 0.001],
    [1.062_2, 0.631, 0.000_8],
    [1.045_6, 0.566_8, 0.000_6],
    [1.002_6, 0.503, 0.000_34],
    [0.938_4, 0.441_2, 0.000_24],
    [0.854_45, 0.381, 0.000_19],
    [0.751_4, 0.321, 0.000_1],
    [0.642_4, 0.265, 0.000_05],
    [0.541_9, 0.217, 0.000_03],
    [0.447_9, 0.175, 0.000_02],
    [0.360_8, 0.138_2, 0.000_01],
    [0.283_5, 0.107, 0.0],
    [0.218_7, 0.081_6, 0.0],
    [0.164_9, 0.061, 0.0],
    [0.121_2, 0.044_58, 0.0],
    [0.087_4, 0.032, 0.0],
    [0.063_6, 0.023_2, 0.0],
    [0.046_77, 0.017, 0.0],
    [0.032_9, 0.011_92, 0.0],
    [0.022_7, 0.008_21, 0.0],
    [0.015_84, 0.005_723, 0.0],
    [0.011_359, 0.004_102, 0.0],
    [0.008_111, 0.002_929, 0.0],
    [0.005_79, 0.002_091, 0.0],
    [0.004_109, 0.001_484, 0.0],
    [0.002_899, 0.001_047, 0.0],
    [0.002_049, 0.000_74, 0.0],
    [0.001_44, 0.000_52, 0.0],
    [0.001, 0.000_361, 0.0],
    [0.000_69, 0.000_249, 0.0],
    [0.000_476, 0.000_172, 0.0],
    [0.000_332, 0.000_12, 0.0],
    [0.000_235, 0.000_085, 0.0],
    [0.000_166, 0.000_06, 0.0],
    [0.000_117, 0.000_042, 0.0],
    [0.000_083, 0.000_03, 0.0],
    [0.000_059, 0.000_021, 0.0],
    [0.000_042, 0.000_015, 0.0],
];

/// Daylight of 6500 K, D65, each 10 nm (CIE 15:2004).
const DAYLIGHT: [f64; 41] = [
    49.9755, 54.6482, 82.7549, 91.486, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861,
    115.923, 108.811, 109.354, 107.802, 104.79, 107.689, 104.405, 104.046, 100.0, 96.3342, 95.788,
    88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268, 80.2146, 82.2778, 78.2842,
    69.7213, 71.6091, 74.349, 61.604, 69.8856, 75.087, 63.5927, 46.4182, 66.8054, 63.3828,
];

/// What a spectrum describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// Emitted light.
    Light,
    /// A share of light, or another property of matter.
    Matter,
}

/// The color of a spectrum that is linear between values at rising wavelengths, in nanometers, and 0 beyond. What lies
/// outside of all colors is brought to their edge.
pub(super) fn color_of_list(list: &[(f64, f64)], quantity: Quantity) -> Rgb {
    let value = |wavelength: f64| {
        let after = list.partition_point(|entry| entry.0 < wavelength);
        match (after.checked_sub(1).map(|i| list[i]), list.get(after)) {
            (_, Some(&(at, value))) if at == wavelength => value,
            (Some((w0, v0)), Some(&(w1, v1))) => v0 + (v1 - v0) * (wavelength - w0) / (w1 - w0),
            _ => 0.0,
        }
    };
    color(value, quantity)
}

/// The color of a black body, in W/(m^2 sr nm): Planck's law. The temperature is in kelvins.
pub(super) fn color_of_black_body(temperature: f64) -> Rgb {
    // The speed of light, Planck's constant and Boltzmann's.
    const C: f64 = 299_792_458.0;
    const H: f64 = 6.626_070_15e-34;
    const K: f64 = 1.380_649e-23;
    let value = |wavelength: f64| {
        let l = wavelength * 1e-9;
        let exponent = libm::expm1(H * C / (l * K * temperature));
        2e-9 * H * C * C / (l * l * l * l * l * exponent)
    };
    color(value, Quantity::Light)
}

fn color(value: impl Fn(f64) -> f64, quantity: Quantity) -> Rgb {
    // Finer than the tables, for spectra with peaks.
    const PARTS: usize = 10;
    let (mut sum, mut white) = ([0.0; 3], 0.0);
    for i in 0..(OBSERVER.len() - 1) * PARTS {
        let at = (i as f64 + 0.5) / PARTS as f64;
        let between = |low: f64, high: f64, at: f64| low + (high - low) * at.fract();
        let illuminant = match quantity {
            Quantity::Light => 1.0,
            Quantity::Matter => {
                let place = at * 0.5;
                let low = place as usize;
                between(DAYLIGHT[low], DAYLIGHT[low + 1], place)
            }
        };
        let sent = value(FIRST + STEP * at) * illuminant;
        let (low, high) = (OBSERVER[at as usize], OBSERVER[at as usize + 1]);
        for channel in 0..3 {
            sum[channel] += sent * between(low[channel], high[channel], at);
        }
        white += illuminant * between(low[1], high[1], at);
    }
    let [x, y, z] = sum.map(|sum| sum / white);
    // From XYZ to Rec. 709 with the white of D65 (IEC 61966-2-1).
    let rgb = [
        3.240_479 * x - 1.537_150 * y - 0.498_535 * z,
        -0.969_256 * x + 1.875_991 * y + 0.041_556 * z,
        0.055_648 * x - 0.204_043 * y + 1.057_311 * z,
    ];
    Rgb::from(rgb.map(|c| c.max(0.0) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(color: Rgb, expected: [f32; 3]) -> bool {
        color.to_array().iter().zip(expected).all(|(c, e)| (c - e).abs() < 0.005 * e.max(1.0))
    }

    #[test]
    fn white_is_white_and_equal_energy_is_pink() {
        let flat = [(300.0, 1.0), (900.0, 1.0)];
        let white = color_of_list(&flat, Quantity::Matter);
        assert!(close(white, [1.0; 3]), "{white:?}");
        // Illuminant E in Rec. 709.
        let pink = color_of_list(&flat, Quantity::Light);
        assert!(close(pink, [1.205, 0.948, 0.909]), "{pink:?}");
    }

    #[test]
    fn bands_have_their_colors_and_nothing_lies_beyond_lists() {
        let band = |from: f64, to: f64| color_of_list(&[(from, 1.0), (to, 1.0)], Quantity::Light);
        let (blue, green, red) = (band(430.0, 480.0), band(520.0, 560.0), band(620.0, 700.0));
        assert!(
            blue.b > blue.r.max(blue.g) && green.g > green.r.max(green.b),
            "{blue:?} {green:?}"
        );
        assert!(red.r > 0.0 && red.g == 0.0 && red.b < 0.01, "{red:?}");
        assert_eq!(band(900.0, 1000.0), Rgb::BLACK);
        // Parts of a list add up to the whole.
        let halves = band(300.0, 550.0) + band(550.0, 900.0);
        let whole = band(300.0, 900.0);
        assert!((halves.luminance() / whole.luminance() - 1.0).abs() < 0.2, "{halves:?} {whole:?}");
    }

    #[test]
    fn black_bodies_glow_as_planck_says() {
        // Chromaticity on the Planckian locus: 6504 K is near D65, 2856 K is illuminant A, (0.4476, 0.4074).
        let a = color_of_black_body(2856.0);
        let [x, y, z] = [
            0.412_453 * a.r + 0.357_580 * a.g + 0.180_423 * a.b,
            0.212_671 * a.r + 0.715_160 * a.g + 0.072_169 * a.b,
            0.019_334 * a.r + 0.119_193 * a.g + 0.950_227 * a.b,
        ];
        let sum = x + y + z;
        assert!((x / sum - 0.4476).abs() < 5e-4 && (y / sum - 0.4074).abs() < 5e-4, "{x} {y} {z}");
        // At 560 nm and 5000 K Planck's law gives 12,750 W/(m^2 sr nm); the mean over the eye's range is close.
        let warm = color_of_black_body(5000.0).luminance();
        assert!((warm / 12_600.0 - 1.0).abs() < 0.03, "{warm}");
        assert!(color_of_black_body(100.0) == Rgb::BLACK);
    }
}
