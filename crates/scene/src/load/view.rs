//! The camera of the scene file.

use glam::Vec3;
use toml::Spanned;

use super::source::{MAX_LENGTH, Source};
use super::tables::CameraTable;
use crate::{Camera, Error, FovAxis};

/// The camera of a table.
pub(super) fn camera(source: &Source, table: &Spanned<CameraTable>) -> Result<Camera, Error> {
    let table = table.get_ref();
    let origin = source.vector(&table.origin, "the origin of the camera")?;
    let target = source.vector(&table.target, "the target of the camera")?;
    let up = match &table.up {
        Some(up) => source.direction(up, "the up vector of the camera")?.as_vec3(),
        None => Vec3::Y,
    };
    let Some(forward) = (target - origin).try_normalize() else {
        let fault = "target and origin of the camera are the same point; move one";
        return Err(source.fault(table.target.span(), fault));
    };
    if forward.cross(up).length() < 1e-4 {
        let fault = "the camera looks along its up vector; give another `up`, such as [0, 0, 1]";
        let span = table.up.as_ref().map_or(table.target.span(), Spanned::span);
        return Err(source.fault(span, fault));
    }
    let fov = source.number(&table.fov, "the fov of the camera")?;
    // The upper limit is that of the tangent of half of it.
    if !(fov > 0.0 && fov < 179.99) {
        let fault =
            format!("the fov of the camera is {fov}; give degrees between 0 and 180, such as 40");
        return Err(source.fault(table.fov.span(), fault));
    }
    let fov_axis = match table.fov_axis.as_ref().map(|a| (a.get_ref().as_str(), a.span())) {
        None | Some(("x", _)) => FovAxis::X,
        Some(("y", _)) => FovAxis::Y,
        Some(("smaller", _)) => FovAxis::Smaller,
        Some(("larger", _)) => FovAxis::Larger,
        Some(("diagonal", _)) => FovAxis::Diagonal,
        Some((other, span)) => {
            let fault = format!(
                "the fov_axis \"{other}\" is unknown; the axes are x, y, smaller, larger and diagonal"
            );
            return Err(source.fault(span, fault));
        }
    };
    let camera = Camera::look_at(origin, target, up, fov, fov_axis);
    let length = |written: &Spanned<f64>, name: &str| {
        let value = source.number(written, &format!("the {name} of the camera"))?;
        if value > 0.0 && value <= MAX_LENGTH {
            return Ok(value);
        }
        let fault = format!(
            "the {name} of the camera is {value}; give a length above 0 and up to {MAX_LENGTH:e}"
        );
        Err(source.fault(written.span(), fault))
    };
    match (&table.aperture_radius, &table.focus_distance) {
        (None, None) => Ok(camera),
        (None, Some(focus)) => {
            let fault = "focus_distance needs an aperture_radius; without one everything is sharp";
            Err(source.fault(focus.span(), fault))
        }
        (Some(radius), focus) => {
            let to_target = (target - origin).length();
            let focus = focus.as_ref().map_or(Ok(to_target), |f| length(f, "focus_distance"))?;
            Ok(camera.with_lens(length(radius, "aperture_radius")?, focus))
        }
    }
}
