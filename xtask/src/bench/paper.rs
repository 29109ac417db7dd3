//! What the paper prints: Tables I and II, in seconds on its authors' machine.

/// A table of the paper.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Printed {
    pub(crate) name: &'static str,
    pub(crate) columns: [PrintedSize; 4],
}

/// The columns of one picture size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PrintedSize {
    pub(crate) size: u32,
    pub(crate) original: PrintedTimes,
    pub(crate) cached: PrintedTimes,
    /// The row "Saved time (%)", as printed.
    pub(crate) saved: f64,
}

/// A column.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PrintedTimes {
    pub(crate) caustics: f64,
    pub(crate) specular: f64,
    pub(crate) indirect: f64,
    pub(crate) direct: f64,
    pub(crate) pass_1: f64,
    /// As printed, which isn't always the sum.
    pub(crate) total: f64,
}

impl PrintedTimes {
    const fn new([caustics, specular, indirect, direct, pass_1, total]: [f64; 6]) -> Self {
        Self { caustics, specular, indirect, direct, pass_1, total }
    }

    /// The four components.
    pub(crate) fn pass_2(&self) -> f64 {
        self.caustics + self.specular + self.indirect + self.direct
    }

    /// What the total should be.
    pub(crate) fn sum(&self) -> f64 {
        self.pass_2() + self.pass_1
    }
}

/// The table of a scene, if the paper has it.
pub(crate) fn printed(scene: &str) -> Option<&'static Printed> {
    match scene {
        "cornell-box" => Some(&TABLE_1),
        "rabbit" => Some(&TABLE_2),
        _ => None,
    }
}

const fn size(size: u32, original: [f64; 6], cached: [f64; 6], saved: f64) -> PrintedSize {
    let (original, cached) = (PrintedTimes::new(original), PrintedTimes::new(cached));
    PrintedSize { size, original, cached, saved }
}

#[rustfmt::skip]
static TABLE_1: Printed = Printed {
    name: "Table I",
    columns: [
        size(128, [0.29, 5.97, 2.71, 65.35, 17.36, 89.84], [0.25, 0.65, 1.07, 11.20, 17.21, 29.60], 27.26),
        size(256, [0.77, 9.67, 3.94, 95.46, 17.36, 126.36], [0.65, 3.92, 3.65, 33.08, 16.82, 58.96], 24.25),
        size(512, [3.22, 67.73, 14.34, 719.26, 17.06, 821.85], [2.71, 15.01, 14.29, 138.67, 17.36, 187.81], 12.28),
        size(1024, [12.47, 136.24, 58.24, 1364.48, 17.12, 1588.54], [11.20, 61.43, 58.01, 545.32, 17.34, 693.33], 14.10),
    ],
};

#[rustfmt::skip]
static TABLE_2: Printed = Printed {
    name: "Table II",
    columns: [
        size(128, [0.11, 10.68, 2.89, 23.84, 49.35, 86.87], [0.11, 2.88, 1.27, 8.13, 49.85, 62.24], 28.35),
        size(256, [0.24, 43.00, 12.63, 87.34, 49.42, 192.84], [0.15, 12.69, 3.69, 27.60, 49.59, 93.72], 51.40),
        size(512, [1.00, 168.13, 49.37, 352.92, 49.42, 620.84], [0.19, 46.23, 14.27, 108.28, 49.60, 218.56], 64.80),
        size(1024, [1.57, 203.56, 52.10, 2144.61, 49.40, 2461.243], [0.20, 194.92, 57.24, 409.20, 49.23, 710.79], 71.12),
    ],
};

#[cfg(test)]
mod tests {
    use super::*;

    /// How the printed rows fit together, as far as they do. A slip in copying them would show here.
    #[test]
    fn printed_numbers_are_copied_right() {
        for c in &TABLE_2.columns {
            let recomputed = (1.0 - c.cached.total / c.original.total) * 100.0;
            assert!((recomputed - c.saved).abs() < 0.006, "{recomputed} against {}", c.saved);
        }
        let recomputed = TABLE_1.columns.map(|c| (1.0 - c.cached.total / c.original.total) * 100.0);
        for (recomputed, expected) in recomputed.iter().zip([67.05, 53.34, 77.15, 56.35]) {
            assert!((recomputed - expected).abs() < 0.01, "{recomputed} against {expected}");
        }
        let off = |table: &Printed| -> Vec<f64> {
            let columns = table.columns.iter().flat_map(|c| [c.original, c.cached]);
            columns.map(|c| ((c.sum() - c.total) * 100.0).round() / 100.0).collect()
        };
        assert_eq!(off(&TABLE_1), [1.84, 0.78, 0.84, -0.84, -0.24, 0.23, 0.01, -0.03]);
        assert_eq!(off(&TABLE_2), [0.0, 0.0, -0.21, 0.0, 0.0, 0.01, -10.0, 0.0]);
    }
}
