//! What is in a picture and in the account of it, and what changes neither.

use base::Component;
use serde_json::Value;

use crate::bench::{Bench, MODES, SMALL, assert_same_layers};

/// All channels, sorted as in the file. Only mode adaptive has levels.
const CHANNELS: &str = "Albedo.B Albedo.G Albedo.R B G N.X N.Y N.Z Ns.X Ns.Y Ns.Z P.X P.Y P.Z R Z \
    caustics.B caustics.G caustics.R direct.B direct.G direct.R emission.B emission.G emission.R \
    indirect.B indirect.G indirect.R level.caustics level.direct level.indirect level.specular \
    reason.caustics reason.direct reason.indirect reason.specular specular.B specular.G specular.R \
    traced.caustics traced.direct traced.indirect traced.specular";

const LAYERS: [&str; 4] = ["direct", "indirect", "specular", "caustics"];

#[test]
fn layers_add_up_to_the_picture() {
    let bench = Bench::new();
    for mode in MODES {
        bench.render(&format!("--mode {mode} -o {mode}.exr"));
        let picture = bench.picture(&format!("{mode}.exr"));
        let names: Vec<_> = picture.channels().map(|(name, _)| name).collect();
        let is_there = |name: &&str| mode == "adaptive" || !name.starts_with("level.");
        let expected: Vec<_> = CHANNELS.split_whitespace().filter(is_there).collect();
        assert_eq!(names, expected, "{mode}");
        for channel in ["R", "G", "B"] {
            let layer = |name: &str| picture.channel(&format!("{name}.{channel}")).unwrap();
            let whole = picture.channel(channel).unwrap();
            assert!(whole.iter().any(|&v| v > 0.0));
            for (i, value) in whole.iter().enumerate() {
                // In single precision and in this order.
                let sum =
                    LAYERS.iter().fold(layer("emission")[i], |sum, name| sum + layer(name)[i]);
                assert_eq!(value.to_bits(), sum.to_bits(), "{mode}, {channel} of pixel {i}");
            }
        }
        for name in LAYERS {
            let light: f32 = ["R", "G", "B"]
                .iter()
                .map(|channel| {
                    picture.channel(&format!("{name}.{channel}")).unwrap().iter().sum::<f32>()
                })
                .sum();
            assert!(light > 0.0, "no {name} light in mode {mode}");
        }
    }
}

#[test]
fn features_describe_the_first_surface() {
    let bench = Bench::new();
    bench.render("--mode original -o a.exr");
    let picture = bench.picture("a.exr");
    let at = |name: &str| picture.channel(name).unwrap();
    let mut n_floor = 0;
    for i in 0..48 * 32 {
        let length2: f32 =
            ["X", "Y", "Z"].iter().map(|axis| at(&format!("N.{axis}"))[i].powi(2)).sum();
        if at("Z")[i] == 0.0 {
            // Nothing is seen there.
            assert_eq!((length2, at("traced.direct")[i]), (0.0, 0.0));
            continue;
        }
        assert!((length2 - 1.0).abs() < 1e-5);
        assert!((at("P.Z")[i] + at("Z")[i] - 4.0).abs() < 1e-5, "the camera looks along -z from 4");
        if at("P.Y")[i].abs() < 1e-6 && at("N.Y")[i] > 0.99 {
            n_floor += 1;
            assert_eq!([at("Albedo.R")[i], at("Albedo.G")[i], at("Albedo.B")[i]], [0.8, 0.7, 0.6]);
            assert_eq!(at("Ns.Y")[i], 1.0);
        }
    }
    assert!(n_floor > 100);
}

#[test]
fn the_command_in_a_picture_makes_it_anew() {
    let bench = Bench::new();
    let options = [
        "--mode original --seed 9 --gather-radius 0.3 --caustic-radius 0.2 --kernel cone",
        "--mode paper --tau-direct 0.11 --tau-indirect 0.07 --tau-specular 0.3 --region 6 --r0 0.7 --fraction 0.03",
        "--mode paper --exposure 2.5",
        "--mode adaptive --error 0.031 --exposure -1.5",
        "--error 0",
    ];
    for options in options {
        bench.render(&format!("{options} -o a.exr --force -t 1"));
        let metadata: Value = serde_json::from_str(bench.picture("a.exr").metadata()).unwrap();
        let keys: Vec<_> = metadata.as_object().unwrap().keys().cloned().collect();
        assert_eq!(keys.join(" "), "command error inputs seed version");
        assert_eq!(metadata["version"], env!("CARGO_PKG_VERSION"));
        let command = metadata["command"].as_str().unwrap();
        let args = command.strip_prefix("render-cached ").unwrap();
        bench.run(&format!("{args} -o b.exr -t 2"));
        assert!(bench.read("a.exr") == bench.read("b.exr"), "{command}");
    }
}

#[test]
fn threads_change_no_byte_and_no_count() {
    let bench = Bench::new();
    // Large enough for several tasks and tiles.
    let size = SMALL.replace("48x32", "90x70");
    for mode in MODES {
        let cache = if mode == "paper" { "--save-cache" } else { "--stats" };
        let mut accounts = Vec::new();
        for threads in ["1", "2", "3"] {
            let name = |ending: &str| format!("{mode}-{threads}.{ending}");
            let (exr, png, json) = (name("exr"), name("png"), name("json"));
            bench.run(&format!(
                "{size} --mode {mode} -t {threads} -o {exr} -o {png} --stats {json}"
            ));
            if mode == "paper" {
                bench.run(&format!("{size} --mode paper -t {threads} {cache} {}", name("cache")));
            }
            let mut account = bench.json(&json);
            assert_eq!(account["threads"].to_string(), threads);
            for varies in
                ["threads", "seconds", "cpu_seconds", "peak_rss_bytes", "predicted_rss_bytes"]
            {
                account[varies] = Value::Null;
            }
            accounts.push(account);
        }
        assert_eq!(accounts[0], accounts[1]);
        assert_eq!(accounts[0], accounts[2]);
    }
    let files = bench.files();
    let mut n_compared = 0;
    for (name, content) in
        files.iter().filter(|(name, _)| name.contains('-') && !name.ends_with("json"))
    {
        let first = format!("{}-1{}", &name[..name.len() - 6], &name[name.len() - 4..]);
        let first = if name.ends_with("cache") { "paper-1.cache".into() } else { first };
        assert!(*content == files[&first], "{name} and {first} differ");
        n_compared += 1;
    }
    assert_eq!(n_compared, 3 * 7);
}

#[test]
fn without_tolerance_all_modes_are_the_original() {
    let bench = Bench::new();
    bench.render("--mode original -o original.exr --stats original.json");
    let original = bench.picture("original.exr");
    for options in [
        "--mode paper --tau-direct 0 --tau-indirect 0 --tau-specular 0",
        "--mode paper --fraction 1",
        "--mode adaptive --error 0",
    ] {
        bench.render(&format!("{options} -o a.exr --stats a.json --force"));
        // Why a pixel was computed differs between the modes; that it was does not.
        assert_same_layers(&original, &bench.picture("a.exr"), &["reason."]);
        let stats = bench.json("a.json");
        assert_eq!(stats["traced"], bench.json("original.json")["traced"], "{options}");
        for component in Component::ALL {
            assert_eq!(stats["interpolated"][component.name()], 0, "{options}");
        }
    }
}

#[test]
fn stats_keep_their_contract() {
    let bench = Bench::new();
    let keys =
        |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>().join(" ");
    for mode in MODES {
        bench
            .render(&format!("--mode {mode} -o {mode}.exr -o {mode}.png --stats {mode}.json -t 2"));
        let stats = bench.json(&format!("{mode}.json"));
        // How many specular chains were cut, and what was reused, is more than the contract asks for.
        assert_eq!(
            keys(&stats),
            "chains_cut cpu_seconds error interpolated mode peak_rss_bytes photons_fingerprint photons_visited \
             predicted_rss_bytes program rays resolution reused scene seconds seed supersample threads traced version"
        );
        for times in ["seconds", "cpu_seconds"] {
            let stages = "cache caustic direct indirect load primary specular total write";
            assert_eq!(keys(&stats[times]), stages);
            let value = |stage: &str| stats[times][stage].as_f64().unwrap();
            let parts: f64 = stages.split(' ').filter(|s| *s != "total").map(value).sum();
            // What comes after all pictures are written isn't counted.
            assert!(parts > 0.0 && parts <= value("total") * 1.0001, "{stats}");
        }
        assert_eq!(keys(&stats["traced"]), "caustic direct indirect specular");
        assert_eq!(keys(&stats["interpolated"]), "caustic direct indirect specular");
        assert_eq!(keys(&stats["reused"]), "caustic direct indirect specular");
        assert_eq!(keys(&stats["rays"]), "eye gather shadow specular");
        if mode == "adaptive" {
            assert_eq!(keys(&stats["error"]), "held_out_pixels measured_mean measured_p995 target");
            assert_eq!(stats["error"]["target"].to_string(), "0.01");
        } else {
            assert_eq!(stats["error"], Value::Null);
        }
        assert_eq!(stats["program"], "render-cached");
        assert_eq!(stats["version"], env!("CARGO_PKG_VERSION"));
        assert_eq!((&stats["scene"], &stats["mode"]), (&"scene.toml".into(), &mode.into()));
        assert_eq!(stats["resolution"].to_string(), "[48,32]");
        let number = |value: &Value| value.as_u64().unwrap();
        assert_eq!(
            [&stats["supersample"], &stats["seed"], &stats["threads"]].map(number),
            [1, 0, 2]
        );
        assert_eq!(number(&stats["rays"]["eye"]), 48 * 32);
        assert!(number(&stats["rays"]["shadow"]) > 0 && number(&stats["photons_visited"]) > 0);

        let picture = bench.picture(&format!("{mode}.exr"));
        let is_surface = |z: &&f32| **z != 0.0;
        let n_surfaces = picture.channel("Z").unwrap().iter().filter(is_surface).count() as u64;
        for (component, layer) in Component::ALL.into_iter().zip(LAYERS) {
            let traced = number(&stats["traced"][component.name()]);
            let interpolated = number(&stats["interpolated"][component.name()]);
            assert_eq!(traced + interpolated, n_surfaces, "{mode}, {component}");
            let flags = picture.channel(&format!("traced.{layer}")).unwrap();
            assert_eq!(flags.iter().sum::<f32>() as u64, traced, "{mode}, {component}");
        }
    }
}

#[test]
fn verbosity_is_heeded() {
    let bench = Bench::new();
    for mode in MODES {
        let said = |args: &str| {
            let (out, err) = bench.run(&format!("{SMALL} --mode {mode} -o a.exr --force {args}"));
            assert_eq!(out, "");
            assert!(err.lines().all(|line| line.starts_with("render-cached: ")), "{err}");
            err
        };
        assert_eq!(said("-q"), "");
        let (normal, verbose) = (said(""), said("-v"));
        assert!(
            normal.contains("48x32 in ") && normal.contains("% of the pixels traced"),
            "{normal}"
        );
        assert!(verbose.lines().count() > normal.lines().count(), "{verbose}");
        assert!(
            verbose.contains("caustic photons") && verbose.contains("rays from the eye"),
            "{verbose}"
        );
    }
}
