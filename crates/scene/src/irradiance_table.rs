//! Irradiance from beyond the scene for surfaces of any orientation, as if nothing were in the way.
//!
//! It changes slowly with the normal, so a table of one value each four degrees tells it to a thousandth.

use base::{Rgb, math, math::PI};
use glam::Vec3A;

/// Rows of the table from pole to pole, less one; twice as many columns.
const ROWS: usize = 48;
const COLUMNS: usize = 2 * ROWS;

/// Irradiance by the direction of the normal.
#[derive(Clone, Debug, Default)]
pub(crate) struct IrradianceTable {
    /// In rows from +y to -y; the last column is the first again.
    values: Vec<Rgb>,
}

impl IrradianceTable {
    /// Sums up parts of the sphere: direction, radiance, solid angle.
    ///
    /// Parts less than four degrees wide are gathered: what comes from half of a gathered part that lies across the
    /// horizon counts as if all came from its middle, weighted by flux.
    pub(crate) fn new(parts: impl Iterator<Item = (Vec3A, Rgb, f32)>) -> Self {
        let mut gathered = vec![[Vec3A::ZERO; 3]; ROWS * COLUMNS];
        for (dir, radiance, solid_angle) in parts {
            let (x, y) = place(dir);
            let cell = (y as usize).min(ROWS - 1) * COLUMNS + (x as usize).min(COLUMNS - 1);
            for (sum, channel) in gathered[cell].iter_mut().zip(radiance.to_array()) {
                *sum += dir * (channel * solid_angle);
            }
        }
        gathered.retain(|vectors| *vectors != [Vec3A::ZERO; 3]);
        let mut values = Vec::with_capacity((ROWS + 1) * (COLUMNS + 1));
        for row in 0..=ROWS {
            let (sin, cos) = math::sin_cos(PI * row as f32 / ROWS as f32);
            for column in 0..=COLUMNS {
                let (s, c) = math::sin_cos(2.0 * PI * (column % COLUMNS) as f32 / COLUMNS as f32);
                let normal = Vec3A::new(sin * s, cos, -sin * c);
                let mut sum = [0.0_f32; 3];
                for vectors in &gathered {
                    for (sum, vector) in sum.iter_mut().zip(vectors) {
                        *sum += vector.dot(normal).max(0.0);
                    }
                }
                values.push(Rgb::from(sum));
            }
        }
        Self { values }
    }

    /// Irradiance on a surface with this normal.
    pub(crate) fn at(&self, normal: Vec3A) -> Rgb {
        let (x, y) = place(normal);
        let (left, above) = ((x as usize).min(COLUMNS - 1), (y as usize).min(ROWS - 1));
        let (f, g) = (x - left as f32, y - above as f32);
        let along = |row: usize| {
            let row = &self.values[row * (COLUMNS + 1)..];
            row[left] * (1.0 - f) + row[left + 1] * f
        };
        along(above) * (1.0 - g) + along(above + 1) * g
    }
}

/// Column and row of a direction, both from 0.
fn place(dir: Vec3A) -> (f32, f32) {
    let turn = math::atan2(dir.x, -dir.z) / (2.0 * PI);
    let turn = if turn < 0.0 { turn + 1.0 } else { turn };
    (turn * COLUMNS as f32, math::acos(dir.y) / PI * ROWS as f32)
}
