//! How pictures are made, but for mode and size: the same for all modes and sizes of a bench.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::programs;

/// Photons in an estimate of indirect light.
const GATHER: &str = "500";

/// Options of the programs. Runs with other settings can't be compared.
#[derive(clap::Args, Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Settings {
    /// Photons to emit from each light, such as 1M
    #[arg(long, value_name = "COUNT", default_value = "1M", value_parser = programs::parse_count_text)]
    pub(crate) photons: String,
    /// Shadow rays for each pixel and light
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(crate) shadow_rays: u32,
    /// Eye rays for each pixel: N x N
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub(crate) supersample: u32,
    /// Error that mode adaptive aims at
    #[arg(long, value_name = "E", default_value = USUAL_ERROR, value_parser = parse_error)]
    #[serde(default = "usual_error")]
    pub(crate) error: String,
}

/// What mode adaptive aims at when nothing is said.
const USUAL_ERROR: &str = "0.01";

fn usual_error() -> String {
    USUAL_ERROR.into()
}

/// The text of an error, as short as it can be, so that settings are compared as numbers are.
fn parse_error(text: &str) -> Result<String, String> {
    let error: f32 = text.parse().map_err(|_| "not a number".to_string())?;
    if error.is_finite() && error >= 0.0 {
        Ok(error.to_string())
    } else {
        Err("must be a finite number that isn't negative".into())
    }
}

impl Settings {
    /// Those of the tables: what the options are when nothing is said.
    pub(crate) fn usual() -> Self {
        Self { photons: "1M".into(), shadow_rays: 64, supersample: 1, error: usual_error() }
    }

    /// The options of `render-cached`, but for those that name files, mode and size.
    pub(crate) fn render_args(&self) -> Vec<String> {
        let mut args = vec!["--shadow-rays".into(), self.shadow_rays.to_string()];
        args.extend(["--gather".into(), GATHER.into()]);
        if self.supersample > 1 {
            args.extend(["--supersample".into(), self.supersample.to_string()]);
        }
        if self.error != USUAL_ERROR {
            args.extend(["--error".into(), self.error.clone()]);
        }
        args
    }

    /// What tells these settings from the usual ones, as part of the name of a folder: nothing for those.
    pub(crate) fn suffix(&self) -> String {
        let usual = Self::usual();
        let parts = [
            (self.photons != usual.photons, format!("-photons-{}", self.photons)),
            (self.shadow_rays != usual.shadow_rays, format!("-shadow-rays-{}", self.shadow_rays)),
            (self.supersample != usual.supersample, format!("-supersample-{}", self.supersample)),
            (self.error != usual.error, format!("-error-{}", self.error)),
        ];
        parts.into_iter().filter(|(is_other, _)| *is_other).map(|(_, text)| text).collect()
    }
}

/// As a sentence has them.
impl fmt::Display for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { photons, shadow_rays, supersample, error } = self;
        let eye_rays = match supersample {
            1 => "one eye ray".into(),
            n => format!("{n}\u{d7}{n} eye rays"),
        };
        write!(
            f,
            "{photons} photons a light, {eye_rays} a pixel, {shadow_rays} shadow rays a light, {GATHER} photons gathered"
        )?;
        match error.as_str() {
            USUAL_ERROR => Ok(()),
            error => write!(f, ", adaptive with --error {error}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        settings: Settings,
    }

    #[test]
    fn the_usual_settings_are_those_of_no_option() {
        let none = Cli::try_parse_from(["bench"]).unwrap().settings;
        assert_eq!(none, Settings::usual());
        assert_eq!(none.suffix(), "");
        assert_eq!(none.render_args(), ["--shadow-rays", "64", "--gather", "500"]);
    }

    #[test]
    fn other_settings_have_another_folder_and_reach_the_program() {
        let args = ["bench", "--shadow-rays", "256", "--supersample", "2", "--error", "0.0150"];
        let other = Cli::try_parse_from(args).unwrap().settings;
        assert_eq!(other.suffix(), "-shadow-rays-256-supersample-2-error-0.015");
        let expected = "--shadow-rays 256 --gather 500 --supersample 2 --error 0.015";
        assert_eq!(other.render_args().join(" "), expected);
        assert!(
            other.to_string().contains("2\u{d7}2 eye rays a pixel, 256 shadow rays"),
            "{other}"
        );
    }
}
