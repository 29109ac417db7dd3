//! The scene file's text: reading it, and checks of its values that know where each stands.

use std::ops::Range;
use std::path::{Path, PathBuf};

use base::Rgb;
use glam::{DVec3, Vec3};
use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};
use toml::Spanned;

use super::reach::Reach;
use crate::Error;

/// No coordinate or length may be larger: the squares of areas must fit single precision.
pub(super) const MAX_LENGTH: f32 = 1e8;

/// No radiance, intensity or irradiance may be larger: fluxes and their sums must fit single precision.
pub(super) const MAX_LIGHT: f32 = 1e15;

/// A color as written: one number for gray, or red, green and blue.
#[derive(Clone, Copy, Debug)]
pub(super) struct Color(pub(super) [f64; 3]);

impl<'de> Deserialize<'de> for Color {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Numbers("a number or three numbers [r, g, b]")).map(Self)
    }
}

/// Factors along the axes as written: one number for all, or one each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factors(pub(super) [f64; 3]);

impl<'de> Deserialize<'de> for Factors {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Numbers("a number or three numbers [x, y, z]")).map(Self)
    }
}

struct Numbers(&'static str);

impl<'de> Visitor<'de> for Numbers {
    type Value = [f64; 3];

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0)
    }

    fn visit_f64<E>(self, v: f64) -> Result<Self::Value, E> {
        Ok([v; 3])
    }

    fn visit_i64<E>(self, v: i64) -> Result<Self::Value, E> {
        Ok([v as f64; 3])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
        let mut values = [0.0; 3];
        for (n, value) in values.iter_mut().enumerate() {
            *value = seq
                .next_element()?
                .ok_or_else(|| serde::de::Error::invalid_length(n, &Self(self.0)))?;
        }
        match seq.next_element::<f64>()? {
            Some(_) => Err(serde::de::Error::invalid_length(4, &Self(self.0))),
            None => Ok(values),
        }
    }
}

/// The text of the scene file.
#[derive(Debug)]
pub(super) struct Source {
    path: PathBuf,
    text: String,
    reach: Reach,
}

impl Source {
    /// Reads the file; what it names must be in reach as well as itself.
    pub(super) fn read(path: &Path, reach: &Reach) -> Result<Self, Error> {
        let bytes =
            reach.bytes(path).map_err(|cause| Error::Read { path: path.to_path_buf(), cause })?;
        Self::new(path, bytes, reach)
    }

    /// The text with these bytes, which come from the file.
    pub(super) fn new(path: &Path, bytes: Vec<u8>, reach: &Reach) -> Result<Self, Error> {
        let reach = reach.clone();
        let text = String::from_utf8(bytes).map_err(|e| {
            let good = e.utf8_error().valid_up_to();
            let before = String::from_utf8_lossy(&e.as_bytes()[..good]).into_owned();
            let source = Self { path: path.to_path_buf(), text: before, reach: reach.clone() };
            source.fault(good..good, "the text is not UTF-8; save it in that encoding")
        })?;
        Ok(Self { path: path.to_path_buf(), text, reach })
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// What the file may name.
    pub(super) fn reach(&self) -> &Reach {
        &self.reach
    }

    /// A path in the file is relative to the file.
    pub(super) fn resolve(&self, relative: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(relative)
    }

    /// Something is wrong with the bytes of `span`.
    pub(super) fn fault(&self, span: Range<usize>, fault: impl Into<String>) -> Error {
        let start = self.text.floor_char_boundary(span.start);
        let before = &self.text[..start];
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        let line = before.matches('\n').count() + 1;
        let column = before[line_start..].chars().count() + 1;
        Error::at(&self.path, line, column, fault)
    }

    /// Something is wrong at a byte of a line, both counted from 1.
    pub(super) fn fault_at_line(&self, line: usize, byte: usize, fault: String) -> Error {
        let before: usize =
            self.text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
        let start = (before + byte.saturating_sub(1)).min(self.text.len());
        self.fault(start..start, fault)
    }

    /// Something about the bytes of `span` that the user should know.
    pub(super) fn warning(&self, span: Range<usize>, warning: impl Into<String>) -> String {
        self.fault(span, warning).to_string()
    }

    /// Something is wrong with the scene as a whole.
    pub(super) fn fault_of_whole(&self, fault: impl Into<String>) -> Error {
        Error::whole(&self.path, fault)
    }

    /// What toml has to say, in the words of scene files.
    pub(super) fn syntax(&self, error: &toml::de::Error) -> Error {
        let fault = error
            .message()
            .replace("unknown field", "unknown key")
            .replace("missing field", "missing key")
            .replace("expected f64", "expected a number");
        self.fault(error.span().unwrap_or(0..0), fault)
    }

    /// A finite number that single precision can hold.
    pub(super) fn number(&self, value: &Spanned<f64>, what: &str) -> Result<f32, Error> {
        let v = *value.get_ref();
        if v.is_finite() && v.abs() <= f64::from(f32::MAX) {
            Ok(v as f32)
        } else {
            Err(self.fault(value.span(), format!("{what} is {v}; give a finite number")))
        }
    }

    /// A position, or a vector of the size of the scene.
    pub(super) fn vector(&self, value: &Spanned<[f64; 3]>, what: &str) -> Result<Vec3, Error> {
        let v = DVec3::from_array(*value.get_ref());
        if !v.is_finite() {
            let fault = format!("{what} holds {}; give finite numbers", first_bad(v));
            return Err(self.fault(value.span(), fault));
        }
        if v.abs().max_element() > f64::from(MAX_LENGTH) {
            let fault = format!(
                "{what} is too far away; keep coordinates within {MAX_LENGTH:e}, such as by a larger unit of length"
            );
            return Err(self.fault(value.span(), fault));
        }
        Ok(v.as_vec3())
    }

    /// A unit vector along a direction of any length.
    pub(super) fn direction(&self, value: &Spanned<[f64; 3]>, what: &str) -> Result<DVec3, Error> {
        let v = DVec3::from_array(*value.get_ref());
        if !v.is_finite() {
            let fault = format!("{what} holds {}; give finite numbers", first_bad(v));
            return Err(self.fault(value.span(), fault));
        }
        // Scaled first, since the square of the length may not fit.
        let largest = v.abs().max_element();
        if largest < f64::MIN_POSITIVE {
            return Err(self.fault(value.span(), format!("{what} has no length; give a direction")));
        }
        Ok((v / largest).normalize())
    }

    /// A color that is never negative.
    fn color(&self, value: &Spanned<Color>, what: &str) -> Result<Rgb, Error> {
        let [r, g, b] = value.get_ref().0;
        let v = DVec3::new(r, g, b);
        if !v.is_finite() {
            let fault = format!("{what} holds {}; give finite numbers", first_bad(v));
            return Err(self.fault(value.span(), fault));
        }
        if v.min_element() < 0.0 {
            let fault = format!("{what} is negative; use 0 or more in every channel");
            return Err(self.fault(value.span(), fault));
        }
        // Adding zero turns -0 into 0.
        Ok(Rgb::new(r as f32 + 0.0, g as f32 + 0.0, b as f32 + 0.0))
    }

    /// A share of what arrives.
    pub(super) fn share(&self, value: &Spanned<Color>, what: &str) -> Result<Rgb, Error> {
        let color = self.color(value, what)?;
        if color.max_channel() > 1.0 {
            let fault = format!(
                "{what} is above 1, which would create light; use at most 1 in every channel"
            );
            return Err(self.fault(value.span(), fault));
        }
        Ok(color)
    }

    /// A color without an upper bound of its own: light, or a property of matter.
    pub(super) fn amount(&self, value: &Spanned<Color>, what: &str) -> Result<Rgb, Error> {
        let color = self.color(value, what)?;
        if color.max_channel() > MAX_LIGHT {
            let fault = format!("{what} is too large; use at most {MAX_LIGHT:e}");
            return Err(self.fault(value.span(), fault));
        }
        Ok(color)
    }
}

fn first_bad(v: DVec3) -> f64 {
    v.to_array().into_iter().find(|x| !x.is_finite()).unwrap_or(f64::NAN)
}
