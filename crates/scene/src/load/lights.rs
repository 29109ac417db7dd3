//! Lights of the scene file that aren't surfaces.

use base::Rgb;
use glam::{DMat3, Vec3A};

use super::keys::{Typed, span};
use super::source::Source;
use super::tables::LightTable;
use super::{image, transform};
use crate::light::Spot;
use crate::{EnvironmentMap, Error, LightKind};

/// The light of a table; `object` is such as ``light `lamp` ``.
pub(super) fn light(source: &Source, object: &str, table: &LightTable) -> Result<LightKind, Error> {
    let of = |what: &str| format!("the {what} of {object}");
    let typed = Typed { source, object, kind: &table.kind };
    let given = [
        ("position", span(&table.position)),
        ("target", span(&table.target)),
        ("direction", span(&table.direction)),
        ("intensity", span(&table.intensity)),
        ("irradiance", span(&table.irradiance)),
        ("radiance", span(&table.radiance)),
        ("cone_angle", span(&table.cone_angle)),
        ("falloff_angle", span(&table.falloff_angle)),
        ("file", span(&table.file)),
        ("rotate", span(&table.rotate)),
    ];
    match table.kind.get_ref().as_str() {
        "point" => {
            typed.take_only(&given, &["position", "intensity"])?;
            let position = typed.need(&table.position, "position")?;
            let intensity = typed.need(&table.intensity, "intensity")?;
            Ok(LightKind::Point {
                position: source.vector(position, &of("position"))?.into(),
                intensity: source.amount(intensity, &of("intensity"))?,
            })
        }
        "spot" => {
            typed.take_only(
                &given,
                &["position", "target", "intensity", "cone_angle", "falloff_angle"],
            )?;
            spot(source, &typed, table).map(LightKind::Spot)
        }
        "directional" => {
            typed.take_only(&given, &["direction", "irradiance"])?;
            let direction = typed.need(&table.direction, "direction")?;
            let irradiance = typed.need(&table.irradiance, "irradiance")?;
            let direction = source.direction(direction, &of("direction"))?.as_vec3a();
            Ok(LightKind::Directional {
                direction: direction.normalize(),
                irradiance: source.amount(irradiance, &of("irradiance"))?,
            })
        }
        "environment" if table.file.is_some() => {
            typed.take_only(&given, &["radiance", "file", "rotate"])?;
            map(source, &typed, table).map(LightKind::EnvironmentMap)
        }
        "environment" => {
            typed.take_only(&given, &["radiance", "file"])?;
            let radiance = typed.need(&table.radiance, "radiance")?;
            Ok(LightKind::Environment { radiance: source.amount(radiance, &of("radiance"))? })
        }
        _ => Err(typed.unknown(&["point", "spot", "directional", "environment"])),
    }
}

fn map(source: &Source, typed: &Typed<'_>, table: &LightTable) -> Result<EnvironmentMap, Error> {
    let file = typed.need(&table.file, "file")?;
    let factor = match &table.radiance {
        Some(radiance) => source.amount(radiance, &format!("the radiance of {}", typed.object))?,
        None => Rgb::ONE,
    };
    let to_world = match &table.rotate {
        Some(rotate) => {
            transform::rotations(source, &format!("rotate of {}", typed.object), rotate.get_ref())?
        }
        None => DMat3::IDENTITY,
    };
    let (size, texels) =
        image::read_linear(source.reach(), &source.resolve(file.get_ref()), factor)
            .map_err(|fault| source.fault(file.span(), fault))?;
    Ok(EnvironmentMap::new(size, texels, to_world.as_mat3().into()))
}

fn spot(source: &Source, typed: &Typed<'_>, table: &LightTable) -> Result<Spot, Error> {
    let of = |what: &str| format!("the {what} of {}", typed.object);
    let position = source.vector(typed.need(&table.position, "position")?, &of("position"))?;
    let written = typed.need(&table.target, "target")?;
    let target = source.vector(written, &of("target"))?;
    let Some(direction) = (target - position).as_dvec3().try_normalize() else {
        let fault = format!("target and position of {} are the same point; move one", typed.object);
        return Err(source.fault(written.span(), fault));
    };
    let intensity = typed.need(&table.intensity, "intensity")?;
    let intensity = source.amount(intensity, &of("intensity"))?;
    let written = typed.need(&table.cone_angle, "cone_angle")?;
    let cone = source.number(written, &of("cone_angle"))?;
    if !(cone > 0.0 && cone <= 180.0) {
        let fault = format!(
            "{} is {cone}; half angles of cones lie above 0 and up to 180 degrees",
            of("cone_angle")
        );
        return Err(source.fault(written.span(), fault));
    }
    let mut falloff = cone;
    if let Some(written) = &table.falloff_angle {
        falloff = source.number(written, &of("falloff_angle"))?;
        if !(0.0..=cone).contains(&falloff) {
            let fault = format!(
                "{} is {falloff}; it lies between 0 and the cone_angle, {cone}",
                of("falloff_angle")
            );
            return Err(source.fault(written.span(), fault));
        }
    }
    let cos = |degrees: f32| libm::cos(f64::from(degrees).to_radians()) as f32;
    let direction: Vec3A = direction.as_vec3a().normalize();
    let (cos_outer, cos_inner) = (cos(cone), cos(falloff));
    if cos_outer >= 1.0 {
        let fault = format!("{} is too small to hold any direction; widen it", of("cone_angle"));
        return Err(source.fault(written.span(), fault));
    }
    Ok(Spot { position: position.into(), direction, intensity, cos_outer, cos_inner })
}
