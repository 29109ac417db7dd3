//! The sensor and its film.

use base::ImageSize;
use glam::DVec3;

use super::Context;
use super::plugin::Plugin;
use super::xml::Element;
use crate::load::keys::list;
use crate::load::source::MAX_LENGTH;
use crate::{Camera, Error, FovAxis};

/// The axes that a field of view may span.
const AXES: [(&str, FovAxis); 5] = [
    ("x", FovAxis::X),
    ("y", FovAxis::Y),
    ("diagonal", FovAxis::Diagonal),
    ("smaller", FovAxis::Smaller),
    ("larger", FovAxis::Larger),
];

/// The diagonal of the film for which focal lengths are meant: 36 by 24 mm.
const FILM_DIAGONAL: f64 = 43.266_615_305_567_87;

/// The camera of a sensor.
pub(super) fn camera<'d>(context: &mut Context<'d>, element: &'d Element) -> Result<Camera, Error> {
    let plugin = Plugin::new(context, element)?;
    let fault =
        |context: &Context<'_>, fault: String| Err(context.document.fault(element.place, fault));
    if !["perspective", "thinlens"].contains(&plugin.kind) {
        let text = format!("{} isn't supported; use perspective or thinlens", plugin.title());
        return fault(context, text);
    }
    let lens = lens(context, &plugin)?;
    // They change nothing where all is in focus and nothing is cut away.
    for name in ["near_clip", "far_clip", "focus_distance", "shutter_open", "shutter_close"] {
        plugin.number(context, name)?;
    }
    plugin.nested(context, &["sampler"])?;
    let (fov, axis) = field_of_view(context, &plugin)?;
    let map = plugin.transform(context)?;
    let of = |axis| map.transform_vector3(axis).normalize();
    let (left, up, forward) = (of(DVec3::X), of(DVec3::Y), of(DVec3::Z));
    if up.cross(forward).dot(left) < 0.0 {
        return fault(
            context,
            "to_world of the sensor mirrors the picture; every scale must be above 0".into(),
        );
    }
    let films = plugin.nested(context, &["film"])?;
    let film = match films.first() {
        Some(film) => self::film(context, film)?,
        None => Film { size: DEFAULT_FILM, corner: [0, 0], part: DEFAULT_FILM },
    };
    plugin.finish(context)?;
    let origin = map.translation.as_vec3();
    // A target as far away as the origin is, so that their difference has digits left.
    let target = (map.translation + forward * map.translation.length().max(1.0)).as_vec3();
    let camera = Camera::look_at(origin, target, up.as_vec3(), fov, axis).with_crop(
        film.size,
        film.corner,
        film.part,
    );
    Ok(lens.map_or(camera, |(radius, focus)| camera.with_lens(radius, focus)))
}

/// Radius and focus of the lens, if there is one that blurs anything.
fn lens(context: &Context<'_>, plugin: &Plugin<'_>) -> Result<Option<(f32, f32)>, Error> {
    if plugin.kind != "thinlens" {
        return Ok(None);
    }
    let fault = |fault: String| Err(context.document.fault(plugin.element.place, fault));
    let Some(radius) = plugin.number(context, "aperture_radius")? else {
        return fault(format!("{} needs an `aperture_radius`", plugin.title()));
    };
    let Some(focus) = plugin.number(context, "focus_distance")? else {
        return fault(format!("{} needs a `focus_distance`", plugin.title()));
    };
    let most = f64::from(MAX_LENGTH);
    if !((0.0..=most).contains(&radius) && focus > 0.0 && focus <= most) {
        return fault(format!(
            "aperture_radius is {radius} and focus_distance {focus}; give lengths, the second above 0 and both up to {most:e}"
        ));
    }
    Ok((radius > 0.0).then_some((radius as f32, focus as f32)))
}

fn field_of_view(context: &Context<'_>, plugin: &Plugin<'_>) -> Result<(f32, FovAxis), Error> {
    let fault = |fault: String| Err(context.document.fault(plugin.element.place, fault));
    let written = plugin.get(&["focal_length"]);
    let fov = plugin.number(context, "fov")?;
    let (fov, axis) = match (fov, written) {
        (Some(fov), None) => {
            let word = plugin.string("fov_axis").unwrap_or("x");
            let Some((_, axis)) = AXES.iter().find(|(name, _)| *name == word) else {
                let known = list(&AXES.map(|(name, _)| name));
                return fault(format!("fov_axis is \"{word}\"; it may be one of {known}"));
            };
            (fov, *axis)
        }
        (None, Some(element)) => {
            let value = element.attribute("value").unwrap_or_default();
            let length = value.trim().trim_end_matches("mm").parse::<f64>().ok();
            let Some(length) = length.filter(|l| l.is_finite() && *l > 0.0) else {
                return fault(format!(
                    "focal_length is \"{value}\"; give millimeters, such as 50mm"
                ));
            };
            (2.0 * libm::atan(FILM_DIAGONAL / (2.0 * length)).to_degrees(), FovAxis::Diagonal)
        }
        // Version 0.6 takes a lens of 50 mm where nothing is said.
        _ => return fault(format!("{} needs either `fov` or `focal_length`", plugin.title())),
    };
    if !(fov > 0.0 && fov < 179.99) {
        return fault(format!(
            "the fov of {} is {fov}; give degrees between 0 and 180",
            plugin.title()
        ));
    }
    Ok((fov as f32, axis))
}

/// A film, and the part of it that a picture shows.
struct Film {
    size: ImageSize,
    corner: [u32; 2],
    part: ImageSize,
}

/// What Mitsuba takes where nothing is said.
const DEFAULT_FILM: ImageSize = ImageSize { width: 768, height: 576 };

/// The size of a film and its crop; how it stores and filters pictures is a matter of the programs.
fn film<'d>(context: &mut Context<'d>, element: &'d Element) -> Result<Film, Error> {
    let film = Plugin::new(context, element)?;
    let count = |name: &str, default: u32| {
        film.count(context, name).map(|number| number.unwrap_or(default))
    };
    let fault = |fault: String| Err(context.document.fault(element.place, fault));
    let width = count("width", DEFAULT_FILM.width)?;
    let height = count("height", DEFAULT_FILM.height)?;
    if width == 0 || height == 0 {
        return fault(format!("the film has {width}x{height} pixels; give at least one"));
    }
    let corner = [count("crop_offset_x", 0)?, count("crop_offset_y", 0)?];
    // What lies behind the corner.
    let rest = [width.saturating_sub(corner[0]), height.saturating_sub(corner[1])];
    let part =
        ImageSize { width: count("crop_width", rest[0])?, height: count("crop_height", rest[1])? };
    if part.width == 0 || part.height == 0 || part.width > rest[0] || part.height > rest[1] {
        return fault(format!(
            "the crop of {}x{} pixels at {}, {} doesn't lie within the film of {width}x{height}",
            part.width, part.height, corner[0], corner[1]
        ));
    }
    Ok(Film { size: ImageSize { width, height }, corner, part })
}
