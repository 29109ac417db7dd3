//! A quantity that differs from run to run.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A quantity over the measured runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Spread {
    pub(crate) median: f64,
    pub(crate) least: f64,
    pub(crate) most: f64,
}

impl Spread {
    /// The spread of some values; of none, zero.
    pub(crate) fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        let n = values.len();
        let (Some(&least), Some(&most)) = (values.first(), values.last()) else {
            return Self { median: 0.0, least: 0.0, most: 0.0 };
        };
        Self { median: (values[n / 2] + values[(n - 1) / 2]) / 2.0, least, most }
    }

    /// The same in another unit.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let Self { median, least, most } = *self;
        Self { median: median * factor, least: least * factor, most: most * factor }
    }

    /// The quotient of two quantities, if any values of them may belong together.
    pub(crate) fn over(&self, other: &Self) -> Self {
        Self {
            median: self.median / other.median,
            least: self.least / other.most,
            most: self.most / other.least,
        }
    }

    /// Half of the range, as a share of the median.
    pub(crate) fn relative(&self) -> f64 {
        if self.median > 0.0 { (self.most - self.least) / 2.0 / self.median } else { 0.0 }
    }
}

/// `least to most`, with as many digits as the formatter asks for.
impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(2);
        write!(f, "{:.digits$}\u{2013}{:.digits$}", self.least, self.most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads() {
        let spread = Spread::of([3.0, 1.0, 2.0, 5.0]);
        assert_eq!(spread, Spread { median: 2.5, least: 1.0, most: 5.0 });
        assert_eq!(spread.relative(), 0.8);
        assert_eq!(format!("{spread:.1}"), "1.0\u{2013}5.0");
        let over = spread.over(&Spread { median: 2.0, least: 1.0, most: 4.0 });
        assert_eq!(over, Spread { median: 1.25, least: 0.25, most: 5.0 });
        assert_eq!(Spread::of([4.0]), Spread { median: 4.0, least: 4.0, most: 4.0 });
    }
}
