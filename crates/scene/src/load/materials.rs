//! Materials of the scene file.

use base::Rgb;
use toml::Spanned;

use super::assembly::Assembly;
use super::keys::{Typed, list, span};
use super::source::MAX_LIGHT;
use super::source::Source;
use super::tables::MaterialTable;
use crate::{Coat, Error, LEAST_ROUGHNESS, Material, Specular, TextureId};

/// Indices of refraction beyond these limits are typing errors.
pub(super) const IOR_RANGE: std::ops::RangeInclusive<f32> = 0.1..=10.0;

/// Keys of all types but glass and panes.
const EMISSION: [&str; 2] = ["emission", "emission_texture"];

/// Keys of all types but glass.
const OPACITY: [&str; 2] = ["opacity", "opacity_texture"];

/// The complex index of refraction of metals at 650, 550 and 450 nm, from measurements collected at refractiveindex.info
/// (the choice of wavelengths is that of Chaos Group 2016, "Understanding Metalness").
const METALS: [(&str, [f32; 3], [f32; 3]); 7] = [
    ("aluminium", [1.3456, 0.96521, 0.61722], [7.4746, 6.3995, 5.3031]),
    ("chromium", [3.1071, 3.1812, 2.3230], [3.3314, 3.3291, 3.1350]),
    ("copper", [0.27105, 0.67693, 1.3164], [3.6092, 2.6248, 2.2921]),
    ("gold", [0.18299, 0.42108, 1.3734], [3.4242, 2.3459, 1.7704]),
    ("iron", [2.9114, 2.9497, 2.5845], [3.0893, 2.9318, 2.7670]),
    ("platinum", [2.3757, 2.0847, 1.8453], [4.2655, 3.7153, 3.1365]),
    ("silver", [0.15943, 0.14512, 0.13547], [3.9291, 3.1900, 2.3808]),
];

/// The material of a table; its textures are known to the assembly.
pub(super) fn material(
    assembly: &mut Assembly<'_>,
    name: &str,
    table: &MaterialTable,
) -> Result<Material, Error> {
    let source = assembly.source;
    let object = format!("material `{name}`");
    let of = |what: &str| format!("the {what} of {object}");
    let typed = Typed { source, object: &object, kind: &table.kind };
    let given = [
        ("albedo", span(&table.albedo)),
        ("albedo_texture", span(&table.albedo_texture)),
        ("emission", span(&table.emission)),
        ("emission_texture", span(&table.emission_texture)),
        ("reflectance", span(&table.reflectance)),
        ("eta", span(&table.eta)),
        ("k", span(&table.k)),
        ("preset", span(&table.preset)),
        ("ior", span(&table.ior)),
        ("absorption", span(&table.absorption)),
        ("roughness", span(&table.roughness)),
        ("nonlinear", span(&table.nonlinear)),
        ("opacity", span(&table.opacity)),
        ("opacity_texture", span(&table.opacity_texture)),
    ];
    let take = |keys: &[&str]| typed.take_only(&given, &[keys, &EMISSION, &OPACITY].concat());
    let roughness = roughness(source, table, &of("roughness"))?;
    let (mut albedo, mut albedo_texture) = (Rgb::BLACK, None);
    let specular = match table.kind.get_ref().as_str() {
        "diffuse" => {
            take(&["albedo", "albedo_texture"])?;
            if table.albedo_texture.is_none() {
                typed.need(&table.albedo, "albedo")?;
            }
            (albedo, albedo_texture) = diffuse(assembly, &object, table, Rgb::BLACK)?;
            Specular::None
        }
        "mirror" => {
            take(&["reflectance", "albedo", "albedo_texture", "roughness"])?;
            let written = typed.need(&table.reflectance, "reflectance")?;
            let reflectance = source.share(written, &of("reflectance"))?;
            (albedo, albedo_texture) = diffuse(assembly, &object, table, reflectance)?;
            Specular::Mirror { reflectance }
        }
        "metal" => {
            take(&["eta", "k", "preset", "roughness"])?;
            metal(source, &typed, table)?
        }
        "plastic" => {
            take(&["albedo", "albedo_texture", "ior", "reflectance", "nonlinear", "roughness"])?;
            if table.albedo_texture.is_none() {
                typed.need(&table.albedo, "albedo")?;
            }
            // The coat takes from the base what it reflects.
            (albedo, albedo_texture) = diffuse(assembly, &object, table, Rgb::BLACK)?;
            let ior = ior(source, &typed, table)?;
            let reflectance = match &table.reflectance {
                Some(written) => source.share(written, &of("reflectance"))?,
                None => Rgb::ONE,
            };
            let is_nonlinear = table.nonlinear.as_ref().is_some_and(|n| *n.get_ref());
            let of_coat = if roughness < LEAST_ROUGHNESS { 0.0 } else { roughness };
            Specular::Coat(Coat::new(ior, reflectance, is_nonlinear, of_coat))
        }
        "glass" => {
            if let Some(emission) = &table.emission {
                let fault = format!(
                    "{object} is glass, which cannot emit; give the emission to a diffuse material"
                );
                return Err(source.fault(emission.span(), fault));
            }
            typed.take_only(&given, &["ior", "absorption", "roughness"])?;
            let ior = ior(source, &typed, table)?;
            let absorption = match &table.absorption {
                Some(absorption) => source.amount(absorption, &of("absorption"))?,
                None => Rgb::BLACK,
            };
            if ior == 1.0 && absorption.is_black() {
                let warning = format!("{} is 1, so it is invisible", of("ior"));
                let span = span(&table.ior).unwrap_or_default();
                assembly.warnings.push(source.warning(span, warning));
            }
            Specular::Glass { ior, absorption }
        }
        "pane" => {
            typed.take_only(&given, &[&["ior"], OPACITY.as_slice()].concat())?;
            let ior = ior(source, &typed, table)?;
            Specular::Pane { ior }
        }
        _ => return Err(typed.unknown(&["diffuse", "mirror", "metal", "plastic", "glass", "pane"])),
    };
    let (emission, emission_texture) = emission(assembly, &object, table)?;
    let (opacity, opacity_texture) = opacity(assembly, &object, table)?;
    if !emission.is_black() && (opacity < 1.0 || opacity_texture.is_some()) {
        let span = span(&table.opacity).or(span(&table.opacity_texture)).unwrap_or_default();
        let fault = format!("{object} emits and lets light pass; keep one of the two");
        return Err(source.fault(span, fault));
    }
    let black = Material::black(name);
    let material = Material {
        albedo,
        albedo_texture,
        specular,
        roughness,
        emission,
        emission_texture,
        opacity,
        opacity_texture,
        ..black
    };
    if let Some(written) = &table.roughness
        && roughness > 0.0
        && !material.is_rough()
    {
        let why = if roughness < LEAST_ROUGHNESS {
            format!("it is below {LEAST_ROUGHNESS}")
        } else {
            "glass of this ior doesn't bend light".into()
        };
        let warning = format!("{} is rendered as 0, since {why}", of("roughness"));
        assembly.warnings.push(source.warning(written.span(), warning));
    }
    Ok(material)
}

fn roughness(source: &Source, table: &MaterialTable, what: &str) -> Result<f32, Error> {
    let Some(written) = &table.roughness else { return Ok(0.0) };
    let roughness = source.number(written, what)?;
    if (0.0..=1.0).contains(&roughness) {
        return Ok(roughness);
    }
    Err(source.fault(written.span(), format!("{what} is {roughness}; use 0 to 1")))
}

/// The emission of a table and what it is multiplied with.
fn emission(
    assembly: &mut Assembly<'_>,
    object: &str,
    table: &MaterialTable,
) -> Result<(Rgb, Option<TextureId>), Error> {
    let what = format!("the emission of {object}");
    let emission = match (&table.emission, &table.emission_texture) {
        (Some(written), _) => assembly.source.amount(written, &what)?,
        (None, Some(_)) => Rgb::ONE,
        (None, None) => Rgb::BLACK,
    };
    let Some(name) = &table.emission_texture else { return Ok((emission, None)) };
    let (id, largest) = assembly.texture(name, object)?;
    if emission.max_channel() * largest > MAX_LIGHT {
        let fault = format!("{what} reaches more than {MAX_LIGHT:e} with its texture; lower it");
        return Err(assembly.source.fault(name.span(), fault));
    }
    // What is black emits nothing, and a texture of black is no light either.
    let is_lit = !emission.is_black() && largest > 0.0;
    Ok(if is_lit { (emission, Some(id)) } else { (Rgb::BLACK, None) })
}

/// The opacity of a table and what it is multiplied with.
fn opacity(
    assembly: &mut Assembly<'_>,
    object: &str,
    table: &MaterialTable,
) -> Result<(f32, Option<TextureId>), Error> {
    let what = format!("the opacity of {object}");
    let opacity = match &table.opacity {
        Some(written) => {
            let opacity = assembly.source.number(written, &what)?;
            if !(0.0..=1.0).contains(&opacity) {
                let fault = format!("{what} is {opacity}; use 0 to 1");
                return Err(assembly.source.fault(written.span(), fault));
            }
            opacity
        }
        None => 1.0,
    };
    let Some(name) = &table.opacity_texture else { return Ok((opacity, None)) };
    let (id, largest) = assembly.texture(name, object)?;
    if opacity * largest > 1.0 {
        let fault = format!("{what} reaches {} with its texture; use at most 1", opacity * largest);
        return Err(assembly.source.fault(name.span(), fault));
    }
    Ok((opacity, Some(id)))
}

fn ior(source: &Source, typed: &Typed<'_>, table: &MaterialTable) -> Result<f32, Error> {
    let written = typed.need(&table.ior, "ior")?;
    let what = format!("the ior of {}", typed.object);
    let ior = source.number(written, &what)?;
    if IOR_RANGE.contains(&ior) {
        return Ok(ior);
    }
    let (least, most) = (IOR_RANGE.start(), IOR_RANGE.end());
    let fault = format!("{what} is {ior}; indices of refraction lie between {least} and {most}");
    Err(source.fault(written.span(), fault))
}

/// The albedo of a table and what it is multiplied with, beside a specular part of the given reflectance.
fn diffuse(
    assembly: &mut Assembly<'_>,
    object: &str,
    table: &MaterialTable,
    reflectance: Rgb,
) -> Result<(Rgb, Option<TextureId>), Error> {
    let source = assembly.source;
    let albedo = match (&table.albedo, &table.albedo_texture) {
        (Some(albedo), _) => source.share(albedo, &format!("the albedo of {object}"))?,
        (None, Some(_)) => Rgb::ONE,
        (None, None) => return Ok((Rgb::BLACK, None)),
    };
    let (texture, largest) = match &table.albedo_texture {
        Some(name) => {
            let (id, largest) = assembly.texture(name, object)?;
            (Some((id, name)), largest)
        }
        None => (None, 1.0),
    };
    // Decimal fractions that add up to 1 may add up to a little more in binary.
    if (albedo * largest + reflectance).max_channel() > 1.0 + 2.0 * f32::EPSILON {
        let place = table.albedo.as_ref().map(Spanned::span);
        return Err(match texture {
            Some((_, name)) => {
                let fault = format!(
                    "the texture of {object} reaches {largest}, with which more light would leave than arrives; lower `albedo`, which it is multiplied with"
                );
                source.fault(place.unwrap_or(name.span()), fault)
            }
            None => {
                let fault = format!(
                    "albedo and reflectance of {object} add up to more than 1, which would create light; lower one of them"
                );
                source.fault(place.unwrap_or_default(), fault)
            }
        });
    }
    Ok((albedo, texture.map(|(id, _)| id)))
}

fn metal(source: &Source, typed: &Typed<'_>, table: &MaterialTable) -> Result<Specular, Error> {
    let object = typed.object;
    if let Some(preset) = &table.preset {
        if let Some(own) = table.eta.as_ref().or(table.k.as_ref()) {
            let fault = format!("{object} has a preset and values of its own; keep one of the two");
            return Err(source.fault(own.span(), fault));
        }
        let found = METALS.iter().find(|(name, ..)| name == preset.get_ref());
        let Some(&(_, eta, k)) = found else {
            let fault = format!(
                "{object} names the unknown preset \"{}\"; the presets are {}",
                preset.get_ref(),
                list(&METALS.map(|(name, ..)| name))
            );
            return Err(source.fault(preset.span(), fault));
        };
        return Ok(Specular::Metal { eta: eta.into(), k: k.into() });
    }
    if table.eta.is_none() && table.k.is_none() {
        let fault = format!("{object} of type \"metal\" needs the keys `eta` and `k`, or `preset`");
        return Err(source.fault(typed.kind.span(), fault));
    }
    let value = |written: &Option<Spanned<_>>, key: &str| {
        let written = typed.need(written, key)?;
        let what = format!("the {key} of {object}");
        let value = source.amount(written, &what)?;
        // Real metals stay below 20; the fourth powers in Fresnel's equations must fit.
        if value.max_channel() > 1000.0 {
            return Err(
                source.fault(written.span(), format!("{what} is too large; use at most 1000"))
            );
        }
        Ok((value, written.span(), what))
    };
    let (eta, eta_span, what) = value(&table.eta, "eta")?;
    let (k, ..) = value(&table.k, "k")?;
    if eta.min_channel() < 1e-3 {
        let fault = format!("{what} is too small; use at least 0.001 in every channel");
        return Err(source.fault(eta_span, fault));
    }
    Ok(Specular::Metal { eta, k })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fresnel_conductor;

    #[test]
    fn presets_have_the_color_of_their_metal() {
        // Reflectance at normal incidence, ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2).
        let expected = [
            ("gold", [0.944, 0.776, 0.373]),
            ("silver", [0.961, 0.948, 0.921]),
            ("copper", [0.925, 0.721, 0.504]),
            ("aluminium", [0.912, 0.914, 0.920]),
        ];
        for (name, reflectance) in expected {
            let &(_, eta, k) = METALS.iter().find(|m| m.0 == name).unwrap();
            let f = fresnel_conductor(1.0, eta.into(), k.into()).to_array();
            for (f, expected) in f.into_iter().zip(reflectance) {
                assert!((f - expected).abs() < 2e-3, "{name}: {f}, not {expected}");
            }
        }
    }
}
