//! Rays, photons and places to gather at, the same in every run.

use std::path::Path;
use std::sync::OnceLock;

use base::{ImageSize, Photon, Ray, Rgb, Rng, Stream, warp};
use cache_map::Rule;
use glam::{Vec2, Vec3A};
use photon_map::{Gather, Kernel, PhotonSet, Scratch};
use photon_trace::{Budget, Config, trace};
use scene::Scene;

use crate::peer::Peer;

/// Side of the picture whose pixels rays and gathers belong to.
pub(crate) const SIDE: u32 = 128;
pub(crate) const SIZE: ImageSize = ImageSize { width: SIDE, height: SIDE };
/// Rays in an iteration: one for each pixel.
pub(crate) const N_RAYS: usize = (SIDE * SIDE) as usize;
/// Gathers in an iteration.
pub(crate) const N_GATHERS: usize = 4096;

/// Which rays or gathers follow one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// Neighbors, as in the scan of a picture.
    Coherent,
    /// Any two.
    Random,
}

impl Order {
    pub(crate) const ALL: [Self; 2] = [Self::Coherent, Self::Random];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Coherent => "coherent",
            Self::Random => "random",
        }
    }
}

/// A place on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub(crate) position: Vec3A,
    /// On the side of the eye.
    pub(crate) normal: Vec3A,
    /// Whether anybody gathers photons here.
    pub(crate) is_diffuse: bool,
}

/// A scene of the paper.
pub(crate) fn scene(name: &str) -> Scene {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    scene::load(&scenes.join(name).join("scene.toml"))
        .expect("the scene is in the repository")
        .scene
}

/// What the eye sees in each pixel.
pub(crate) fn primary(scene: &Scene) -> Vec<Option<Point>> {
    let point = |i: usize| {
        let ray = eye_ray(scene, i);
        let hit = scene.accel.closest_hit(&ray)?;
        let surface = scene.accel.surface(&ray, &hit).facing(-ray.dir());
        let (position, normal) = (surface.position, surface.geometric_normal);
        Some(Point { position, normal, is_diffuse: scene.material(&surface).is_diffuse() })
    };
    (0..SIZE.n_pixels()).map(point).collect()
}

fn eye_ray(scene: &Scene, i: usize) -> Ray {
    let pixel = SIZE.pixel(i);
    scene.camera.ray(SIZE, Vec2::new(pixel.x as f32 + 0.5, pixel.y as f32 + 0.5))
}

/// So many of the points that the eye sees and that are wanted, in their order.
fn seen(scene: &Scene, n: usize, is_wanted: impl Fn(&Point) -> bool) -> Vec<Point> {
    let points: Vec<Point> = primary(scene).into_iter().flatten().filter(is_wanted).collect();
    (0..n).map(|i| points[i * points.len() / n]).collect()
}

fn rng(index: u64) -> Rng {
    Rng::new(0, Stream::Test, index)
}

/// Fisher and Yates, as given by Knuth.
fn shuffle<T>(values: &mut [T]) {
    let mut rng = rng(1);
    for i in (1..values.len()).rev() {
        values.swap(i, rng.next_u32() as usize % (i + 1));
    }
}

/// Rays without an end: those of the eye, or from what it sees to anywhere above, shuffled.
pub(crate) fn rays(scene: &Scene, order: Order) -> Vec<Ray> {
    if order == Order::Coherent {
        return (0..N_RAYS).map(|i| eye_ray(scene, i)).collect();
    }
    let mut points = seen(scene, N_RAYS, |_| true);
    shuffle(&mut points);
    let mut rng = rng(2);
    let bounce = |p: &Point| {
        let frame = base::Frame::new(p.normal);
        let dir = frame.to_world(warp::cosine_hemisphere(rng.next_2d()));
        Ray::unbounded(p.position + p.normal * 1e-3, dir)
    };
    points.iter().map(bounce).collect()
}

/// The same rays, those that start close by and go the same way one after the other: by the octant of the direction, then by
/// where they start along a curve that fills the bounds, 32 cells a side.
pub(crate) fn sorted(scene: &Scene, rays: &[Ray]) -> Vec<Ray> {
    const CELLS: f32 = 32.0;
    let bounds = scene.bounds();
    let (min, extent) = (Vec3A::from(bounds.min), Vec3A::from(bounds.max - bounds.min));
    let spread = |v: u32| (0..5).fold(0, |sum, bit| sum | (v >> bit & 1) << (3 * bit));
    let key = |ray: &Ray| {
        let cell =
            ((ray.origin() - min) / extent * CELLS).clamp(Vec3A::ZERO, Vec3A::splat(CELLS - 1.0));
        let [x, y, z] = cell.to_array().map(|v| spread(v as u32));
        ray.dir().is_negative_bitmask() << 15 | z << 2 | y << 1 | x
    };
    let mut keyed: Vec<(u32, u32)> = rays.iter().map(key).zip(0..).collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, i)| rays[i as usize]).collect()
}

/// Rays with an end: from what the eye sees to a lamp, or from anywhere that it sees to anywhere else.
pub(crate) fn occlusion_rays(scene: &Scene, order: Order) -> Vec<Ray> {
    let points = seen(scene, N_RAYS, |_| true);
    let center: Vec3A = scene.bounds().center().into();
    let lamp = center + Vec3A::Y * 0.49 * (scene.bounds().max.y - scene.bounds().min.y);
    let mut targets = points.clone();
    shuffle(&mut targets);
    let mut sources = points;
    if order == Order::Random {
        sources.rotate_left(N_RAYS / 3);
        shuffle(&mut sources);
    }
    let between = |(p, q): (&Point, &Point)| {
        let origin = p.position + p.normal * 1e-3;
        let target = if order == Order::Coherent { lamp } else { q.position + q.normal * 1e-3 };
        let way = target - origin;
        let length = way.length();
        (length > 1e-3).then(|| Ray::new(origin, way / length, length))
    };
    let mut rays: Vec<Ray> = sources.iter().zip(&targets).filter_map(between).collect();
    // The few that lead nowhere are replaced, so that there are always as many.
    while rays.len() < N_RAYS {
        rays.push(rays[rays.len() / 2]);
    }
    rays
}

/// Prepares on all threads what is then measured on one.
fn on_all_threads<T: Send>(f: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().build().expect("threads can be started");
    pool.install(f)
}

/// The indirect photons of a scene, with what is asked of them.
pub(crate) struct Field {
    /// As they were emitted.
    pub(crate) photons: Vec<Photon>,
    points: Vec<Point>,
    /// The largest distance of a photon, as `render-cached` has it.
    pub(crate) max_radius: f32,
    set: OnceLock<PhotonSet>,
    peer: OnceLock<Peer>,
    radius: OnceLock<f32>,
}

impl Field {
    /// So many photons: as many as that are stored of a shot that stores more.
    pub(crate) fn new(scene: &Scene, n: usize) -> Self {
        // Somewhat more than half of the photons emitted in the Cornell box are stored as indirect ones.
        let config = Config {
            budget: Budget::Total(2 * n as u64),
            seed: 0,
            max_bounces: 1024,
            store_direct: false,
            aim: 0.0,
        };
        let traced = on_all_threads(|| trace(scene, &config, &|_| true));
        let traced = traced.expect("nobody asks for a stop");
        let mut photons = traced.indirect;
        assert!(photons.len() >= n, "{} photons were stored, and {n} are wanted", photons.len());
        photons.truncate(n);
        let (set, peer, radius) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
        Self {
            photons,
            points: seen(scene, N_GATHERS, |p| p.is_diffuse),
            max_radius: scene.bounds().diagonal() / 20.0,
            set,
            peer,
            radius,
        }
    }

    /// The places to gather at.
    pub(crate) fn points(&self, order: Order) -> Vec<Point> {
        let mut points = self.points.clone();
        if order == Order::Random {
            shuffle(&mut points);
        }
        points
    }

    /// Our kd-tree.
    pub(crate) fn set(&self) -> &PhotonSet {
        self.set.get_or_init(|| on_all_threads(|| PhotonSet::build(&self.photons)))
    }

    /// The same photons in a tree of kiddo.
    pub(crate) fn peer(&self) -> &Peer {
        self.peer.get_or_init(|| Peer::new(&self.photons))
    }

    /// The radius within which some 100 photons lie: the median over the places to gather at.
    pub(crate) fn radius(&self) -> f32 {
        *self.radius.get_or_init(|| {
            let gather = Gather { k: 100, max_radius: self.max_radius, kernel: Kernel::Box };
            let mut scratch = Scratch::default();
            let radius = |p: &Point| {
                self.set().irradiance(p.position, p.normal, &gather, None, &mut scratch).radius
            };
            let mut radii: Vec<f32> = self.points.iter().map(radius).collect();
            radii.sort_by(f32::total_cmp);
            radii[radii.len() / 2]
        })
    }
}

/// All pixels matter alike.
pub(crate) struct Even;

impl Rule<Rgb> for Even {
    fn gain(&self, _: usize) -> f32 {
        1.0
    }
    fn reference(&self, _: usize, _: Rgb) -> f32 {
        1.0
    }
    fn spacing(&self, _: base::Pixel) -> f32 {
        16.0
    }
}
