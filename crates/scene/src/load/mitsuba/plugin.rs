//! A plugin of a scene: its type, its parameters by name, and the promise that each of them is looked at.

use std::cell::RefCell;
use std::collections::BTreeSet;

use base::Rgb;
use film::decode_srgb;
use glam::{DAffine3, DMat3, DVec3};

use super::Context;
use super::spectrum::{Quantity, color_of_black_body, color_of_list};
use super::xml::{Element, Place};
use crate::Error;
use crate::load::keys::list;
use crate::load::source::MAX_LENGTH;
use crate::load::transform::{is_flat, rotation};

/// No value that is a light or a property of matter may be larger.
const MAX_AMOUNT: f64 = 1e15;

/// An element with a type.
pub(super) struct Plugin<'d> {
    pub(super) element: &'d Element,
    /// Such as `diffuse`.
    pub(super) kind: &'d str,
    used: RefCell<BTreeSet<Place>>,
}

impl<'d> Plugin<'d> {
    pub(super) fn new(context: &Context<'d>, element: &'d Element) -> Result<Self, Error> {
        let kind = element.attribute("type").ok_or_else(|| {
            let fault = format!("<{}> needs the attribute `type`", element.tag);
            context.document.fault(element.place, fault)
        })?;
        Ok(Self { element, kind, used: RefCell::default() })
    }

    /// How messages call it.
    pub(super) fn title(&self) -> String {
        format!("{} \"{}\"", self.element.tag, self.kind)
    }

    /// The parameter with one of these names, which are in the style of Mitsuba 3.
    pub(super) fn get(&self, names: &[&str]) -> Option<&'d Element> {
        let is_wanted = |child: &&Element| {
            child.attribute("name").is_some_and(|name| names.contains(&snake_case(name).as_str()))
        };
        let found = self.element.children.iter().find(is_wanted)?;
        self.used.borrow_mut().insert(found.place);
        Some(found)
    }

    /// Nested elements with one of these tags, references aside.
    pub(super) fn nested(
        &self,
        context: &Context<'d>,
        tags: &[&str],
    ) -> Result<Vec<&'d Element>, Error> {
        let mut found = Vec::new();
        for child in &self.element.children {
            let target = context.resolve(child)?;
            if tags.contains(&target.tag.as_str()) {
                self.used.borrow_mut().insert(child.place);
                found.push(target);
            }
        }
        Ok(found)
    }

    /// Refuses what nobody has looked at.
    pub(super) fn finish(&self, context: &mut Context<'d>) -> Result<(), Error> {
        for child in &self.element.children {
            if !self.used.borrow().contains(&child.place) {
                let name = child.attribute("name").map_or(format!("<{}>", child.tag), snake_case);
                let what = format!("{} takes no `{name}`", self.title());
                context.refuse(child.place, &what, "it is ignored")?;
            }
        }
        Ok(())
    }

    pub(super) fn string(&self, name: &str) -> Option<&'d str> {
        self.get(&[name])?.attribute("value")
    }

    pub(super) fn boolean(&self, context: &Context<'d>, name: &str) -> Result<bool, Error> {
        match self.get(&[name]) {
            None => Ok(false),
            Some(element) => match element.attribute("value") {
                Some("true") => Ok(true),
                Some("false") => Ok(false),
                _ => Err(context.document.fault(
                    element.place,
                    format!("`{name}` of {} must be true or false", self.title()),
                )),
            },
        }
    }

    pub(super) fn number(&self, context: &Context<'d>, name: &str) -> Result<Option<f64>, Error> {
        let Some(element) = self.get(&[name]) else { return Ok(None) };
        match numbers(context, element, "value")?.as_slice() {
            [number] => Ok(Some(*number)),
            _ => Err(context
                .document
                .fault(element.place, format!("`{name}` of {} must be one number", self.title()))),
        }
    }

    pub(super) fn count(&self, context: &Context<'d>, name: &str) -> Result<Option<u32>, Error> {
        let Some(number) = self.number(context, name)? else { return Ok(None) };
        if number.fract() == 0.0 && (0.0..=f64::from(1 << 24)).contains(&number) {
            return Ok(Some(number as u32));
        }
        let place = self.get(&[name]).map_or(self.element.place, |element| element.place);
        let fault = format!("`{name}` of {} is {number}; give a whole number", self.title());
        Err(context.document.fault(place, fault))
    }

    /// A position or a direction.
    pub(super) fn vector(&self, context: &Context<'d>, name: &str) -> Result<Option<DVec3>, Error> {
        let Some(element) = self.get(&[name]) else { return Ok(None) };
        let vector = triple(context, element, "value", 0.0)?;
        if vector.abs().max_element() > f64::from(MAX_LENGTH) {
            let fault = format!("`{name}` is too far away; keep coordinates within {MAX_LENGTH:e}");
            return Err(context.document.fault(element.place, fault));
        }
        Ok(Some(vector))
    }

    /// A map that isn't flat.
    pub(super) fn transform(&self, context: &Context<'d>) -> Result<DAffine3, Error> {
        let Some(element) = self.get(&["to_world"]) else { return Ok(DAffine3::IDENTITY) };
        let map = transform(context, element)?;
        if is_flat(&map) {
            let fault =
                format!("to_world of {} flattens it; every scale must differ from 0", self.title());
            return Err(context.document.fault(element.place, fault));
        }
        Ok(map)
    }

    /// A color, if there is one of this name.
    pub(super) fn color(&self, context: &Context<'d>, name: &str) -> Result<Option<Rgb>, Error> {
        let quantity = match self.element.tag.as_str() {
            "emitter" | "luminaire" => Quantity::Light,
            _ => Quantity::Matter,
        };
        let Some(element) = self.get(&[name]) else { return Ok(None) };
        color(context, context.resolve(element)?, quantity).map(Some)
    }
}

/// A color, without an upper bound of its own; spectra become colors by what they describe.
pub(super) fn color<'d>(
    context: &Context<'d>,
    element: &'d Element,
    quantity: Quantity,
) -> Result<Rgb, Error> {
    let fault = |fault: String| context.document.fault(element.place, fault);
    let value = element.attribute("value").unwrap_or_default().trim();
    let channels: Vec<f64> = match element.tag.as_str() {
        "rgb" | "srgb" if value.starts_with('#') => {
            let digits = &value[1..];
            let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6);
            let number =
                number.ok_or_else(|| fault(format!("`{value}` is no color such as #80ff00")))?;
            [16, 8, 0].map(|shift| f64::from(number >> shift & 255) / 255.0).to_vec()
        }
        "rgb" | "srgb" | "float" => numbers(context, element, "value")?,
        "blackbody" => return black_body(context, element),
        "spectrum" => match element.attribute("type") {
            Some("blackbody") => return black_body(context, element),
            Some(other) => {
                let text = format!("the spectrum \"{other}\" isn't supported; use blackbody");
                return Err(fault(text));
            }
            None if element.attribute("filename").is_none() && !value.contains(':') => {
                numbers(context, element, "value")?
            }
            None => {
                let list = wavelengths(context, element)?;
                return within_range(color_of_list(&list, quantity)).map_err(fault);
            }
        },
        other => {
            let known = ["rgb", "srgb", "float", "spectrum", "blackbody"];
            let name = element.attribute("name").unwrap_or(other);
            return Err(fault(format!(
                "`{name}` is a <{other}> that isn't supported; use {}",
                list(&known)
            )));
        }
    };
    let rgb = match channels.as_slice() {
        [gray] => [*gray; 3],
        [r, g, b] => [*r, *g, *b],
        _ => return Err(fault(format!("`{value}` is no color; give one number or three"))),
    };
    if rgb.iter().any(|c| !(0.0..=MAX_AMOUNT).contains(c)) {
        return Err(fault(format!("the color `{value}` must lie between 0 and {MAX_AMOUNT:e}")));
    }
    let linear = |c: f64| if element.tag == "srgb" { decode_srgb(c as f32) } else { c as f32 };
    Ok(Rgb::from(rgb.map(linear)))
}

fn within_range(color: Rgb) -> Result<Rgb, String> {
    if color.is_finite() && f64::from(color.max_channel()) <= MAX_AMOUNT {
        return Ok(color);
    }
    Err(format!("the color of the spectrum is too large; use at most {MAX_AMOUNT:e}"))
}

/// Pairs of a wavelength in nanometers and a value, rising; those of the attribute `value`, or a file with one in a line.
fn wavelengths(context: &Context<'_>, element: &Element) -> Result<Vec<(f64, f64)>, Error> {
    let fault = |fault: String| context.document.fault(element.place, fault);
    let text = match element.attribute("filename") {
        None => element.attribute("value").unwrap_or_default().to_owned(),
        Some(file) => {
            let source = context.document.source(element.place);
            let path = source.resolve(file);
            let bytes = (source.reach().bytes(&path))
                .map_err(|cause| fault(format!("cannot read {}: {cause}", path.display())))?;
            let text = String::from_utf8_lossy(&bytes);
            let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
            let pairs = lines.filter(|line| !line.is_empty());
            pairs.map(|line| line.replacen([' ', '\t'], ":", 1) + ",").collect()
        }
    };
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    let mut list: Vec<(f64, f64)> = Vec::new();
    for word in words {
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
        let pair = word.split_once(':').and_then(|(w, v)| Some((number(w)?, number(v)?)));
        let Some((wavelength, value)) = pair.filter(|pair| pair.1 >= 0.0) else {
            let word: String = word.chars().take(40).collect();
            return Err(fault(format!(
                "`{word}` is no entry of a spectrum; give a wavelength in nanometers and a value of at least 0, such as 550:0.2"
            )));
        };
        if list.last().is_some_and(|before| before.0 >= wavelength) {
            return Err(fault(format!(
                "the wavelengths of a spectrum must rise, unlike {wavelength}"
            )));
        }
        list.push((wavelength, value));
    }
    if list.len() < 2 {
        return Err(fault("a spectrum needs two wavelengths at least".into()));
    }
    Ok(list)
}

/// `<blackbody temperature="5000K" scale="2"/>` of version 0.6, or the same with nested numbers.
fn black_body(context: &Context<'_>, element: &Element) -> Result<Rgb, Error> {
    let fault = |fault: String| context.document.fault(element.place, fault);
    let number = |name: &str, default: Option<f64>| {
        let nested = element.children.iter().find(|c| c.attribute("name") == Some(name));
        let written = element.attribute(name).or_else(|| nested?.attribute("value"));
        let number = match written {
            None => default,
            Some(text) => text.trim_end_matches(['K', 'k']).trim().parse().ok(),
        };
        number.filter(|x: &f64| *x >= 0.0 && x.is_finite()).ok_or_else(|| {
            fault(format!(
                "a black body needs a {name} of at least 0, such as temperature=\"5000\""
            ))
        })
    };
    let known = |c: &&Element| matches!(c.attribute("name"), Some("temperature" | "scale"));
    if let Some(other) = element.children.iter().find(|c| !known(c)) {
        let name = other.attribute("name").unwrap_or(&other.tag);
        let text = format!("a black body takes no `{name}`; it has a temperature and a scale");
        return Err(context.document.fault(other.place, text));
    }
    let temperature = number("temperature", None)?;
    let scale = number("scale", Some(1.0))?;
    within_range(color_of_black_body(temperature) * scale as f32).map_err(fault)
}

/// Maps one after the other.
pub(super) fn transform(context: &Context<'_>, element: &Element) -> Result<DAffine3, Error> {
    let mut map = DAffine3::IDENTITY;
    for step in &element.children {
        let fault = |fault: String| context.document.fault(step.place, fault);
        let next = match step.tag.as_str() {
            "translate" => DAffine3::from_translation(triple(context, step, "value", 0.0)?),
            "scale" => DAffine3::from_scale(triple(context, step, "value", 1.0)?),
            "rotate" => {
                let axis = triple(context, step, "axis", 0.0)?;
                let Some(axis) = axis.try_normalize() else {
                    return Err(fault("the axis of a rotation has no length".into()));
                };
                let angle = numbers(context, step, "angle")?;
                let [angle] = angle.as_slice() else {
                    return Err(fault("a rotation needs one `angle`, in degrees".into()));
                };
                DAffine3::from_mat3(rotation(axis, *angle))
            }
            "lookat" => {
                let of = |name: &str| triple(context, step, name, 0.0);
                let (origin, target) = (of("origin")?, of("target")?);
                let up = if step.attribute("up").is_some() { of("up")? } else { DVec3::Y };
                let dir = (target - origin).try_normalize();
                let left = dir.and_then(|dir| up.cross(dir).try_normalize());
                let (Some(dir), Some(left)) = (dir, left) else {
                    let text =
                        "`lookat` needs a target apart from its origin, and an up vector across";
                    return Err(fault(text.into()));
                };
                DAffine3 {
                    matrix3: DMat3::from_cols(left, dir.cross(left), dir),
                    translation: origin,
                }
            }
            "matrix" => matrix(&numbers(context, step, "value")?).ok_or_else(|| {
                fault("a matrix has 9 or 16 numbers, and its last row is 0 0 0 1".into())
            })?,
            other => {
                let known = ["translate", "scale", "rotate", "lookat", "matrix"];
                return Err(fault(format!(
                    "<{other}> is no part of a transform; they are {}",
                    list(&known)
                )));
            }
        };
        map = next * map;
    }
    if map.is_finite() && map.translation.abs().max_element() <= f64::from(MAX_LENGTH) {
        Ok(map)
    } else {
        let fault = format!("the transform leaves the range of {MAX_LENGTH:e}");
        Err(context.document.fault(element.place, fault))
    }
}

/// A matrix by rows.
fn matrix(values: &[f64]) -> Option<DAffine3> {
    let at = |row: usize, column: usize| match values.len() {
        9 => {
            if row < 3 && column < 3 {
                values[3 * row + column]
            } else {
                0.0
            }
        }
        _ => values[4 * row + column],
    };
    let is_affine =
        values.len() == 9 || (values.len() == 16 && values[12..] == [0.0, 0.0, 0.0, 1.0]);
    is_affine.then(|| {
        let column = |i: usize| DVec3::new(at(0, i), at(1, i), at(2, i));
        DAffine3 {
            matrix3: DMat3::from_cols(column(0), column(1), column(2)),
            translation: column(3),
        }
    })
}

/// Three numbers of an attribute, or of `x`, `y` and `z`; one number stands for all of a scale.
fn triple(
    context: &Context<'_>,
    element: &Element,
    name: &str,
    default: f64,
) -> Result<DVec3, Error> {
    if element.attribute(name).is_none() {
        let one = |axis: &str| match element.attribute(axis) {
            None => Ok(default),
            Some(_) => numbers(context, element, axis).and_then(|n| match n.as_slice() {
                [number] => Ok(*number),
                _ => Err(context
                    .document
                    .fault(element.place, format!("`{axis}` must be one number"))),
            }),
        };
        return Ok(DVec3::new(one("x")?, one("y")?, one("z")?));
    }
    match numbers(context, element, name)?.as_slice() {
        [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
        [all] if element.tag == "scale" => Ok(DVec3::splat(*all)),
        _ => Err(context.document.fault(element.place, format!("`{name}` must be three numbers"))),
    }
}

/// Finite numbers of an attribute, set apart by blanks or commas.
pub(super) fn numbers(
    context: &Context<'_>,
    element: &Element,
    name: &str,
) -> Result<Vec<f64>, Error> {
    let text = element.attribute(name).unwrap_or_default();
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    words
        .map(|word| {
            word.parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(|| {
                let word: String = word.chars().take(40).collect();
                let fault = format!("`{word}` in <{}> is no finite number", element.tag);
                context.document.fault(element.place, fault)
            })
        })
        .collect()
}

/// `toWorld` and `intIOR` of version 0.6 as version 3 writes them: `to_world`, `int_ior`.
pub(super) fn snake_case(name: &str) -> String {
    let mut snake = String::with_capacity(name.len() + 4);
    let mut was_upper = true;
    for c in name.chars() {
        if c.is_ascii_uppercase() && !was_upper && !snake.ends_with('_') {
            snake.push('_');
        }
        was_upper = c.is_ascii_uppercase();
        snake.push(c.to_ascii_lowercase());
    }
    snake
}
