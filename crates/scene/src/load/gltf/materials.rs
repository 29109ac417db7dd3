//! Materials: metallic-roughness and its extensions, as far as our bsdfs express them.
//!
//! What isn't metal is a diffuse base under a coat of `ior`, as rough as the material (section B.3 of the specification
//! mixes the same two by Fresnel's reflectance; the coat does so for light going in and coming out, so that it is reciprocal).
//! What is metal is a conductor whose reflectance is nearest to Schlick's. What lets light pass is a pane, or a body of
//! glass if it has a thickness.

use base::{Rgb, math};
use geometry::MaterialId;

use super::tables::{MaterialTable, TextureInfo};
use super::textures::{self, Role};
use super::{Context, name};
use crate::load::materials::IOR_RANGE;
use crate::load::source::MAX_LIGHT;
use crate::{Coat, Error, LEAST_ROUGHNESS, Material, Specular, TextureId, fresnel_conductor};

/// No index of refraction gives more.
const MAX_METAL: f32 = 0.998;

/// The material of an index, or the default, and which texture coordinates its surfaces need.
pub(super) fn material(
    context: &mut Context<'_>,
    index: Option<usize>,
    place: &str,
) -> Result<(MaterialId, Option<usize>), Error> {
    if let Some(known) = context.materials.get(&index) {
        return Ok(*known);
    }
    let file = context.file;
    let default = MaterialTable::default();
    let (table, place) = match index {
        Some(i) => {
            (file.get(&file.tables.materials, "materials", i, place)?, format!("materials[{i}]"))
        }
        None => (&default, "the default material".to_owned()),
    };
    let name = match index {
        Some(i) => name(&table.name, "material", i, &context.first_materials),
        None => "the default".to_owned(),
    };
    let mut reading = Reading { context, table, place, uv_set: None };
    let material = reading.material(name)?;
    let uv_set = reading.uv_set.filter(|_| material.is_textured());
    let id = context
        .assembly
        .add_material(material)
        .ok_or_else(|| file.fault("materials", "too many materials; use at most 65536"))?;
    context.materials.insert(index, (id, uv_set));
    Ok((id, uv_set))
}

/// A material being read.
struct Reading<'c, 'f> {
    context: &'c mut Context<'f>,
    table: &'c MaterialTable,
    place: String,
    /// The texture coordinates of its textures so far.
    uv_set: Option<usize>,
}

impl Reading<'_, '_> {
    fn material(&mut self, name: String) -> Result<Material, Error> {
        let pbr = &self.table.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor;
        let shares = [pbr.metallic_factor, pbr.roughness_factor];
        let is_share = |x: &f32| (0.0..=1.0).contains(x);
        if !pbr.base_color_factor.iter().chain(&shares).all(is_share) {
            let text =
                "its baseColorFactor, metallicFactor and roughnessFactor must lie between 0 and 1";
            return Err(self.fault(text));
        }
        self.refuse_extensions()?;
        if self.table.normal_texture.is_some() {
            let place = self.place.clone();
            self.context.warn(&place, "its normalTexture is left out; its surfaces stay smooth");
        }
        // Of a metal, light that passes has no way.
        let metallic =
            self.share("metallic", pbr.metallic_factor, &pbr.metallic_roughness_texture, 2)?;
        let metallic = self.one_or_other(metallic, "metallic", "it is metal", "it is no metal")?;
        let roughness =
            self.share("roughness", pbr.roughness_factor, &pbr.metallic_roughness_texture, 1)?;
        let transmission = match &self.table.extensions.transmission {
            Some(table) if !metallic => {
                if !is_share(&table.transmission_factor) {
                    return Err(self.fault("its transmissionFactor must lie between 0 and 1"));
                }
                let map = &table.transmission_texture;
                self.share("transmission", table.transmission_factor, map, 0)?
            }
            _ => 0.0,
        };
        let passes =
            self.one_or_other(transmission, "transmission", "it is clear", "it is opaque")?;
        let color = Rgb::new(r, g, b);
        let mut material = Material { roughness, ..Material::black(name) };
        if metallic {
            let color = color * self.mean_color("a metal")?;
            material.specular = conductor(color);
        } else if passes {
            material.specular = self.clear(color)?;
            if matches!(material.specular, Specular::Pane { .. }) && roughness >= LEAST_ROUGHNESS {
                self.refuse("rough panes aren't supported", "it is sharp")?;
                material.roughness = 0.0;
            }
        } else {
            material.albedo = color;
            material.albedo_texture = match &pbr.base_color_texture {
                Some(info) => self.texture(info, Role::Color)?,
                None => None,
            };
            material.specular = self.coat(roughness)?;
            if material.specular == Specular::None {
                material.roughness = 0.0;
            }
        }
        self.emission(&mut material)?;
        self.opacity(&mut material)?;
        Ok(material)
    }

    fn fault(&self, text: impl AsRef<str>) -> Error {
        self.context.file.fault(&self.place, text)
    }

    fn refuse(&mut self, what: &str, instead: &str) -> Result<(), Error> {
        self.context.refuse(&self.place, what, instead)
    }

    /// Layers that we have no bsdf for, unless a factor of 0 takes them away.
    fn refuse_extensions(&mut self) -> Result<(), Error> {
        let all = &self.table.extensions;
        let layers = [
            ("KHR_materials_unlit", &all.unlit, None),
            ("KHR_materials_pbrSpecularGlossiness", &all.specular_glossiness, None),
            ("KHR_materials_clearcoat", &all.clearcoat, Some("clearcoatFactor")),
            ("KHR_materials_sheen", &all.sheen, Some("sheenColorFactor")),
            ("KHR_materials_iridescence", &all.iridescence, Some("iridescenceFactor")),
            ("KHR_materials_anisotropy", &all.anisotropy, Some("anisotropyStrength")),
            ("KHR_materials_dispersion", &all.dispersion, Some("dispersion")),
            (
                "KHR_materials_diffuse_transmission",
                &all.diffuse_transmission,
                Some("diffuseTransmissionFactor"),
            ),
        ];
        for (name, value, factor) in layers {
            let Some(value) = value else { continue };
            let is_nothing = factor.is_some_and(|factor| match value.get(factor) {
                None => true,
                Some(serde_json::Value::Array(parts)) => {
                    parts.iter().all(|part| part.as_f64() == Some(0.0))
                }
                Some(number) => number.as_f64() == Some(0.0),
            });
            if !is_nothing {
                let instead = match name {
                    "KHR_materials_unlit" => "it is lit as any other",
                    _ => "it is left out",
                };
                self.refuse(&format!("{name} isn't supported"), instead)?;
            }
        }
        Ok(())
    }

    /// A number that is the same everywhere: a factor times a channel of a texture.
    fn share(
        &mut self,
        name: &str,
        factor: f32,
        map: &Option<TextureInfo>,
        channel: usize,
    ) -> Result<f32, Error> {
        let Some(info) = map else { return Ok(factor) };
        if factor == 0.0 {
            return Ok(0.0);
        }
        let mean = textures::mean(self.context, info, &self.place)?;
        if !mean.is_even[channel] {
            let what = format!("{name} that varies by a texture isn't supported");
            self.refuse(&what, "it is the mean of the texture")?;
        }
        Ok(factor * mean.channels[channel])
    }

    /// Whether a share is 1; what lies between 0 and 1 has no place here.
    fn one_or_other(
        &mut self,
        share: f32,
        name: &str,
        one: &str,
        zero: &str,
    ) -> Result<bool, Error> {
        let is_one = share >= 0.5;
        if share != 0.0 && share != 1.0 {
            let what = format!("{name} between 0 and 1 isn't supported");
            self.refuse(&what, if is_one { one } else { zero })?;
        }
        Ok(is_one)
    }

    /// What the texture of the base color shows on something that takes no texture.
    fn mean_color(&mut self, of: &str) -> Result<Rgb, Error> {
        let Some(info) = &self.table.pbr_metallic_roughness.base_color_texture else {
            return Ok(Rgb::ONE);
        };
        let mean = textures::mean(self.context, info, &self.place)?;
        if mean.is_even.contains(&false) {
            let what = format!("a texture on {of} isn't supported");
            self.refuse(&what, "its mean color is taken")?;
        }
        Ok(mean.color)
    }

    fn texture(&mut self, info: &TextureInfo, role: Role) -> Result<Option<TextureId>, Error> {
        let (id, set) = textures::texture(self.context, info, role, &self.place)?;
        if id.is_some() && *self.uv_set.get_or_insert(set) != set {
            let what = "textures with different texture coordinates aren't supported";
            self.refuse(what, "all have those of the first")?;
        }
        Ok(id)
    }

    fn ior(&self) -> Result<f32, Error> {
        let ior = self.table.extensions.ior.as_ref().map_or(1.5, |table| table.ior);
        if ior >= 1.0 && IOR_RANGE.contains(&ior) {
            return Ok(ior);
        }
        Err(self.fault(format!("its ior is {ior}; use 1 to {}", IOR_RANGE.end())))
    }

    /// What the reflections of a surface that isn't metal are multiplied with.
    fn specular(&mut self) -> Result<Rgb, Error> {
        let Some(table) = &self.table.extensions.specular else { return Ok(Rgb::ONE) };
        let [r, g, b] = table.specular_color_factor;
        let factor = Rgb::new(r, g, b) * table.specular_factor;
        if !(factor.is_finite() && factor.min_channel() >= 0.0) {
            return Err(
                self.fault("its specularFactor and specularColorFactor must not be negative")
            );
        }
        let has_texture =
            table.specular_texture.is_some() || table.specular_color_texture.is_some();
        if factor.is_black() || (factor == Rgb::ONE && !has_texture) {
            return Ok(factor);
        }
        let what = "KHR_materials_specular that is neither 0 nor 1 isn't supported";
        self.refuse(what, "reflections are multiplied by its factors, at most 1")?;
        Ok(factor.map(|x| x.min(1.0)))
    }

    /// The coat over a diffuse base.
    fn coat(&mut self, roughness: f32) -> Result<Specular, Error> {
        let (ior, reflectance) = (self.ior()?, self.specular()?);
        if ior == 1.0 || reflectance.is_black() {
            return Ok(Specular::None);
        }
        let roughness = if roughness < LEAST_ROUGHNESS { 0.0 } else { roughness };
        Ok(Specular::Coat(Coat::new(ior, reflectance, false, roughness)))
    }

    /// A pane, or a body if it has a thickness.
    fn clear(&mut self, color: Rgb) -> Result<Specular, Error> {
        let ior = self.ior()?;
        if self.specular()? != Rgb::ONE {
            self.refuse("glass without reflections isn't supported", "it has those of its ior")?;
        }
        let color = color * self.mean_color("glass")?;
        if color != Rgb::ONE {
            let what =
                "glass whose base color isn't white isn't supported (give it an attenuationColor)";
            self.refuse(what, "it is taken for white")?;
        }
        let Some(volume) = &self.table.extensions.volume else {
            return Ok(Specular::Pane { ior });
        };
        if volume.thickness_factor == 0.0 {
            return Ok(Specular::Pane { ior });
        }
        let [r, g, b] = volume.attenuation_color;
        let color = Rgb::new(r, g, b);
        let distance = volume.attenuation_distance.unwrap_or(f32::INFINITY);
        if color.to_array().iter().any(|x| !(0.0..=1.0).contains(x))
            || distance.is_nan()
            || distance <= 0.0
        {
            let text = "its attenuationColor must lie between 0 and 1, and its attenuationDistance above 0";
            return Err(self.fault(text));
        }
        // Light is left by the color after the distance; of black, less than any picture shows.
        let absorption = color.map(|x| -math::ln(x.max(1e-12)) / distance + 0.0);
        if absorption.max_channel() > MAX_LIGHT {
            return Err(self.fault("its attenuationDistance is too small"));
        }
        Ok(Specular::Glass { ior, absorption })
    }

    fn emission(&mut self, material: &mut Material) -> Result<(), Error> {
        let [r, g, b] = self.table.emissive_factor;
        let strength = &self.table.extensions.emissive_strength;
        let strength = strength.as_ref().map_or(1.0, |table| table.emissive_strength);
        let emission = Rgb::new(r, g, b) * strength;
        let is_light = emission.is_finite() && emission.min_channel() >= 0.0;
        if !is_light || emission.max_channel() > MAX_LIGHT {
            let text = format!("its emission must lie between 0 and {MAX_LIGHT:e}");
            return Err(self.fault(text));
        }
        if emission.is_black() {
            return Ok(());
        }
        if matches!(material.specular, Specular::Glass { .. } | Specular::Pane { .. }) {
            return self.refuse("glass that emits isn't supported", "its emission is left out");
        }
        material.emission = emission;
        if let Some(info) = &self.table.emissive_texture {
            material.emission_texture = self.texture(info, Role::Color)?;
        }
        if self.table.double_sided {
            let place = self.place.clone();
            self.context.warn(&place, "it emits light from its front side only");
        }
        Ok(())
    }

    fn opacity(&mut self, material: &mut Material) -> Result<(), Error> {
        let pbr = &self.table.pbr_metallic_roughness;
        let factor = pbr.base_color_factor[3];
        let map = &pbr.base_color_texture;
        let (opacity, texture) = match self.table.alpha_mode.as_deref() {
            None | Some("OPAQUE") => return Ok(()),
            Some("BLEND") => {
                let texture = map.as_ref().map(|info| self.texture(info, Role::Alpha));
                (factor, texture.transpose()?.flatten())
            }
            Some("MASK") => {
                let cutoff = self.table.alpha_cutoff.unwrap_or(0.5);
                let role = Role::Mask(factor, cutoff);
                match map {
                    Some(info) => (1.0, self.texture(info, role)?),
                    None => (if factor >= cutoff { 1.0 } else { 0.0 }, None),
                }
            }
            Some(other) => {
                return Err(self.fault(format!(
                    "its alphaMode \"{other}\" is unknown; the modes are OPAQUE, MASK and BLEND"
                )));
            }
        };
        if !material.emission.is_black() && (opacity < 1.0 || texture.is_some()) {
            let what = "a material that emits and lets light pass isn't supported";
            return self.refuse(what, "it is opaque");
        }
        (material.opacity, material.opacity_texture) = (opacity, texture);
        Ok(())
    }
}

/// The conductor that reflects that color at normal incidence and, in the mean over all angles, is nearest to Schlick's
/// approximation. Any index in a range may have a given reflectance (Gulbrandsen 2014).
fn conductor(color: Rgb) -> Specular {
    let [r, g, b] = color.to_array().map(|r| index_of_metal(r.clamp(0.0, MAX_METAL)));
    Specular::Metal { eta: Rgb::new(r.0, g.0, b.0), k: Rgb::new(r.1, g.1, b.1) }
}

/// Real and imaginary part of the index of refraction for a reflectance at normal incidence.
fn index_of_metal(r: f32) -> (f32, f32) {
    const STEPS: usize = 256;
    const ANGLES: usize = 32;
    let root = r.sqrt();
    let (least, most) = ((1.0 - r) / (1.0 + r), (1.0 + root) / (1.0 - root));
    let k_of = |n: f32| {
        let k2 = (r * (n + 1.0) * (n + 1.0) - (n - 1.0) * (n - 1.0)) / (1.0 - r);
        k2.max(0.0).sqrt()
    };
    let difference = |n: f32| -> f32 {
        let (eta, k) = (Rgb::splat(n), Rgb::splat(k_of(n)));
        (0..ANGLES)
            .map(|i| {
                // Light from all sides is spread evenly over squares of cosines.
                let cos = ((i as f32 + 0.5) / ANGLES as f32).sqrt();
                let schlick = r + (1.0 - r) * (1.0 - cos).powi(5);
                (fresnel_conductor(cos, eta, k).r - schlick).powi(2)
            })
            .sum()
    };
    // Even steps of the logarithm, since the range may be wide.
    let step = math::pow(most / least, 1.0 / STEPS as f32);
    let mut n = least;
    let mut best = (difference(n), n);
    for _ in 0..STEPS {
        n *= step;
        let found = difference(n);
        if found < best.0 {
            best = (found, n);
        }
    }
    (best.1, k_of(best.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metals_reflect_as_schlick_has_it() {
        assert_eq!(index_of_metal(0.0), (1.0, 0.0), "what reflects nothing is nothing");
        for r in [0.02, 0.2, 0.5, 0.8, 0.91, 0.95, 0.998] {
            let (eta, k) = index_of_metal(r);
            assert!(eta > 5e-4 && k >= 0.0 && eta.max(k) < 1000.0, "{r}: {eta} + {k} i");
            let reflected = |cos: f32| fresnel_conductor(cos, Rgb::splat(eta), Rgb::splat(k)).r;
            assert!((reflected(1.0) - r).abs() < 2e-3, "{r}: {}", reflected(1.0));
            let (mut mean, mut square) = (0.0, 0.0);
            for i in 0..100 {
                let cos = ((i as f32 + 0.5) / 100.0).sqrt();
                let off = reflected(cos) - (r + (1.0 - r) * (1.0 - cos).powi(5));
                (mean, square) = (mean + off / 100.0, square + off * off / 100.0);
            }
            // Between dielectrics and metals no index has Schlick's shape.
            assert!(mean.abs() < 0.012 && square.sqrt() < 0.022, "{r}: {mean}, {}", square.sqrt());
        }
    }
}
