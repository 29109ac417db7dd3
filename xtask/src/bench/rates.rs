//! Rates of single stages, as criterion leaves them in files.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};

use crate::bench::against;
use crate::bench::spread::Spread;
use crate::bench::tables::percent;
use crate::table::Table;

/// How fast a stage is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Rate {
    /// The stage.
    pub(crate) stage: String,
    /// The case, such as the order of queries.
    pub(crate) case: String,
    /// The library that did it, if it wasn't ours.
    pub(crate) peer: Option<String>,
    /// What is counted.
    pub(crate) counted: String,
    /// How many of these an iteration does.
    pub(crate) elements: u64,
    /// Seconds of an iteration.
    pub(crate) seconds: Spread,
}

/// A library that does the same.
pub(crate) struct Peer {
    pub(crate) name: &'static str,
    what: &'static str,
}

/// All libraries that are measured beside ours.
const PEERS: [Peer; 3] = [
    Peer {
        name: "embree",
        what: "traces rays one at a time, its scene robust, its build of high quality",
    },
    Peer {
        name: "kiddo",
        what: "is a kd-tree; it finds photons by place alone, ours tells surfaces apart, too",
    },
    Peer { name: "nanoflann", what: "is a kd-tree, used as kiddo is" },
];

/// What criterion calls a benchmark.
#[derive(Deserialize)]
struct Benchmark {
    group_id: String,
    function_id: Option<String>,
    value_str: Option<String>,
    throughput: Option<Throughput>,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Throughput {
    elements: u64,
}

/// The samples of a benchmark: iterations, and nanoseconds for all of them.
#[derive(Deserialize)]
struct Sample {
    iters: Vec<f64>,
    times: Vec<f64>,
}

impl Rate {
    /// What is counted, in a second.
    pub(crate) fn per_second(&self) -> f64 {
        self.elements as f64 / self.seconds.median
    }

    pub(crate) fn is_of_the_same(&self, other: &Self) -> bool {
        (&self.stage, &self.case) == (&other.stage, &other.case)
    }

    pub(crate) fn name(&self) -> String {
        format!("{}, {}", self.stage, self.case)
    }
}

/// Reads the results below the folder of criterion.
///
/// # Errors
/// When there are none, or when one can't be read.
pub(crate) fn read(folder: &Path) -> anyhow::Result<Vec<Rate>> {
    let mut rates = Vec::new();
    for folder in results(folder)? {
        rates.push(rate(&folder)?);
    }
    ensure!(!rates.is_empty(), "no benchmark was run; is there one of that name?");
    rates.sort_by(|a, b| (&a.stage, &a.case, &a.peer).cmp(&(&b.stage, &b.case, &b.peer)));
    Ok(rates)
}

/// All folders with the result of a benchmark.
fn results(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if folder.join("benchmark.json").is_file() {
        // The results of this time are in `new`; `base` has copies of them.
        return Ok(if folder.ends_with("new") { vec![folder.into()] } else { vec![] });
    }
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("reading {}", folder.display()))? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(results(&path)?);
        }
    }
    Ok(found)
}

/// The rate in a folder.
fn rate(folder: &Path) -> anyhow::Result<Rate> {
    let benchmark: Benchmark = crate::stats::read(&folder.join("benchmark.json"))?;
    let sample: Sample = crate::stats::read(&folder.join("sample.json"))?;
    let faulty = || format!("{} doesn't say what it counts", folder.display());
    let Benchmark { group_id, function_id, value_str, throughput } = benchmark;
    let (stage, counted) =
        group_id.strip_suffix(')').and_then(|id| id.rsplit_once(" (")).with_context(faulty)?;
    let function = function_id.with_context(faulty)?;
    let peer = PEERS.into_iter().find(|peer| function.ends_with(&format!(", {}", peer.name)));
    let function = match peer {
        Some(ref peer) => &function[..function.len() - peer.name.len() - 2],
        None => &function,
    };
    let case =
        value_str.map_or_else(|| function.to_owned(), |value| format!("{function}, {value}"));
    Ok(Rate {
        stage: stage.into(),
        case,
        peer: peer.map(|peer| peer.name.into()),
        counted: counted.into(),
        elements: throughput.with_context(faulty)?.elements,
        seconds: Spread::of(sample.times.iter().zip(&sample.iters).map(|(t, n)| t / n * 1e-9)),
    })
}

/// All rates, those of others beside ours.
pub(crate) fn table(rates: &[Rate]) -> Table {
    let header = ["", "in a second", "spread", "others", "ours, of the fastest other"];
    let mut table =
        Table::new("Rates of single stages, on one thread unless it says two: medians", header);
    for rate in rates.iter().filter(|rate| rate.peer.is_none()) {
        let ours = rate.per_second();
        let others = rates.iter().filter(|r| r.is_of_the_same(rate));
        let others: Vec<(&str, f64)> =
            others.filter_map(|r| Some((r.peer.as_deref()?, r.per_second()))).collect();
        let fastest = others.iter().map(|(_, rate)| *rate).reduce(f64::max);
        let each = |(name, rate): &(&str, f64)| format!("{name} {}", short(*rate));
        let cells = [
            format!("{} {}", short(ours), rate.counted),
            format!("\u{b1}{}", percent(rate.seconds.relative(), 1)),
            others.iter().map(each).collect::<Vec<_>>().join(", "),
            fastest.map_or_else(String::new, |fastest| format!("{:.2}", ours / fastest)),
        ];
        table.push(rate.name(), cells);
    }
    for Peer { name, what } in PEERS {
        if rates.iter().any(|rate| rate.peer.as_deref() == Some(name)) {
            table.notes.push(format!("{name} {what}."));
        }
    }
    table
}

/// A sentence for each rate that has changed by more than noise. Each with its yardstick: what a piece of work took that
/// is the same then and now.
pub(crate) fn changes(
    (now, yardstick): (&[Rate], &Spread),
    (then, old_yardstick): (&[Rate], &Spread),
) -> Vec<String> {
    let change = |rate: &Rate| {
        let old = then.iter().find(|r| r.peer == rate.peer && r.is_of_the_same(rate))?;
        let each = |rate: &Rate| rate.seconds.scaled(1.0 / rate.elements as f64);
        let change = against::change(each(rate).over(yardstick), each(old).over(old_yardstick))?;
        let peer = rate.peer.as_ref().map_or_else(String::new, |peer| format!(", {peer}"));
        Some(format!("{}: {}{peer}, {change}", change.word(), rate.name()))
    };
    let mut changes: Vec<String> = now.iter().filter_map(change).collect();
    changes.sort();
    if changes.is_empty() {
        changes.push("nothing changed by more than noise".into());
    }
    changes
}

/// Three digits, and K or M.
pub(crate) fn short(n: f64) -> String {
    let (n, unit) = match n {
        n if n >= 1e6 => (n / 1e6, " M"),
        n if n >= 1e3 => (n / 1e3, " K"),
        n => (n, ""),
    };
    let digits = 2 - (n.max(1.0).log10() as usize).min(2);
    format!("{n:.digits$}{unit}")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// A folder as criterion leaves it.
    fn write(folder: &Path, group: &str, function: &str, value: Option<&str>, seconds: f64) {
        let own = folder.join(group).join(format!("{function} {}", value.unwrap_or_default()));
        for name in ["base", "new"] {
            let folder = own.join(name);
            fs::create_dir_all(&folder).unwrap();
            let benchmark = json!({
                "group_id": group, "function_id": function, "value_str": value, "throughput": { "Elements": 1000 },
                "full_id": "-", "directory_name": "-", "title": "-",
            });
            let times = [1.0, 1.1, 0.9].map(|f| f * seconds * 2e9);
            let sample =
                json!({ "sampling_mode": "Flat", "iters": [2.0, 2.0, 2.0], "times": times });
            fs::write(folder.join("benchmark.json"), benchmark.to_string()).unwrap();
            fs::write(folder.join("sample.json"), sample.to_string()).unwrap();
        }
    }

    fn rates() -> Vec<Rate> {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "gather (queries)", "500 nearest", Some("random"), 0.01);
        write(folder.path(), "gather (queries)", "500 nearest, kiddo", Some("random"), 0.04);
        write(folder.path(), "gather (queries)", "500 nearest, nanoflann", Some("random"), 0.02);
        write(folder.path(), "BVH (rays)", "occlusion", None, 0.000_5);
        read(folder.path()).unwrap()
    }

    #[test]
    fn rates_stand_beside_those_of_others() {
        let table = table(&rates());
        assert_eq!(
            table.rows,
            [
                ["BVH, occlusion", "2.00 M rays", "±10.0 %", "", ""],
                [
                    "gather, 500 nearest, random",
                    "100 K queries",
                    "±10.0 %",
                    "kiddo 25.0 K, nanoflann 50.0 K",
                    "2.00"
                ],
            ]
        );
    }

    #[test]
    fn only_what_is_more_than_noise_has_changed() {
        let (then, mut now) = (rates(), rates());
        let [yard, two] = [1.0, 2.0].map(|y| Spread::of([y]));
        assert_eq!(changes((&now, &yard), (&then, &yard)), ["nothing changed by more than noise"]);
        now[0].seconds = now[0].seconds.scaled(1.5);
        now[1].seconds = now[1].seconds.scaled(1.1);
        assert_eq!(
            changes((&now, &yard), (&then, &yard)),
            ["slower: BVH, occlusion, 1.50 times the CPU time (noise 20 %)"]
        );
        // On a machine of half the speed all are faster.
        let faster = changes((&now, &two), (&then, &yard));
        assert!(
            faster.len() == 4 && faster.iter().all(|c| c.starts_with("faster: ")),
            "{faster:?}"
        );
        // One whose speed nobody knows tells nothing.
        let any = Spread { median: 1.0, least: 0.2, most: 5.0 };
        assert_eq!(changes((&now, &any), (&then, &yard)), ["nothing changed by more than noise"]);
    }

    #[test]
    fn an_empty_folder_is_no_result() {
        let folder = tempfile::tempdir().unwrap();
        let error = read(folder.path()).unwrap_err().to_string();
        assert!(error.starts_with("no benchmark was run"), "{error}");
    }

    #[test]
    fn three_digits_count() {
        assert_eq!(
            [0.5, 999.0, 1234.0, 56_789.0, 1.5e8].map(short),
            ["0.50", "999", "1.23 K", "56.8 K", "150 M"]
        );
    }
}
