//! Rates of the stages that work on speed is judged by, each on one thread: rays, photons, queries and pixels a second.
//!
//! `cargo xtask bench micro [FILTER]` runs them and reads what criterion keeps: the name of a group ends with what is
//! counted, in brackets, and what another library does has its name after a comma. Scenes and photons are made when the
//! first benchmark asks for them.
//!
//! `micro count` names the loops whose instructions are counted, and `micro count LOOP N` runs one: see `counts.rs`.

mod counts;
mod fields;
mod outside;
mod peer;

use std::cell::LazyCell;
use std::hint::black_box;
use std::path::Path;
use std::process::ExitCode;
use std::sync::LazyLock;
use std::time::Duration;
use std::{env, iter};

use atomic_file::Existing;
use base::{Component, Grid, Photon, Ray, Rgb};
use cache_map::{
    CacheMap, Lattice, Layer, Origin, SurfacePoint, Thresholds, Tolerance, choose_pixels, refine,
};
use criterion::measurement::WallTime;
use criterion::{BatchSize, BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, Throughput};
use geometry::Accel;
use photon_map::{Gather, Kernel, Metadata, PhotonMaps, PhotonSet, Scratch};
use photon_trace::{Budget, Config, trace};
use rayon::prelude::*;
use scene::Scene;

use crate::fields::{
    Even, Field, N_GATHERS, N_RAYS, Order, Point, SIDE, occlusion_rays, rays, scene, sorted,
};
use crate::outside::Program;

static RABBIT: LazyLock<Scene> = LazyLock::new(|| scene("rabbit"));
static BOX: LazyLock<Scene> = LazyLock::new(|| scene("cornell-box"));
/// Numbers of photons, and those photons.
const SIZES: [&str; 2] = ["1 M", "4 M"];
static FIELDS: [LazyLock<Field>; 2] =
    [LazyLock::new(|| Field::new(&BOX, 1_000_000)), LazyLock::new(|| Field::new(&BOX, 4_000_000))];

fn main() -> ExitCode {
    // Rates are those of one thread.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    pool.build_global().expect("nothing has used the pool yet");
    let args: Vec<String> = env::args().skip(1).collect();
    if args.first().is_some_and(|word| word == "count") {
        return count(&args[1..]);
    }
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .sample_size(10)
        .configure_from_args();
    bvh(&mut criterion);
    photon_tracing(&mut criterion);
    trees(&mut criterion);
    gathers(&mut criterion);
    interpolation(&mut criterion);
    map_open(&mut criterion);
    second_thread(&mut criterion);
    criterion.final_summary();
    ExitCode::SUCCESS
}

/// Names the loops, or runs one: wrong usage is 2.
#[expect(clippy::print_stdout, reason = "the names are what is asked for")]
fn count(args: &[String]) -> ExitCode {
    match args {
        [] => counts::names().for_each(|name| println!("{name}")),
        [name, n] if n.parse().is_ok_and(|n| counts::run(name, n)) => {}
        _ => return ExitCode::from(2),
    }
    ExitCode::SUCCESS
}

/// A group whose iterations each do `n` of what is counted.
fn group<'a>(
    criterion: &'a mut Criterion,
    name: &str,
    counted: &str,
    n: usize,
) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(format!("{name} ({counted})"));
    group.throughput(Throughput::Elements(n as u64)).sampling_mode(SamplingMode::Flat);
    group
}

/// Rays through the rabbit: some 70,000 triangles of glass in a box.
fn bvh(criterion: &mut Criterion) {
    type Trace = fn(&Accel, &[Ray]) -> usize;
    let closest: Trace = |accel, rays| rays.iter().filter_map(|ray| accel.closest_hit(ray)).count();
    let occluded: Trace = |accel, rays| rays.iter().filter(|ray| accel.occluded(ray)).count();
    let sets = Order::ALL.into_iter().flat_map(|order| {
        let closest = ("closest hit", order, rays as fn(&Scene, Order) -> Vec<Ray>, closest);
        [closest, ("occlusion", order, occlusion_rays, occluded)]
    });
    let mut group = group(criterion, "BVH", "rays", N_RAYS);
    let mut embree = LazyCell::new(|| {
        let corners = RABBIT.accel.triangles().flatten().flat_map(|corner| corner.to_array());
        let ray = |r: &Ray| -> [f32; 7] {
            let ([x, y, z], [u, v, w]) = (r.origin().to_array(), r.dir().to_array());
            [x, y, z, u, v, w, r.t_max()]
        };
        let rays = |(_, order, rays, _): (_, _, fn(&Scene, Order) -> Vec<Ray>, _)| {
            rays(&RABBIT, order).iter().flat_map(ray).collect()
        };
        let arrays: Vec<Vec<f32>> =
            iter::once(corners.collect()).chain(sets.clone().map(rays)).collect();
        Program::start("embree", &arrays)
    });
    for (i, (name, order, rays, trace)) in sets.clone().enumerate() {
        group.bench_function(BenchmarkId::new(name, order.name()), |b| {
            let rays = rays(&RABBIT, order);
            b.iter(|| trace(&RABBIT.accel, &rays));
        });
        let Some(embree) = &mut *embree else { continue };
        group.bench_function(BenchmarkId::new(format!("{name}, embree"), order.name()), |b| {
            // Rays that graze an edge may end either way.
            let expected = trace(&RABBIT.accel, &rays(&RABBIT, order)) as f64;
            let what = name.replace(' ', "-");
            let (found, _) = embree.ask(&format!("{what} {i} 1"));
            let apart = (found - expected).abs();
            assert!(apart < 1e-3 * N_RAYS as f64, "{found} hits, and ours {expected}");
            b.iter_custom(|n| embree.ask(&format!("{what} {i} {n}")).1);
        });
    }
    // What tracing rays by waves could gain, and what is left of it when they have been sorted.
    let random = rays(&RABBIT, Order::Random);
    group.bench_function("closest hit, random, sorted before", |b| {
        let rays = sorted(&RABBIT, &random);
        b.iter(|| closest(&RABBIT.accel, &rays));
    });
    group.bench_function("closest hit, random, with sorting", |b| {
        b.iter(|| closest(&RABBIT.accel, &sorted(&RABBIT, &random)));
    });
}

const N_TRACED: u64 = 100_000;
const TRACING: Config = Config {
    budget: Budget::Total(N_TRACED),
    seed: 0,
    max_bounces: 1024,
    store_direct: false,
    aim: 0.0,
};

/// Photons a second from emission to absorption.
fn photon_tracing(criterion: &mut Criterion) {
    let mut group = group(criterion, "photon tracing", "photons", N_TRACED as usize);
    for (name, scene) in [("cornell-box", &BOX), ("rabbit", &RABBIT)] {
        group.bench_function(name, |b| {
            b.iter(|| trace(scene, &TRACING, &|_| true));
        });
    }
}

/// Photons a second into a kd-tree.
fn trees(criterion: &mut Criterion) {
    for (name, field) in SIZES.into_iter().zip(&FIELDS) {
        let n = field.photons.len();
        let mut group = group(criterion, "kd-tree build", "photons", n);
        group.bench_function(name, |b| b.iter(|| PhotonSet::build(&field.photons)));
        group.bench_function(format!("{name}, kiddo"), |b| {
            let positions = peer::positions(&field.photons);
            b.iter(|| peer::build(&positions));
        });
    }
}

/// Photons in an estimate: as `render-cached` takes them for caustics and for indirect light.
const KS: [usize; 2] = [100, 500];

/// Gathers a second around what an eye sees, in the order of its pixels and shuffled.
fn gathers(criterion: &mut Criterion) {
    for (name, field) in SIZES.into_iter().zip(&FIELDS) {
        let name = format!("gather from {name} photons");
        let mut group = group(criterion, &name, "queries", N_GATHERS);
        for order in Order::ALL {
            for k in KS {
                group.bench_function(BenchmarkId::new(format!("{k} nearest"), order.name()), |b| {
                    let (points, set) = (field.points(order), field.set());
                    let gather =
                        Gather { k, max_radius: field.max_radius, kernel: Kernel::Epanechnikov };
                    let mut scratch = Scratch::default();
                    b.iter(|| {
                        let mut sum = Rgb::BLACK;
                        for Point { position, normal, .. } in &points {
                            sum += set
                                .irradiance(*position, *normal, &gather, None, &mut scratch)
                                .irradiance;
                        }
                        sum
                    });
                });
                group.bench_function(
                    BenchmarkId::new(format!("{k} nearest, kiddo"), order.name()),
                    |b| {
                        let (points, peer) = (field.points(order), field.peer());
                        b.iter(|| {
                            points
                                .iter()
                                .map(|p| peer.nearest(p.position, k, field.max_radius))
                                .sum::<Rgb>()
                        });
                    },
                );
            }
            group.bench_function(BenchmarkId::new("within a radius", order.name()), |b| {
                let (points, set, radius) = (field.points(order), field.set(), field.radius());
                b.iter(|| {
                    let mut sum = Rgb::BLACK;
                    for Point { position, normal, .. } in &points {
                        sum += set
                            .irradiance_within(*position, *normal, radius, Kernel::Epanechnikov)
                            .irradiance;
                    }
                    sum
                });
            });
            group.bench_function(BenchmarkId::new("within a radius, kiddo", order.name()), |b| {
                let (points, peer, radius) = (field.points(order), field.peer(), field.radius());
                b.iter(|| points.iter().map(|p| peer.within(p.position, radius)).sum::<Rgb>());
            });
        }
        drop(group);
        gathers_outside(criterion, &name, field);
    }
}

/// The same gathers by nanoflann.
fn gathers_outside(criterion: &mut Criterion, name: &str, field: &Field) {
    let mut group = group(criterion, name, "queries", N_GATHERS);
    let places = |order| -> Vec<f32> {
        field.points(order).iter().flat_map(|p| p.position.to_array()).collect()
    };
    let photon = |p: &Photon| -> [f32; 6] {
        let ([x, y, z], flux) = (p.position.to_array(), p.flux);
        [x, y, z, flux.r, flux.g, flux.b]
    };
    let photons = field.photons.iter().flat_map(photon).collect();
    let [coherent, random] = Order::ALL.map(places);
    let Some(mut nanoflann) = Program::start("nanoflann", &[photons, coherent, random]) else {
        return;
    };
    let about = |sum: f64, expected: f64| (sum / expected - 1.0).abs() < 0.01;
    for (set, order) in Order::ALL.into_iter().enumerate() {
        for k in KS {
            let id = BenchmarkId::new(format!("{k} nearest, nanoflann"), order.name());
            group.bench_function(id, |b| {
                let (points, peer) = (field.points(order), field.peer());
                let near = |p: &Point| peer.nearest(p.position, k, field.max_radius);
                let expected = total(points.iter().map(near).sum());
                b.iter_custom(|n| {
                    let question = format!("nearest {set} {n} {k} {}", field.max_radius);
                    let (sum, time) = nanoflann.ask(&question);
                    assert!(about(sum, expected), "{sum}, and kiddo {expected}");
                    time
                });
            });
        }
        let id = BenchmarkId::new("within a radius, nanoflann", order.name());
        group.bench_function(id, |b| {
            let (points, peer, radius) = (field.points(order), field.peer(), field.radius());
            let expected = total(points.iter().map(|p| peer.within(p.position, radius)).sum());
            b.iter_custom(|n| {
                let (sum, time) = nanoflann.ask(&format!("within {set} {n} {radius}"));
                assert!(about(sum, expected), "{sum}, and kiddo {expected}");
                time
            });
        });
    }
}

fn total(flux: Rgb) -> f64 {
    f64::from(flux.r) + f64::from(flux.g) + f64::from(flux.b)
}

/// Pixels a second, of one component: the paper's search among candidates, and the refinement of mode `adaptive`.
fn interpolation(criterion: &mut Criterion) {
    let n_pixels = (SIDE * SIDE) as usize;
    let mut group = group(criterion, "interpolation", "pixels", n_pixels);
    let surfaces = || {
        let points = fields::primary(&BOX);
        Grid::from_values(fields::SIZE, points.into_iter().map(surface_point).collect())
    };
    for component in Component::ALL {
        group.bench_function(BenchmarkId::new("paper", component), |b| {
            let surfaces = surfaces();
            let samples = choose_pixels(fields::SIZE, 1.0 / 16.0, 0);
            let value = if component == Component::Caustic { Rgb::BLACK } else { Rgb::ONE };
            let values = vec![value; samples.len()];
            // So loose that every pixel with a candidate is interpolated, as at high resolution.
            let thresholds =
                Thresholds { direct: 1.0, indirect: 1.0, specular: 1.0, r0: 5.0, reach: 4 };
            let prepared = || {
                let mut map = CacheMap::new(surfaces.clone());
                map.record(component, &samples, &values, Origin::Sampled);
                map
            };
            let interpolate = |mut map: CacheMap| {
                let to_trace = map.plan(component, &thresholds);
                (to_trace.len(), map.interpolate(component, &thresholds), map)
            };
            b.iter_batched(prepared, interpolate, BatchSize::LargeInput);
        });
    }
    group.bench_function(BenchmarkId::new("adaptive", "lattice"), |b| {
        let surfaces = surfaces();
        b.iter(|| Lattice::new(&surfaces, 16));
    });
    group.bench_function(BenchmarkId::new("adaptive", "refinement"), |b| {
        let lattice = Lattice::new(&surfaces(), 16);
        b.iter(|| {
            let mut layer = Layer::<Rgb>::new(n_pixels);
            let tolerance = Tolerance { error: 0.05, edge: 0.5 };
            let ones = &mut |pixels: &[base::Pixel]| Ok::<_, ()>(vec![Rgb::ONE; pixels.len()]);
            refine(&lattice, &mut layer, 16, &Even, tolerance, ones).map(|()| layer)
        });
    });
}

fn surface_point(point: Option<Point>) -> Option<SurfacePoint> {
    point.map(|p| SurfacePoint { position: p.position.into(), normal: p.normal.into() })
}

/// The same work on one thread and on two: what a second thread is good for.
fn second_thread(criterion: &mut Criterion) {
    let pool = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build();
        pool.expect("threads can be started")
    };
    let pools = [("1 thread", pool(1)), ("2 threads", pool(2))];
    let mut rays_by = group(criterion, "threads", "rays", N_RAYS);
    for (name, pool) in &pools {
        rays_by.bench_function(format!("closest hit, {name}"), |b| {
            let rays = rays(&RABBIT, Order::Random);
            let is_hit = |ray: &&Ray| RABBIT.accel.closest_hit(ray).is_some();
            let hits = || rays.par_chunks(256).map(|rays| rays.iter().filter(is_hit).count());
            b.iter(|| pool.install(|| hits().sum::<usize>()));
        });
    }
    drop(rays_by);
    let mut gathers_by = group(criterion, "threads", "queries", N_GATHERS);
    for (name, pool) in &pools {
        gathers_by.bench_function(format!("100 nearest of 1 M, {name}"), |b| {
            let field = &FIELDS[0];
            let (points, set) = (field.points(Order::Coherent), field.set());
            let gather =
                Gather { k: 100, max_radius: field.max_radius, kernel: Kernel::Epanechnikov };
            let found = |points: &[Point]| {
                let mut scratch = Scratch::default();
                let found = |p: &Point| {
                    set.irradiance(p.position, p.normal, &gather, None, &mut scratch).found
                };
                points.iter().map(found).sum::<usize>()
            };
            b.iter(|| pool.install(|| points.par_chunks(64).map(found).sum::<usize>()));
        });
    }
    drop(gathers_by);
    let mut photons_by = group(criterion, "threads", "photons", N_TRACED as usize);
    for (name, pool) in &pools {
        photons_by.bench_function(format!("photon tracing, {name}"), |b| {
            b.iter(|| pool.install(|| trace(&BOX, &TRACING, &|_| true)));
        });
    }
}

/// Photons a second that are ready for use after opening a map.
fn map_open(criterion: &mut Criterion) {
    for (name, field) in SIZES.into_iter().zip(&FIELDS) {
        let mut group = group(criterion, "map open", "photons", field.photons.len());
        group.bench_function(name, |b| {
            let folder = tempfile::tempdir().expect("there is room for a map");
            let path = folder.path().join("maps.photons");
            save(&path, field);
            b.iter(|| black_box(PhotonMaps::open(&path).expect("the map was just saved")));
        });
    }
}

fn save(path: &Path, field: &Field) {
    let maps = PhotonMaps {
        metadata: Metadata::default(),
        direct: None,
        caustic: PhotonSet::build(&[]),
        indirect: field.set().clone(),
        focused: None,
    };
    maps.save(path, Existing::Refuse, "bench", "bench").expect("the folder is new and empty");
}
