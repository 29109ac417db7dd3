//! How many photons each light gets.

use base::Rgb;

/// The number of photons to be emitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Budget {
    /// In all, shared out by flux.
    Total(u64),
    /// From each light that emits anything.
    PerLight(u64),
}

/// The number of photons of each light, given their fluxes. A light that emits gets one at least.
///
/// Shares of the total are rounded so that they add up (largest remainders); equal remainders go to the earlier light.
pub fn photons_of_lights(budget: Budget, fluxes: &[Rgb]) -> Vec<u64> {
    match budget {
        Budget::PerLight(n) => fluxes.iter().map(|f| if f.is_black() { 0 } else { n }).collect(),
        Budget::Total(n) => {
            let shares: Vec<f64> = fluxes.iter().map(|f| f64::from(f.mean())).collect();
            let sum: f64 = shares.iter().sum();
            let shares: Vec<f64> = shares.iter().map(|s| s / sum * n as f64).collect();
            let mut counts: Vec<u64> = shares.iter().map(|s| *s as u64).collect();
            let mut by_remainder: Vec<usize> = (0..shares.len()).collect();
            by_remainder.sort_by(|&a, &b| {
                (shares[b].fract()).total_cmp(&shares[a].fract()).then(a.cmp(&b))
            });
            let missing = n.saturating_sub(counts.iter().sum()) as usize;
            by_remainder
                .iter()
                .cycle()
                .take(if sum > 0.0 { missing } else { 0 })
                .for_each(|&i| counts[i] += 1);
            for (count, flux) in counts.iter_mut().zip(fluxes) {
                *count = if flux.is_black() { 0 } else { (*count).max(1) };
            }
            counts
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_follow_flux_and_add_up() {
        let fluxes = [Rgb::splat(1.0), Rgb::splat(2.0), Rgb::BLACK, Rgb::splat(4.0)];
        assert_eq!(photons_of_lights(Budget::Total(1000), &fluxes), [143, 286, 0, 571]);
        assert_eq!(
            photons_of_lights(Budget::Total(7_000_000), &fluxes),
            [1_000_000, 2_000_000, 0, 4_000_000]
        );
        assert_eq!(photons_of_lights(Budget::PerLight(10), &fluxes), [10, 10, 0, 10]);
        let feeble = [Rgb::splat(1e-9), Rgb::ONE];
        assert_eq!(photons_of_lights(Budget::Total(100), &feeble), [1, 100]);
    }
}
