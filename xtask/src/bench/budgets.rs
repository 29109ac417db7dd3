//! The budgets that single stages are held to, and whether they hold: ours beside other libraries, a second thread beside
//! the first, and the programs as the system sees them.

use anyhow::Context;
use serde::{Deserialize, Serialize};

use crate::bench::bars::{Bar, Demanded};
use crate::bench::outside;
use crate::bench::rates::{Rate, short};
use crate::bench::spread::Spread;
use crate::programs::{self, Call};
use crate::stats::{self, BuildStats, RenderStats};
use crate::table::Table;

use Demanded::{AtLeast, AtMost};

/// The programs on the Cornell box.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Whole {
    /// CPU seconds of `photon-build` with a million photons, from start to file.
    build: Spread,
    /// Of the file.
    bytes_per_photon: f64,
    /// Peak memory of `render-cached` at 1024 x 1024 by mode, without that of the mapped file, in MB.
    render: Vec<(String, f64)>,
}

/// How often `photon-build` runs.
const RUNS: usize = 3;

/// Runs the programs.
///
/// # Errors
/// When they can't be built, when one fails, or on systems that don't tell CPU time.
pub(crate) fn whole() -> anyhow::Result<Whole> {
    let programs = programs::build()?;
    let folder = programs::root().join("target/bench/budgets");
    std::fs::create_dir_all(&folder).context("cannot make target/bench/budgets")?;
    let [maps, picture, json] = ["a.photons", "a.exr", "a.json"].map(|name| folder.join(name));
    let call = |program, output, args: &[&str]| {
        let call = Call::new(program).args(["scenes/cornell-box/scene.toml", "-o"]);
        call.args([output]).args(["--stats"]).args([&json]).args(["-q", "--force"]).args(args)
    };

    let build = call(&programs.photon_build, &maps, &["--photons", "1M"]);
    let seconds =
        |_| outside::measure(&build)?.cpu_seconds.context("this system tells no CPU time");
    let seconds = (0..RUNS).map(seconds).collect::<anyhow::Result<Vec<f64>>>()?;
    let built: BuildStats = stats::read(&json)?;
    let stored = built.stored.direct + built.stored.caustic + built.stored.indirect;

    let mut render = Vec::new();
    for mode in programs.modes()? {
        // The usual rays and photons: with few of them mode adaptive sees that no cache pays, and is the original.
        let call = call(&programs.render_cached, &picture, &["--resolution", "1024x1024"]);
        call.args(["--mode", &mode, "--photons"]).args([&maps]).run()?;
        let rendered: RenderStats = stats::read(&json)?;
        let own = rendered.peak_rss_bytes.saturating_sub(built.file_bytes);
        render.push((mode, own as f64 / 1e6));
    }
    let bytes_per_photon = built.file_bytes as f64 / stored.max(1) as f64;
    Ok(Whole { build: Spread::of(seconds), bytes_per_photon, render })
}

/// All budgets that these rates and programs tell of.
pub(crate) fn table(rates: &[Rate], whole: Option<&Whole>) -> Table {
    let header = ["", "demanded", "measured", "beside", "holds"];
    let mut table = Table::new("Budgets of single stages", header);
    let mut n_failed = 0;
    let mut push = |bar: Bar, beside: String| {
        n_failed += usize::from(!bar.holds());
        let measured = bar.measured.map_or_else(String::new, bar.show);
        table
            .push(bar.name.clone(), [bar.demanded.text(bar.show), measured, beside, bar.verdict()]);
    };
    let bar = |name: &str, demanded, measured, show| Bar {
        name: name.into(),
        demanded,
        measured: Some(measured),
        show,
        waived: None,
    };
    if let Some(Whole { build, bytes_per_photon, render }) = whole {
        let seconds: fn(f64) -> String = |v| format!("{v:.2} CPU s");
        let bytes: fn(f64) -> String = |v| format!("{v:.1} bytes");
        let megabytes: fn(f64) -> String = |v| format!("{v:.0} MB");
        let name = "photon-build, Cornell box, 1M photons";
        push(bar(name, AtMost(1.6), build.median, seconds), String::new());
        push(bar("a photon in its file", AtMost(20.0), *bytes_per_photon, bytes), String::new());
        for (mode, own) in render {
            let name = format!("render-cached, {mode}, 1024\u{d7}1024, without the mapped file");
            push(bar(&name, AtMost(400.0), *own, megabytes), String::new());
        }
    }
    let times: fn(f64) -> String = |v| format!("{v:.2} times");
    for rate in rates.iter().filter(|rate| rate.peer.is_none()) {
        if let Some(least) = least(rate) {
            let others = rates.iter().filter(|r| r.peer.is_some() && r.is_of_the_same(rate));
            let fastest = others.max_by(|a, b| a.per_second().total_cmp(&b.per_second()));
            let beside = fastest.map_or_else(String::new, |other| {
                let name = other.peer.as_deref().unwrap_or_default();
                format!("{} and {name} {}", short(rate.per_second()), short(other.per_second()))
            });
            let measured = fastest.map(|other| rate.per_second() / other.per_second());
            let demanded = AtLeast(least);
            push(Bar { name: rate.name(), demanded, measured, show: times, waived: None }, beside);
        }
        if (rate.stage.as_str(), rate.case.as_str()) == ("map open", "4 M") {
            let milliseconds: fn(f64) -> String = |v| format!("{v:.1} ms");
            let measured = rate.seconds.median * 1e3;
            push(bar(&rate.name(), AtMost(20.0), measured, milliseconds), String::new());
        }
        let of_one = rate.case.strip_suffix(TWO_THREADS).and_then(|case| {
            let one = format!("{case}{ONE_THREAD}");
            rates.iter().find(|r| r.stage == rate.stage && r.case == one)
        });
        if let Some(one) = of_one {
            let [two, one] = [rate, one].map(Rate::per_second);
            let beside = format!("{} and {}", short(two), short(one));
            push(bar(&rate.name(), AtLeast(1.9), two / one, times), beside);
        }
    }
    table.notes.push(match (n_failed, table.rows.len()) {
        (0, n) => format!("All {n} hold."),
        (failed, n) => format!("{} of {n} hold.", n - failed),
    });
    table
}

/// How the benchmarks name what is measured for the second thread.
const ONE_THREAD: &str = ", 1 thread";
const TWO_THREADS: &str = ", 2 threads";

/// What a stage must reach as a multiple of the fastest other library.
fn least(rate: &Rate) -> Option<f64> {
    let is_gather = rate.stage.starts_with("gather from");
    let is_asked = rate.case.starts_with("100 nearest") || rate.case.starts_with("within a radius");
    match (rate.stage.as_str(), rate.case.as_str()) {
        ("BVH", "closest hit, random") => Some(0.75),
        _ if is_gather && is_asked => Some(1.5),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rate(stage: &str, case: &str, peer: Option<&str>, seconds: f64) -> Rate {
        Rate {
            stage: stage.into(),
            case: case.into(),
            peer: peer.map(Into::into),
            counted: "items".into(),
            elements: 1000,
            seconds: Spread::of([seconds]),
        }
    }

    #[test]
    fn each_budget_is_held_against_its_figure() {
        let gather = "gather from 1 M photons";
        let rates = [
            rate("BVH", "closest hit, random", None, 1.3),
            rate("BVH", "closest hit, random", Some("embree"), 1.0),
            rate("BVH", "closest hit, coherent", None, 1.0),
            rate(gather, "100 nearest, random", None, 1.0),
            rate(gather, "100 nearest, random", Some("kiddo"), 2.0),
            rate(gather, "100 nearest, random", Some("nanoflann"), 1.4),
            rate(gather, "within a radius, random", None, 1.0),
            rate("map open", "4 M", None, 0.019),
            rate("threads", "rays, 1 thread", None, 1.92),
            rate("threads", "rays, 2 threads", None, 1.0),
        ];
        let render = vec![("original".to_owned(), 401.0)];
        let whole = Whole { build: Spread::of([1.59]), bytes_per_photon: 12.9, render };
        let table = table(&rates, Some(&whole));
        let verdicts: Vec<[&str; 3]> =
            table.rows.iter().map(|row| [&*row[0], &*row[2], &*row[4]]).collect();
        assert_eq!(
            verdicts,
            [
                ["photon-build, Cornell box, 1M photons", "1.59 CPU s", "yes"],
                ["a photon in its file", "12.9 bytes", "yes"],
                [
                    "render-cached, original, 1024\u{d7}1024, without the mapped file",
                    "401 MB",
                    "no"
                ],
                ["BVH, closest hit, random", "0.77 times", "yes"],
                ["gather from 1 M photons, 100 nearest, random", "1.40 times", "no"],
                ["gather from 1 M photons, within a radius, random", "", "not measured"],
                ["map open, 4 M", "19.0 ms", "yes"],
                ["threads, rays, 2 threads", "1.92 times", "yes"],
            ]
        );
        assert_eq!(table.rows[4][3], "1.00 K and nanoflann 714");
        assert_eq!(table.notes, ["5 of 8 hold."]);
    }
}
