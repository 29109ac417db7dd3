//! Indirect light goes on undiminished to the edges of surfaces, though no photons lie beyond them.

use base::{Photon, Ray, Rgb, Rng, Stream, encode_octahedral};
use geometry::Mesh;
use glam::{Vec3, Vec3A};
use photon_map::{Gather, Kernel, Metadata, PhotonMaps, PhotonSet};
use scene::{Parts, Scene};
use shade::{Settings, Shader, Work};

use crate::scenes::{add_mesh, cuboid, diffuse, empty, inside_out, mirror, quad};

/// Irradiance of all fields of photons.
const IRRADIANCE: f32 = 3.0;
const N_PHOTONS: usize = 200_000;

/// Photons that are spread evenly over the unit square at height 0, but for where `covered` says there is none, on the
/// side of `normal`.
fn photons(normal: Vec3A, covered: impl Fn(Vec3A) -> bool) -> PhotonMaps {
    photons_at(normal, |p| (!covered(p)).then_some(0.0))
}

/// The same at the heights that `height` tells, if any.
fn photons_at(normal: Vec3A, height: impl Fn(Vec3A) -> Option<f32>) -> PhotonMaps {
    let mut rng = Rng::new(0, Stream::Test, 0);
    let flux = Rgb::splat(IRRADIANCE / N_PHOTONS as f32);
    let photons: Vec<Photon> = (0..N_PHOTONS)
        .map(|_| Vec3A::new(rng.next_f32(), 0.0, rng.next_f32()))
        .filter_map(|p| height(p).map(|y| p + Vec3A::Y * y))
        .map(|p| Photon { position: p.into(), normal: encode_octahedral(normal), flux })
        .collect();
    PhotonMaps {
        metadata: Metadata::default(),
        direct: None,
        caustic: PhotonSet::build(&[]),
        indirect: PhotonSet::build(&photons),
        focused: None,
    }
}

/// Irradiance at a point of the plane, seen along the negative normal.
fn irradiance(scene: &Scene, photons: &PhotonMaps, kernel: Kernel, normal: Vec3A, p: Vec3A) -> f32 {
    let gather = Gather { k: 2000, max_radius: 0.5, kernel };
    let settings =
        Settings { shadow_rays: 1, glossy_rays: 4, indirect: gather, caustic: gather, seed: 0 };
    let shader = Shader::new(scene, photons, settings);
    let ray = Ray::unbounded(p + normal * 0.01, -normal);
    let point = shader.eye_point(&ray, &mut Work::default()).expect("the plane is there");
    shader.indirect_estimate(&point.facing, &mut Work::default()).irradiance.g
}

/// Points in the middle, at edges, in corners, and near them.
fn places() -> impl Iterator<Item = Vec3A> {
    let along = [1e-4, 0.02, 0.06, 0.47, 0.5, 0.93, 0.9999];
    along.into_iter().flat_map(move |x| along.map(|z| Vec3A::new(x, 0.0, z)))
}

/// Asserts that the photons of the unit square give the same irradiance at all places that aren't covered.
fn assert_even(what: &str, parts: &Parts, normal: Vec3A, covered: impl Fn(Vec3A) -> bool + Copy) {
    let scene = Scene::assemble(parts.clone());
    let photons = photons(normal, covered);
    for kernel in Kernel::ALL {
        for p in places().filter(|p| !covered(*p)) {
            let found = irradiance(&scene, &photons, kernel, normal, p);
            // The noise of 2000 photons is 2 to 3 %.
            let error = (found / IRRADIANCE - 1.0).abs();
            assert!(error < 0.12, "{what}, {kernel:?}: {found} instead of {IRRADIANCE} at {p}");
        }
    }
}

fn with_mesh(mesh: Mesh) -> Parts {
    let mut parts = empty(Vec3::ONE, Vec3::ZERO, 40.0);
    add_mesh(&mut parts, mesh, diffuse(Rgb::ONE));
    parts
}

const NOWHERE: fn(Vec3A) -> bool = |_| false;

#[test]
fn a_square_from_both_sides() {
    let square = with_mesh(quad(Vec3::ZERO, Vec3::Z, Vec3::X));
    assert_even("front", &square, Vec3A::Y, NOWHERE);
    assert_even("back", &square, -Vec3A::Y, NOWHERE);
}

#[test]
fn the_side_of_a_box_from_within_and_without() {
    let below = cuboid(Vec3::new(0.0, -1.0, 0.0), Vec3::new(1.0, 0.0, 1.0));
    assert_even("without", &with_mesh(below.clone()), Vec3A::Y, NOWHERE);
    assert_even("within", &with_mesh(inside_out(below)), -Vec3A::Y, NOWHERE);
}

/// Four squares of different sizes, each a mesh of its own.
#[test]
fn tiles() {
    let mut parts = empty(Vec3::ONE, Vec3::ZERO, 40.0);
    for (x, width) in [(0.0, 0.49), (0.49, 0.51)] {
        for (z, depth) in [(0.0, 0.08), (0.08, 0.92)] {
            let tile = quad(Vec3::new(x, 0.0, z), Vec3::Z * depth, Vec3::X * width);
            add_mesh(&mut parts, tile, diffuse(Rgb::ONE));
        }
    }
    assert_even("tiles", &parts, Vec3A::Y, NOWHERE);
}

/// A smaller square floats right above the larger one, as a lamp under a ceiling: photons fall on it instead.
#[test]
fn a_plate_above_a_floor() {
    let mut parts = with_mesh(quad(Vec3::ZERO, Vec3::Z, Vec3::X));
    let plate = quad(Vec3::new(0.53, 1e-4, 0.53), Vec3::Z * 0.37, Vec3::X * 0.37);
    add_mesh(&mut parts, plate, diffuse(Rgb::ONE));
    assert_even("floor", &parts, Vec3A::Y, NOWHERE);
}

/// A box stands on the square: no photons fall on what it covers.
#[test]
fn a_box_that_stands_on_a_floor() {
    let mut parts = with_mesh(quad(Vec3::ZERO, Vec3::Z, Vec3::X));
    let base = cuboid(Vec3::new(0.1, 0.0, 0.1), Vec3::new(0.48, 0.5, 0.9));
    add_mesh(&mut parts, base, diffuse(Rgb::ONE));
    let covered = |p: Vec3A| p.x > 0.1 && p.x < 0.48 && p.z > 0.1 && p.z < 0.9;
    assert_even("floor", &parts, Vec3A::Y, covered);
}

/// A mirror in a frame on the square: no photon of the frame lies where the mirror covers it.
#[test]
fn a_mirror_in_a_frame() {
    let (low, high) = (Vec3::new(0.2, 0.0, 0.2), Vec3::new(0.8, 0.04, 0.8));
    let (width, top) = (0.04, 0.045);
    let corner = Vec3::new(low.x + width, top, low.z + width);
    let side = high.x - low.x - 2.0 * width;
    let from_middle = |p: Vec3A| (p.x - 0.5).abs().max((p.z - 0.5).abs());
    let photons = photons_at(Vec3A::Y, |p| match from_middle(p) {
        d if d < 0.5 * side => None,
        d if d < 0.5 * side + width => Some(high.y),
        _ => Some(0.0),
    });
    let mut parts = with_mesh(quad(Vec3::ZERO, Vec3::Z, Vec3::X));
    add_mesh(&mut parts, cuboid(low, high), diffuse(Rgb::ONE));
    add_mesh(&mut parts, quad(corner, Vec3::Z * side, Vec3::X * side), mirror(1.0));
    let scene = Scene::assemble(parts);
    for along in [0.3, 0.5, 0.7] {
        for off in [0.01, 0.02, 0.03] {
            let p = Vec3A::new(low.x + off, high.y, along);
            let found = irradiance(&scene, &photons, Kernel::Epanechnikov, Vec3A::Y, p);
            println!("{off} off, at {along}: {:+.3}", found / IRRADIANCE - 1.0);
            let error = (found / IRRADIANCE - 1.0).abs();
            assert!(error < 0.15, "{found} instead of {IRRADIANCE} at {p}");
        }
    }
}

/// A sheet or a box floats a little above the square, and light from straight above falls on it instead of on what it
/// covers. Neither takes photons from the other, nor area.
#[test]
fn a_rug_on_a_floor() {
    const TOP: f32 = 0.005;
    let (low, high) = (Vec3::new(0.1, 0.0005, 0.1), Vec3::new(0.48, TOP, 0.9));
    let corner = Vec3::new(low.x, TOP, low.z);
    let sheet = quad(corner, Vec3::Z * (high.z - low.z), Vec3::X * (high.x - low.x));
    let covered = |p: Vec3A| p.x > low.x && p.x < high.x && p.z > low.z && p.z < high.z;
    let photons = photons_at(Vec3A::Y, |p| Some(if covered(p) { TOP } else { 0.0 }));
    for (what, rug) in [("sheet", sheet), ("box", cuboid(low, high))] {
        let mut parts = with_mesh(quad(Vec3::ZERO, Vec3::Z, Vec3::X));
        add_mesh(&mut parts, rug, diffuse(Rgb::ONE));
        let scene = Scene::assemble(parts);
        // On either side of the border, and of its corner.
        for off in [-0.1, -0.03, -0.015, -0.004, 0.002, 0.005, 0.01, 0.02, 0.03, 0.04, 0.1] {
            for z in [0.3, 0.5, high.z + off] {
                let y = if off < 0.0 { TOP } else { 0.0 };
                let p = Vec3A::new(high.x + off, y, z);
                let found = irradiance(&scene, &photons, Kernel::Epanechnikov, Vec3A::Y, p);
                println!("{what}, {off} off, at {z}: {:+.3}", found / IRRADIANCE - 1.0);
                let error = (found / IRRADIANCE - 1.0).abs();
                // A sheet has no bottom that tells of the floor below it.
                let is_told = what == "box" || off > 0.0;
                assert!(!is_told || error < 0.1, "{what}: {found} instead of {IRRADIANCE} at {p}");
            }
        }
    }
}
