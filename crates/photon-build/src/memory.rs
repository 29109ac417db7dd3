//! How much memory photons take.

use base::PhotonClass;
use cli::{Interrupt, Need};
use photon_map::PhotonShard;
use photon_trace::{Budget, Config};
use rayon::ThreadPool;
use scene::Scene;

/// Bytes of a photon while it is traced: in its batch, and among all of its class. As `peak_rss_bytes` of `--stats` shows with
/// 100 million.
const TRACED: f64 = 66.0;

/// What threads keep of batches that end in an unlucky order.
const BESIDE: u64 = 2_000_000;

/// Bytes of a photon that waits for its place in the tree, and in it.
const LOOSE: f64 = 24.0;
const IN_TREE: f64 = 12.9;

/// One in so many photons is traced to find out how many will be stored, and so many at most.
const FEW: u64 = 128;
const MOST_TRACED: u64 = 1 << 16;

/// As many as this are stored of each that is emitted, where too few are to find out.
const STORED_OF_FEW: f64 = 4.0;

/// What so many photons of a run take.
///
/// # Errors
/// When the user has asked for an end.
pub(crate) fn of_tracing(
    scene: &Scene,
    config: &Config,
    n_emitted: u64,
    pool: &ThreadPool,
    interrupt: &Interrupt,
) -> anyhow::Result<Need> {
    let few = |n: u64| (n / FEW).min(MOST_TRACED);
    let budget = match &config.budget {
        Budget::Total(n) => Budget::Total(few(*n)),
        Budget::PerLight(n) => Budget::PerLight(few(*n)),
        Budget::Each(counts) => Budget::Each(counts.iter().map(|n| few(*n)).collect()),
    };
    let few = Config { budget, ..config.clone() };
    let traced = pool.install(|| photon_trace::trace(scene, &few, &|_| interrupt.go_on()))?;
    let sets = [&traced.direct, &traced.caustic, &traced.indirect, &traced.focused];
    let n_stored: usize = sets.into_iter().map(Vec::len).sum();
    let stored = match traced.account.emitted {
        0 => STORED_OF_FEW,
        emitted => n_stored as f64 / emitted as f64,
    };
    Ok(Need { own: (n_emitted as f64 * stored * TRACED) as u64 + BESIDE, mapped: 0 })
}

/// What merging shards takes beside them, one class after the other.
pub(crate) fn of_merging(shards: &[PhotonShard]) -> Need {
    let (mut in_trees, mut most) = (0.0, 0.0_f64);
    for class in PhotonClass::ALL {
        let n: u64 = shards.iter().map(|shard| shard.n_photons(class) as u64).sum();
        in_trees += IN_TREE * n as f64;
        most = most.max(in_trees + LOOSE * n as f64);
    }
    Need { own: most as u64, mapped: 0 }
}
