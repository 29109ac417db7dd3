//! The programs against the libraries, and what lies on disk against what lies in memory.

use std::path::Path;

use base::{Component, Components, ImageSize, Rgb};
use clap::Parser;
use glam::Vec2;
use photon_map::{Gather, Kernel, Metadata, PhotonMaps, PhotonSet};
use photon_trace::{Budget, Config};
use scene::Scene;
use shade::{PixelStream, Settings, Shader, Work};

const SIZE: ImageSize = ImageSize { width: 40, height: 30 };

/// What `photon-build --photons 20K --seed 3` keeps.
fn photons(scene: &Scene) -> PhotonMaps {
    let budget = Budget::Total(20_000);
    let config = Config { budget, seed: 3, max_bounces: 1024, store_direct: false, aim: 0.0 };
    let traced = photon_trace::trace(scene, &config, &|_| true).expect("nobody interrupts");
    let inventory = scene.inventory().clone();
    PhotonMaps {
        metadata: Metadata { inventory, ..Metadata::default() },
        direct: None,
        caustic: PhotonSet::build(&traced.caustic),
        indirect: PhotonSet::build(&traced.indirect),
        focused: None,
    }
}

/// Every component of every pixel, row by row.
fn pixels(scene: &Scene, photons: &PhotonMaps) -> Vec<Components<Rgb>> {
    let gather = |k, max_radius| Gather { k, max_radius, kernel: Kernel::Cone };
    let settings = Settings {
        shadow_rays: 4,
        glossy_rays: 4,
        indirect: gather(60, 0.6),
        caustic: gather(30, 0.25),
        seed: 7,
    };
    let shader = Shader::new(scene, photons, settings);
    let mut work = Work::default();
    let mut pixel = |i: usize| {
        let at = SIZE.pixel(i);
        let ray = scene.camera.ray(SIZE, Vec2::new(at.x as f32 + 0.5, at.y as f32 + 0.5));
        let Some(point) = shader.eye_point(&ray, &mut work) else { return Components::default() };
        let stream = PixelStream(i as u64);
        Components {
            direct: shader.direct(&point, stream, &mut work),
            indirect: shader.indirect(&point, &mut work),
            specular: shader.specular(&point, stream, &mut work),
            caustic: shader.caustic(&point, &mut work),
        }
    };
    (0..SIZE.n_pixels()).map(&mut pixel).collect()
}

#[test]
fn photons_are_the_same_in_memory_on_disk_and_from_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let scene_file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell-box/scene.toml");
    let scene_file = scene_file.display().to_string();
    let scene = scene::load(Path::new(&scene_file)).unwrap().scene;

    let (memory, saved) = (photons(&scene), at("saved.photons"));
    memory.save(Path::new(&saved), film::Existing::Refuse, "a test", "no command").unwrap();
    let (disk, _) = PhotonMaps::open(Path::new(&saved)).unwrap();
    assert_eq!(disk.metadata, memory.metadata);
    assert_eq!(disk.fingerprint(), memory.fingerprint());
    let expected = pixels(&scene, &memory);
    assert_eq!(pixels(&scene, &disk), expected);

    let built = at("built.photons");
    let args = ["photon-build", &scene_file, "-o", &built, "--photons", "20K", "--seed", "3", "-q"];
    photon_build::run(&photon_build::Args::parse_from(args)).unwrap();
    let (program, _) = PhotonMaps::open(Path::new(&built)).unwrap();
    assert_eq!(program.fingerprint(), memory.fingerprint());

    let exr = at("a.exr");
    let args = format!(
        "--photons {built} -o {exr} --resolution 40x30 --mode original --shadow-rays 4 --gather 60 --gather-radius 0.6 \
         --caustic-gather 30 --caustic-radius 0.25 --kernel cone --seed 7 -q"
    );
    let words = ["render-cached", &scene_file].into_iter().chain(args.split_whitespace());
    render_cached::run(&render_cached::Args::parse_from(words)).unwrap();
    let picture = film::read_exr(Path::new(&exr)).unwrap();
    for (component, layer) in
        Component::ALL.into_iter().zip(["direct", "indirect", "specular", "caustics"])
    {
        let values: Vec<Rgb> = expected.iter().map(|components| components[component]).collect();
        assert!(values.iter().any(|value| !value.is_black()), "{layer}");
        assert_eq!(picture.rgb(layer).unwrap().values(), values, "{layer}");
    }
}
