//! What the eye sees of the scenes of this project, for tests.

use std::path::Path;

use base::ImageSize;
use glam::Vec2;
use photon_map::{Gather, Kernel, Metadata, PhotonMaps, PhotonSet};
use scene::Scene;

use crate::{PixelStream, Settings, Shader, ShadingPoint, Work};

/// Calls `check` for the surface that each of 60x60 pixels shows, without photons.
pub(crate) fn each_pixel(
    scene: &str,
    shadow_rays: u32,
    mut check: impl FnMut(&Shader<'_>, &ShadingPoint<'_>, PixelStream, &mut Work),
) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(scene);
    let options = scene::Options { definitions: Vec::new(), lenient: false, no_external: false };
    let parts = scene::load_parts(&folder.join("scene.toml"), &options).expect("a scene").0;
    let scene = Scene::assemble(parts);
    let maps = PhotonMaps {
        metadata: Metadata::default(),
        direct: None,
        caustic: PhotonSet::build(&[]),
        indirect: PhotonSet::build(&[]),
        focused: None,
    };
    let gather = Gather { k: 1, max_radius: 1.0, kernel: Kernel::Cone };
    let settings =
        Settings { shadow_rays, glossy_rays: 1, indirect: gather, caustic: gather, seed: 7 };
    let shader = Shader::new(&scene, &maps, settings);
    let size = ImageSize { width: 60, height: 60 };
    let mut work = Work::default();
    for (i, pixel) in size.pixels().enumerate() {
        let at = Vec2::new(pixel.x as f32, pixel.y as f32) + 0.5;
        if let Some(point) = shader.eye_point(&scene.camera.ray(size, at), &mut work) {
            check(&shader, &point, PixelStream(i as u64), &mut work);
        }
    }
}
