//! Bsdfs.

use base::Rgb;
use geometry::MaterialId;

use super::plugin::{Plugin, color};
use super::spectrum::Quantity;
use super::textures::texture;
use super::xml::Element;
use super::{Context, MAX_REFERENCES, bits};
use crate::load::keys::list;
use crate::load::materials::IOR_RANGE;
use crate::{Coat, Error, LEAST_ROUGHNESS, Material, Specular, TextureId};

/// Mitsuba's names of metals, with eta and k as it reduces its measurements to red, green and blue (version 3.9).
const CONDUCTORS: [(&str, [f32; 3], [f32; 3]); 5] = [
    ("Ag", [0.155276, 0.116728, 0.138388], [4.82835, 3.12222, 2.1469]),
    ("Al", [1.6575, 0.880405, 0.521244], [9.22381, 6.2695, 4.837]),
    ("Au", [0.143036, 0.375307, 1.44205], [3.983, 2.38556, 1.60336]),
    ("Cr", [4.36967, 2.91651, 1.6549], [5.20655, 4.23131, 3.7547]),
    ("Cu", [0.201005, 0.92375, 1.10222], [3.91326, 2.45305, 2.14209]),
];

/// Mitsuba's names of dielectrics, with their indices of refraction.
const DIELECTRICS: [(&str, f64); 20] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water ice", 1.31),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("fused quartz", 1.458),
    ("carbon tetrachloride", 1.461),
    ("pyrex", 1.47),
    ("glycerol", 1.4729),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("benzene", 1.501),
    ("bk7", 1.5046),
    ("silicone oil", 1.520_45),
    ("sodium chloride", 1.544),
    ("diamond", 2.419),
];

/// The material of a shape whose bsdf this is, if it has any, and whose surface emits that much.
pub(super) fn material<'d>(
    context: &mut Context<'d>,
    shape: &'d Element,
    bsdf: Option<&'d Element>,
    (emission, emission_texture): (Rgb, Option<TextureId>),
    on_sphere: bool,
) -> Result<MaterialId, Error> {
    let element = bsdf.unwrap_or(shape);
    let key = (element.place, on_sphere, bits(emission), emission_texture.map(|id| id.0));
    if let Some(&id) = context.materials.get(&key) {
        return Ok(id);
    }
    let looks = match bsdf {
        Some(bsdf) => looks(context, bsdf, on_sphere, 0)?,
        // As Mitsuba has it.
        None => Looks { albedo: Rgb::splat(0.5), ..Looks::default() },
    };
    if !emission.is_black()
        && matches!(looks.specular, Specular::Glass { .. } | Specular::Pane { .. })
    {
        let fault = "a shape of glass cannot emit; give the emitter to another one";
        return Err(context.document.fault(shape.place, fault));
    }
    let mut name = context.name(element, context.assembly.materials.len() + 1);
    if context.assembly.materials.iter().any(|m| m.name == name) {
        name = format!("{name}, {}", context.assembly.materials.len() + 1);
    }
    let Looks { albedo, albedo_texture, specular, roughness, opacity, opacity_texture } = looks;
    if !emission.is_black() && (opacity < 1.0 || opacity_texture.is_some()) {
        let fault = "a shape with a mask cannot emit; give the emitter to another one";
        return Err(context.document.fault(shape.place, fault));
    }
    let material = Material {
        albedo,
        albedo_texture,
        specular,
        roughness,
        emission,
        emission_texture,
        opacity,
        opacity_texture,
        ..Material::black(name)
    };
    let id = context.assembly.add_material(material).ok_or_else(|| {
        context.document.fault(element.place, "too many materials; use at most 65536")
    })?;
    context.materials.insert(key, id);
    Ok(id)
}

/// What a bsdf comes to.
struct Looks {
    albedo: Rgb,
    albedo_texture: Option<TextureId>,
    specular: Specular,
    roughness: f32,
    opacity: f32,
    opacity_texture: Option<TextureId>,
}

impl Default for Looks {
    fn default() -> Self {
        Self {
            albedo: Rgb::BLACK,
            albedo_texture: None,
            specular: Specular::None,
            roughness: 0.0,
            opacity: 1.0,
            opacity_texture: None,
        }
    }
}

fn looks<'d>(
    context: &mut Context<'d>,
    element: &'d Element,
    on_sphere: bool,
    n_above: usize,
) -> Result<Looks, Error> {
    let plugin = Plugin::new(context, element)?;
    if n_above == MAX_REFERENCES {
        let fault = format!("{} refers to itself", plugin.title());
        return Err(context.document.fault(element.place, fault));
    }
    let looks = match plugin.kind {
        "diffuse" => diffuse(context, &plugin, "reflectance", on_sphere)?,
        "dielectric" => {
            full(context, &plugin, &["specular_reflectance", "specular_transmittance"])?;
            glass(context, &plugin)?
        }
        "conductor" => Looks { specular: conductor(context, &plugin)?, ..Looks::default() },
        // Our surfaces have two equal sides.
        "twosided" => return inner(context, &plugin, on_sphere, n_above),
        "mask" => masked(context, &plugin, on_sphere, n_above)?,
        "bumpmap" | "normalmap" => {
            let text = format!("{} is left out; its surface stays smooth", plugin.title());
            let warning = context.document.fault(element.place, text).to_string();
            if !context.assembly.warnings.contains(&warning) {
                context.assembly.warnings.push(warning);
            }
            return inner(context, &plugin, on_sphere, n_above);
        }
        "roughconductor" => {
            let roughness = roughness(context, &plugin)?;
            Looks { specular: conductor(context, &plugin)?, roughness, ..Looks::default() }
        }
        "roughdielectric" => {
            full(context, &plugin, &["specular_reflectance", "specular_transmittance"])?;
            Looks { roughness: roughness(context, &plugin)?, ..glass(context, &plugin)? }
        }
        "thindielectric" => {
            full(context, &plugin, &["specular_reflectance", "specular_transmittance"])?;
            let ior = relative_ior(context, &plugin, "bk7")?;
            Looks { specular: Specular::Pane { ior }, ..Looks::default() }
        }
        "plastic" => plastic(context, &plugin, 0.0, on_sphere)?,
        "roughplastic" => {
            let roughness = roughness(context, &plugin)?;
            plastic(context, &plugin, roughness, on_sphere)?
        }
        "phong" | "ward" | "coating" | "difftrans" => {
            instead(context, &plugin, "only its diffuse part is taken")?;
            return diffuse(context, &plugin, "diffuse_reflectance", on_sphere);
        }
        _ => {
            let known = [
                "diffuse",
                "dielectric",
                "thindielectric",
                "conductor",
                "roughdielectric",
                "roughconductor",
                "plastic",
                "roughplastic",
                "mask",
                "twosided",
            ];
            let fault =
                format!("{} isn't supported; the bsdfs are {}", plugin.title(), list(&known));
            return Err(context.document.fault(element.place, fault));
        }
    };
    plugin.finish(context)?;
    Ok(looks)
}

fn instead(context: &mut Context<'_>, plugin: &Plugin<'_>, instead: &str) -> Result<(), Error> {
    context.refuse(plugin.element.place, &format!("{} isn't supported", plugin.title()), instead)
}

/// The bsdf in another one.
fn inner<'d>(
    context: &mut Context<'d>,
    plugin: &Plugin<'d>,
    on_sphere: bool,
    n_above: usize,
) -> Result<Looks, Error> {
    let nested = plugin.nested(context, &["bsdf"])?;
    let Some(first) = nested.first() else {
        let fault = format!("{} needs a bsdf in it", plugin.title());
        return Err(context.document.fault(plugin.element.place, fault));
    };
    if let Some(second) = nested.get(1) {
        let what = "sides of two materials aren't supported";
        context.refuse(second.place, what, "both are of the first")?;
    }
    looks(context, first, on_sphere, n_above + 1)
}

/// What is in a mask, as far as it is there.
fn masked<'d>(
    context: &mut Context<'d>,
    plugin: &Plugin<'d>,
    on_sphere: bool,
    n_above: usize,
) -> Result<Looks, Error> {
    let looks = inner(context, plugin, on_sphere, n_above)?;
    let Some(written) = plugin.get(&["opacity"]) else {
        // As Mitsuba has it.
        return Ok(Looks { opacity: 0.5 * looks.opacity, ..looks });
    };
    let target = context.resolve(written)?;
    if target.tag == "texture" {
        if looks.opacity_texture.is_some() {
            let fault = "a mask in a mask has a texture, too; keep one of them";
            return Err(context.document.fault(written.place, fault));
        }
        let id = texture(context, target, on_sphere)?;
        return Ok(Looks { opacity_texture: Some(id), ..looks });
    }
    let opacity = color(context, target, Quantity::Matter)?.mean();
    if opacity > 1.0 {
        let fault = format!("`opacity` of {} is {opacity}; use 0 to 1", plugin.title());
        return Err(context.document.fault(written.place, fault));
    }
    Ok(Looks { opacity: opacity * looks.opacity, ..looks })
}

/// A coat over a diffuse base.
fn plastic<'d>(
    context: &mut Context<'d>,
    plugin: &Plugin<'d>,
    roughness: f32,
    on_sphere: bool,
) -> Result<Looks, Error> {
    let base = diffuse(context, plugin, "diffuse_reflectance", on_sphere)?;
    let ior = relative_ior(context, plugin, "polypropylene")?;
    let is_nonlinear = plugin.boolean(context, "nonlinear")?;
    let reflectance = plugin.color(context, "specular_reflectance")?.unwrap_or(Rgb::ONE);
    if reflectance.max_channel() > 1.0 {
        let fault = format!("{} would create light; use at most 1", plugin.title());
        return Err(context.document.fault(plugin.element.place, fault));
    }
    let of_coat = if roughness < LEAST_ROUGHNESS { 0.0 } else { roughness };
    let coat = Coat::new(ior, reflectance, is_nonlinear, of_coat);
    Ok(Looks { specular: Specular::Coat(coat), roughness, ..base })
}

fn diffuse<'d>(
    context: &mut Context<'d>,
    plugin: &Plugin<'d>,
    name: &str,
    on_sphere: bool,
) -> Result<Looks, Error> {
    let Some(written) = plugin.get(&[name]) else {
        return Ok(Looks { albedo: Rgb::splat(0.5), ..Looks::default() });
    };
    let target = context.resolve(written)?;
    let (albedo, albedo_texture) = if target.tag == "texture" {
        (Rgb::ONE, Some(texture(context, target, on_sphere)?))
    } else {
        (color(context, target, Quantity::Matter)?, None)
    };
    let largest = match albedo_texture {
        Some(id) => context.assembly.textures[usize::from(id.0)].1.max(),
        None => albedo.max_channel(),
    };
    if largest > 1.0 {
        let fault = format!(
            "`{name}` of {} reaches {largest}, which would create light; use at most 1",
            plugin.title()
        );
        return Err(context.document.fault(written.place, fault));
    }
    Ok(Looks { albedo, albedo_texture, ..Looks::default() })
}

/// Factors that we have no place for must be 1.
fn full<'d>(context: &mut Context<'d>, plugin: &Plugin<'d>, names: &[&str]) -> Result<(), Error> {
    for name in names {
        if let Some(written) = plugin.get(&[name])
            && (written.tag == "texture"
                || written.tag == "ref"
                || color(context, written, Quantity::Matter)? != Rgb::ONE)
        {
            let what = format!("`{name}` of {} must be 1", plugin.title());
            context.refuse(written.place, &what, "it is taken for 1")?;
        }
    }
    Ok(())
}

fn glass(context: &Context<'_>, plugin: &Plugin<'_>) -> Result<Looks, Error> {
    let ior = relative_ior(context, plugin, "bk7")?;
    Ok(Looks { specular: Specular::Glass { ior, absorption: Rgb::BLACK }, ..Looks::default() })
}

/// The index of refraction of the inside relative to the outside.
fn relative_ior(context: &Context<'_>, plugin: &Plugin<'_>, inside: &str) -> Result<f32, Error> {
    let index = |name: &str, default: &str| -> Result<f64, Error> {
        let Some(written) = plugin.get(&[name]) else { return Ok(ior_of(default).unwrap_or(1.0)) };
        if written.tag != "string" {
            return Ok(plugin.number(context, name)?.unwrap_or(1.0));
        }
        let word = written.attribute("value").unwrap_or_default();
        ior_of(word).ok_or_else(|| {
            let fault = format!(
                "`{name}` is \"{word}\"; give a number, or one of {}",
                list(&DIELECTRICS.map(|d| d.0))
            );
            context.document.fault(written.place, fault)
        })
    };
    let ior = (index("int_ior", inside)? / index("ext_ior", "air")?) as f32;
    if !IOR_RANGE.contains(&ior) {
        let fault = format!(
            "the relative index of refraction of {} is {ior}; it lies between {} and {}",
            plugin.title(),
            IOR_RANGE.start(),
            IOR_RANGE.end()
        );
        return Err(context.document.fault(plugin.element.place, fault));
    }
    Ok(ior)
}

/// The roughness whose square is the width of microfacets.
fn roughness<'d>(context: &mut Context<'d>, plugin: &Plugin<'d>) -> Result<f32, Error> {
    let place = plugin.element.place;
    if plugin.string("distribution") != Some("ggx") {
        let what = format!("{} with microfacets by Beckmann isn't supported", plugin.title());
        context.refuse(place, &what, "they are taken as those of GGX")?;
    }
    // Which way samples are drawn changes no mean.
    plugin.get(&["sample_visible"]);
    let alpha = plugin.number(context, "alpha")?.unwrap_or(0.1);
    if !(0.0..=1.0).contains(&alpha) {
        let fault = format!("alpha of {} is {alpha}; use 0 to 1", plugin.title());
        return Err(context.document.fault(place, fault));
    }
    Ok(alpha.sqrt() as f32)
}

fn ior_of(name: &str) -> Option<f64> {
    let name = name.to_ascii_lowercase().replace('_', " ");
    DIELECTRICS.iter().find(|(known, _)| *known == name).map(|(_, ior)| *ior)
}

fn conductor<'d>(context: &mut Context<'d>, plugin: &Plugin<'d>) -> Result<Specular, Error> {
    let fault = |context: &Context<'_>, fault: String| {
        Err(context.document.fault(plugin.element.place, fault))
    };
    let (eta, k) = (plugin.color(context, "eta")?, plugin.color(context, "k")?);
    let material = plugin.string("material");
    if material == Some("none") {
        let reflectance = plugin.color(context, "specular_reflectance")?.unwrap_or(Rgb::ONE);
        if reflectance.max_channel() > 1.0 {
            return fault(context, format!("{} would create light; use at most 1", plugin.title()));
        }
        return Ok(Specular::Mirror { reflectance });
    }
    full(context, plugin, &["specular_reflectance"])?;
    match (eta, k, material) {
        (Some(eta), Some(k), None) => {
            if eta.min_channel() < 1e-3 || eta.max_channel().max(k.max_channel()) > 1000.0 {
                return fault(
                    context,
                    format!(
                        "eta of {} lies between 0.001 and 1000, and k up to 1000",
                        plugin.title()
                    ),
                );
            }
            Ok(Specular::Metal { eta, k })
        }
        (None, None, material) => {
            let material = material.unwrap_or("Cu");
            match CONDUCTORS.iter().find(|(name, ..)| *name == material) {
                Some(&(_, eta, k)) => Ok(Specular::Metal { eta: eta.into(), k: k.into() }),
                None => fault(
                    context,
                    format!(
                        "the metal \"{material}\" isn't known; give eta and k, or one of {} and none",
                        CONDUCTORS.map(|c| c.0).join(", ")
                    ),
                ),
            }
        }
        _ => fault(
            context,
            format!("{} needs either `material` or both `eta` and `k`", plugin.title()),
        ),
    }
}
