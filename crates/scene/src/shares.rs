//! Choosing from a list in proportion to the values in it.

/// The share of the sum of all that lies in each and those before it.
pub(crate) fn running_shares(values: &[f64]) -> impl Iterator<Item = f32> {
    let sum = values.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    values.iter().scan(0.0, move |before, value| {
        *before += value;
        Some((*before / sum) as f32)
    })
}

/// The entry of a list of running sums up to 1 where `u` falls, and `u` made uniform again.
pub(crate) fn pick(cumulative: &[f32], u: f32) -> (usize, f32) {
    let i = cumulative.partition_point(|&c| c <= u).min(cumulative.len() - 1);
    let low = if i == 0 { 0.0 } else { cumulative[i - 1] };
    let width = cumulative[i] - low;
    let u = if width > 0.0 { (u - low) / width } else { 0.5 };
    (i, u.clamp(0.0, 1.0 - f32::EPSILON))
}
