//! `map_Kd` and `map_d` and their options.

use std::path::Path;

use glam::{Affine2, Vec2};

use crate::load::image;
use crate::load::reach::Reach;
use crate::{Filter, Pattern, Texture, Wrap};

/// Factors and offsets beyond this are typing errors.
const MAX_PLACEMENT: f32 = 1e5;

/// An image, and how it lies on the surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    file: String,
    scale: Vec2,
    offset: Vec2,
    clamp: bool,
    /// Options that would change the picture.
    ignored: Vec<String>,
}

impl Map {
    /// The options and the file of a statement such as `-s 2 2 -clamp on my wood.png`; or what is wrong, behind the
    /// subject.
    pub(super) fn parse(statement: &str) -> Result<Self, String> {
        let mut map = Self {
            file: String::new(),
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            clamp: false,
            ignored: Vec::new(),
        };
        let mut rest = statement;
        while rest.starts_with('-') {
            let (option, values) = word(rest);
            let (values, tail) = values_of(option, values);
            rest = tail;
            match option {
                "-s" => map.scale = pair(option, &values, 1.0)?,
                "-o" => map.offset = pair(option, &values, 0.0)?,
                "-clamp" => map.clamp = values == ["on"],
                // They are hints for smaller copies of the image, which rays don't use.
                "-blendu" | "-blendv" | "-boost" | "-texres" => {}
                "-mm" if pair(option, &values, 1.0)? == Vec2::Y => {}
                "-t" if pair(option, &values, 0.0)? == Vec2::ZERO => {}
                "-cc" if values != ["on"] => {}
                _ => map.ignored.push(option.into()),
            }
        }
        map.file = rest.into();
        if map.file.is_empty() { Err("names no file".into()) } else { Ok(map) }
    }

    /// What the author of the material should know.
    pub(super) fn ignored<'a>(
        &'a self,
        keyword: &'a str,
        material: &'a str,
    ) -> impl Iterator<Item = String> + 'a {
        self.ignored.iter().map(move |option| {
            format!("the option {option} of the {keyword} of material `{material}` is ignored")
        })
    }

    /// The image of colors, which is looked for beside the library.
    pub(super) fn read(&self, library: &Path, reach: &Reach) -> Result<Texture, String> {
        self.texture(library, reach, false)
    }

    /// The same of an image whose values are meant as they are.
    pub(super) fn read_linear(&self, library: &Path, reach: &Reach) -> Result<Texture, String> {
        self.texture(library, reach, true)
    }

    fn texture(&self, library: &Path, reach: &Reach, is_linear: bool) -> Result<Texture, String> {
        let folder = library.parent().unwrap_or(Path::new(""));
        let mut path = folder.join(&self.file);
        // Some programs write the separators of another system.
        if !path.exists() && self.file.contains('\\') {
            path = folder.join(self.file.replace('\\', "/"));
        }
        let (size, texels) = image::read(reach, &path, is_linear)?;
        let wrap = if self.clamp { Wrap::Clamp } else { Wrap::Repeat };
        Ok(Texture {
            placement: Affine2::from_scale_angle_translation(self.scale, 0.0, self.offset),
            pattern: Pattern::Bitmap { size, texels, filter: Filter::Bilinear, wrap },
        })
    }
}

/// The first word of a text, and the rest.
fn word(text: &str) -> (&str, &str) {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}

/// The values of an option, and what follows them: at most so many, and behind the first only numbers.
fn values_of<'a>(option: &str, text: &'a str) -> (Vec<&'a str>, &'a str) {
    let most = match option {
        "-o" | "-s" | "-t" => 3,
        "-mm" => 2,
        _ => 1,
    };
    let (mut values, mut rest) = (Vec::new(), text);
    for i in 0..most {
        let (value, tail) = word(rest);
        if value.is_empty() || (i > 0 && value.parse::<f64>().is_err()) {
            break;
        }
        values.push(value);
        rest = tail;
    }
    (values, rest)
}

/// The first two of up to three numbers; those left out have a default.
fn pair(option: &str, values: &[&str], default: f32) -> Result<Vec2, String> {
    let number = |i: usize| match values.get(i) {
        None if i > 0 => Ok(default),
        value => value
            .and_then(|word| word.parse::<f32>().ok())
            .filter(|x| x.abs() <= MAX_PLACEMENT)
            .ok_or_else(|| format!("has an {option} without numbers within {MAX_PLACEMENT:e}")),
    };
    Ok(Vec2::new(number(0)?, number(1)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_come_before_the_file() {
        let map = |statement: &str| Map::parse(statement).unwrap();
        let plain = map("my wood.png");
        assert_eq!(
            (plain.file.as_str(), plain.scale, plain.offset),
            ("my wood.png", Vec2::ONE, Vec2::ZERO)
        );
        let all = map("-blendu on -s 2 3 1 -o 0.5 -clamp on -mm 0 1 -texres 512 2 wood.png");
        assert_eq!(
            (all.file.as_str(), all.scale, all.offset),
            ("2 wood.png", Vec2::new(2.0, 3.0), Vec2::X * 0.5)
        );
        assert!(all.clamp && all.ignored.is_empty());
        assert_eq!(map("-s 4 -clamp off a.png").scale, Vec2::new(4.0, 1.0));
        assert_eq!(map("-mm 0.1 1 -t 1 1 1 -imfchan r a.png").ignored, ["-mm", "-t", "-imfchan"]);
        assert_eq!(Map::parse("-s x a.png").unwrap_err(), "has an -s without numbers within 1e5");
        assert_eq!(Map::parse("-o 1e6 a.png").unwrap_err(), "has an -o without numbers within 1e5");
        for cut in ["", "-clamp", "-s 1 2 3", "-blendu on"] {
            assert_eq!(Map::parse(cut).unwrap_err(), "names no file");
        }
    }
}
