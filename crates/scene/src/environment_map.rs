//! Light from beyond the scene that differs from direction to direction: an image wrapped around everything.
//!
//! The image spans longitude and latitude. Between the centers of its texels radiance is linear in the longitude and in
//! the *height*, the cosine of the angle to the upper pole, which differs from the latitude only where a texel is large
//! or near a pole. Area on the sphere is uniform in both, so radiance is a sum of tents, one a texel, whose integrals
//! are known: directions are drawn by choosing a texel by its flux, then a place under its tent, and their density is
//! the radiance looked up, over all of it, exactly.

use base::{Fingerprint, FingerprintBuilder, Frame, Rgb, math, math::PI, warp};
use glam::{Mat3A, Vec2, Vec3A};

use crate::irradiance_table::IrradianceTable;
use crate::shares::{pick, running_shares};

/// Share of the samples for a surface that is drawn from the map; the others are drawn by the cosine.
const SHARE_OF_MAP: f32 = 0.5;

/// An image of this many columns is fine enough for its irradiance to be that of points at the centers of texels.
const FINE: usize = 384;

/// Where the rows of an image lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rows {
    /// Each in the middle of its share of the way from pole to pole, as texels of any image do.
    Within,
    /// The first and the last at the poles, as Mitsuba has it.
    FromPoleToPole,
}

/// An image around the scene.
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    /// Width and height in texels.
    size: [usize; 2],
    /// Radiance, in rows from the upper pole on.
    texels: Vec<Rgb>,
    /// From directions of the scene to those of the image, without any change of length.
    from_world: Mat3A,
    /// Of its rows.
    placement: Rows,
    /// Heights of the centers of rows, falling.
    heights: Vec<f32>,
    /// Of each row, the share of the radiance that comes from it or from rows above.
    rows: Vec<f32>,
    /// Of each texel, the share of its row's that comes from it or from texels before it.
    columns: Vec<f32>,
    /// Radiance, integrated over all directions.
    total: Rgb,
    irradiance: IrradianceTable,
}

/// One direction towards an environment map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FromBeyond {
    /// Unit direction out of the scene.
    pub(crate) dir: Vec3A,
    /// What comes from there.
    pub(crate) radiance: Rgb,
    /// Density per steradian.
    pub(crate) pdf: f32,
}

impl EnvironmentMap {
    /// An image of the given width and height, in rows from above, each at least 1, of finite values that aren't
    /// negative; `to_world` is orthogonal. In the space of the image +y is up and the middle of the image lies towards
    /// +z, its left quarter towards +x.
    pub fn new(size: [u32; 2], texels: Vec<Rgb>, to_world: Mat3A) -> Self {
        Self::placed(size, texels, to_world, Rows::Within)
    }

    /// The same for an image whose first and last row are meant for the poles, as those of Mitsuba 3 are.
    pub fn from_pole_to_pole(size: [u32; 2], texels: Vec<Rgb>, to_world: Mat3A) -> Self {
        Self::placed(size, texels, to_world, Rows::FromPoleToPole)
    }

    fn placed(
        [width, height]: [u32; 2],
        texels: Vec<Rgb>,
        to_world: Mat3A,
        placement: Rows,
    ) -> Self {
        let [w, h] = [width as usize, height as usize];
        assert!(texels.len() == w * h && w * h > 0, "an image has as many texels as its size says");
        // One row can't lie at two poles.
        let placement = if h == 1 { Rows::Within } else { placement };
        let height_of = |row: f64| libm::cos(row * std::f64::consts::PI) as f32;
        let heights = (0..h).map(|row| match placement {
            Rows::Within => height_of((row as f64 + 0.5) / h as f64),
            Rows::FromPoleToPole => height_of(row as f64 / (h - 1) as f64),
        });
        let heights: Vec<f32> = heights.collect();
        let mut map = Self {
            size: [w, h],
            texels,
            from_world: to_world.transpose(),
            placement,
            heights,
            rows: Vec::with_capacity(h),
            columns: Vec::with_capacity(w * h),
            total: Rgb::BLACK,
            irradiance: IrradianceTable::default(),
        };
        let mut total = [0.0_f64; 3];
        let mut by_row = Vec::with_capacity(h);
        for row in 0..h {
            let solid_angle = f64::from(map.solid_angle(row));
            let mut by_column = Vec::with_capacity(w);
            for texel in &map.texels[row * w..][..w] {
                let channels = texel.to_array().map(f64::from);
                by_column.push(channels.iter().sum());
                total.iter_mut().zip(channels).for_each(|(sum, c)| *sum += c * solid_angle);
            }
            by_row.push(by_column.iter().sum::<f64>() * solid_angle);
            map.columns.extend(running_shares(&by_column));
        }
        map.rows.extend(running_shares(&by_row));
        map.total = Rgb::from(total.map(|c| c as f32));
        map.irradiance = if w < FINE {
            IrradianceTable::new(map.steps())
        } else {
            IrradianceTable::new(map.parts())
        };
        map
    }

    /// Radiance from all directions, integrated over solid angle.
    pub fn total(&self) -> Rgb {
        self.total
    }

    /// Radiance that arrives from a direction out of the scene.
    pub fn radiance(&self, dir: Vec3A) -> Rgb {
        let d = self.from_world * dir;
        let [w, h] = self.size;
        let turn = math::atan2(d.x, -d.z) / (2.0 * PI);
        let x = turn * w as f32 - 0.5;
        let low = x.floor();
        let f = x - low;
        let column = |x: f32| (x as i64).rem_euclid(w as i64) as usize;
        let (left, right) = (column(low), column(low + 1.0));
        let along = |row: usize| {
            let row = &self.texels[row * w..][..w];
            row[left] * (1.0 - f) + row[right] * f
        };
        let down = math::acos(d.y) / PI;
        let y = match self.placement {
            Rows::Within => down * h as f32 - 0.5,
            Rows::FromPoleToPole => down * (h - 1) as f32,
        };
        if y < 0.0 || h == 1 {
            return along(0);
        }
        let above = (y as usize).min(h - 2);
        let (top, bottom) = (self.heights[above], self.heights[above + 1]);
        let g = ((top - d.y) / (top - bottom).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        along(above) * (1.0 - g) + along(above + 1) * g
    }

    /// Density per steradian of a direction with this radiance, if directions are drawn by radiance.
    pub(crate) fn pdf(&self, radiance: Rgb) -> f32 {
        radiance.mean() / self.total.mean()
    }

    /// A direction, with a density proportional to the mean of the radiance over the channels; `None` where rounding
    /// has led to a black place.
    pub(crate) fn draw(&self, u: Vec2) -> Option<FromBeyond> {
        let [w, h] = self.size;
        let (row, v) = pick(&self.rows, u.y);
        let (column, t) = pick(&self.columns[row * w..][..w], u.x);
        let (above, below) = self.tent(row);
        let share = above / (above + below);
        let height = self.heights[row];
        // Falling from the upper end of the tent to its lower end.
        let height = if v < share {
            let v = v / share;
            let end = if row == 0 { 1.0 } else { self.heights[row - 1] };
            end + (height - end) * if row == 0 { v } else { v.sqrt() }
        } else {
            let v = (1.0 - v) / (1.0 - share);
            let end = if row + 1 == h { -1.0 } else { self.heights[row + 1] };
            end + (height - end) * if row + 1 == h { v } else { v.max(0.0).sqrt() }
        };
        let within =
            if t < 0.5 { (2.0 * t).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * t).max(0.0).sqrt() };
        let turn = (column as f32 + 0.5 + within) / w as f32;
        let dir = (self.from_world.transpose() * direction(turn, height)).normalize();
        let radiance = self.radiance(dir);
        let pdf = self.pdf(radiance);
        (pdf > 0.0).then_some(FromBeyond { dir, radiance, pdf })
    }

    /// Irradiance on a surface with this normal if nothing were in the way, to about a thousandth.
    pub(crate) fn irradiance(&self, normal: Vec3A) -> Rgb {
        self.irradiance.at(self.from_world * normal)
    }

    /// One direction for a surface with this normal, and the irradiance that it stands for: half of them by radiance,
    /// half by the cosine, weighted by the balance heuristic (Veach 1997, section 9.2), since a map may be a sun or
    /// a gray day.
    pub(crate) fn sample(&self, normal: Vec3A, u: Vec2) -> Option<(Vec3A, Rgb)> {
        let FromBeyond { dir, radiance, pdf } = if u.x < SHARE_OF_MAP {
            self.draw(Vec2::new(u.x / SHARE_OF_MAP, u.y))?
        } else {
            let u = Vec2::new((u.x - SHARE_OF_MAP) / (1.0 - SHARE_OF_MAP), u.y);
            let dir = Frame::new(normal).to_world(warp::cosine_hemisphere(u)).normalize();
            let radiance = self.radiance(dir);
            FromBeyond { dir, radiance, pdf: self.pdf(radiance) }
        };
        let cos = dir.dot(normal);
        let density = SHARE_OF_MAP * pdf + (1.0 - SHARE_OF_MAP) * warp::cosine_hemisphere_pdf(cos);
        (cos > 0.0).then(|| (dir, radiance * (cos / density)))
    }

    /// A digest of all that decides what arrives.
    pub(crate) fn digest(&self) -> Fingerprint {
        let mut digest = FingerprintBuilder::new();
        digest.pod(&self.size.map(|side| side as u64)).pod(&self.texels);
        digest.pod(&self.from_world.to_cols_array());
        if self.placement == Rows::FromPoleToPole {
            digest.bytes(b"from pole to pole");
        }
        digest.finish()
    }

    /// The areas under the tent of a row in height, above its center and below. At the poles it is a roof.
    fn tent(&self, row: usize) -> (f32, f32) {
        let height = self.heights[row];
        let above = match row {
            0 => 1.0 - height,
            _ => 0.5 * (self.heights[row - 1] - height),
        };
        let below = match self.heights.get(row + 1) {
            None => height + 1.0,
            Some(next) => 0.5 * (height - next),
        };
        (above, below)
    }

    /// What a texel of a row stands for, in steradians.
    fn solid_angle(&self, row: usize) -> f32 {
        let (above, below) = self.tent(row);
        (above + below) * (2.0 * PI / self.size[0] as f32)
    }

    /// Direction, radiance and solid angle of each texel, in the space of the image.
    fn parts(&self) -> impl Iterator<Item = (Vec3A, Rgb, f32)> {
        let w = self.size[0];
        self.texels.iter().enumerate().map(move |(i, &texel)| {
            let (row, column) = (i / w, i % w);
            let dir = direction((column as f32 + 0.5) / w as f32, self.heights[row]);
            (dir, texel, self.solid_angle(row))
        })
    }

    /// The same of a coarse image, in steps that are finer than its texels.
    fn steps(&self) -> impl Iterator<Item = (Vec3A, Rgb, f32)> {
        let height = |row: f32| math::sin_cos(PI * (0.5 - row / (FINE / 2) as f32)).0;
        (0..FINE / 2 * FINE).map(move |i| {
            let (row, column) = ((i / FINE) as f32, (i % FINE) as f32);
            let dir = direction((column + 0.5) / FINE as f32, height(row + 0.5));
            let solid_angle = (height(row) - height(row + 1.0)) * (2.0 * PI / FINE as f32);
            (dir, self.radiance(self.from_world.transpose() * dir), solid_angle)
        })
    }
}

/// The direction at a part of a turn, from -z over +x, and at a height, in the space of the image.
fn direction(turn: f32, height: f32) -> Vec3A {
    let (sin, cos) = math::sin_cos(2.0 * PI * turn);
    let r = (1.0 - height * height).max(0.0).sqrt();
    Vec3A::new(r * sin, height, -r * cos)
}
