//! Emissive surfaces: parallelograms and triangles, of one radiance or textured.

use std::sync::Arc;

use base::{Frame, Rgb, math::PI, warp};
use geometry::{Bounds, Patch, Plane};
use glam::{DVec3, Vec2, Vec3, Vec3A};

use crate::bright_cells::BrightCells;
use crate::light::{Beam, LightSample, Toward};
use crate::shares::{pick, running_shares};
use crate::{Texture, polygon_irradiance};

/// How many pieces a light may have for its unshadowed irradiance to be summed in closed form.
const MAX_CLOSED_FORM_PIECES: usize = 32;

/// A set of flat pieces that emit from their front sides, diffusely.
#[derive(Clone, Debug)]
pub struct AreaLight {
    pieces: Vec<Piece>,
    /// Share of the area that lies before the end of each piece.
    cumulative: Vec<f32>,
    area: f32,
    /// Emitted radiance, or what that of the texture is multiplied with.
    radiance: Rgb,
    paint: Option<Paint>,
    /// Mean radiance over the area.
    mean: Rgb,
    /// A sphere around all pieces.
    center: Vec3A,
    radius: f32,
}

/// What makes radiance differ from place to place.
#[derive(Clone, Debug)]
struct Paint {
    texture: Arc<Texture>,
    /// Texture coordinates of the corners of each piece.
    uvs: Vec<[Vec2; 3]>,
    cells: BrightCells,
}

/// A place on a light.
struct Place<'a> {
    piece: &'a Piece,
    point: Vec3A,
    radiance: Rgb,
    /// The density of places uniform by area over that at which it was drawn.
    weight: f32,
}

/// A parallelogram with corners `corner + {0, 1} a + {0, 1} b`, or half of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    corner: Vec3,
    a: Vec3,
    b: Vec3,
    is_triangle: bool,
    normal: Vec3A,
    /// See [`geometry::Surface::error`].
    error: f32,
}

impl Piece {
    fn new(corner: Vec3, a: Vec3, b: Vec3, is_triangle: bool) -> Self {
        let normal = a.cross(b).normalize();
        let largest = [corner, corner + a, corner + b, corner + a + b].map(Vec3::abs);
        let largest = largest.into_iter().reduce(Vec3::max).unwrap_or(Vec3::ZERO);
        let error = normal.abs().dot(largest) * (8.0 * f32::EPSILON);
        Self { corner, a, b, is_triangle, normal: normal.into(), error }
    }

    fn area(&self) -> f32 {
        self.a.cross(self.b).length() * if self.is_triangle { 0.5 } else { 1.0 }
    }

    /// How much of both edges leads to a place, from two uniform numbers.
    fn weights(&self, u: Vec2) -> Vec2 {
        if self.is_triangle { warp::uniform_triangle(u) } else { u }
    }

    fn point(&self, w: Vec2) -> Vec3A {
        Vec3A::from(self.corner) + Vec3A::from(self.a) * w.x + Vec3A::from(self.b) * w.y
    }

    /// The piece as one triangle or two.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [Vec3; 3]> {
        let (o, a, b) = (self.corner, self.corner + self.a, self.corner + self.b);
        let other = (!self.is_triangle).then_some([a + self.b, b, a]);
        std::iter::once([o, a, b]).chain(other)
    }

    /// Where a ray from a point in front meets the plane of the piece, moved off it by what rounding may be wrong.
    pub(crate) fn meet(&self, point: Vec3A, dir: DVec3) -> Option<Vec3A> {
        let (point, normal) = (point.as_dvec3(), self.normal.as_dvec3());
        let distance = (self.corner.as_dvec3() - point).dot(normal) / dir.dot(normal);
        let target = (point + dir * distance).as_vec3a() + self.normal * self.error;
        (distance > 0.0 && target.is_finite()).then_some(target)
    }

    fn corners(&self) -> ([Vec3; 4], usize) {
        let (o, a, b) = (self.corner, self.corner + self.a, self.corner + self.b);
        if self.is_triangle { ([o, a, b, o], 3) } else { ([o, a, a + self.b, b], 4) }
    }

    /// Whether the point is in front, by more than rounding could have put it there.
    fn faces(&self, point: Vec3A) -> bool {
        (point - Vec3A::from(self.corner)).dot(self.normal) > 2.0 * self.error
    }
}

impl AreaLight {
    /// Where it is, if it is flat.
    pub(crate) fn patch(&self) -> Option<Patch> {
        let normal = self.pieces.first()?.normal;
        let mut bounds = Bounds::EMPTY;
        let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
        for piece in &self.pieces {
            for corner in piece.triangles().flatten() {
                let height = Plane::height(normal, corner.into());
                (lowest, highest) = (lowest.min(height), highest.max(height));
                bounds.extend(corner);
            }
        }
        // Rays end above it by the error: it isn't in their way itself.
        let error = f64::from(self.pieces[0].error);
        let offset = highest + 0.5 * error;
        (highest - lowest <= 0.25 * error)
            .then_some(Patch { bounds, plane: Some(Plane { normal, offset }) })
    }

    /// A sphere around all pieces.
    pub(crate) fn enclosing_sphere(&self) -> (Vec3A, f32) {
        (self.center, self.radius)
    }

    /// The light of all given triangles. Two triangles in a row that form a parallelogram become one piece.
    pub fn new(triangles: &[[Vec3; 3]], radiance: Rgb) -> Self {
        let mut pieces = Vec::new();
        let mut rest = triangles;
        while let [first, tail @ ..] = rest {
            let parallelogram = tail.first().and_then(|second| join(first, second));
            pieces.push(parallelogram.unwrap_or_else(|| {
                Piece::new(first[0], first[1] - first[0], first[2] - first[0], true)
            }));
            rest = if parallelogram.is_some() { &tail[1..] } else { tail };
        }
        let area: f64 = pieces.iter().map(|p| f64::from(p.area())).sum();
        let mut before = 0.0;
        let cumulative = pieces
            .iter()
            .map(|p| {
                before += f64::from(p.area());
                (before / area) as f32
            })
            .collect();
        let corners = triangles.iter().flatten().copied();
        let min = corners.clone().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
        let max = corners.reduce(Vec3::max).unwrap_or(Vec3::ZERO);
        let (center, radius) = (Vec3A::from((min + max) * 0.5), (max - min).length() * 0.5);
        let (area, mean, paint) = (area as f32, radiance, None);
        Self { pieces, cumulative, area, radiance, paint, mean, center, radius }
    }

    /// The light of all given triangles, of which each emits `radiance` times the texture at its texture coordinates.
    pub fn textured(
        triangles: &[([Vec3; 3], [Vec2; 3])],
        radiance: Rgb,
        texture: Arc<Texture>,
    ) -> Self {
        let mut pieces = Vec::with_capacity(triangles.len());
        for ([a, b, c], _) in triangles {
            // Apart from its neighbors: pairs that make a parallelogram may be textured as they like.
            pieces.push(Piece::new(*a, *b - *a, *c - *a, true));
        }
        let corners: Vec<[Vec3; 3]> = triangles.iter().map(|t| t.0).collect();
        let uvs: Vec<[Vec2; 3]> = triangles.iter().map(|t| t.1).collect();
        let areas: Vec<f32> = pieces.iter().map(Piece::area).collect();
        let of = |piece: usize, u: Vec2| texture.at(uv_at(&uvs[piece], warp::uniform_triangle(u)));
        let cells = BrightCells::new(&areas, |piece, u| (radiance * of(piece, u)).mean());
        let mut light = Self::new(&corners, radiance);
        light.mean = radiance * cells.mean(&areas, of);
        light.cumulative =
            running_shares(&areas.iter().map(|&a| a.into()).collect::<Vec<_>>()).collect();
        light.pieces = pieces;
        light.paint = Some(Paint { texture, uvs, cells });
        light
    }

    /// Total area, in square units of length.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// Mean emitted radiance over the area; of a texture, by lookups at some places.
    pub fn mean_radiance(&self) -> Rgb {
        self.mean
    }

    /// Emitted flux: pi A L.
    pub fn flux(&self) -> Rgb {
        self.mean * (PI * self.area)
    }

    /// A place, uniform by area.
    fn place(&self, u: Vec2) -> Place<'_> {
        let (i, x) = match self.pieces.len() {
            1 => (0, u.x),
            _ => pick(&self.cumulative, u.x),
        };
        self.place_at(i, Vec2::new(x, u.y), 1.0)
    }

    /// A place, by how bright it is.
    fn bright_place(&self, u: Vec2) -> Place<'_> {
        match &self.paint {
            None => self.place(u),
            Some(paint) => {
                let drawn = paint.cells.draw(u);
                self.place_at(drawn.piece, drawn.at, drawn.weight)
            }
        }
    }

    fn place_at(&self, i: usize, u: Vec2, weight: f32) -> Place<'_> {
        let piece = &self.pieces[i];
        let w = piece.weights(u);
        let radiance = match &self.paint {
            None => self.radiance,
            Some(paint) => self.radiance * paint.texture.at(uv_at(&paint.uvs[i], w)),
        };
        Place { piece, point: piece.point(w), radiance, weight }
    }

    /// A photon's origin and direction, by brightness and by the cosine, and the flux of the whole light as far as this one
    /// start tells.
    pub(crate) fn emit(&self, u: [f32; 4]) -> (Vec3A, Vec3A, Rgb) {
        let Place { piece, point, radiance, weight } = self.bright_place(Vec2::new(u[0], u[1]));
        let dir = Frame::new(piece.normal)
            .to_world(warp::cosine_hemisphere(Vec2::new(u[2], u[3])))
            .normalize();
        (point + piece.normal * piece.error, dir, radiance * (PI * self.area) * weight)
    }

    /// Whether all places emit the same.
    pub(crate) fn is_uniform(&self) -> bool {
        self.paint.is_none()
    }

    /// Whether there are few enough pieces for their irradiance to be summed in closed form.
    pub(crate) fn has_closed_form(&self) -> bool {
        self.pieces.len() <= MAX_CLOSED_FORM_PIECES && self.is_uniform()
    }

    /// Whether a point is within so many radii of the light, and the pieces are few enough to look at each.
    #[inline]
    pub(crate) fn is_near(&self, point: Vec3A, radii: f32) -> bool {
        (point - self.center).length_squared() < (radii * self.radius).powi(2)
            && self.has_closed_form()
    }

    /// The pieces that show their front to a point.
    pub(crate) fn pieces_facing(&self, point: Vec3A) -> impl Iterator<Item = &Piece> {
        self.pieces.iter().filter(move |p| p.faces(point))
    }

    /// Unshadowed irradiance, if there are few enough pieces for a sum in closed form.
    pub(crate) fn irradiance(&self, point: Vec3A, normal: Vec3A) -> Option<Rgb> {
        if !self.has_closed_form() {
            return None;
        }
        let mut sum = 0.0;
        for piece in self.pieces_facing(point) {
            let (corners, n) = piece.corners();
            sum += polygon_irradiance(point, normal, &corners[..n]);
        }
        Some(self.radiance * sum)
    }

    /// One point, uniform by area, for surfaces that scatter by direction.
    pub(crate) fn beam(&self, point: Vec3A, u: Vec2) -> Option<Beam> {
        let Place { piece, point: target, radiance, .. } = self.place(u);
        if !piece.faces(point) {
            return None;
        }
        let distance = (target - point).length();
        let dir = (target - point).try_normalize()?;
        let cos_light = -dir.dot(piece.normal);
        if cos_light <= 0.0 {
            return None;
        }
        let pdf = self.beam_pdf(cos_light, distance);
        let toward = Toward::Point(target + piece.normal * piece.error);
        Some(Beam { dir, toward, distance, irradiance: radiance / pdf, pdf })
    }

    /// Density of [`AreaLight::beam`] per steradian.
    pub(crate) fn beam_pdf(&self, cos_light: f32, distance: f32) -> f32 {
        distance * distance / (cos_light * self.area)
    }

    /// One point, by how bright it is.
    pub(crate) fn sample(&self, point: Vec3A, normal: Vec3A, u: Vec2) -> Option<LightSample> {
        let Place { piece, point: target, radiance, weight } = self.bright_place(u);
        if !piece.faces(point) {
            return None;
        }
        let to_light = target - point;
        let (cos, cos_light) = (to_light.dot(normal), -to_light.dot(piece.normal));
        if cos <= 0.0 || cos_light <= 0.0 {
            return None;
        }
        let distance2 = to_light.length_squared();
        Some(LightSample {
            toward: Toward::Point(target + piece.normal * piece.error),
            irradiance: radiance * (weight * cos * cos_light * self.area / (distance2 * distance2)),
        })
    }
}

/// Texture coordinates of a place on a triangle, by how much of both edges leads there.
fn uv_at([a, b, c]: &[Vec2; 3], w: Vec2) -> Vec2 {
    *a + (*b - *a) * w.x + (*c - *a) * w.y
}

/// The parallelogram made of two triangles that share an edge, if they make one.
fn join(first: &[Vec3; 3], second: &[Vec3; 3]) -> Option<Piece> {
    // The corner of `second` that `first` lacks is opposite to one of its corners.
    let fourth = second.iter().find(|&p| !first.contains(p))?;
    if second.iter().filter(|&p| first.contains(p)).count() != 2 {
        return None;
    }
    (0..3).find_map(|i| {
        let (corner, next, previous) = (first[i], first[(i + 1) % 3], first[(i + 2) % 3]);
        let expected = next + previous - corner;
        let size = (next - corner).length() + (previous - corner).length();
        let same_side = {
            let normal = |t: &[Vec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]);
            normal(first).dot(normal(second)) > 0.0
        };
        let fits =
            same_side && !second.contains(&corner) && (expected - *fourth).length() <= 1e-6 * size;
        fits.then(|| Piece::new(corner, next - corner, previous - corner, false))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn n_pieces(triangles: &[[Vec3; 3]]) -> usize {
        let light = AreaLight::new(triangles, Rgb::ONE);
        let area: f32 = triangles.iter().map(|t| (t[1] - t[0]).cross(t[2] - t[0]).length()).sum();
        assert!(
            (light.area() / (0.5 * area) - 1.0).abs() < 1e-6,
            "{} of {triangles:?}",
            light.area()
        );
        light.pieces.len()
    }

    /// The corners of a triangle, started at each.
    fn turns(t: [Vec3; 3]) -> [[Vec3; 3]; 3] {
        [t, [t[1], t[2], t[0]], [t[2], t[0], t[1]]]
    }

    #[test]
    fn halves_of_a_parallelogram_are_joined_wherever_their_corners_start() {
        let (a, b) = (Vec3::new(1.3, 0.0, 0.2), Vec3::new(0.4, 0.9, -0.3));
        for corner in [Vec3::ZERO, Vec3::new(-5.0, 3.0, 8.0)] {
            let (o, p, q, r) = (corner, corner + a, corner + a + b, corner + b);
            for (first, second) in [([o, p, q], [o, q, r]), ([o, p, r], [p, q, r])] {
                for first in turns(first) {
                    for second in turns(second) {
                        assert_eq!(n_pieces(&[first, second]), 1);
                        assert_eq!(n_pieces(&[second, first]), 1);
                        let light = AreaLight::new(&[first, second], Rgb::ONE);
                        let expected = Vec3A::from(a.cross(b).normalize());
                        assert!((light.pieces[0].normal - expected).length() < 1e-6);
                    }
                }
            }
        }
    }

    #[test]
    fn other_pairs_are_not_joined() {
        let (o, x, y) = (Vec3::ZERO, Vec3::X, Vec3::Y);
        let first = [o, x, y];
        let others = [
            // A kite, with a fourth corner too far out; one too far in, so that the outline is concave.
            [x, Vec3::new(2.0, 2.0, 0.0), y],
            [x, Vec3::new(0.6, 0.6, 0.0), y],
            // Folded along the shared edge, a little and all the way; and flat, but facing the other way.
            [x, Vec3::new(1.0, 1.0, 0.1), y],
            [y, x, o],
            [x, y, Vec3::new(1.0, 1.0, 0.0)],
            // No shared edge: a corner, nothing, everything.
            [x, Vec3::new(2.0, 0.0, 0.0), Vec3::new(1.0, 1.0, 0.0)],
            first.map(|p| p + 3.0),
            first,
        ];
        for second in others {
            for second in turns(second) {
                assert_eq!(n_pieces(&[first, second]), 2, "{second:?}");
            }
        }
    }

    #[test]
    fn only_neighbors_are_joined() {
        let square = |z: f32| {
            let [o, p, q, r] =
                [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, z));
            [[o, p, q], [o, q, r]]
        };
        let [a, b] = [square(0.0), square(1.0)];
        assert_eq!(n_pieces(&[a[0], a[1], b[0], b[1]]), 2);
        assert_eq!(n_pieces(&[a[0], a[1], b[0]]), 2);
        assert_eq!(n_pieces(&[a[0], b[0], b[1]]), 2);
        assert_eq!(n_pieces(&[a[0], b[0], a[1], b[1]]), 4);
    }
}
