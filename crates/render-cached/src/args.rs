//! The command line.

use std::path::PathBuf;

use base::{ImageSize, Share};
use cli::{Common, JournalOptions, MemoryOptions, SceneOptions, parse_count};
use photon_map::Kernel;

/// Render a scene with saved photon maps, by component
#[derive(Clone, Debug, clap::Parser)]
#[command(
    name = "render-cached",
    version,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true
)]
pub struct Args {
    /// What to do instead of rendering.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The scene: a scene.toml, or one of Mitsuba (.xml) or glTF (.gltf, .glb)
    #[arg(required = true)]
    pub scene: Option<PathBuf>,
    /// The photon maps that photon-build has made of the scene
    #[arg(long, value_name = "MAPS.photons", required = true)]
    pub photons: Option<PathBuf>,
    /// Where the picture goes: .exr holds all layers, .png what a screen shows; may be given several times, or
    /// not at all with --save-cache or --save-layers
    #[arg(short, long, value_name = "IMAGE", required_unless_present_any = ["save_cache", "save_layers"])]
    pub output: Vec<PathBuf>,
    /// Width and height of the picture, in pixels [default: those of the scene, if it is of Mitsuba or glTF and tells, or 512x512]
    #[arg(long, value_name = "WxH", allow_hyphen_values = true, value_parser = parse_size)]
    pub resolution: Option<ImageSize>,
    /// Render a part of the picture, from column X0 up to X1 and row Y0 up to Y1, neither of them included, for
    /// `render-cached assemble`
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = parse_crop, conflicts_with = "tile")]
    pub crop: Option<[u32; 4]>,
    /// Render part I of N of about the same size
    #[arg(long, value_name = "I/N")]
    pub tile: Option<Share>,
    /// Eye rays for each pixel: N x N, through the middles of its subpixels
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub supersample: u32,
    /// How pixels are made of subpixels
    #[arg(long, value_enum, default_value_t = Filter::Box)]
    pub filter: Filter,
    /// Which pixels are computed
    #[arg(long, value_enum, default_value_t = Mode::Adaptive)]
    pub mode: Mode,
    /// Mean FLIP against mode original that mode adaptive aims at; 0 computes everything
    #[arg(long, value_name = "E", default_value_t = 0.01, value_parser = parse_error)]
    pub error: f32,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Exposure of .png pictures, in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true, value_parser = parse_exposure)]
    pub exposure: f32,
    /// How components are computed.
    #[command(flatten)]
    pub shading: Shading,
    /// How pixels are interpolated.
    #[command(flatten)]
    pub paper: Paper,
    /// What survives an end.
    #[command(flatten)]
    pub journal: JournalOptions,
    /// What is done without memory.
    #[command(flatten)]
    pub memory: MemoryOptions,
    /// How the scene is read.
    #[command(flatten)]
    pub scene_options: SceneOptions,
    /// Options that all programs have.
    #[command(flatten)]
    pub common: Common,
}

impl Args {
    /// Whether a part is asked for, not the whole picture.
    pub(crate) fn is_part(&self) -> bool {
        self.crop.is_some() || self.tile.is_some()
    }
}

/// How pixels are made of subpixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Filter {
    /// The mean of those of the pixel
    Box,
    /// Less with the distance, up to a pixel
    Tent,
    /// A normal distribution, up to 1.5 pixels
    Gaussian,
    /// The cubics of Mitchell and Netravali, up to two pixels: sharp
    Mitchell,
}

/// Which pixels are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Mode {
    /// Every component at every pixel
    Original,
    /// A few pixels, the rest interpolated where the paper's conditions allow it
    Paper,
    /// Each component where it has structure, to one error target
    Adaptive,
}

/// How components are computed; the same in every mode.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Quality")]
pub struct Shading {
    /// Shadow rays for each pixel and light with an extent
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub shadow_rays: u32,
    /// Directions in which a rough surface is followed, at the first that an eye ray meets
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub glossy_rays: u32,
    /// How indirect light is computed
    #[arg(long, value_enum, default_value_t = Indirect::Estimate)]
    pub indirect: Indirect,
    /// Rays of final gathering for each pixel, with --indirect gather
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub gather_rays: u32,
    /// Photons in an estimate of indirect light
    #[arg(long, value_name = "K", default_value = "500", value_parser = parse_k)]
    pub gather: u64,
    /// Greatest radius of an estimate of indirect light, in units of the scene [default: 1/20 of its diagonal]
    #[arg(long, value_name = "R", value_parser = parse_length)]
    pub gather_radius: Option<f32>,
    /// Photons in an estimate of caustics
    #[arg(long, value_name = "K", default_value = "100", value_parser = parse_k)]
    pub caustic_gather: u64,
    /// Greatest radius of an estimate of caustics, in units of the scene [default: 1/100 of its diagonal]
    #[arg(long, value_name = "R", value_parser = parse_length)]
    pub caustic_radius: Option<f32>,
    /// How the weight of a photon falls with its distance
    #[arg(long, value_name = "NAME", default_value = "epanechnikov", value_parser = parse_kernel)]
    pub kernel: Kernel,
}

/// How indirect light is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Indirect {
    /// From the density of photons around a point
    Estimate,
    /// By rays to what is around it, where photons tell the light; needs maps made with --store gather
    Gather,
}

const TAU_DIRECT: f32 = 0.05;
const TAU_INDIRECT: f32 = 0.05;
const TAU_SPECULAR: f32 = 0.02;
const REGION: u32 = 8;

/// How pixels are interpolated, and what is kept of the computed ones.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Mode paper")]
pub struct Paper {
    /// Greatest error of a candidate for direct light, Eq. (9)
    #[arg(long, value_name = "TAU", default_value_t = TAU_DIRECT, value_parser = parse_threshold)]
    pub tau_direct: f32,
    /// Greatest error of a candidate for indirect light, Eq. (10)
    #[arg(long, value_name = "TAU", default_value_t = TAU_INDIRECT, value_parser = parse_threshold)]
    pub tau_indirect: f32,
    /// Greatest error of a candidate for specular light, Eq. (11)
    #[arg(long, value_name = "TAU", default_value_t = TAU_SPECULAR, value_parser = parse_threshold)]
    pub tau_specular: f32,
    /// Side of the square in which candidates are searched, in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = REGION, value_parser = clap::value_parser!(u32).range(2..=256))]
    pub region: u32,
    /// Distance that counts as an error of 1, `R_0` of Eq. (2), in units of the scene [default: 1/10 of its diagonal]
    #[arg(long, value_name = "R", value_parser = parse_length)]
    pub r0: Option<f32>,
    /// Share of the pixels sampled at low resolution [default: one in each quarter of the region]
    #[arg(long, value_name = "SHARE", value_parser = parse_fraction)]
    pub fraction: Option<f64>,
    /// Save all that was computed, in mode paper for the same view, in mode adaptive for any
    #[arg(long, value_name = "FILE.cache", help_heading = "Modes paper and adaptive")]
    pub save_cache: Option<PathBuf>,
    /// Start from what the same mode has saved: with other thresholds, another error, at another resolution, and in
    /// mode adaptive with another camera
    #[arg(long, value_name = "FILE.cache", help_heading = "Modes paper and adaptive")]
    pub from_cache: Option<PathBuf>,
    /// Save the layers of the whole picture, for tiles to be made of
    #[arg(long, value_name = "FILE.layers", help_heading = "Mode adaptive")]
    pub save_layers: Option<PathBuf>,
    /// Make the picture, or a tile of it, of the layers that the same options have saved
    #[arg(long, value_name = "FILE.layers", help_heading = "Mode adaptive", conflicts_with_all = ["save_layers", "save_cache"])]
    pub from_layers: Option<PathBuf>,
}

impl Paper {
    /// The first option that only mode paper heeds, if one has another value than when nothing is said.
    pub(crate) fn of_paper_alone(&self) -> Option<&'static str> {
        let options = [
            ("--tau-direct", self.tau_direct != TAU_DIRECT),
            ("--tau-indirect", self.tau_indirect != TAU_INDIRECT),
            ("--tau-specular", self.tau_specular != TAU_SPECULAR),
            ("--region", self.region != REGION),
            ("--r0", self.r0.is_some()),
            ("--fraction", self.fraction.is_some()),
        ];
        options.into_iter().find_map(|(name, is_given)| is_given.then_some(name))
    }
}

/// What else the program does.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum Command {
    /// Say how far two pictures differ
    Diff(Diff),
    /// Join the parts that --tile or --crop has made, in any order, to the picture that one run makes
    Assemble(Assemble),
}

/// Parts to be joined.
#[derive(Clone, Debug, clap::Args)]
pub struct Assemble {
    /// All parts of one picture
    #[arg(required = true)]
    pub parts: Vec<PathBuf>,
    /// Where the picture goes: .exr holds all layers, .png what a screen shows; may be given several times
    #[arg(short, long, value_name = "IMAGE", required = true)]
    pub output: Vec<PathBuf>,
    /// Exposure of .png pictures, in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true, value_parser = parse_exposure)]
    pub exposure: f32,
    /// Options that all programs have.
    #[command(flatten)]
    pub common: Common,
}

/// Two pictures to be compared.
#[derive(Clone, Debug, clap::Args)]
pub struct Diff {
    /// The picture in question
    pub a: PathBuf,
    /// The reference
    pub b: PathBuf,
    /// Where a picture of the difference goes, as FLIP sees it
    #[arg(short, long, value_name = "DIFF.png")]
    pub output: Option<PathBuf>,
    /// The layer to compare, such as direct [default: the whole picture]
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    pub layer: String,
    /// Exposure at which FLIP looks, in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true, value_parser = parse_exposure)]
    pub exposure: f32,
    /// Replace the output if it exists
    #[arg(long)]
    pub force: bool,
}

fn parse_size(text: &str) -> Result<ImageSize, String> {
    let sides = text
        .split_once('x')
        .and_then(|(w, h)| Some((w.parse::<u32>().ok()?, h.parse::<u32>().ok()?)));
    let (width, height) = sides.ok_or("expected a width and a height such as 640x480")?;
    match u64::from(width) * u64::from(height) {
        0 => Err("a picture needs one pixel at least each way".into()),
        n if n > MOST_PIXELS => Err("a picture may have 2^32 pixels at most".into()),
        _ => Ok(ImageSize { width, height }),
    }
}

/// A picture in tiles may be as large as this; of what is rendered at once, the memory sets the limit.
const MOST_PIXELS: u64 = 1 << 32;

fn parse_crop(text: &str) -> Result<[u32; 4], String> {
    let bounds: Option<Vec<u32>> = text.split(',').map(|bound| bound.parse().ok()).collect();
    let bounds = bounds.and_then(|bounds| bounds.try_into().ok());
    bounds.ok_or_else(|| "expected X0,X1,Y0,Y1 in pixels, such as 0,640,240,480".into())
}

fn parse_number(text: &str, is_fine: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    // Most are used in single precision.
    let number = text.parse::<f64>().ok().filter(|&n| (n as f32).is_finite() && is_fine(n));
    number.ok_or_else(|| format!("expected {expected}"))
}

fn parse_exposure(text: &str) -> Result<f32, String> {
    parse_number(text, |n| n.abs() <= 100.0, "a number of stops between -100 and 100")
        .map(|n| n as f32)
}

fn parse_length(text: &str) -> Result<f32, String> {
    parse_number(text, |n| n as f32 > 0.0, "a length above 0").map(|n| n as f32)
}

fn parse_threshold(text: &str) -> Result<f32, String> {
    parse_number(text, |n| n >= 0.0, "a number from 0 up").map(|n| n as f32)
}

fn parse_error(text: &str) -> Result<f32, String> {
    parse_number(text, |n| (0.0..=1.0).contains(&n), "a FLIP value from 0 to 1").map(|n| n as f32)
}

fn parse_fraction(text: &str) -> Result<f64, String> {
    parse_number(text, |n| (1e-6..=1.0).contains(&n), "a share from 0.000001 to 1")
}

fn parse_k(text: &str) -> Result<u64, String> {
    match parse_count(text)? {
        n @ 2..=1_000_000 => Ok(n),
        _ => Err("expected a count from 2 to 1M; the farthest photon only tells the radius".into()),
    }
}

fn parse_kernel(text: &str) -> Result<Kernel, String> {
    let names = Kernel::ALL.map(Kernel::name).join(", ");
    Kernel::ALL
        .into_iter()
        .find(|k| k.name() == text)
        .ok_or_else(|| format!("expected one of {names}"))
}
