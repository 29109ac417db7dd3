//! The command line.

use std::path::PathBuf;

use base::Share;
use cli::{Common, JournalOptions, MemoryOptions, SceneOptions, parse_count};

/// Shoot photons into a scene and save photon maps
///
/// The maps serve every camera, resolution and mode of render-cached.
#[derive(Clone, Debug, clap::Parser)]
#[command(
    name = "photon-build",
    version,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true
)]
pub struct Args {
    /// What to do instead of building a map.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The scene: a scene.toml, or one of Mitsuba (.xml) or glTF (.gltf, .glb)
    #[arg(required = true)]
    pub scene: Option<PathBuf>,
    /// Where the photon maps go
    #[arg(short, long, value_name = "MAPS.photons", required = true)]
    pub output: Option<PathBuf>,
    /// Photons to emit in all, shared among the lights by their flux [default: 1M]
    #[arg(long, value_name = "COUNT", allow_hyphen_values = true, value_parser = parse_count, conflicts_with = "photons_per_light")]
    pub photons: Option<u64>,
    /// Photons to emit from each light
    #[arg(long, value_name = "COUNT", allow_hyphen_values = true, value_parser = parse_count)]
    pub photons_per_light: Option<u64>,
    /// Photons out of --photons that one light gets, by its name in the scene; the others share the rest
    #[arg(long, value_name = "LIGHT=COUNT", value_parser = parse_quota, conflicts_with = "photons_per_light")]
    pub quota: Vec<Quota>,
    /// What no light gets less than, as a share of an equal part: 0 shares by flux alone, 1 gives all as many
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, allow_hyphen_values = true, value_parser = parse_min_share, conflicts_with = "photons_per_light")]
    pub min_share: f64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Classes to store besides caustic and indirect
    #[arg(long, value_name = "CLASS")]
    pub store: Vec<Store>,
    /// Surfaces that a photon may meet; what is cut off there is reported
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..))]
    pub max_bounces: u32,
    /// Share of the photons that is aimed at mirrors, metals and glass, and tells of caustics only: for scenes in which
    /// those are small
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, allow_hyphen_values = true, value_parser = parse_aim)]
    pub aim: f32,
    /// Trace share I of N only, and save it for `photon-build merge`, which makes of all N what one run makes
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Share>,
    /// How the scene is read.
    #[command(flatten)]
    pub scene_options: SceneOptions,
    /// What survives an end.
    #[command(flatten)]
    pub journal: JournalOptions,
    /// What is done without memory.
    #[command(flatten)]
    pub memory: MemoryOptions,
    /// Options that all programs have.
    #[command(flatten)]
    pub common: Common,
}

fn parse_aim(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(share @ 0.0..=0.95) => Ok(share),
        _ => Err("expected a share from 0 to 0.95; the other photons carry all other light".into()),
    }
}

fn parse_min_share(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(share @ 0.0..=1.0) => Ok(share),
        _ => Err("expected a share of an equal part, from 0 to 1".into()),
    }
}

/// What one light gets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quota {
    /// Its name in the scene.
    pub light: String,
    /// Photons, one at least.
    pub photons: u64,
}

fn parse_quota(text: &str) -> Result<Quota, String> {
    let (light, photons) =
        text.rsplit_once('=').ok_or("expected the name of a light, = and a count")?;
    match parse_count(photons)? {
        0 => Err("a light without photons is dark; give it one at least".into()),
        photons => Ok(Quota { light: light.into(), photons }),
    }
}

/// Classes of photons that aren't always stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Store {
    /// Photons straight from the lights
    Direct,
    /// Those, and what else render-cached needs for --indirect gather
    Gather,
}

/// What else the program does.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum Command {
    /// Say what is in a map, and what made it
    Info {
        /// The map
        map: PathBuf,
    },
    /// Join the shards that --shard has made, in any order, to the maps that one run makes
    Merge(Merge),
}

/// Shards to be joined.
#[derive(Clone, Debug, clap::Args)]
pub struct Merge {
    /// All shards of one run
    #[arg(required = true)]
    pub shards: Vec<PathBuf>,
    /// Where the photon maps go
    #[arg(short, long, value_name = "MAPS.photons")]
    pub output: PathBuf,
    /// What is done without memory.
    #[command(flatten)]
    pub memory: MemoryOptions,
    /// Options that all programs have.
    #[command(flatten)]
    pub common: Common,
}
