//! The paths of photons.

use std::fmt;
use std::ops::AddAssign;

use base::{
    Frame, Interrupted, OwenSobol, Photon, PhotonClass, Ray, Rgb, Rng, Share, Stream, Watch,
    encode_octahedral, hash_u64, warp,
};
use glam::Vec2;
use rayon::prelude::*;
use scene::{Light, Material, Scene, SpecularBounce, Transport};

use crate::aim::Aim;
use crate::{Budget, photons_of_lights};

/// Photons that one task traces. Fixed, since it decides what a share is.
const BATCH: u64 = 8192;

/// How pass 1 is done.
#[derive(Clone, Debug)]
pub struct Config {
    /// How many photons are emitted.
    pub budget: Budget,
    /// Seed of all random streams.
    pub seed: u64,
    /// Surfaces a photon may meet before its path is cut. What is cut is counted: see [`Account::cut`].
    pub max_bounces: u32,
    /// Whether photons of class *direct* are stored.
    pub store_direct: bool,
    /// Share of each light's photons, in [0, 1), that is aimed at specular surfaces, if there are any, and tells of caustics
    /// only. The mean of what is stored doesn't depend on it.
    pub aim: f32,
}

/// What became of the emitted photons.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Account {
    /// Photons emitted.
    pub emitted: u64,
    /// Of these, absorbed by a surface or inside glass; or aimed, and scattered diffusely.
    pub absorbed: u64,
    /// Of these, gone out of the scene.
    pub escaped: u64,
    /// Of these, ended by [`Config::max_bounces`].
    pub cut: u64,
    /// Rays traced.
    pub rays: u64,
    /// Flux emitted, in watts.
    pub flux: Rgb,
    /// What became of it.
    pub energy: Energy,
}

/// Where the flux of the photons went, in watts, the mean of the channels.
///
/// Roulette ends photons and never thins them: a photon carries the same mean flux from its start to its end, but for
/// what shading normals add. So `absorbed + escaped + cut` is what was emitted and `gained`, to within rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Carried by photons when they were emitted.
    pub emitted: f64,
    /// By photons when they were absorbed.
    pub absorbed: f64,
    /// By photons when they left the scene.
    pub escaped: f64,
    /// By photons when they were cut.
    pub cut: f64,
    /// Added where shading normals turn more light to a surface than arrives there.
    pub gained: f64,
}

impl Energy {
    /// What is missing, as a share of what there was: rounding alone leaves less than 0.001.
    pub fn imbalance(&self) -> f64 {
        let sources = self.emitted + self.gained;
        let ends = self.absorbed + self.escaped + self.cut;
        if sources > 0.0 { (ends - sources).abs() / sources } else { ends.abs() }
    }
}

impl AddAssign for Energy {
    fn add_assign(&mut self, o: Self) {
        self.emitted += o.emitted;
        self.absorbed += o.absorbed;
        self.escaped += o.escaped;
        self.cut += o.cut;
        self.gained += o.gained;
    }
}

/// The photons of a scene, by class, in the order of their emission.
#[derive(Debug, Default)]
pub struct Traced {
    /// See [`PhotonClass::Direct`].
    pub direct: Vec<Photon>,
    /// See [`PhotonClass::Caustic`].
    pub caustic: Vec<Photon>,
    /// See [`PhotonClass::Indirect`].
    pub indirect: Vec<Photon>,
    /// See [`PhotonClass::Focused`].
    pub focused: Vec<Photon>,
    /// What became of all.
    pub account: Account,
}

/// Emits photons from all lights of a scene and follows them, in rayon's current pool.
///
/// The watch is told the photons done.
///
/// # Errors
/// When the watch asks for a stop.
pub fn trace(scene: &Scene, config: &Config, watch: Watch<'_>) -> Result<Traced, Interrupted> {
    trace_share(scene, config, Share::WHOLE, watch)
}

/// As [`trace`], one share of the photons: those of all shares, joined in order, are those of [`trace`]. Each accounts for
/// itself, but for [`Account::flux`], which is that of all.
///
/// # Errors
/// When the watch asks for a stop.
pub fn trace_share(
    scene: &Scene,
    config: &Config,
    share: Share,
    watch: Watch<'_>,
) -> Result<Traced, Interrupted> {
    let keeper = Keeper { find: &|_, _| None, keep: &|_, _| {} };
    trace_kept(scene, config, share, &keeper, watch)
}

/// Where finished batches are kept beside, by their number among those of all shares.
#[derive(Clone, Copy)]
pub struct Keeper<'a> {
    /// What an earlier run with the same scene and configuration has kept, given also how many photons it emits.
    pub find: &'a (dyn Fn(u64, u64) -> Option<Traced> + Sync),
    /// Told of every batch that was traced.
    pub keep: &'a (dyn Fn(u64, &Traced) + Sync),
}

impl fmt::Debug for Keeper<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Keeper")
    }
}

/// As [`trace_share`], but batches that were kept aren't traced again.
///
/// # Errors
/// When the watch asks for a stop.
pub fn trace_kept(
    scene: &Scene,
    config: &Config,
    share: Share,
    keeper: &Keeper<'_>,
    watch: Watch<'_>,
) -> Result<Traced, Interrupted> {
    let bounds = scene.bounds();
    let fluxes: Vec<Rgb> = scene.lights.iter().map(|light| light.flux(&bounds)).collect();
    let counts = photons_of_lights(&config.budget, &fluxes);

    let mut batches = Vec::new();
    for (light, &count) in counts.iter().enumerate() {
        let starts = (0..count.div_ceil(BATCH)).map(|b| b * BATCH);
        batches.extend(starts.map(|start| (light, start..(start + BATCH).min(count))));
    }
    let of_share = share.range(batches.len() as u64);
    batches.truncate(of_share.end as usize);
    batches.drain(..of_share.start as usize);
    let tracers: Vec<Emitter<'_>> = (scene.lights.iter().enumerate())
        .map(|(i, light)| Emitter::new(scene, config, light, i, counts[i]))
        .collect();
    let done: Option<Vec<Traced>> = batches
        .into_par_iter()
        .enumerate()
        .map(|(i, (light, photons))| {
            let (batch, n) = (of_share.start + i as u64, photons.end - photons.start);
            let traced = (keeper.find)(batch, n).unwrap_or_else(|| {
                let mut traced = Traced::default();
                photons.for_each(|i| tracers[light].photon(i, &mut traced));
                (keeper.keep)(batch, &traced);
                traced
            });
            watch(n).then_some(traced)
        })
        .collect();
    let mut all = join(done.ok_or(Interrupted)?);
    all.account.flux = (fluxes.iter().zip(&counts)).filter(|(_, n)| **n > 0).map(|(f, _)| *f).sum();
    Ok(all)
}

fn join(batches: Vec<Traced>) -> Traced {
    let len = |f: fn(&Traced) -> &Vec<Photon>| batches.iter().map(|b| f(b).len()).sum();
    let mut all = Traced {
        direct: Vec::with_capacity(len(|b| &b.direct)),
        caustic: Vec::with_capacity(len(|b| &b.caustic)),
        indirect: Vec::with_capacity(len(|b| &b.indirect)),
        focused: Vec::with_capacity(len(|b| &b.focused)),
        account: Account::default(),
    };
    for batch in batches {
        all.direct.extend(batch.direct);
        all.caustic.extend(batch.caustic);
        all.indirect.extend(batch.indirect);
        all.focused.extend(batch.focused);
        let (a, b) = (&mut all.account, batch.account);
        a.emitted += b.emitted;
        a.absorbed += b.absorbed;
        a.escaped += b.escaped;
        a.cut += b.cut;
        a.rays += b.rays;
        a.energy += b.energy;
    }
    all
}

/// One light and what its photons need.
struct Emitter<'a> {
    scene: &'a Scene,
    config: &'a Config,
    light: &'a Light,
    seed: u64,
    starts: OwenSobol,
    /// How many photons share its flux. Those beyond are aimed.
    n_photons: u64,
    /// Where aimed photons start.
    aim: Option<Aim>,
    /// What caustic photons that start there carry, as a share of what others do.
    share_of_aimed: f32,
}

/// Of the aimed photons one in so many is a ray that looks for what to aim at; it isn't counted.
const RAYS_OF_AIM: u64 = 4;

impl<'a> Emitter<'a> {
    /// The light with a number and so many photons.
    fn new(
        scene: &'a Scene,
        config: &'a Config,
        light: &'a Light,
        number: usize,
        n_photons: u64,
    ) -> Self {
        let seed = hash_u64(config.seed, number as u64);
        let n_aimed = (n_photons as f64 * f64::from(config.aim)) as u64;
        let aim = match n_aimed {
            0 => None,
            n => Aim::find(scene, light, seed, n / RAYS_OF_AIM),
        };
        let n_aimed = if aim.is_some() { n_aimed } else { 0 };
        let n_others = (n_photons - n_aimed).max(1);
        let share_of_aimed = aim.as_ref().map_or(1.0, |aim| {
            let others = n_others as f32;
            others / (others + n_aimed as f32 / aim.share())
        });
        let starts = OwenSobol::new(seed);
        Self { scene, config, light, seed, starts, n_photons: n_others, aim, share_of_aimed }
    }

    /// Emits photon `index` of the light and follows it to its end.
    fn photon(&self, index: u64, out: &mut Traced) {
        let (u, is_aimed) = match &self.aim {
            Some(aim) if index >= self.n_photons => {
                let points = OwenSobol::new(hash_u64(self.seed, Stream::Aim as u64));
                (aim.start(points.point(index - self.n_photons)), true)
            }
            _ => (self.starts.point(index), false),
        };
        let caustic_share = match &self.aim {
            Some(aim) if is_aimed || aim.holds(u) => self.share_of_aimed,
            _ => 1.0,
        };
        let start = self.light.emit(&self.scene.bounds(), u);
        let mut scatter = Rng::new(self.seed, Stream::Scatter, index);
        let mut roulette = Rng::new(self.seed, Stream::Roulette, index);
        let mut ray = Ray::unbounded(start.origin, start.dir);
        let mut flux = start.flux / self.n_photons as f32;
        let mut class = PhotonClass::Direct;
        let mut medium: Option<&Material> = None;
        // What aimed photons carry is carried by others, too.
        let watts = |flux: Rgb| if is_aimed { 0.0 } else { f64::from(flux.mean()) };
        out.account.emitted += 1;
        out.account.energy.emitted += watts(flux);
        if flux.is_black() {
            out.account.absorbed += 1;
            return;
        }
        for _ in 0..self.config.max_bounces {
            out.account.rays += 1;
            let Some((surface, distance)) = self.scene.arrive(&ray, self.seed) else {
                out.account.escaped += 1;
                out.account.energy.escaped += watts(flux);
                return;
            };
            let material = self.scene.material(&surface);
            let w_o = -ray.dir();

            // Absorb on the way: inside glass, whether the photon was refracted into it or its light lies within.
            let inside = w_o.dot(surface.geometric_normal) < 0.0;
            let through = if inside && material.is_glass() { Some(material) } else { medium };
            if let Some(glass) = through {
                let Some(rest) = survive(flux, glass.transmittance(distance), roulette.next_f32())
                else {
                    out.account.absorbed += 1;
                    out.account.energy.absorbed += watts(flux);
                    return;
                };
                flux = rest;
            }

            // Store where the surface scatters diffusely.
            let facing = surface.facing(w_o);
            let gain = facing.shading_gain(w_o) * material.passage(facing.shading_normal.dot(w_o));
            if material.is_diffuse() {
                // Estimates divide by the area of the whole surface, and this part of it is there: those that land are
                // all that arrive.
                let part = if material.is_masked() { self.scene.opacity(&surface) } else { 1.0 };
                let photon = Photon {
                    position: surface.position.into(),
                    normal: encode_octahedral(facing.geometric_normal),
                    flux: flux * (gain / part),
                };
                match class {
                    _ if gain == 0.0 => {}
                    PhotonClass::Direct if is_aimed || !self.config.store_direct => {}
                    PhotonClass::Direct => out.direct.push(photon),
                    PhotonClass::Caustic => {
                        let flux = photon.flux * caustic_share;
                        out.caustic.push(Photon { flux, ..photon });
                    }
                    PhotonClass::Indirect => out.indirect.push(photon),
                    PhotonClass::Focused => {
                        out.indirect.push(photon);
                        out.focused.push(photon);
                    }
                }
            }

            // Let one number choose between the diffuse part, the specular directions, and the end. Shading normals may
            // gain more than is lost; then there is no end, and the flux grows.
            let mut bounces = material.specular_bounces(&surface, w_o, Transport::Flux);
            if let Some(lobe) = material.lobe(&surface, w_o, Transport::Flux) {
                let u = scatter.next_2d();
                bounces[0] = lobe.sample(u, scatter.next_f32()).map(SpecularBounce::from);
            }
            let weight_of =
                |bounce: &Option<SpecularBounce>| bounce.map_or(Rgb::BLACK, |b| b.weight);
            // Around the true normal: it tells how much of the surface is seen from a direction.
            let scatter_diffusely = |scatter: &mut Rng| {
                let local =
                    warp::cosine_hemisphere(Vec2::new(scatter.next_f32(), scatter.next_f32()));
                Frame::new(facing.geometric_normal).to_world(local).normalize()
            };
            // Through a coat it weighs, too, where light goes on.
            let coated = material.is_coated().then(|| scatter_diffusely(&mut scatter));
            let leaving =
                coated.map_or(1.0, |dir| material.passage(facing.shading_normal.dot(dir)));
            let diffuse = self.scene.albedo(&surface) * (gain * leaving);
            let share = |weight: Rgb| (flux * weight).mean() / flux.mean();
            let sum = share(diffuse) + bounces.iter().map(|b| share(weight_of(b))).sum::<f32>();
            let scale = sum.max(1.0);
            let mut u = roulette.next_f32();
            let mut choose = |weight: Rgb| {
                let p = share(weight) / scale;
                let chosen = u < p;
                u -= p;
                chosen.then(|| flux * weight / p)
            };
            if let Some(rest) = choose(diffuse) {
                if is_aimed {
                    out.account.absorbed += 1;
                    return;
                }
                let dir = coated.unwrap_or_else(|| scatter_diffusely(&mut scatter));
                if dir.dot(facing.geometric_normal) <= 0.0 {
                    out.account.absorbed += 1;
                    out.account.energy.absorbed += watts(flux);
                    return;
                }
                out.account.energy.gained += watts(flux) * f64::from(scale - 1.0);
                (flux, class) = (rest, PhotonClass::Indirect);
                ray = Ray::unbounded(surface.leave(dir), dir);
                continue;
            }
            let chosen =
                bounces.into_iter().flatten().find_map(|b| choose(b.weight).map(|rest| (b, rest)));
            let Some((bounce, rest)) = chosen else {
                out.account.absorbed += 1;
                out.account.energy.absorbed += watts(flux);
                return;
            };
            out.account.energy.gained += watts(flux) * f64::from(scale - 1.0);
            flux = rest;
            class = match class {
                PhotonClass::Direct | PhotonClass::Caustic => PhotonClass::Caustic,
                PhotonClass::Indirect | PhotonClass::Focused => PhotonClass::Focused,
            };
            if bounce.transmitted && material.is_glass() {
                medium = if inside { None } else { Some(material) };
            }
            ray = Ray::unbounded(surface.leave(bounce.dir), bounce.dir);
        }
        out.account.cut += 1;
        out.account.energy.cut += watts(flux);
    }
}

/// Roulette on a loss: the flux that goes on, of unchanged mean, or nothing.
fn survive(flux: Rgb, weight: Rgb, u: f32) -> Option<Rgb> {
    let rest = flux * weight;
    let p = rest.mean() / flux.mean();
    (u < p).then(|| rest / p)
}
