//! `--mode adaptive`: a cache for each component, one error target for all.
//!
//! Eye rays and specular chains are followed everywhere; what is cached is irradiance and the visibility of lights,
//! never radiance times albedo. Each is computed on a coarse lattice and refined where it has structure
//! ([`cache_map::refine`]); then pixels held out measure the error that was reached, and what failed is refined again.

mod account;
mod around;
mod caustic;
mod cells;
mod clear;
mod direct;
mod glossy;
mod holdout;
mod indirect;
mod leaves;
mod primary;
mod records;
mod strictness;
mod subpixels;
mod told;
mod view;
mod whole;

use std::cell::OnceCell;
use std::mem::take;

use base::{Component, Components, Grid, Inventory, Rgb, math::FRAC_1_PI};
use cache_map::{Reason, RecordSet};
use cli::Clock;
use rayon::prelude::*;
use scene::Scene;

use crate::frame::Frame;
use crate::render::{Progress, Rendered};
use crate::{Args, Mode};

pub(crate) use account::{Account, ErrorReport, origins};
pub(crate) use subpixels::step as step_of_cache;
pub(crate) use view::View;

use glossy::Glossy;
use holdout::HeldOut;
use leaves::Leaves;
use primary::Primary;
use strictness::Strictness;
use subpixels::Coarse;
use told::Told;

/// The widest spacing of a lattice, in pixels.
const COARSEST: u32 = 16;

/// The error is known to about 15 % from the pixels held out: within this factor, another round isn't worth its time.
const NEAR_ENOUGH: f64 = 1.08;

/// The same of what the eye sees directly: what chains show comes on top.
const NEAR_ENOUGH_IN_VIEW: f64 = 1.03;

/// Pixels of a large picture whose error is so many times the one aimed at aren't told by those around them.
const TOO_WRONG: f64 = 2.0;

/// How often what failed is refined again.
const MAX_ROUNDS: usize = 4;

/// Of a picture of so many subpixels the cache works on every so many, both ways; of what the others show little needs to be
/// kept. 1 if all is to be kept.
pub(crate) fn thinned_by(args: &Args, n_subpixels: usize, scene: &Scene) -> u32 {
    match args.mode == Mode::Adaptive && args.error > 0.0 && !scene.is_masked() {
        true => step_of_cache(args, n_subpixels, &scene.camera),
        false => 1,
    }
}

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
    let mut strictness = Strictness::new(args.error, frame.shader().is_gathering());
    if !has_file && !whole::cache_pays(&strictness, &mut account)? {
        let (counts, cache) = account.close();
        let mut rendered = whole::render(args, &frame.thinned(1), clock, progress)?;
        rendered.counts += counts;
        rendered.cache += cache;
        return Ok(rendered);
    }
    let fine = frame;
    let coarse = subpixels::coarse(args, fine);
    let all = OnceCell::new();
    let mut frame = coarse.as_ref().unwrap_or(fine);
    let mut told = match &coarse {
        None => None,
        Some(coarse) => Some(Told::new(args, fine, coarse, &mut account)?),
    };
    let (view, mut primary) = loop {
        account.frame = frame;
        let view = View::new(frame, args.supersample);
        let primary = Primary::start(&view, &saved, args.error, &strictness, &mut account)?;
        // Where light is mostly noise, no pixel tells of those beside it.
        let is_too_wrong = view.apart() > 1
            && told.as_ref().is_some_and(|told| {
                told.in_view(args, &view, &primary).measured_mean
                    > TOO_WRONG * f64::from(args.error)
            });
        if !is_too_wrong {
            break (view, primary);
        }
        (frame, told) = (all.get_or_init(|| fine.thinned(1)), None);
    };
    let held_out = HeldOut::compute(args, &mut account)?;
    let target = f64::from(args.error);
    let too_large_by = |error: &ErrorReport| (error.measured_mean / target) as f32;
    // Chains end on what the eye sees, so that comes first; what they show is wrong by as much.
    for round in 0.. {
        let shown = |i: usize, specular: Rgb| {
            view.sites.values()[i].map(|_| primary.radiance(&view, i, specular))
        };
        let mut report = held_out.measure(args, frame.size(), shown, |_| false);
        if view.apart() > 1
            && let Some(told) = &told
        {
            let of_told = told.in_view(args, &view, &primary);
            report.estimate = report.estimate.with(of_told, told.share());
        }
        if report.estimate.measured_mean <= NEAR_ENOUGH_IN_VIEW * target || round == MAX_ROUNDS {
            break;
        }
        let factor = too_large_by(&report.estimate);
        strictness.tighten(&report, factor);
        primary.improve(report.worst, &view, factor, &strictness, &mut account)?;
    }
    let mut specular = Leaves::start(&saved, &mut account)?;
    let mut glossy = Glossy::start(frame, specular.glossy_pixels());
    let mut round = 0;
    let mut view_is_better = false;
    let error = loop {
        let finished = primary.finished(&view);
        let of_specular = strictness.tolerance(Component::Specular);
        specular.resolve(&view, &finished, of_specular, &mut account)?;
        let sharp = |i: usize| specular.radiance(i);
        glossy.resolve(&view, &finished, sharp, strictness.tolerance_of_glossy(), &mut account)?;
        let shown = |i: usize, _| {
            Some(primary.radiance(&view, i, specular.radiance(i) + glossy.radiance(i)))
        };
        let report = held_out.measure(args, frame.size(), shown, |i| glossy.is_shown_at(i));
        round += 1;
        if report.estimate.measured_mean <= NEAR_ENOUGH * target || round == MAX_ROUNDS {
            break report.estimate;
        }
        view_is_better |= report.worst != Component::Specular;
        let factor = too_large_by(&report.estimate);
        strictness.tighten(&report, factor);
        primary.improve(report.worst, &view, factor, &strictness, &mut account)?;
    };

    if view_is_better {
        glossy.look_up(&view, &primary.finished(&view), &mut account)?;
    }
    saved.check_untouched()?;
    if let Some(path) = &args.paper.save_cache {
        let views = saved.set.views;
        let mut set = RecordSet { views, ..RecordSet::default() };
        let Primary { direct, indirect, caustic } = &primary;
        direct.record(&view, &mut set);
        set.indirect = indirect.records(&view);
        set.caustic = caustic.records(&view, frame.shader().settings.caustic.max_radius);
        set.leaves = specular.records();
        let is_nearby = |reasons: &[Reason]| reasons.contains(&Reason::Nearby);
        let is_complete =
            !(direct.uses_nearby() || is_nearby(&indirect.layer.reasons) || specular.uses_nearby());
        records::save(path, args, frame, inputs, &mut set, is_complete)?;
    }
    let (reasons, levels) = history(&mut primary, &specular, &glossy, frame.size().n_pixels());
    if let Some(told) = told {
        let finished = primary.finished(&view);
        let coarse = Coarse {
            frame,
            view: &view,
            primary: &primary,
            finished: &finished,
            strictness: &strictness,
        };
        account.frame = fine;
        let shown = subpixels::render(&coarse, &mut specular, (reasons, levels), &mut account)?;
        let error = told.at_last(args, error, &shown.values);
        return Ok(account.finish(shown.values, shown.reasons, shown.levels, error));
    }
    // Radiance takes the place of irradiance: memory that is touched for the first time takes longer than the sums.
    let scaled = |mut values: Vec<Rgb>| {
        let each = values.par_iter_mut().with_min_len(4096).enumerate();
        each.for_each(|(i, value)| *value = view.albedo(i) * FRAC_1_PI * *value);
        Grid::from_values(frame.size(), values)
    };
    let Primary { direct, indirect, caustic } = primary;
    let mut of_specular = specular.into_radiance();
    glossy.add_to(&mut of_specular);
    let values = Components {
        direct: scaled(direct.into_irradiance()),
        indirect: scaled(indirect.layer.values),
        specular: Grid::from_values(frame.size(), of_specular),
        caustic: scaled(caustic.layer.values),
    };
    Ok(account.finish(values, reasons, levels, error))
}

/// Why values were computed, and from which step on they were predicted, at so many pixels.
fn history(
    primary: &mut Primary,
    specular: &Leaves,
    glossy: &Glossy,
    n_pixels: usize,
) -> (Components<Vec<Reason>>, Components<Vec<u8>>) {
    let Primary { direct, indirect, caustic } = primary;
    let (mut specular_reasons, mut specular_levels) = (specular.reasons(), vec![0; n_pixels]);
    glossy.tell(&mut specular_reasons, &mut specular_levels);
    let reasons = Components {
        direct: direct.reasons(),
        indirect: take(&mut indirect.layer.reasons),
        specular: specular_reasons,
        caustic: take(&mut caustic.layer.reasons),
    };
    let levels = Components {
        direct: direct.levels(),
        indirect: take(&mut indirect.layer.levels),
        specular: specular_levels,
        caustic: take(&mut caustic.layer.levels),
    };
    (reasons, levels)
}
