//! Punctual lights, and the camera.

use base::{ImageSize, Rgb};
use glam::{DAffine3, DVec3, Vec3A};

use super::file::File;
use super::tables::{PunctualLight, SpotTable};
use crate::load::keys::list;
use crate::load::source::MAX_LIGHT;
use crate::{Camera, Error, FovAxis, LightKind, Spot};

/// The height of pictures of cameras that tell their aspect ratio.
const HEIGHT: f64 = 512.0;

/// The light of a node.
pub(super) fn light(
    file: &File,
    index: usize,
    place: &str,
    map: &DAffine3,
) -> Result<LightKind, Error> {
    let lights = file.tables.extensions.punctual.as_ref();
    let lights = lights.map_or(&[][..], |punctual| &punctual.lights);
    let light = file.get(lights, "lights", index, place)?;
    let fault = |fault: String| file.fault(&format!("lights[{index}]"), fault);
    let PunctualLight { kind, color: [r, g, b], intensity, spot } = light;
    let amount = Rgb::new(*r, *g, *b) * *intensity;
    let is_light = amount.is_finite() && amount.min_channel() >= 0.0;
    if !is_light || amount.max_channel() > MAX_LIGHT {
        let text = format!("its color times its intensity must lie between 0 and {MAX_LIGHT:e}");
        return Err(fault(text));
    }
    let position = Vec3A::from(map.translation.as_vec3());
    // Lights shine along -z of their node.
    let direction = || direction(map, DVec3::NEG_Z).map_err(|text| file.fault(place, text));
    match kind.as_str() {
        "point" => Ok(LightKind::Point { position, intensity: amount }),
        "directional" => Ok(LightKind::Directional {
            direction: direction()?.as_vec3a().normalize(),
            irradiance: amount,
        }),
        "spot" => {
            let Some(SpotTable { inner_cone_angle: inner, outer_cone_angle: outer }) = spot else {
                return Err(fault("it is a spot, for which it needs `spot`".into()));
            };
            if !(0.0 <= *inner && inner < outer && *outer <= std::f64::consts::PI) {
                return Err(fault(format!(
                    "its innerConeAngle is {inner} and its outerConeAngle {outer}; give 0 <= inner < outer <= pi"
                )));
            }
            Ok(LightKind::Spot(Spot {
                position,
                direction: direction()?.as_vec3a().normalize(),
                intensity: amount,
                cos_outer: libm::cos(*outer) as f32,
                cos_inner: libm::cos(*inner) as f32,
            }))
        }
        other => {
            let known = list(&["point", "spot", "directional"]);
            Err(fault(format!("its type \"{other}\" is unknown; the types are {known}")))
        }
    }
}

/// The camera of a node, if it is one in perspective.
pub(super) fn camera(
    file: &File,
    index: usize,
    place: &str,
    map: &DAffine3,
) -> Result<Option<Camera>, Error> {
    let table = file.get(&file.tables.cameras, "cameras", index, place)?;
    let Some(perspective) = &table.perspective else { return Ok(None) };
    let fault = |fault: String| file.fault(&format!("cameras[{index}].perspective"), fault);
    let fov = perspective.yfov.to_degrees();
    if !(fov > 0.0 && fov < 179.99) {
        let text = format!("its yfov is {}; give radians between 0 and pi", perspective.yfov);
        return Err(fault(text));
    }
    let of = |axis| direction(map, axis).map_err(|text| file.fault(place, text));
    let (right, up, forward) = (of(DVec3::X)?, of(DVec3::Y)?, of(DVec3::NEG_Z)?);
    if right.cross(up).dot(forward) > 0.0 {
        let text = "it mirrors the picture of its camera; every scale must be above 0";
        return Err(file.fault(place, text));
    }
    if forward.cross(up).length() < 1e-4 {
        return Err(file.fault(place, "it bends the axes of its camera into one"));
    }
    // A target as far away as the origin is, so that their difference has digits left.
    let origin = map.translation;
    let target = (origin + forward * origin.length().max(1.0)).as_vec3();
    let camera = Camera::look_at(origin.as_vec3(), target, up.as_vec3(), fov as f32, FovAxis::Y);
    let Some(aspect) = perspective.aspect_ratio else { return Ok(Some(camera)) };
    if !(0.01..=100.0).contains(&aspect) {
        return Err(fault(format!("its aspectRatio is {aspect}; use 0.01 to 100")));
    }
    let film = ImageSize { width: (HEIGHT * aspect).round() as u32, height: HEIGHT as u32 };
    Ok(Some(camera.with_crop(film, [0, 0], film)))
}

/// The unit vector into which a map turns an axis, or why there is none, in words.
fn direction(map: &DAffine3, axis: DVec3) -> Result<DVec3, &'static str> {
    map.transform_vector3(axis)
        .try_normalize()
        .ok_or("it flattens the axes of what it shows; every scale must differ from 0")
}
