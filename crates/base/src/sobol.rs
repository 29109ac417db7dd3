//! Low-discrepancy points: Sobol' with Owen scrambling by hashing (Burley 2020, "Practical Hash-based Owen
//! Scrambling"; the hash is that of Vegdahl 2021). Direction numbers: Joe and Kuo 2008.

use std::array;

use crate::random::hash_u64;

/// Dimensions a point has.
pub const SOBOL_DIMENSIONS: usize = 5;

/// Degree, coefficients and first direction numbers of dimensions 2 to 5 (Joe and Kuo 2008, `new-joe-kuo-6`).
const JOE_KUO: [(u32, u32, [u32; 3]); 4] =
    [(1, 0, [1, 0, 0]), (2, 1, [1, 3, 0]), (3, 1, [1, 3, 1]), (3, 2, [1, 1, 1])];

const MATRICES: [[u32; 32]; SOBOL_DIMENSIONS] = matrices();

const fn matrices() -> [[u32; 32]; SOBOL_DIMENSIONS] {
    let mut all = [[0_u32; 32]; SOBOL_DIMENSIONS];
    let mut i = 0;
    while i < 32 {
        all[0][i] = 1 << (31 - i);
        i += 1;
    }
    let mut d = 1;
    while d < SOBOL_DIMENSIONS {
        let (degree, coefficients, m) = JOE_KUO[d - 1];
        let mut i = 0;
        while i < 32 {
            if i < degree as usize {
                all[d][i] = m[i] << (31 - i);
            } else {
                let mut v = all[d][i - degree as usize];
                v ^= v >> degree;
                let mut k = 1;
                while k < degree {
                    if (coefficients >> (degree - 1 - k)) & 1 == 1 {
                        v ^= all[d][i - k as usize];
                    }
                    k += 1;
                }
                all[d][i] = v;
            }
            i += 1;
        }
        d += 1;
    }
    all
}

/// Dimensions that are computed: vectors are filled.
const LANES: usize = SOBOL_DIMENSIONS.next_multiple_of(4);

/// Sums of rows of [`MATRICES`], of all dimensions, by four bits of the index and their number: a tenth of the steps that
/// bits take one by one.
static SUMS: [[[u32; LANES]; 16]; 8] = sums();

const fn sums() -> [[[u32; LANES]; 16]; 8] {
    let mut all = [[[0; LANES]; 16]; 8];
    let mut i = 0;
    while i < 8 * 16 * 4 {
        let (place, bits, bit, mut d) = (i / 64, i / 4 % 16, i % 4, 0);
        while d < SOBOL_DIMENSIONS {
            if bits >> bit & 1 == 1 {
                all[place][bits][d] ^= MATRICES[d][4 * place + bit];
            }
            d += 1;
        }
        i += 1;
    }
    all
}

/// An endless sequence of points in the unit cube of [`SOBOL_DIMENSIONS`] dimensions, scrambled by its seed.
///
/// Any 2^m points that start at a multiple of 2^m are stratified in every dimension and in every pair of neighbours.
/// Points past 2^32 start again with another scrambling.
#[derive(Clone, Copy, Debug)]
pub struct OwenSobol {
    seed: u64,
    first: Scrambling,
}

/// How 2^32 points are scrambled.
#[derive(Clone, Copy, Debug)]
struct Scrambling {
    index: u32,
    dimensions: [u32; LANES],
}

impl Scrambling {
    #[inline]
    fn new(seed: u64, epoch: u64) -> Self {
        let seed = hash_u64(seed, epoch);
        let mut dimensions = [0; LANES];
        for (d, of) in dimensions[..SOBOL_DIMENSIONS].iter_mut().enumerate() {
            *of = hash_u64(seed, d as u64 + 1) as u32;
        }
        Self { index: seed as u32, dimensions }
    }
}

impl OwenSobol {
    /// Sequences of different seeds are independent.
    #[inline]
    pub fn new(seed: u64) -> Self {
        Self { seed, first: Scrambling::new(seed, 0) }
    }

    /// The first `N` coordinates of point `index`, each in [0, 1).
    #[inline]
    pub fn point<const N: usize>(&self, index: u64) -> [f32; N] {
        const { assert!(N <= SOBOL_DIMENSIONS) };
        let scrambling = match index >> 32 {
            0 => self.first,
            epoch => Scrambling::new(self.seed, epoch),
        };
        // Shuffling the index keeps the sets of points and decorrelates sequences that are used side by side.
        let index = owen_scramble(index as u32, scrambling.index);
        let mut bits = [0; LANES];
        for (place, sums) in SUMS.iter().enumerate() {
            let sums = &sums[(index >> (4 * place) & 15) as usize];
            bits.iter_mut().zip(sums).for_each(|(bits, sum)| *bits ^= sum);
        }
        for (bits, seed) in bits.iter_mut().zip(scrambling.dimensions) {
            *bits = owen_scramble(*bits, seed);
        }
        array::from_fn(|d| (bits[d] >> 8) as f32 * (1.0 / 16_777_216.0))
    }
}

/// Nested uniform scrambling of a binary fraction, most significant bit first.
#[inline(always)]
fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_block_is_stratified_in_each_dimension_and_in_the_first_pair() {
        for seed in 0..4 {
            let sobol = OwenSobol::new(seed);
            for block in [0_u64, 5] {
                let points: Vec<[f32; SOBOL_DIMENSIONS]> =
                    (0..256).map(|i| sobol.point(block * 256 + i)).collect();
                for d in 0..SOBOL_DIMENSIONS {
                    let mut seen = [false; 256];
                    points.iter().for_each(|p| seen[(p[d] * 256.0) as usize] = true);
                    assert!(seen.iter().all(|&s| s), "dimension {d}, seed {seed}");
                }
                let mut seen = [false; 256];
                points.iter().for_each(|p| {
                    seen[(p[0] * 16.0) as usize * 16 + (p[1] * 16.0) as usize] = true;
                });
                assert!(seen.iter().all(|&s| s), "pair, seed {seed}");
            }
        }
    }

    #[test]
    fn integrates_far_better_than_chance() {
        // The mean of x0 x1 x2 x3 x4 is 1/32; 2^14 independent points would be off by about 6e-4 x 0.5.
        let n = 1 << 14;
        let mean = (0..n).map(|i| {
            OwenSobol::new(3).point::<5>(i).iter().map(|&x| f64::from(x)).product::<f64>()
        });
        let mean = mean.sum::<f64>() / n as f64;
        assert!((mean - 1.0 / 32.0).abs() < 2e-5, "{mean}");
    }

    #[test]
    fn sums_of_rows_are_those_of_bits_one_by_one() {
        let mut index = 1_u64;
        for seed in 0..1000 {
            index = hash_u64(index, seed) >> (seed % 50);
            let scrambling = hash_u64(seed, index >> 32);
            let shuffled = owen_scramble(index as u32, scrambling as u32);
            let expected: [f32; 5] = array::from_fn(|d| {
                let rows = MATRICES[d].iter().enumerate();
                let bits = rows.fold(0, |sum, (i, row)| sum ^ (row * (shuffled >> i & 1)));
                let bits = owen_scramble(bits, hash_u64(scrambling, d as u64 + 1) as u32);
                (bits >> 8) as f32 * (1.0 / 16_777_216.0)
            });
            let sobol = OwenSobol::new(seed);
            assert_eq!(sobol.point::<5>(index), expected);
            assert_eq!(sobol.point::<2>(index), expected[..2]);
        }
    }

    #[test]
    fn values_are_pinned() {
        assert_eq!(OwenSobol::new(7).point::<5>(12_345).map(|x| (x * 16_777_216.0) as u32), PINNED);
    }

    const PINNED: [u32; 5] = [6737942, 7458434, 7111307, 6248187, 3243823];
}
