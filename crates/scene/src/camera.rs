//! From pixels to eye rays and back.

use base::{Fingerprint, FingerprintBuilder, ImageSize, Ray, math, warp};
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

/// A camera: a pinhole, or a thin lens.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    origin: Vec3A,
    right: Vec3A,
    up: Vec3A,
    forward: Vec3A,
    tan_half_fov: f32,
    fov_axis: FovAxis,
    film: Option<ImageSize>,
    /// What its pictures show of the view.
    crop: Option<Crop>,
    lens: Option<Lens>,
}

/// A part of a film, as shares of its width and height.
#[derive(Clone, Copy, Debug)]
struct Crop {
    /// Its upper left corner.
    corner: Vec2,
    /// Its own width and height.
    size: Vec2,
}

/// A thin lens.
#[derive(Clone, Copy, Debug)]
struct Lens {
    radius: f32,
    /// Distance along the view axis of what is sharp.
    focus: f32,
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
            crop: None,
            lens: None,
        }
    }

    /// The same camera behind a thin lens: what lies at the distance `focus` along the view axis is sharp. Both lengths
    /// are above 0.
    pub fn with_lens(self, radius: f32, focus: f32) -> Self {
        Self { lens: Some(Lens { radius, focus }), ..self }
    }

    /// Whether everything is sharp, so that all eye rays start at one point.
    pub fn is_pinhole(&self) -> bool {
        self.lens.is_none()
    }

    /// The same camera, whose pictures are meant to show that part of a film of that size; the field of view is that of the
    /// whole film. `corner` is the upper left one of the part, which lies within the film.
    pub fn with_crop(self, film: ImageSize, corner: [u32; 2], part: ImageSize) -> Self {
        let whole = Vec2::new(film.width as f32, film.height as f32);
        let crop = Crop {
            corner: Vec2::new(corner[0] as f32, corner[1] as f32) / whole,
            size: Vec2::new(part.width as f32, part.height as f32) / whole,
        };
        Self { film: Some(part), crop: (part != film).then_some(crop), ..self }
    }

    /// The size that its pictures are meant to have, if the scene tells.
    pub fn film(&self) -> Option<ImageSize> {
        self.film
    }

    /// Half the extent of the film at distance 1 along the view axis, if its picture, which may show a part of it, has that
    /// size.
    fn half_extent(&self, size: ImageSize) -> Vec2 {
        let film = self.crop.map_or(Vec2::ONE, |crop| crop.size);
        let (w, h) = (size.width as f32 / film.x, size.height as f32 / film.y);
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
    /// first pixel. If there is a lens, it comes through its middle.
    pub fn ray(&self, size: ImageSize, at: Vec2) -> Ray {
        self.rays(size)(at)
    }

    /// [`Camera::ray`] for many places of a picture of that size.
    #[inline]
    pub fn rays(&self, size: ImageSize) -> impl Fn(Vec2) -> Ray {
        let Self { origin, .. } = *self;
        let along = self.along(size);
        move |at| Ray::unbounded(origin, along(at).normalize())
    }

    /// One of the eye rays through a place of the picture, in pixels as for [`Camera::ray`]: `u` tells, uniformly by area,
    /// where it comes through the lens.
    pub fn lens_ray(&self, size: ImageSize, at: Vec2, u: Vec2) -> Ray {
        let Some(Lens { radius, focus }) = self.lens else { return self.ray(size, at) };
        let place = warp::uniform_disc(u) * radius;
        let aside = self.right * place.x + self.up * place.y;
        let dir = (self.along(size)(at) * focus - aside).normalize();
        Ray::unbounded(self.origin + aside, dir)
    }

    /// From the eye to places of a picture of that size at distance 1 along the view axis.
    #[inline]
    fn along(&self, size: ImageSize) -> impl Fn(Vec2) -> Vec3A {
        let Self { right, up, forward, crop, .. } = *self;
        let half_extent = self.half_extent(size);
        let size = Vec2::new(size.width as f32, size.height as f32);
        move |at| {
            let mut place = at / size;
            if let Some(crop) = crop {
                place = crop.corner + place * crop.size;
            }
            let p = (place * 2.0 - Vec2::ONE) * half_extent;
            forward + right * p.x - up * p.y
        }
    }

    /// Where a point appears in the picture, in pixels as for [`Camera::ray`], if it lies in front of the eye. Through a
    /// lens points appear as discs: none.
    pub fn project(&self, size: ImageSize, point: Vec3A) -> Option<Vec2> {
        let d = point - self.origin;
        let depth = d.dot(self.forward);
        if depth <= 0.0 || !self.is_pinhole() {
            return None;
        }
        let p = Vec2::new(d.dot(self.right), -d.dot(self.up)) / depth / self.half_extent(size);
        let mut place = (p + Vec2::ONE) * 0.5;
        if let Some(crop) = self.crop {
            place = (place - crop.corner) / crop.size;
        }
        Some(place * Vec2::new(size.width as f32, size.height as f32))
    }

    /// The side of a pixel at distance 1 along the view axis.
    pub fn pixel_extent(&self, size: ImageSize) -> f32 {
        let film = self.crop.map_or(1.0, |crop| crop.size.x);
        2.0 * self.half_extent(size).x * film / size.width as f32
    }

    /// The distance of a point along the view axis.
    pub fn depth(&self, point: Vec3A) -> f32 {
        (point - self.origin).dot(self.forward)
    }

    /// Where the eye is, or the middle of the lens.
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
        // Nothing of pinholes, so that what was saved of their views stays valid.
        if let Some(Lens { radius, focus }) = self.lens {
            digest.bytes(b"lens").pod(&[radius, focus]);
        }
        if let Some(Crop { corner, size }) = self.crop {
            digest.bytes(b"crop").pod(&corner.to_array()).pod(&size.to_array());
        }
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
    fn a_crop_shows_a_part_of_the_film() {
        let film = ImageSize { width: 640, height: 360 };
        let part = ImageSize { width: 64, height: 90 };
        for axis in [FovAxis::X, FovAxis::Y, FovAxis::Diagonal] {
            let whole = Camera::look_at(Vec3::ONE, Vec3::ZERO, Vec3::Y, 50.0, axis);
            let camera = whole.with_crop(film, [100, 200], part);
            assert_eq!(camera.film(), Some(part));
            assert!(camera.fingerprint() != whole.fingerprint());
            // Also if the picture has another size: here twice the width and height.
            for scale in [1, 2] {
                let size = ImageSize { width: 64 * scale, height: 90 * scale };
                for at in [Vec2::new(0.5, 0.5), Vec2::new(63.5, 17.0)] {
                    let ray = camera.ray(size, at * scale as f32);
                    let expected = whole.ray(film, at + Vec2::new(100.0, 200.0));
                    assert!((ray.dir() - expected.dir()).length() < 1e-6, "{axis:?}, {at}");
                    let back = camera.project(size, ray.at(3.0)).unwrap();
                    assert!((back - at * scale as f32).length() < 1e-2, "{back}");
                }
            }
            let extents = camera.pixel_extent(part) / whole.pixel_extent(film);
            assert!((extents - 1.0).abs() < 1e-5, "{extents}");
        }
        let whole = Camera::look_at(Vec3::ONE, Vec3::ZERO, Vec3::Y, 50.0, FovAxis::X);
        let all = whole.with_crop(film, [0, 0], film);
        assert_eq!(all.fingerprint(), whole.fingerprint());
    }

    #[test]
    fn rays_through_a_lens_meet_where_it_is_sharp() {
        let size = ImageSize { width: 640, height: 360 };
        let (eye, target) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 1.0, -4.0));
        let pinhole = Camera::look_at(eye, target, Vec3::Y, 50.0, FovAxis::X);
        let camera = pinhole.with_lens(0.3, 5.0);
        assert!(camera.fingerprint() != pinhole.fingerprint());
        let axis = Vec3A::from(target - eye).normalize();
        for at in [Vec2::new(320.0, 180.0), Vec2::new(3.0, 350.0)] {
            let chief = camera.ray(size, at);
            let sharp = chief.at(5.0 / chief.dir().dot(axis));
            let (mut sum, mut farthest) = (Vec3A::ZERO, 0.0_f32);
            for i in 0..4096 {
                let u = Vec2::new((i % 64) as f32 + 0.5, (i / 64) as f32 + 0.5) / 64.0;
                let ray = camera.lens_ray(size, at, u);
                let aside = ray.origin() - Vec3A::from(eye);
                assert!(aside.dot(axis).abs() < 1e-5, "{aside} lies off the lens");
                let passed = ray.at((sharp - ray.origin()).dot(ray.dir()));
                assert!((passed - sharp).length() < 1e-4, "{at}: {passed}, not {sharp}");
                sum += aside;
                farthest = farthest.max(aside.length());
            }
            assert!(sum.length() / 4096.0 < 1e-4 && (0.295..0.300_01).contains(&farthest));
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
