//! MTL material libraries, read by tobj from lines that can do it no harm.
//!
//! tobj panics on colors of fewer than three numbers, gives up a whole library for one odd line, and takes NaN: every
//! line is checked, and written anew, before tobj sees it.

mod map;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use base::Rgb;

use super::lines::{Statement, TextFile, decode, statements};
use super::materials::IOR_RANGE;
use super::reach::Reach;
use crate::{Error, Material, Specular, Texture};
use map::Map;

/// The materials of one library.
#[derive(Debug)]
pub(super) struct Library {
    file: TextFile,
    entries: Vec<Entry>,
    /// Places in `entries`.
    by_name: BTreeMap<String, usize>,
}

#[derive(Debug)]
struct Entry {
    line: usize,
    material: tobj::Material,
    /// `Pr` of the PBR extension.
    roughness: Option<f32>,
    /// What colors the diffuse part, with its line.
    map: Option<(usize, Map)>,
    /// What tells which part of the surface is there, with its line.
    mask: Option<(usize, Map)>,
    /// What is ignored, told only if the material is used.
    warnings: Vec<String>,
}

/// What we make of a material.
#[derive(Debug)]
pub(super) struct Found {
    pub(super) material: Material,
    /// What colors it.
    pub(super) texture: Option<Texture>,
    /// What tells which part of its surfaces is there.
    pub(super) mask: Option<Texture>,
    /// What its author should know.
    pub(super) warnings: Vec<String>,
}

/// A material whose statements are being read.
#[derive(Default)]
struct Head {
    line: usize,
    name: String,
    map: Option<(usize, Map)>,
    mask: Option<(usize, Map)>,
    roughness: Option<f32>,
    warnings: Vec<String>,
}

impl Library {
    /// Reads a library.
    pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Self, Error> {
        let file = TextFile::new(path);
        let (mut clean, mut heads) = (String::new(), Vec::<Head>::new());
        let mut by_name = BTreeMap::new();
        for statement in statements(&decode(bytes)) {
            let line = statement.line;
            match statement.keyword() {
                "" => {}
                "newmtl" => {
                    let name = statement.name();
                    if name.is_empty() {
                        return Err(file.fault(line, "`newmtl` needs a name"));
                    }
                    if let Some(first) = by_name.insert(name.to_string(), heads.len()) {
                        let first = heads[first].line;
                        let fault = format!(
                            "material `{name}` is defined again, after line {first}; rename one"
                        );
                        return Err(file.fault(line, fault));
                    }
                    let name = name.to_string();
                    heads.push(Head { line, name, ..Head::default() });
                    // tobj tells materials apart by their order.
                    let _ = writeln!(clean, "newmtl {}", heads.len());
                }
                keyword => {
                    let Some(head) = heads.last_mut() else {
                        let fault = format!("`{keyword}` stands before any `newmtl`");
                        return Err(file.fault(line, fault));
                    };
                    match rewrite(&file, &statement, &head.name)? {
                        Rewritten::Clean(line) => clean += &line,
                        Rewritten::Roughness(roughness) => head.roughness = Some(roughness),
                        Rewritten::Ignored(why) => head.warnings.push(file.warning(line, why)),
                        Rewritten::Map(map) => {
                            let ignored = map.ignored("map_Kd", &head.name);
                            head.warnings.extend(ignored.map(|why| file.warning(line, why)));
                            head.map = Some((line, map));
                        }
                        Rewritten::Mask(map) => {
                            let ignored = map.ignored("map_d", &head.name);
                            head.warnings.extend(ignored.map(|why| file.warning(line, why)));
                            head.mask = Some((line, map));
                        }
                        Rewritten::Nothing => {}
                    }
                }
            }
        }
        let (materials, _) = tobj::load_mtl_buf(&mut clean.as_bytes())
            .map_err(|e| file.whole(format!("{e}; save the file anew")))?;
        let entries = heads
            .into_iter()
            .zip(materials)
            .map(|(Head { line, name, map, mask, roughness, warnings }, material)| Entry {
                line,
                material: tobj::Material { name, ..material },
                map,
                mask,
                roughness,
                warnings,
            })
            .collect();
        Ok(Self { file, entries, by_name })
    }

    /// The place of a material in the library.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        self.by_name.get(name).copied()
    }

    /// The names of all materials.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.by_name.keys().map(String::as_str)
    }

    /// What we make of material number `index`; its textures must be in reach.
    pub(super) fn material(&self, index: usize, reach: &Reach) -> Result<Found, Error> {
        let Entry { line, material, map, mask, roughness, warnings } = &self.entries[index];
        let name = &material.name;
        let fault = |text: String| self.file.fault(*line, text);
        let mut warnings = warnings.clone();
        let color = |c: Option<[f32; 3]>| c.map_or(Rgb::BLACK, Rgb::from);
        let (kd, ks, ke) =
            (color(material.diffuse), color(material.specular), color(material.emissive));
        let illum = material.illumination_model.unwrap_or(if ks.is_black() { 1 } else { 2 });
        let (mut albedo, mut reflectance) = (kd, Rgb::BLACK);
        if map.is_some() && material.diffuse.is_none() {
            albedo = Rgb::ONE;
        }
        let specular = match illum {
            0 | 1 => Specular::None,
            2 => {
                if !ks.is_black() {
                    let text =
                        "highlights (Ks with illum 2) are not rendered; use illum 3 for mirrors";
                    warnings.push(self.file.whole(text).to_string());
                }
                Specular::None
            }
            3 | 5 | 8 => {
                reflectance = ks;
                Specular::Mirror { reflectance }
            }
            4 | 6 | 7 | 9 => {
                albedo = Rgb::BLACK;
                let ior = material.optical_density.ok_or_else(|| {
                    fault(format!(
                        "material `{name}` is glass (illum {illum}) but has no index of refraction; add Ni, such as Ni 1.5"
                    ))
                })?;
                if !IOR_RANGE.contains(&ior) {
                    return Err(fault(format!(
                        "the Ni of material `{name}` is {ior}; indices of refraction lie between {} and {}",
                        IOR_RANGE.start(),
                        IOR_RANGE.end()
                    )));
                }
                if !ke.is_black() {
                    return Err(fault(format!(
                        "material `{name}` is glass (illum {illum}), which cannot emit; remove Ke or use illum 1"
                    )));
                }
                Specular::Glass { ior, absorption: Rgb::BLACK }
            }
            _ => {
                return Err(fault(format!(
                    "material `{name}` has illum {illum}, which is not supported; use 1 for diffuse, 3 for mirrors or 7 for glass"
                )));
            }
        };
        if roughness.is_some() && specular == Specular::None {
            let text = format!(
                "the Pr of material `{name}` is ignored; roughness is that of mirrors (illum 3) and glass (illum 7)"
            );
            warnings.push(self.file.warning(*line, text));
        }
        let is_glass = matches!(specular, Specular::Glass { .. });
        // Glass and lamps are there, whatever d says: many programs write it for glass, too.
        let may_be_masked = !is_glass && ke.is_black();
        let opacity =
            material.dissolve.filter(|_| may_be_masked).map_or(1.0, |d| d.clamp(0.0, 1.0));
        let mask = match mask {
            Some((line, map)) if may_be_masked => {
                let texture = map.read_linear(&self.file.path, reach);
                Some(texture.map_err(|fault| self.file.fault(*line, fault))?)
            }
            _ => None,
        };
        if (material.dissolve.is_some_and(|d| d < 1.0) || mask.is_some()) && !ke.is_black() {
            let text = format!("the d of material `{name}` is ignored, since it emits");
            warnings.push(self.file.warning(*line, text));
        }
        if albedo.is_black() && reflectance.is_black() && ke.is_black() && !is_glass {
            let text = format!("material `{name}` is black; give it Kd");
            warnings.push(self.file.warning(*line, text));
        }
        let texture = match map {
            Some((line, map)) if !albedo.is_black() => Some(
                map.read(&self.file.path, reach).map_err(|fault| self.file.fault(*line, fault))?,
            ),
            Some((line, _)) => {
                let text = format!(
                    "the map_Kd of material `{name}` is ignored, since there is no diffuse part that it could color"
                );
                warnings.push(self.file.warning(*line, text));
                None
            }
            None => None,
        };
        let largest = texture.as_ref().map_or(1.0, Texture::max);
        let total = (albedo * largest + reflectance).max_channel();
        let mut specular = specular;
        if total > 1.0 + 2.0 * f32::EPSILON {
            let text = format!(
                "material `{name}` would create light; its Kd and Ks are divided by {total}"
            );
            warnings.push(self.file.warning(*line, text));
            albedo = albedo / total;
            if let Specular::Mirror { reflectance } = &mut specular {
                *reflectance = *reflectance / total;
            }
        }
        let roughness = roughness.filter(|_| specular != Specular::None).unwrap_or(0.0);
        let (emission, black) = (ke, Material::black(name.clone()));
        let material = Material { albedo, specular, roughness, emission, opacity, ..black };
        Ok(Found { material, texture, mask, warnings })
    }
}

enum Rewritten {
    /// A line for tobj.
    Clean(String),
    /// Something that tobj doesn't know.
    Roughness(f32),
    /// Something that isn't rendered.
    Ignored(String),
    /// What colors the diffuse part.
    Map(Map),
    /// What tells which part is there.
    Mask(Map),
    Nothing,
}

/// Checks a statement of material `name`.
fn rewrite(file: &TextFile, statement: &Statement<'_>, name: &str) -> Result<Rewritten, Error> {
    let (keyword, line) = (statement.keyword(), statement.line);
    let clean = |text: String| Ok(Rewritten::Clean(format!("{keyword} {text}\n")));
    match keyword {
        "Ka" | "Kd" | "Ks" | "Ke" => {
            let [r, g, b] = color(file, statement, name)?;
            clean(format!("{r} {g} {b}"))
        }
        "Tf" => Ok(if color(file, statement, name)? == [1.0; 3] {
            Rewritten::Nothing
        } else {
            let text = format!(
                "the Tf of material `{name}` is ignored; use a scene file's glass with absorption"
            );
            Rewritten::Ignored(text)
        }),
        "Ni" | "Ns" | "d" | "Tr" => {
            let word = statement.words().find(|w| *w != "-halo").ok_or_else(|| {
                file.fault(line, format!("`{keyword}` of material `{name}` needs a number"))
            })?;
            let number = file.number(statement, word)? as f32;
            if keyword == "Tr" {
                return Ok(Rewritten::Clean(format!("d {}\n", 1.0 - number)));
            }
            clean(number.to_string())
        }
        "illum" => {
            let number = statement.words().next().and_then(|w| w.parse::<u8>().ok());
            let number = number.ok_or_else(|| {
                let fault = format!("`illum` of material `{name}` needs a number from 0 to 9");
                file.fault(line, fault)
            })?;
            clean(number.to_string())
        }
        "Pr" => {
            let word = statement.words().next().ok_or_else(|| {
                file.fault(line, format!("`Pr` of material `{name}` needs a number"))
            })?;
            let roughness = file.number(statement, word)?;
            if !(0.0..=1.0).contains(&roughness) {
                let fault = format!("the Pr of material `{name}` is {roughness}; use 0 to 1");
                return Err(file.fault(line, fault));
            }
            Ok(Rewritten::Roughness(roughness as f32))
        }
        "sharpness" => Ok(Rewritten::Nothing),
        "map_Kd" => match Map::parse(statement.name()) {
            Ok(map) => Ok(Rewritten::Map(map)),
            Err(fault) => Err(file.fault(line, format!("the map_Kd of material `{name}` {fault}"))),
        },
        "map_d" => match Map::parse(statement.name()) {
            Ok(map) => Ok(Rewritten::Mask(map)),
            Err(fault) => Err(file.fault(line, format!("the map_d of material `{name}` {fault}"))),
        },
        _ if is_map(keyword) => Ok(Rewritten::Ignored(format!(
            "only map_Kd and map_d are rendered; the {keyword} of material `{name}` is ignored"
        ))),
        _ => Ok(Rewritten::Ignored(format!(
            "`{keyword}` of material `{name}` is not supported and ignored"
        ))),
    }
}

fn color(file: &TextFile, statement: &Statement<'_>, name: &str) -> Result<[f32; 3], Error> {
    let (keyword, line) = (statement.keyword(), statement.line);
    let words: Vec<_> = statement.words().collect();
    let color = match words.as_slice() {
        [form @ ("spectral" | "xyz"), ..] => {
            return Err(file.fault(
                line,
                format!("the {keyword} of material `{name}` is given as `{form}`; give red, green and blue"),
            ));
        }
        [gray] => [file.number(statement, gray)?; 3],
        [r, g, b] => {
            [file.number(statement, r)?, file.number(statement, g)?, file.number(statement, b)?]
        }
        _ => {
            return Err(file.fault(
                line,
                format!(
                    "the {keyword} of material `{name}` needs one number or three, not {}",
                    words.len()
                ),
            ));
        }
    };
    if color.iter().any(|&c| c < 0.0) {
        let fault = format!("the {keyword} of material `{name}` is negative; use 0 or more");
        return Err(file.fault(line, fault));
    }
    if color.iter().any(|&c| c > 1e15) {
        let fault = format!("the {keyword} of material `{name}` is too large; use at most 1e15");
        return Err(file.fault(line, fault));
    }
    Ok(color.map(|c| c as f32))
}

fn is_map(keyword: &str) -> bool {
    const OTHERS: [&str; 5] = ["bump", "disp", "decal", "refl", "norm"];
    keyword.starts_with("map_") || OTHERS.contains(&keyword)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The only material of a library, and its warnings.
    fn material(lines: &str) -> Result<(Material, Vec<String>), String> {
        let text = format!("newmtl a\n{lines}\n");
        Library::read(Path::new("l.mtl"), text.as_bytes())
            .and_then(|library| library.material(0, &Reach::Everything))
            .map(|Found { material, warnings, .. }| (material, warnings))
            .map_err(|e| e.to_string())
    }

    fn clean(lines: &str) -> Material {
        let (material, warnings) = material(lines).unwrap();
        assert!(warnings.is_empty(), "{lines}: {warnings:?}");
        material
    }

    #[test]
    fn illumination_models() {
        let kd = Rgb::new(0.5, 0.25, 0.125);
        for illum in ["", "illum 0", "illum 1"] {
            let m = clean(&format!("Kd 0.5 0.25 0.125\nKa 1 1 1\n{illum}"));
            assert_eq!((m.albedo, m.specular), (kd, Specular::None));
        }
        for illum in [3, 5, 8] {
            let m = clean(&format!("Kd 0.5 0.25 0.125\nKs 0.25\nillum {illum}"));
            let reflectance = Rgb::splat(0.25);
            assert_eq!((m.albedo, m.specular), (kd, Specular::Mirror { reflectance }));
        }
        for illum in [4, 6, 7, 9] {
            let m = clean(&format!("Kd 0.5\nKs 1\nd 0.1\nTf 1\nNi 1.33\nillum {illum}"));
            let glass = Specular::Glass { ior: 1.33, absorption: Rgb::BLACK };
            assert_eq!((m.albedo, m.specular), (Rgb::BLACK, glass));
        }
        assert_eq!(clean("Ks 1\nPr 0.5\nillum 3").roughness, 0.5);
        assert_eq!(clean("Ni 1.5\nPr 0.25\nillum 7").roughness, 0.25);
        for half in ["d 0.5", "d -halo 0.5", "Tr 0.5"] {
            assert_eq!(clean(&format!("Kd 0.5\n{half}")).opacity, 0.5);
        }
        let m = clean("Kd 0.5\nKe 3 2 1");
        assert_eq!(m.emission, Rgb::new(3.0, 2.0, 1.0));
        assert_eq!(m.name, "a");
    }

    #[test]
    fn short_colors_are_gray() {
        // tobj alone panics on this line.
        assert_eq!(clean("Kd 0.5").albedo, Rgb::splat(0.5));
        assert_eq!(clean("Kd\t0.5 0.5\\\n 0.25 # comment").albedo, Rgb::new(0.5, 0.5, 0.25));
    }

    #[test]
    fn foreign_encodings_do_no_harm() {
        let bytes = b"# \xa9 caf\xe9\r\nnewmtl b\xe9ton\r\nKd 1\r\n";
        let library = Library::read(Path::new("l.mtl"), bytes).unwrap();
        assert_eq!(library.find("b\u{fffd}ton"), Some(0));
    }

    #[test]
    fn what_is_ignored_is_told() {
        let cases = [
            (
                "Kd 0.5\nKs 0.5\nNs 10\nillum 2",
                "l.mtl: highlights (Ks with illum 2) are not rendered; use illum 3 for mirrors",
            ),
            ("Kd 0.5\nKe 1\nd 0.5", "l.mtl:1:1: the d of material `a` is ignored, since it emits"),
            ("Ka 0.5", "l.mtl:1:1: material `a` is black; give it Kd"),
            (
                "Kd 0.75\nKs 0.5\nillum 3",
                "l.mtl:1:1: material `a` would create light; its Kd and Ks are divided by 1.25",
            ),
            (
                "Kd 0.5\nbump -bm 0.1 -o 1 b.png",
                "l.mtl:3:1: only map_Kd and map_d are rendered; the bump of material `a` is ignored",
            ),
            (
                "Kd 0\nKe 1\nmap_Kd a.png",
                "l.mtl:4:1: the map_Kd of material `a` is ignored, since there is no diffuse part that it could color",
            ),
            (
                "illum 7\nNi 1.5\nmap_Kd -blendu off -mm 0 2 a.png",
                "l.mtl:4:1: the option -mm of the map_Kd of material `a` is ignored",
            ),
            ("Kd 0.5\nPm 1", "l.mtl:3:1: `Pm` of material `a` is not supported and ignored"),
            (
                "Kd 0.5\nPr 0.5",
                "l.mtl:1:1: the Pr of material `a` is ignored; roughness is that of mirrors (illum 3) and glass (illum 7)",
            ),
            (
                "illum 7\nNi 1.5\nTf 1 0 0",
                "l.mtl:4:1: the Tf of material `a` is ignored; use a scene file's glass with absorption",
            ),
        ];
        for (lines, expected) in cases {
            assert_eq!(material(lines).unwrap().1[0], expected);
        }
        let (scaled, _) = material("Kd 0.75\nKs 0.5\nillum 3").unwrap();
        assert!((scaled.albedo.r - 0.6).abs() < 1e-6);
        let Specular::Mirror { reflectance } = scaled.specular else { panic!("{scaled:?}") };
        assert!((reflectance.r - 0.4).abs() < 1e-6);
    }

    #[test]
    fn faults_name_material_and_line() {
        let cases = [
            (
                "Kd spectral file.rfl 1",
                "l.mtl:2:1: the Kd of material `a` is given as `spectral`; give red, green and blue",
            ),
            (
                "Ks xyz 1 1 1",
                "l.mtl:2:1: the Ks of material `a` is given as `xyz`; give red, green and blue",
            ),
            ("Kd 1 1", "l.mtl:2:1: the Kd of material `a` needs one number or three, not 2"),
            ("Kd", "l.mtl:2:1: the Kd of material `a` needs one number or three, not 0"),
            ("Kd 1 x 1", "l.mtl:2:1: `x` after `Kd` is no number"),
            ("Kd nan", "l.mtl:2:1: `Kd` holds NaN; give finite numbers"),
            ("Kd -1", "l.mtl:2:1: the Kd of material `a` is negative; use 0 or more"),
            ("Ke 1e20", "l.mtl:2:1: the Ke of material `a` is too large; use at most 1e15"),
            ("Pr", "l.mtl:2:1: `Pr` of material `a` needs a number"),
            ("Pr 1.5", "l.mtl:2:1: the Pr of material `a` is 1.5; use 0 to 1"),
            ("Ni", "l.mtl:2:1: `Ni` of material `a` needs a number"),
            ("illum x", "l.mtl:2:1: `illum` of material `a` needs a number from 0 to 9"),
            (
                "illum 7",
                "l.mtl:1:1: material `a` is glass (illum 7) but has no index of refraction; add Ni, such as Ni 1.5",
            ),
            (
                "illum 7\nNi 0",
                "l.mtl:1:1: the Ni of material `a` is 0; indices of refraction lie between 0.1 and 10",
            ),
            (
                "illum 7\nNi 1.5\nKe 1",
                "l.mtl:1:1: material `a` is glass (illum 7), which cannot emit; remove Ke or use illum 1",
            ),
            (
                "illum 10",
                "l.mtl:1:1: material `a` has illum 10, which is not supported; use 1 for diffuse, 3 for mirrors or 7 for glass",
            ),
            ("map_Kd -s 2 x.png", "l.mtl:2:1: cannot read x.png: there is no such file"),
            ("map_Kd -s 2 2", "l.mtl:2:1: the map_Kd of material `a` names no file"),
            ("newmtl", "l.mtl:2:1: `newmtl` needs a name"),
            (
                "newmtl b\nnewmtl a",
                "l.mtl:3:1: material `a` is defined again, after line 1; rename one",
            ),
        ];
        for (lines, expected) in cases {
            assert_eq!(material(lines).unwrap_err(), expected);
        }
        let early = Library::read(Path::new("l.mtl"), b"Kd 1\n").unwrap_err();
        assert_eq!(early.to_string(), "l.mtl:1:1: `Kd` stands before any `newmtl`");
    }
}
