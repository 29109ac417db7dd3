//! Maps, and what is said about them.

use std::process::Command;

use assert_cmd::assert::OutputAssertExt;
use base::Rgb;
use photon_map::PhotonMaps;
use serde_json::Value;

use crate::bench::{Bench, SCENE};

#[test]
fn threads_and_names_change_no_byte() {
    let bench = Bench::new();
    let args = "scene.toml --photons 30K --store direct";
    let mut accounts = Vec::new();
    for threads in ["1", "2", "3"] {
        bench.run(&format!("{args} -o {threads}.photons -t {threads} --stats {threads}.json"));
        let mut account = bench.json(&format!("{threads}.json"));
        assert_eq!(account["threads"].to_string(), threads);
        for varies in ["threads", "seconds", "cpu_seconds", "peak_rss_bytes", "predicted_rss_bytes"]
        {
            account[varies] = Value::Null;
        }
        accounts.push(account);
        assert!(bench.read(&format!("{threads}.photons")) == bench.read("1.photons"), "{threads}");
    }
    assert_eq!(accounts[0], accounts[1]);
    assert_eq!(accounts[0], accounts[2]);

    let command = bench.command(&format!("{args} -o env.photons --stats env.json"));
    let mut command = assert_cmd::Command::from_std(command);
    command.env("TETRALUX_THREADS", "3").assert().success();
    assert_eq!(bench.json("env.json")["threads"], 3);
    assert!(bench.read("env.photons") == bench.read("1.photons"));

    bench.run(&format!("{args} -o other.photons --seed 1 --stats other.json"));
    assert!(bench.read("other.photons") != bench.read("1.photons"));
    assert_ne!(bench.json("other.json")["fingerprint"], accounts[0]["fingerprint"]);
}

#[test]
fn stats_keep_their_contract() {
    let bench = Bench::new();
    bench.run("scene.toml --photons 10K -o a.photons --store direct --seed 7 -t 2 --stats a.json");
    let stats = bench.json("a.json");
    let keys =
        |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>().join(" ");
    // What became of the photons is more than the contract asks for.
    assert_eq!(
        keys(&stats),
        "absorbed bytes_per_photon cpu_seconds cut emitted escaped file_bytes fingerprint \
         peak_rss_bytes predicted_rss_bytes program rays scene seconds seed stored threads version"
    );
    assert_eq!(keys(&stats["stored"]), "caustic direct focused indirect");
    for times in ["seconds", "cpu_seconds"] {
        assert_eq!(keys(&stats[times]), "bvh load total trace tree write");
        let value = |stage: &str| stats[times][stage].as_f64().unwrap();
        let sum: f64 = ["bvh", "load", "trace", "tree", "write"].map(value).iter().sum();
        assert!(sum > 0.0 && sum <= value("total"), "{stats}");
    }

    let number = |key: &str| stats[key].as_u64().unwrap();
    assert_eq!(stats["program"], "photon-build");
    assert_eq!(stats["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(stats["scene"], "scene.toml");
    assert_eq!((number("seed"), number("threads"), number("emitted")), (7, 2, 10_000));
    assert_eq!(number("absorbed") + number("escaped") + number("cut"), 10_000);
    assert_eq!(number("file_bytes"), bench.read("a.photons").len() as u64);
    assert!(number("rays") > 10_000 && number("peak_rss_bytes") > 1_000_000, "{stats}");
    let stored =
        ["direct", "caustic", "indirect"].map(|class| stats["stored"][class].as_u64().unwrap());
    assert!(stored.iter().all(|&n| n > 100), "{stats}");
    let bytes = stats["bytes_per_photon"].as_f64().unwrap() * stored.iter().sum::<u64>() as f64;
    assert!(bytes < number("file_bytes") as f64, "{stats}");
}

#[test]
fn direct_photons_are_stored_on_request_only() {
    let bench = Bench::new();
    bench.run("scene.toml --photons 10K -o with --store direct --stats with.json");
    bench.run("scene.toml --photons 10K -o without --stats without.json");
    let (with, without) = (bench.json("with.json"), bench.json("without.json"));
    assert_eq!(without["stored"]["direct"], 0);
    for class in ["caustic", "indirect"] {
        assert_eq!(with["stored"][class], without["stored"][class]);
    }
}

#[test]
fn the_command_in_a_map_makes_it_anew() {
    let bench = Bench::new();
    bench.write("my scene.toml", bench.read("scene.toml"));
    let make = |args: &[&str]| {
        bench
            .command("")
            .args(["my scene.toml", "-o", "my maps.photons"])
            .args(args)
            .assert()
            .success();
    };
    for args in [
        &["--photons", "1.5K"][..],
        &["--photons-per-light", "2K", "--seed", "18446744073709551615"],
        &["--photons", "1K", "--store", "direct", "--max-bounces", "3", "-t", "1"],
    ] {
        make(args);
        let (info, _) = {
            let output = bench.command("").args(["info", "my maps.photons"]).output().unwrap();
            (String::from_utf8(output.stdout).unwrap(), ())
        };
        let command =
            info.lines().find_map(|line| line.trim_start().strip_prefix("command")).unwrap();
        let before = bench.read("my maps.photons");
        bench.write("my maps.photons", "spoilt");
        let command = command.replace("photon-build", env!("CARGO_BIN_EXE_photon-build"));
        let folder = bench.path("");
        Command::new("sh").args(["-c", &command]).current_dir(folder).assert().success();
        assert!(bench.read("my maps.photons") == before, "{command}");
        std::fs::remove_file(bench.path("my maps.photons")).unwrap();
    }
}

#[test]
fn info_says_what_is_in_a_map() {
    let bench = Bench::new();
    bench.run("scene.toml --photons 10K -o a.photons --stats a.json --seed 3 --store direct");
    let stats = bench.json("a.json");
    let (info, err) = bench.run("info a.photons");
    assert_eq!(err, "");
    let mut lines = info.lines();
    let version = env!("CARGO_PKG_VERSION");
    let first = format!("a.photons: photon map of version 1, made by photon-build {version}");
    assert_eq!(lines.next(), Some(&*first));
    let mut fields = lines.map(|line| line.trim_start().split_once(' ').unwrap());
    let mut field = |name: &str| {
        let (found, value) = fields.next().unwrap();
        assert_eq!(found, name);
        value.trim_start().to_owned()
    };
    assert_eq!(
        field("command"),
        "photon-build scene.toml -o 'a.photons' --photons 10000 --seed 3 --max-bounces 1024 --store direct --force"
    );
    assert_eq!(field("scene").len(), 16);
    assert_eq!(field("photons"), stats["fingerprint"]);
    assert_eq!(field("seed"), "3");
    // The lamp emits pi L A.
    assert_eq!(field("emitted"), "10000 (31.415928 28.274334 25.132742 W)");
    for ending in ["absorbed", "escaped", "cut"] {
        let n = stats[ending].as_u64().unwrap();
        assert_eq!(field(ending), format!("{n} ({:.2} %)", n as f64 / 100.0));
    }
    for class in ["direct", "caustic", "indirect"] {
        let text = field(class);
        let n = stats["stored"][class].to_string();
        assert!(text.starts_with(&format!("{n} photons, ")) && text.ends_with(" W"), "{text}");
    }
    assert_eq!(fields.next(), None);
}

#[test]
fn verbosity_is_heeded() {
    let bench = Bench::new();
    let said = |args: &str| {
        let (out, err) = bench.run(&format!("scene.toml --photons 1K -o a.photons --force {args}"));
        assert_eq!(out, "");
        assert!(err.lines().all(|line| line.starts_with("photon-build: ")), "{err}");
        err
    };
    assert_eq!(said("-q"), "");
    let (normal, verbose) = (said(""), said("-v"));
    assert_eq!(normal.lines().count(), 3, "{normal}");
    assert!(normal.contains("1000 emitted, 0.0 MB written to a.photons in "), "{normal}");
    assert!(verbose.lines().count() > 3 && verbose.contains("1 lights, "), "{verbose}");

    // Light that is lost is no detail.
    let cut = said("-q --max-bounces 1");
    assert!(
        cut.starts_with("photon-build: warning: ") && cut.contains("raise --max-bounces"),
        "{cut}"
    );
}

#[test]
fn lights_get_what_they_are_said_to_get() {
    let bench = Bench::new();
    let second = "[[quads]]\nname = \"dim=1\"\ncorner = [1, 2, -0.5]\nedges = [[0.03, 0, 0], [0, 0, 0.03]]\nmaterial = \"lamp\"\n";
    bench.write("two.toml", [SCENE, second].concat());
    bench.run("two.toml --photons 200K -o plain.photons");
    let flux = |name: &str| {
        let (maps, _) = PhotonMaps::open(&bench.path(name)).unwrap();
        let photons = (0..maps.indirect.len()).map(|i| maps.indirect.photon(i).flux);
        (maps.metadata.emitted, photons.sum::<Rgb>())
    };
    let (_, expected) = flux("plain.photons");
    for (options, name) in [
        ("--quota dim=1=150K", "quota.photons"),
        ("--min-share 1", "even.photons"),
        ("--min-share 0.5 --shard 1/1", "1.shard"),
    ] {
        bench.run(&format!("two.toml --photons 200K {options} -o {name}"));
    }
    bench.run("merge 1.shard -o half.photons");
    bench.run("two.toml --photons 200K --min-share 0.5 -o whole.photons");
    assert!(bench.read("half.photons") == bench.read("whole.photons"));
    for name in ["quota.photons", "even.photons", "half.photons"] {
        let (emitted, sum) = flux(name);
        assert_eq!(emitted, 200_000);
        assert!(bench.read(name) != bench.read("plain.photons"));
        // Other photons, the same light: their noise is some 2 %.
        assert!((sum.mean() / expected.mean() - 1.0).abs() < 0.06, "{name}: {sum:?} {expected:?}");
    }
    let made = String::from_utf8_lossy(&bench.read("quota.photons")[..600]).into_owned();
    assert!(made.contains("--photons 200000 --quota dim=1=150000 --seed 0"), "{made}");

    for (options, code, message) in [
        (
            "--quota sun=5",
            1,
            "two.toml has no light `sun`, for --quota; its lights are `lamp`, `dim=1`",
        ),
        ("--quota lamp=5 --quota lamp=6", 2, "--quota names light `lamp` twice"),
        ("--quota lamp=2M", 2, "the quotas take 2000000 photons of 1000000; raise --photons"),
    ] {
        bench.refuses(&format!("two.toml {options} -o b.photons"), code, message);
    }
    for wrong in
        ["--quota lamp", "--quota lamp=0", "--min-share 1.5", "--min-share 1 --photons-per-light 5"]
    {
        let wrong = bench.command(&format!("two.toml {wrong} -o b.photons")).output().unwrap();
        assert_eq!(wrong.status.code(), Some(2));
    }
}
