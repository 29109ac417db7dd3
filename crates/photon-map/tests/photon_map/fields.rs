//! Photons to search among.

use base::{Photon, Rgb, Rng, Stream, encode_octahedral, warp};
use glam::{Quat, Vec3, Vec3A};

pub(crate) fn rng(index: u64) -> Rng {
    Rng::new(0, Stream::Test, index)
}

pub(crate) fn photon(position: Vec3, normal: Vec3A, flux: Rgb) -> Photon {
    Photon { position, normal: encode_octahedral(normal), flux }
}

/// Fluxes between 0.25 and 1 in each channel.
fn some_flux(rng: &mut Rng) -> Rgb {
    let mut channel = || 0.25 + 0.75 * rng.next_f32();
    Rgb::new(channel(), channel(), channel())
}

/// A way to spread photons.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Field {
    /// Uniform on the unit square of z = 0, all facing up.
    Plane,
    /// Uniform on a tilted square.
    Tilted,
    /// As [`Field::Plane`], so far from the origin that single precision resolves 1/8192 only.
    Remote,
    /// Uniform in the unit cube, with normals around +z.
    Volume,
    /// Around twenty centers on z = 0, each with a spread of its own, from 0.1 to 1e-6.
    Clustered,
    /// Only nine places on a line.
    Ties,
    /// All at one place.
    Equal,
}

impl Field {
    pub(crate) const ALL: [Self; 7] = [
        Self::Plane,
        Self::Tilted,
        Self::Remote,
        Self::Volume,
        Self::Clustered,
        Self::Ties,
        Self::Equal,
    ];

    const FAR: Vec3 = Vec3::new(1500.0, -1900.0, 1100.0);

    fn tilt() -> Quat {
        Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.7)
    }

    pub(crate) fn photons(self, n: usize) -> Vec<Photon> {
        let mut rng = rng(self as u64);
        (0..n)
            .map(|_| {
                let square = rng.next_2d().extend(0.0);
                let (position, normal) = match self {
                    Self::Plane => (square, Vec3A::Z),
                    Self::Tilted => (Self::tilt() * square, (Self::tilt() * Vec3::Z).into()),
                    Self::Remote => (square + Self::FAR, Vec3A::Z),
                    Self::Volume => {
                        (square + rng.next_f32() * Vec3::Z, warp::uniform_cone(rng.next_2d(), 0.7))
                    }
                    Self::Clustered => {
                        let cluster = rng.next_u32() % 20;
                        let center = Vec3::new(0.05, 0.37, 0.0) * cluster as f32 % 1.0;
                        let spread = 0.1 * 10.0_f32.powi(-(cluster as i32) / 4);
                        (center + spread * (square - 0.5).with_z(0.0), Vec3A::Z)
                    }
                    Self::Ties => {
                        (Vec3::new((rng.next_u32() % 9) as f32 * 0.125, 0.5, 0.0), Vec3A::Z)
                    }
                    Self::Equal => (Vec3::new(0.3, 0.7, 0.0), Vec3A::Z),
                };
                photon(position, normal, some_flux(&mut rng))
            })
            .collect()
    }

    /// A place and a normal to ask at: on a photon, on the surface, off it, or outside of it all.
    pub(crate) fn query(self, photons: &[Photon], rng: &mut Rng) -> (Vec3A, Vec3A) {
        let square = (rng.next_2d() * 1.4 - 0.2).extend(0.0);
        let (mut point, mut normal) = match self {
            Self::Tilted => (Self::tilt() * square, (Self::tilt() * Vec3::Z).into()),
            Self::Remote => (square + Self::FAR, Vec3A::Z),
            Self::Volume => (square + rng.next_f32() * Vec3::Z, Vec3A::Z),
            _ => (square, Vec3A::Z),
        };
        let choice = rng.next_u32() % 4;
        if choice == 0 && !photons.is_empty() {
            point = photons[rng.next_u32() as usize % photons.len()].position;
        }
        if choice == 1 {
            point += Vec3::from(warp::uniform_sphere(rng.next_2d())) * 0.03;
        }
        if rng.next_u32().is_multiple_of(3) {
            normal = (normal + warp::uniform_sphere(rng.next_2d()) * 0.3).normalize();
        }
        (point.into(), normal)
    }
}
