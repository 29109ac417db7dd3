//! From pixels to eye rays and back.

use base::{Fingerprint, FingerprintBuilder, ImageSize, Ray, math};
use glam::{Vec2, Vec3, Vec3A};

/// Which side of the picture the field of view spans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FovAxis {
    /// The width.
    X,
    /// The height.
    Y,
    /// The shorter side.
    Smaller,
    /// The longer side.
    Larger,
    /// From corner to corner.
    Diagonal,
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    origin: Vec3A,
    right: Vec3A,
    up: Vec3A,
    forward: Vec3A,
    tan_half_fov: f32,
    fov_axis: FovAxis,
    film: Option<ImageSize>,
}

impl Camera {
    /// A camera at `origin` that looks at `target`; `fov` in degrees, in (0, 180).
    ///
    /// The caller makes sure that the two points differ and that `up` isn't along the line through them.
    pub fn look_at(origin: Vec3, target: Vec3, up: Vec3, fov: f32, fov_axis: FovAxis) -> Self {
        let forward = Vec3A::from(target - origin).normalize();
        let right = forward.cross(up.into()).normalize();
        Self {
            origin: origin.into(),
            right,
            up: right.cross(forward),
            forward,
            tan_half_fov: math::tan(fov.to_radians() * 0.5),
            fov_axis,
            film: None,
        }
    }

    /// The same camera, with the size that its pictures are meant to have.
    pub fn with_film(self, film: ImageSize) -> Self {
        Self { film: Some(film), ..self }
    }

    /// The size that its pictures are meant to have, if the scene tells.
    pub fn film(&self) -> Option<ImageSize> {
        self.film
    }

    /// Half the extent of the picture at distance 1 along the view axis.
    fn half_extent(&self, size: ImageSize) -> Vec2 {
        let (w, h) = (size.width as f32, size.height as f32);
        let side = match self.fov_axis {
            FovAxis::X => w,
            FovAxis::Y => h,
            FovAxis::Smaller => w.min(h),
            FovAxis::Larger => w.max(h),
            FovAxis::Diagonal => w.hypot(h),
        };
        Vec2::new(w, h) * (self.tan_half_fov / side)
    }

    /// The eye ray through a place of the picture, in pixels from its upper left corner: (0.5, 0.5) is the middle of the
    /// first pixel.
    pub fn ray(&self, size: ImageSize, at: Vec2) -> Ray {
        let p = (at / Vec2::new(size.width as f32, size.height as f32) * 2.0 - Vec2::ONE)
            * self.half_extent(size);
        Ray::unbounded(self.origin, (self.forward + self.right * p.x - self.up * p.y).normalize())
    }

    /// Where a point appears in the picture, in pixels as for [`Camera::ray`], if it lies in front of the eye.
    pub fn project(&self, size: ImageSize, point: Vec3A) -> Option<Vec2> {
        let d = point - self.origin;
        let depth = d.dot(self.forward);
        if depth <= 0.0 {
            return None;
        }
        let p = Vec2::new(d.dot(self.right), -d.dot(self.up)) / depth / self.half_extent(size);
        Some((p + Vec2::ONE) * 0.5 * Vec2::new(size.width as f32, size.height as f32))
    }

    /// The side of a pixel at distance 1 along the view axis.
    pub fn pixel_extent(&self, size: ImageSize) -> f32 {
        2.0 * self.half_extent(size).x / size.width as f32
    }

    /// The distance of a point along the view axis.
    pub fn depth(&self, point: Vec3A) -> f32 {
        (point - self.origin).dot(self.forward)
    }

    /// Where the eye is.
    pub fn origin(&self) -> Vec3A {
        self.origin
    }

    /// A digest of the view.
    pub fn fingerprint(&self) -> Fingerprint {
        let mut digest = FingerprintBuilder::new();
        for v in [self.origin, self.right, self.up, self.forward] {
            digest.pod(&v.to_array());
        }
        digest.pod(&[self.tan_half_fov]).pod(&[self.fov_axis as u8]);
        digest.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn project_undoes_ray() {
        let size = ImageSize { width: 640, height: 360 };
        for axis in [FovAxis::X, FovAxis::Y, FovAxis::Smaller, FovAxis::Larger, FovAxis::Diagonal] {
            let camera = Camera::look_at(
                Vec3::new(1.0, 2.0, 3.0),
                Vec3::new(0.0, 1.0, -4.0),
                Vec3::Y,
                50.0,
                axis,
            );
            for at in [Vec2::new(0.5, 0.5), Vec2::new(320.0, 180.0), Vec2::new(639.0, 17.25)] {
                let point = camera.ray(size, at).at(7.0);
                let back = camera.project(size, point).unwrap();
                assert!((back - at).length() < 1e-2, "{at} became {back}");
            }
        }
    }

    #[test]
    fn fov_spans_the_axis_it_names() {
        let size = ImageSize { width: 200, height: 100 };
        let camera = Camera::look_at(Vec3::ZERO, -Vec3::Z, Vec3::Y, 90.0, FovAxis::X);
        let left = camera.ray(size, Vec2::new(0.0, 50.0)).dir();
        assert!((left - Vec3A::new(-1.0, 0.0, -1.0).normalize()).length() < 1e-6, "{left}");
        let camera = Camera::look_at(Vec3::ZERO, -Vec3::Z, Vec3::Y, 90.0, FovAxis::Smaller);
        let top = camera.ray(size, Vec2::new(100.0, 0.0)).dir();
        assert!((top - Vec3A::new(0.0, 1.0, -1.0).normalize()).length() < 1e-6, "{top}");
        let camera = Camera::look_at(Vec3::ZERO, -Vec3::Z, Vec3::Y, 90.0, FovAxis::Diagonal);
        let corner = camera.ray(size, Vec2::new(200.0, 0.0)).dir();
        assert!((corner.z + 0.5_f32.sqrt()).abs() < 1e-6, "{corner}");
    }
}
