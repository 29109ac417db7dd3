//! The hot loops of the pipeline, one at a time, as often as is asked, for tools that count instructions.
//!
//! What a loop prepares, it prepares the same for any number, so that the difference between one time and two is the
//! loop alone. `cargo xtask bench counts` takes it.

use std::hint::black_box;

use base::{Grid, Rgb};
use cache_map::{Lattice, Layer, SurfacePoint, Tolerance, refine};
use photon_map::{Gather, Kernel, PhotonSet, Scratch};
use photon_trace::{Budget, Config, trace};

use crate::fields::{self, Even, Field, Order, SIZE, occlusion_rays, primary, rays, scene};

/// A loop of this name prepares itself, and gives what is then repeated.
type Prepare = fn() -> Box<dyn FnMut()>;

const LOOPS: [(&str, Prepare); 10] = [
    ("closest hit, coherent", || closest_hits(Order::Coherent)),
    ("closest hit, random", || closest_hits(Order::Random)),
    ("occlusion, coherent", || occlusions(Order::Coherent)),
    ("occlusion, random", || occlusions(Order::Random)),
    ("photon tracing", photon_tracing),
    ("kd-tree build", tree_build),
    ("gather, 100 nearest", || nearest(100)),
    ("gather, 500 nearest", || nearest(500)),
    ("gather, within a radius", within),
    ("interpolation, adaptive", interpolation),
];

/// Photons of the fields.
const N_PHOTONS: usize = 50_000;

/// The names of all loops.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    LOOPS.into_iter().map(|(name, _)| name)
}

/// Runs the loop of this name `n` times. Whether there is one.
pub(crate) fn run(name: &str, n: u32) -> bool {
    let Some((_, prepare)) = LOOPS.iter().find(|(known, _)| *known == name) else { return false };
    let mut once = prepare();
    (0..n).for_each(|_| once());
    true
}

fn closest_hits(order: Order) -> Box<dyn FnMut()> {
    let scene = scene("rabbit");
    let rays = rays(&scene, order);
    Box::new(move || {
        rays.iter().for_each(|ray| {
            black_box(scene.accel.closest_hit(ray));
        });
    })
}

fn occlusions(order: Order) -> Box<dyn FnMut()> {
    let scene = scene("rabbit");
    let rays = occlusion_rays(&scene, order);
    Box::new(move || {
        rays.iter().for_each(|ray| {
            black_box(scene.accel.occluded(ray));
        });
    })
}

fn photon_tracing() -> Box<dyn FnMut()> {
    let scene = scene("cornell-box");
    let budget = Budget::Total(20_000);
    let config = Config { budget, seed: 0, max_bounces: 1024, store_direct: false, aim: 0.0 };
    Box::new(move || {
        black_box(trace(&scene, &config, &|_| true)).expect("nobody asks for a stop");
    })
}

fn tree_build() -> Box<dyn FnMut()> {
    let field = Field::new(&scene("cornell-box"), N_PHOTONS);
    Box::new(move || {
        black_box(PhotonSet::build(&field.photons));
    })
}

fn nearest(k: usize) -> Box<dyn FnMut()> {
    let field = Field::new(&scene("cornell-box"), N_PHOTONS);
    let (points, mut scratch) = (field.points(Order::Coherent), Scratch::default());
    let gather = Gather { k, max_radius: field.max_radius, kernel: Kernel::Epanechnikov };
    field.set();
    Box::new(move || {
        for p in &points[..512] {
            let gathered =
                field.set().irradiance(p.position, p.normal, &gather, None, &mut scratch);
            black_box(gathered);
        }
    })
}

fn within() -> Box<dyn FnMut()> {
    let field = Field::new(&scene("cornell-box"), N_PHOTONS);
    let (points, radius) = (field.points(Order::Coherent), field.radius());
    Box::new(move || {
        for p in &points {
            let kernel = Kernel::Epanechnikov;
            black_box(field.set().irradiance_within(p.position, p.normal, radius, kernel));
        }
    })
}

fn interpolation() -> Box<dyn FnMut()> {
    let surface = |point: fields::Point| SurfacePoint {
        position: point.position.into(),
        normal: point.normal.into(),
    };
    let points = primary(&scene("cornell-box"));
    let surfaces = points.into_iter().map(|point| point.map(surface)).collect();
    let surfaces = Grid::from_values(SIZE, surfaces);
    Box::new(move || {
        let lattice = Lattice::new(&surfaces, 16);
        let mut layer = Layer::<Rgb>::new(SIZE.n_pixels());
        let tolerance = Tolerance { error: 0.05, edge: 0.5 };
        let ones = &mut |pixels: &[base::Pixel]| Ok::<_, ()>(vec![Rgb::ONE; pixels.len()]);
        let refined = refine(&lattice, &mut layer, 16, &Even, tolerance, ones);
        refined.expect("there is a value for every pixel");
        black_box(layer);
    })
}
