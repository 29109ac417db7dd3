//! `--mode adaptive`: a cache for each component, one error target for all.
//!
//! Eye rays and specular chains are followed everywhere; what is cached is irradiance and the visibility of lights,
//! never radiance times albedo. Each is computed on a coarse lattice and refined where it has structure
//! ([`cache_map::refine`]); then pixels held out measure the error that was reached, and what failed is refined again.

mod account;
mod around;
mod caustic;
mod direct;
mod glossy;
mod holdout;
mod indirect;
mod leaves;
mod records;
mod view;
mod whole;

use base::{Component, Components, Grid, Inventory, Rgb, math::FRAC_1_PI};
use cache_map::{Layer, Reason, RecordSet, Tolerance};
use cli::Clock;
use rayon::prelude::*;

use crate::Args;
use crate::frame::Frame;
use crate::render::{Progress, Rendered};

pub(crate) use account::{Account, ErrorReport, origins};
pub(crate) use view::View;

use holdout::HeldOut;
use leaves::Finished;

/// The widest spacing of a lattice, in pixels.
const COARSEST: u32 = 16;

/// The part of the error that indirect light may make.
const INDIRECT_SHARE: f32 = 0.8;

/// The error is known to about 15 % from the pixels held out: within this factor, another round isn't worth its time.
const NEAR_ENOUGH: f64 = 1.1;

/// How often what failed is refined again.
const MAX_ROUNDS: usize = 4;

/// Renders with the error target of the command line, which is above 0.
pub(crate) fn render(
    args: &Args,
    frame: &Frame<'_>,
    inputs: &Inventory,
    clock: &mut Clock,
    progress: &Progress<'_>,
) -> anyhow::Result<Rendered> {
    let saved = records::Saved::open(args, frame, inputs)?;
    let mut account = Account::new(frame, clock, progress);
    let has_file = args.paper.save_cache.is_some() || args.paper.from_cache.is_some();
    if !has_file && !whole::cache_pays(&mut account)? {
        let (counts, cache) = account.close();
        let mut rendered = whole::render(args, frame, clock, progress)?;
        rendered.counts += counts;
        rendered.cache += cache;
        return Ok(rendered);
    }
    let view = View::new(frame);
    // Tolerances of the embedded pair and of edges, as multiples of the error aimed at. Found on the scenes of this
    // project; the pixels held out correct them where they don't fit.
    let mut strictness = Components::from_fn(|_| args.error);
    let mut glossy_strictness = args.error;
    let tolerances = |strictness: &Components<f32>| {
        let times = |component, error: f32, edge: f32| {
            let error = error * strictness[component];
            Tolerance { error, edge: error * edge }
        };
        // Density estimates have noise that isn't worth following; what is gathered has little.
        let of_indirect = if frame.shader().is_gathering() { (2.0, 8.0) } else { (4.0, 20.0) };
        Components {
            direct: times(Component::Direct, 2.0, 8.0),
            indirect: times(Component::Indirect, of_indirect.0, of_indirect.1),
            specular: times(Component::Specular, 4.0, 20.0),
            caustic: times(Component::Caustic, 2.0, 8.0),
        }
    };
    let mut tolerance = tolerances(&strictness);
    let mut indirect = indirect::Indirect::start(&view, &saved, tolerance.indirect, &mut account)?;
    let mut direct = direct::Direct::start(&view, &indirect, &saved, args.error, &mut account)?;
    let mut caustic = caustic::Caustic::start(&view, &saved, &account);
    let mut specular = leaves::Leaves::start(frame, &saved, &mut account)?;
    let mut glossy = glossy::Glossy::start(frame, specular.glossy_pixels());

    direct.refine(&view, &indirect, tolerance.direct, &mut account)?;
    indirect.aim(&view, &direct, INDIRECT_SHARE * args.error, frame.shader());
    indirect.refine(&view, &direct, tolerance.indirect, &mut account)?;
    caustic.refine(&view, &direct, &indirect, tolerance.caustic, &mut account)?;
    let held_out = HeldOut::compute(args, &mut account)?;
    let target = f64::from(args.error);
    let n = frame.size().n_pixels();
    let mut round = 0;
    let mut view_is_better = false;
    let error = loop {
        let finished = Finished::new(&direct, &indirect, &caustic, n);
        specular.resolve(&view, &finished, tolerance.specular, &mut account)?;
        let of_glossy =
            Tolerance { error: 4.0 * glossy_strictness, edge: 20.0 * glossy_strictness };
        let sharp = |i: usize| specular.radiance(i);
        glossy.resolve(&view, &finished, sharp, of_glossy, &mut account)?;
        let compose = |i: usize| {
            let [d, n, c] = [direct.irradiance(i), indirect.irradiance(i), caustic.irradiance(i)];
            let albedo = view.albedo(i) * FRAC_1_PI;
            Components {
                direct: albedo * d,
                indirect: albedo * n,
                caustic: albedo * c,
                specular: specular.radiance(i) + glossy.radiance(i),
            }
        };
        let is_glossy = |i: usize| glossy.is_shown_at(i);
        let report = holdout::measure(args, frame.size(), &held_out, &compose, &is_glossy);
        round += 1;
        if report.estimate.measured_mean <= NEAR_ENOUGH * target || round == MAX_ROUNDS {
            break report.estimate;
        }
        view_is_better |= report.worst != Component::Specular;
        if report.glossy_is_worst {
            glossy_strictness *= 0.5;
        } else {
            strictness[report.worst] *= 0.5;
        }
        tolerance = tolerances(&strictness);
        match report.worst {
            Component::Direct => direct.refine(&view, &indirect, tolerance.direct, &mut account)?,
            Component::Indirect => {
                indirect.tighten((report.estimate.measured_mean / target) as f32);
                indirect.refine(&view, &direct, tolerance.indirect, &mut account)?;
            }
            Component::Caustic => {
                caustic.refine(&view, &direct, &indirect, tolerance.caustic, &mut account)?;
            }
            Component::Specular => {}
        }
    };

    if view_is_better {
        let finished = Finished::new(&direct, &indirect, &caustic, n);
        glossy.look_up(&view, &finished, &mut account)?;
    }

    saved.check_untouched()?;
    if let Some(path) = &args.paper.save_cache {
        let views = saved.set.views;
        let mut set = RecordSet { views, ..RecordSet::default() };
        direct.record(&view, &mut set);
        set.indirect = indirect.records(&view);
        set.caustic = caustic.records(&view, frame.shader().settings.caustic.max_radius);
        set.leaves = specular.records();
        let is_nearby = |reasons: &[Reason]| reasons.contains(&Reason::Nearby);
        let is_complete =
            !(direct.uses_nearby() || is_nearby(&indirect.layer.reasons) || specular.uses_nearby());
        records::save(path, args, frame, inputs, &mut set, is_complete)?;
    }
    // One component after the other, each freed when its radiance is there.
    let size = frame.size();
    let grid = |radiance: &(dyn Fn(usize) -> Rgb + Sync)| {
        let values = (0..n).into_par_iter().with_min_len(4096).map(radiance).collect();
        Grid::from_values(size, values)
    };
    let diffuse = |i: usize, irradiance: Rgb| view.albedo(i) * FRAC_1_PI * irradiance;
    let of_direct = grid(&|i| diffuse(i, direct.irradiance(i)));
    let (direct_reasons, direct_levels) = (direct.reasons(), direct.levels());
    drop(direct);
    let of_indirect = grid(&|i| diffuse(i, indirect.irradiance(i)));
    let Layer { reasons: indirect_reasons, levels: indirect_levels, .. } = indirect.layer;
    let of_caustic = grid(&|i| diffuse(i, caustic.irradiance(i)));
    let Layer { reasons: caustic_reasons, levels: caustic_levels, .. } = caustic.layer;
    let of_specular = grid(&|i| specular.radiance(i) + glossy.radiance(i));
    let (mut specular_reasons, mut specular_levels) = (specular.reasons(), vec![0; n]);
    glossy.tell(&mut specular_reasons, &mut specular_levels);
    let values = Components {
        direct: of_direct,
        indirect: of_indirect,
        specular: of_specular,
        caustic: of_caustic,
    };
    let reasons = Components {
        direct: direct_reasons,
        indirect: indirect_reasons,
        specular: specular_reasons,
        caustic: caustic_reasons,
    };
    let levels = Components {
        direct: direct_levels,
        indirect: indirect_levels,
        specular: specular_levels,
        caustic: caustic_levels,
    };
    Ok(account.finish(values, reasons, levels, error))
}
