//! How many photons each light gets.

use base::Rgb;

/// The number of photons to be emitted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Budget {
    /// In all, shared out by flux.
    Total(u64),
    /// From each light that emits anything.
    PerLight(u64),
    /// From each light, in the order of the scene's, as [`share_out`] tells them.
    Each(Vec<u64>),
}

/// The number of photons of each light, given their fluxes. A light that emits gets one at least.
///
/// # Panics
/// When [`Budget::Each`] isn't of as many lights.
pub fn photons_of_lights(budget: &Budget, fluxes: &[Rgb]) -> Vec<u64> {
    let of_those_that_emit = |counts: Vec<u64>| {
        assert_eq!(counts.len(), fluxes.len(), "a number for each light");
        let counts = counts.into_iter().zip(fluxes);
        counts.map(|(n, flux)| if flux.is_black() { 0 } else { n.max(1) }).collect()
    };
    match budget {
        Budget::Total(n) => share_out(*n, 0.0, &vec![None; fluxes.len()], fluxes),
        Budget::PerLight(n) => of_those_that_emit(vec![*n; fluxes.len()]),
        Budget::Each(counts) => of_those_that_emit(counts.clone()),
    }
}

/// The number of photons of each light out of `n` in all: those with a quota get that, and the others share the rest by
/// their flux, but none gets less than `min_share`, in [0, 1], of an equal part of it. So 0 is by flux alone, and with 1
/// all get as many. A light that emits gets one at least, and one that doesn't none.
///
/// However they are shared out, a photon carries its light's flux divided by their number: the mean of what lands is the
/// same, and only the noise of each light's part changes.
///
/// Shares are rounded so that they add up (largest remainders); equal remainders go to the earlier light.
pub fn share_out(n: u64, min_share: f64, quotas: &[Option<u64>], fluxes: &[Rgb]) -> Vec<u64> {
    let quota = |i: usize| quotas[i].filter(|_| !fluxes[i].is_black());
    let mut counts: Vec<u64> = (0..fluxes.len()).map(|i| quota(i).unwrap_or(0)).collect();
    let rest = n.saturating_sub(counts.iter().sum());
    let is_free = |&i: &usize| quota(i).is_none() && !fluxes[i].is_black();
    let free: Vec<usize> = (0..fluxes.len()).filter(is_free).collect();

    let fluxes: Vec<f64> = free.iter().map(|&i| f64::from(fluxes[i].mean())).collect();
    let shares = shares(rest as f64, min_share, &fluxes);
    free.iter().zip(&shares).for_each(|(&i, share)| counts[i] = *share as u64);
    let missing = n.saturating_sub(counts.iter().sum()) as usize;
    let mut by_remainder: Vec<usize> = (0..free.len()).collect();
    by_remainder.sort_by(|&a, &b| shares[b].fract().total_cmp(&shares[a].fract()).then(a.cmp(&b)));
    by_remainder.iter().cycle().take(if free.is_empty() { 0 } else { missing }).for_each(|&k| {
        counts[free[k]] += 1;
    });
    free.iter().for_each(|&i| counts[i] = counts[i].max(1));
    counts
}

/// What each of some lights gets of `n`, by flux, but none less than `min_share` of an equal part.
fn shares(mut n: f64, min_share: f64, fluxes: &[f64]) -> Vec<f64> {
    let least = n * min_share / fluxes.len() as f64;
    let mut sum: f64 = fluxes.iter().sum();
    let mut shares = vec![least; fluxes.len()];
    let mut by_flux: Vec<usize> = (0..fluxes.len()).collect();
    by_flux.sort_by(|&a, &b| fluxes[a].total_cmp(&fluxes[b]).then(a.cmp(&b)));
    // What is given to the feeblest is missing to all others, who then are the ones to share.
    let mut by_flux = by_flux.into_iter().peekable();
    while let Some(i) = by_flux.next_if(|&i| fluxes[i] / sum * n < least) {
        (n, sum) = (n - least, sum - fluxes[i]);
    }
    by_flux.for_each(|i| shares[i] = fluxes[i] / sum * n);
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_follow_flux_and_add_up() {
        let fluxes = [Rgb::splat(1.0), Rgb::splat(2.0), Rgb::BLACK, Rgb::splat(4.0)];
        assert_eq!(photons_of_lights(&Budget::Total(1000), &fluxes), [143, 286, 0, 571]);
        assert_eq!(
            photons_of_lights(&Budget::Total(7_000_000), &fluxes),
            [1_000_000, 2_000_000, 0, 4_000_000]
        );
        assert_eq!(photons_of_lights(&Budget::PerLight(10), &fluxes), [10, 10, 0, 10]);
        let feeble = [Rgb::splat(1e-9), Rgb::ONE];
        assert_eq!(photons_of_lights(&Budget::Total(100), &feeble), [1, 100]);
    }

    #[test]
    fn the_feeblest_get_their_least_and_the_others_share_by_flux() {
        let fluxes = [1.0, 2.0, 0.0, 40.0, 57.0].map(Rgb::splat);
        let even = |min_share| share_out(1000, min_share, &[None; 5], &fluxes);
        assert_eq!(even(0.0), [10, 20, 0, 400, 570]);
        // At least 50: the first two get that, and 40 and 57 share 900.
        assert_eq!(even(0.2), [50, 50, 0, 371, 529]);
        assert_eq!(even(1.0), [250, 250, 0, 250, 250]);
        // 60 of 250 is more than 57 would get by flux only after others were raised.
        let close = [1.0, 1.0, 58.0, 40.0].map(Rgb::splat);
        assert_eq!(share_out(100, 1.0, &[None; 4], &close), [25; 4]);
        assert_eq!(share_out(100, 0.8, &[None; 4], &close), [20, 20, 36, 24]);
    }

    #[test]
    fn quotas_come_first() {
        let fluxes = [1.0, 2.0, 0.0, 7.0].map(Rgb::splat);
        let quotas = [Some(600), None, Some(9), None];
        assert_eq!(share_out(1500, 0.0, &quotas, &fluxes), [600, 200, 0, 700]);
        assert_eq!(share_out(1500, 1.0, &quotas, &fluxes), [600, 450, 0, 450]);
        assert_eq!(share_out(600, 0.0, &quotas, &fluxes), [600, 1, 0, 1], "one at least");
        let all = [Some(5), Some(6), None, Some(7)];
        assert_eq!(share_out(18, 0.5, &all, &fluxes), [5, 6, 0, 7]);
    }
}
