//! `--mode original`: every component at every pixel.

use base::{Component, Components, Grid, Interrupted, Rgb};
use cache_map::Origin;
use cli::{Clock, Seconds};
use shade::Counts;

use crate::frame::Frame;
use crate::render::{Progress, Rendered};

pub(crate) fn render(
    frame: &Frame<'_>,
    clock: &mut Clock,
    progress: &Progress<'_>,
) -> Result<Rendered, Interrupted> {
    let pixels = frame.surface_pixels();
    let mut counts = Counts::default();
    let mut seconds = Components::<Seconds>::default();
    let mut values = Components::from_fn(|_| Grid::from_fn(frame.size(), |_| Rgb::BLACK));
    for component in Component::ALL {
        let (radiance, c) = progress.run(component.name(), pixels.len(), |watch| {
            progress.resume.chunks(&pixels, watch, |pixels| frame.shade(component, pixels, watch))
        })?;
        pixels.iter().zip(radiance).for_each(|(&pixel, r)| values[component][pixel] = r);
        counts += c;
        seconds[component] = clock.lap();
    }
    let size = frame.size();
    let origin = |p| match frame.shows_surface(size.index(p)) {
        true => Origin::Traced,
        false => Origin::None,
    };
    let origins = Components::from_fn(|_| Grid::from_fn(size, origin));
    let traced = Components::from_fn(|_| pixels.len() as u64);
    Ok(Rendered {
        values,
        origins,
        traced,
        counts,
        seconds,
        cache: Seconds::default(),
        adaptive: None,
    })
}
