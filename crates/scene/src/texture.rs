//! Colors that vary over a surface.

use base::{Fingerprint, FingerprintBuilder, Rgb};
use glam::{Affine2, Vec2};

/// An index into the list of textures of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureId(pub u16);

/// A color for every pair of texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// From the coordinates of the surface to those of the pattern.
    pub placement: Affine2,
    /// What is painted.
    pub pattern: Pattern,
}

/// What a texture shows where its own coordinates lie in the unit square, and by which rule beyond.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// Four squares, of which the first color takes those that touch (0, 0) and (1, 1); repeated without end.
    Checkerboard([Rgb; 2]),
    /// An image, whose lower left corner is at (0, 0) and whose upper right corner is at (1, 1).
    Bitmap {
        /// Width and height in texels, each at least 1.
        size: [u32; 2],
        /// In rows from above.
        texels: Texels,
        /// What lies between the centers of texels.
        filter: Filter,
        /// What lies beyond the unit square.
        wrap: Wrap,
    },
}

/// The colors of an image, in no more memory than they need.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// Bytes, and the linear value of each.
    Bytes(Vec<[u8; 3]>, Box<[f32; 256]>),
    /// Linear values, finite and not negative.
    Floats(Vec<Rgb>),
}

/// How an image is interpolated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// Not at all: each texel is a rectangle.
    Nearest,
    /// Linearly from the four texels around.
    Bilinear,
}

/// How an image goes on beyond its edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// From its other edge.
    Repeat,
    /// Back again.
    Mirror,
    /// With the color of its edge.
    Clamp,
}

impl Texture {
    /// The color at texture coordinates of a surface; linear.
    pub fn at(&self, uv: Vec2) -> Rgb {
        let at = self.placement.transform_point2(uv);
        match &self.pattern {
            Pattern::Checkerboard(colors) => {
                let upper = (at - at.floor()).cmpge(Vec2::splat(0.5));
                colors[usize::from(upper.x != upper.y)]
            }
            Pattern::Bitmap { size, texels, filter, wrap } => {
                // In texels, rows counted from above.
                let extent = Vec2::new(size[0] as f32, size[1] as f32);
                let at = Vec2::new(at.x, 1.0 - at.y) * extent;
                let texel = |x: f32, y: f32| {
                    let (x, y) = (wrap.texel(x, size[0]), wrap.texel(y, size[1]));
                    texels.get(y as usize * size[0] as usize + x as usize)
                };
                match filter {
                    Filter::Nearest => texel(at.x.floor(), at.y.floor()),
                    Filter::Bilinear => {
                        let low = (at - 0.5).floor();
                        let f = at - 0.5 - low;
                        let row =
                            |y: f32| texel(low.x, y) * (1.0 - f.x) + texel(low.x + 1.0, y) * f.x;
                        row(low.y) * (1.0 - f.y) + row(low.y + 1.0) * f.y
                    }
                }
            }
        }
    }

    /// The largest value of any channel.
    pub fn max(&self) -> f32 {
        match &self.pattern {
            Pattern::Checkerboard([a, b]) => a.max_channel().max(b.max_channel()),
            Pattern::Bitmap { texels: Texels::Bytes(bytes, linear), .. } => {
                let largest = bytes.as_flattened().iter().max();
                largest.map_or(0.0, |&byte| linear[usize::from(byte)])
            }
            Pattern::Bitmap { texels: Texels::Floats(colors), .. } => {
                colors.iter().map(|c| c.max_channel()).fold(0.0, f32::max)
            }
        }
    }

    /// A digest of all that decides its colors.
    pub fn digest(&self) -> Fingerprint {
        let mut digest = FingerprintBuilder::new();
        digest.pod(&self.placement.to_cols_array());
        match &self.pattern {
            Pattern::Checkerboard(colors) => digest.bytes(b"checkerboard").pod(colors),
            Pattern::Bitmap { size, texels, filter, wrap } => {
                digest.bytes(b"bitmap").pod(size).pod(&[*filter as u8, *wrap as u8]);
                match texels {
                    Texels::Bytes(bytes, linear) => digest.pod(bytes).pod(linear.as_slice()),
                    Texels::Floats(colors) => digest.pod(colors),
                }
            }
        };
        digest.finish()
    }
}

impl Texels {
    fn get(&self, index: usize) -> Rgb {
        match self {
            Self::Bytes(bytes, linear) => bytes[index].map(|byte| linear[usize::from(byte)]).into(),
            Self::Floats(colors) => colors[index],
        }
    }
}

impl Wrap {
    /// The texel of a row of `n` that stands at the whole number `at`.
    fn texel(self, at: f32, n: u32) -> u32 {
        // Coordinates beyond all reason saturate; what is not a number becomes 0.
        let (at, n) = (at as i64, i64::from(n));
        let texel = match self {
            Self::Repeat => at.rem_euclid(n),
            Self::Mirror => {
                let at = at.rem_euclid(2 * n);
                at.min(2 * n - 1 - at)
            }
            Self::Clamp => at.clamp(0, n - 1),
        };
        texel as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three texels by two, all different.
    fn bitmap(filter: Filter, wrap: Wrap) -> Texture {
        let texels = (0..6).map(|i| Rgb::new(i as f32, (i * i) as f32, 1.0)).collect();
        let pattern =
            Pattern::Bitmap { size: [3, 2], texels: Texels::Floats(texels), filter, wrap };
        Texture { placement: Affine2::IDENTITY, pattern }
    }

    #[test]
    fn nearest_texels_are_rectangles() {
        let texture = bitmap(Filter::Nearest, Wrap::Repeat);
        for (u, v, expected) in [
            (0.0, 0.99, 0.0),
            (0.32, 0.51, 0.0),
            (0.34, 0.75, 1.0),
            (0.99, 0.99, 2.0),
            (0.1, 0.01, 3.0),
            (0.99, 0.49, 5.0),
        ] {
            assert_eq!(texture.at(Vec2::new(u, v)).r, expected, "({u}, {v})");
        }
    }

    #[test]
    fn bilinear_filtering_is_exact_at_centers_and_linear_between() {
        let texture = bitmap(Filter::Bilinear, Wrap::Clamp);
        for i in 0..6 {
            let center =
                Vec2::new((i % 3) as f32 + 0.5, 1.5 - (i / 3) as f32) / Vec2::new(3.0, 2.0);
            assert!((texture.at(center).g - (i * i) as f32).abs() < 1e-5, "texel {i}");
        }
        // A quarter of the way from texel 0 to 1, a third from row 0 to 1: squares 0, 1, 9, 16.
        let at = Vec2::new(0.75 / 3.0, 1.0 - (0.5 + 1.0 / 3.0) / 2.0);
        let expected = 2.0 / 3.0 * (0.25 * 1.0) + 1.0 / 3.0 * (0.75 * 9.0 + 0.25 * 16.0);
        assert!((texture.at(at).g - expected).abs() < 1e-5);
    }

    #[test]
    fn images_go_on_beyond_their_edges_as_told() {
        // Texels of the upper row from the third before the image to the third behind it.
        let cases = [
            (Wrap::Repeat, [0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 0.0, 1.0, 2.0]),
            (Wrap::Mirror, [2.0, 1.0, 0.0, 0.0, 1.0, 2.0, 2.0, 1.0, 0.0]),
            (Wrap::Clamp, [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 2.0]),
        ];
        for (wrap, expected) in cases {
            let texture = bitmap(Filter::Nearest, wrap);
            let row = [-3, -2, -1, 0, 1, 2, 3, 4, 5]
                .map(|x| texture.at(Vec2::new((x as f32 + 0.5) / 3.0, 0.75)).r);
            assert_eq!(row, expected, "{wrap:?}");
        }
        // Between the last texel and the first.
        let seam = |wrap| bitmap(Filter::Bilinear, wrap).at(Vec2::new(1.0, 0.75)).r;
        assert_eq!([Wrap::Repeat, Wrap::Mirror, Wrap::Clamp].map(seam), [1.0, 2.0, 2.0]);
        for far in [1e30, -1e30, f32::INFINITY, f32::NAN] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                // Any color will do, as long as there is one.
                bitmap(Filter::Bilinear, wrap).at(Vec2::splat(far));
            }
        }
    }

    #[test]
    fn checkerboards_have_four_squares() {
        let colors = [Rgb::BLACK, Rgb::ONE];
        let placement = Affine2::from_scale(Vec2::new(2.0, 1.0));
        let board = Texture { placement, pattern: Pattern::Checkerboard(colors) };
        let at = |u, v| usize::from(board.at(Vec2::new(u, v)) == Rgb::ONE);
        assert_eq!([at(0.1, 0.1), at(0.3, 0.1), at(0.1, 0.6), at(0.3, 0.6)], [0, 1, 1, 0]);
        assert_eq!([at(0.6, 0.1), at(-0.1, 0.1), at(-0.1, -0.1)], [0, 1, 0]);
    }

    #[test]
    fn bytes_are_looked_up() {
        let mut linear = Box::new([0.0; 256]);
        linear[7] = 0.5;
        let texels = Texels::Bytes(vec![[0, 7, 0]], linear);
        let pattern =
            Pattern::Bitmap { size: [1, 1], texels, filter: Filter::Bilinear, wrap: Wrap::Repeat };
        let texture = Texture { placement: Affine2::IDENTITY, pattern };
        assert_eq!(texture.at(Vec2::new(0.3, 0.7)), Rgb::new(0.0, 0.5, 0.0));
        assert_eq!(texture.max(), 0.5);
    }
}
