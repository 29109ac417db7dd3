//! The two passes without their programs: photons, then every component at every pixel.

use base::{Component, Components, Grid, ImageSize, Rgb, Rng, Stream};
use glam::Vec2;
use photon_map::{Metadata, PhotonMaps, PhotonSet};
use photon_trace::{Budget, Config, Traced};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rayon::slice::ParallelSlice;
use scene::Scene;
use shade::{GatherPhotons, GatherPlace, IrradianceAhead, PixelStream, Settings, Shader, Work};

/// A picture by terms of Eq. (8).
#[derive(Debug)]
pub(crate) struct Rendering {
    /// Radiance emitted towards the eye, the background included.
    pub(crate) emission: Grid<Rgb>,
    /// The rest.
    pub(crate) components: Components<Grid<Rgb>>,
}

impl Rendering {
    /// The picture: emission and all components.
    pub(crate) fn total(&self) -> Grid<Rgb> {
        Grid::from_fn(self.emission.size(), |at| {
            self.emission[at] + Component::ALL.map(|c| self.components[c][at]).into_iter().sum()
        })
    }
}

/// Pass 1.
pub(crate) fn photons(scene: &Scene, n_photons: u64, seed: u64) -> PhotonMaps {
    maps(&traced(scene, n_photons, seed, false))
}

/// Pass 1 with all that final gathering needs.
pub(crate) fn photons_for_gathering(scene: &Scene, n_photons: u64, seed: u64) -> PhotonMaps {
    let traced = traced(scene, n_photons, seed, true);
    PhotonMaps {
        direct: Some(PhotonSet::build(&traced.direct)),
        focused: Some(PhotonSet::build(&traced.focused)),
        ..maps(&traced)
    }
}

/// Shading by final gathering, with so many rays at each point.
pub(crate) fn gathering<'a>(
    scene: &'a Scene,
    maps: &'a PhotonMaps,
    settings: Settings,
    rays: u32,
) -> Shader<'a> {
    let photons = GatherPhotons::of(maps, &settings.indirect).unwrap();
    let shader = Shader::new(scene, maps, settings);
    let places = photons.places(settings.seed);
    let chunk = |places: &[GatherPlace]| -> Vec<IrradianceAhead> {
        let mut work = Work::default();
        places.iter().map(|place| shader.irradiance_ahead(&photons, place, &mut work)).collect()
    };
    let irradiance = places.par_chunks(512).map(chunk).collect::<Vec<_>>().concat();
    shader.gathering(rays, photons, &irradiance)
}

fn traced(scene: &Scene, n_photons: u64, seed: u64, store_direct: bool) -> Traced {
    let budget = Budget::Total(n_photons);
    let config = Config { budget, seed, max_bounces: 1000, store_direct, aim: 0.0 };
    let traced = photon_trace::trace(scene, &config, &|_| true).expect("nobody interrupts");
    assert_eq!(traced.account.cut, 0, "photons were cut");
    traced
}

fn maps(traced: &Traced) -> PhotonMaps {
    PhotonMaps {
        metadata: Metadata::default(),
        direct: None,
        caustic: PhotonSet::build(&traced.caustic),
        indirect: PhotonSet::build(&traced.indirect),
        focused: None,
    }
}

/// Pass 2, as `--mode original` does it; through a lens, one ray for each pixel.
pub(crate) fn original(shader: &Shader<'_>, size: ImageSize) -> Rendering {
    let row = |y: u32| -> Vec<(Rgb, Components<Rgb>)> {
        let mut work = Work::default();
        let mut pixel = |x: u32| {
            let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let mut random =
                Rng::new(shader.settings.seed, Stream::Lens, u64::from(y * size.width + x));
            let ray = shader.scene.camera.lens_ray(size, at, random.next_2d());
            let Some(point) = shader.eye_point(&ray, &mut work) else {
                return (shader.background(ray.dir()), Components::default());
            };
            let stream = PixelStream(u64::from(y * size.width + x));
            let components = Components::from_fn(|component| match component {
                Component::Direct => shader.direct(&point, stream, &mut work),
                Component::Indirect => shader.indirect(&point, &mut work),
                Component::Specular => shader.specular(&point, stream, &mut work),
                Component::Caustic => shader.caustic(&point, &mut work),
            });
            (point.emitted, components)
        };
        (0..size.width).map(&mut pixel).collect()
    };
    let pixels: Vec<_> = (0..size.height).into_par_iter().flat_map_iter(row).collect();
    Rendering {
        emission: Grid::from_values(size, pixels.iter().map(|p| p.0).collect()),
        components: Components::from_fn(|c| {
            Grid::from_values(size, pixels.iter().map(|p| p.1[c]).collect())
        }),
    }
}
