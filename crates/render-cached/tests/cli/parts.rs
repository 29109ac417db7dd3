//! Parts of pictures, and the pictures that they are joined to.

use std::time::Duration;

use assert_cmd::assert::OutputAssertExt;

use crate::bench::{Bench, SCENE, SMALL};

/// Six blocks of 64x64 pixels, the last ones not full.
const RUN: &str = "scene.toml --photons a.photons --resolution 150x90 --shadow-rays 2 --gather 10 --caustic-gather 5";

fn tiles(bench: &Bench, options: &str, of: u32) -> String {
    let names: Vec<String> = (1..=of)
        .map(|i| {
            bench.run(&format!(
                "{RUN} {options} --tile {i}/{of} -o {i}.exr -t {} --exposure 1 --force",
                i % 3 + 1
            ));
            format!("{i}.exr")
        })
        .collect();
    names.join(" ")
}

#[test]
fn any_split_gives_the_bytes_of_one_run() {
    let bench = Bench::new();
    for (options, splits) in [
        ("--mode original", &[1, 2, 5, 6][1..]),
        ("--mode paper", &[2, 6]),
        (
            "--mode paper --tau-direct 0.01 --tau-indirect 0.2 --region 20 --fraction 0.01 --seed 3",
            &[6],
        ),
        ("--mode original --supersample 2 --filter mitchell", &[6]),
        ("--mode paper --supersample 2 --filter gaussian --tau-direct 0.3", &[6]),
        ("--mode adaptive --error 0", &[4]),
    ] {
        bench.run(&format!("{RUN} {options} -o whole.exr -o whole.png --force --exposure 1"));
        for &of in splits {
            let names = tiles(&bench, options, of);
            bench.run(&format!(
                "assemble {names} -o a.exr -o a.png --exposure 1 --force --stats a.json"
            ));
            assert!(bench.read("a.exr") == bench.read("whole.exr"), "{of} tiles, {options}");
            assert!(bench.read("a.png") == bench.read("whole.png"), "{of} tiles, {options}");
            assert_eq!(bench.json("a.json")["parts"], of);
        }
    }
}

#[test]
fn crops_lie_anywhere() {
    let bench = Bench::new();
    for options in ["--mode original", "--mode paper", "--mode paper --filter tent --supersample 2"]
    {
        bench.run(&format!("{RUN} {options} -o whole.exr --force"));
        let crops = ["0,150,0,33", "0,71,33,90", "71,149,33,90", "149,150,33,90"];
        for (i, crop) in crops.iter().enumerate() {
            bench.run(&format!("{RUN} {options} --crop {crop} -o {i}.exr --force"));
        }
        bench.run("assemble 2.exr 0.exr 3.exr 1.exr -o a.exr --force");
        assert!(bench.read("a.exr") == bench.read("whole.exr"), "{options}");
    }
}

/// Mode original renders a picture of so many subpixels in bands, of which each crop lies in one: borders show nowhere.
#[test]
fn large_pictures_are_those_of_their_crops() {
    // Far away, so that most rays meet nothing.
    let bench = Bench::of(&SCENE.replace("[0, 1, 4]", "[0, 1, 40]"));
    let run = "scene.toml --photons a.photons --shadow-rays 2 --gather 10 --caustic-gather 5 --mode original \
               --resolution 256x96 --supersample 16 --filter mitchell --checkpoint 0 --force";
    bench.run(&format!("{run} -o whole.exr -o whole.png -o again.exr --stats whole.json"));
    assert!(bench.read("again.exr") == bench.read("whole.exr"));
    // Three bands of 32 rows, and two rows of pixels on each side of the borders between them.
    assert_eq!(bench.json("whole.json")["rays"]["eye"], 256 * 256 * (96 + 8));
    for i in 0..4 {
        bench.run(&format!("{run} --crop 0,256,{},{} -o {i}.exr", 24 * i, 24 * i + 24));
    }
    bench.run("assemble 0.exr 1.exr 2.exr 3.exr -o a.exr -o a.png");
    assert!(bench.read("a.exr") == bench.read("whole.exr"));
    assert!(bench.read("a.png") == bench.read("whole.png"));
}

/// What a run that fails says, and leaves as it was.
fn refusal(bench: &Bench, args: &str, code: i32) -> String {
    let before = bench.files();
    let output = bench.command(args).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args}: {message}");
    assert!(bench.files() == before, "`{args}` has changed files");
    assert_eq!(message.lines().count(), 1, "{message}");
    message
}

#[test]
fn what_is_missing_double_or_foreign_is_named() {
    let bench = Bench::new();
    let options = "--mode original";
    bench.run(&format!("{RUN} {options} -o whole.exr"));
    tiles(&bench, options, 6);
    let join = |parts: &str| format!("assemble {parts} -o a.exr");

    // What the message says makes what is missing.
    let message = refusal(&bench, &join("1.exr 3.exr 4.exr 5.exr 6.exr"), 1);
    let told = "render-cached: columns 64 to 127 of rows 0 to 63 are in no part; name the part that holds them, or make it with: render-cached ";
    let remedy = message.strip_prefix(told).unwrap_or_else(|| panic!("{message}"));
    bench.run(&remedy.trim_end().replace("PART.exr", "part.exr"));
    bench.run(&join("1.exr 3.exr 4.exr 5.exr 6.exr part.exr"));
    assert!(bench.read("a.exr") == bench.read("whole.exr"));
    std::fs::remove_file(bench.path("a.exr")).unwrap();

    bench.write("again.exr", bench.read("2.exr"));
    let message = refusal(&bench, &join("1.exr 2.exr 3.exr 4.exr 5.exr 6.exr again.exr"), 1);
    let told =
        "render-cached: 2.exr and again.exr both hold pixel (64, 0); leave one of them out\n";
    let order =
        "render-cached: again.exr and 2.exr both hold pixel (64, 0); leave one of them out\n";
    assert!(message == told || message == order, "{message}");
    bench.run(&format!("{RUN} {options} --crop 60,70,10,20 -o over.exr"));
    let message = refusal(&bench, &join("1.exr 2.exr 3.exr 4.exr 5.exr 6.exr over.exr"), 1);
    assert!(message.contains(" and over.exr both hold pixel (6"), "{message}");

    for (other, difference) in [
        ("--mode original --seed 4", "scene, camera, photons or quality"),
        ("--mode original --resolution 150x91", "the resolution"),
        ("--mode paper", "their commands, "),
        ("--mode original --supersample 2", "their commands, "),
    ] {
        let run = RUN.replace(
            "--resolution 150x90 ",
            if other.contains("--res") { "" } else { "--resolution 150x90 " },
        );
        bench.run(&format!("{run} {other} --tile 2/6 -o other.exr --force"));
        let message = refusal(&bench, &join("1.exr other.exr 3.exr"), 1);
        let told = format!(
            "render-cached: other.exr is a part of another picture than 1.exr: they differ in {difference}"
        );
        assert!(message.starts_with(&told), "{message}");
    }
    let message = refusal(&bench, &join("1.exr whole.exr"), 1);
    assert!(
        message
            .starts_with("render-cached: whole.exr is not a part of a picture; make parts with "),
        "{message}"
    );
    let message = refusal(&bench, &join("1.exr a.photons"), 1);
    assert_eq!(message, "render-cached: a.photons is not an OpenEXR file\n");
    let message = refusal(&bench, &join("1.exr none.exr"), 1);
    assert!(message.contains("cannot read none.exr"), "{message}");
}

#[test]
fn a_damaged_part_is_named_and_made_again() {
    let bench = Bench::new();
    let options = "--mode original";
    bench.run(&format!("{RUN} {options} -o whole.exr"));
    let names = tiles(&bench, options, 2);
    let good = bench.read("2.exr");
    let mut flipped = good.clone();
    let middle = good.len() / 2;
    flipped[middle] ^= 16;
    for bad in [&flipped, &good[..middle]] {
        bench.write("2.exr", bad);
        let message = refusal(&bench, &format!("assemble {names} -o a.exr"), 1);
        assert!(message.starts_with("render-cached: 2.exr is damaged ("), "{message}");
    }
    tiles(&bench, options, 2);
    bench.run(&format!("assemble {names} -o a.exr"));
    assert!(bench.read("a.exr") == bench.read("whole.exr"));
}

/// A machine that fails leaves no part, and a part that two machines write is one of them.
#[test]
fn a_killed_tile_leaves_nothing_to_be_taken_for_one() {
    let bench = Bench::new();
    let options = "--mode original --shadow-rays 64";
    let run = RUN.replace("--shadow-rays 2", "");
    bench.run(&format!("{run} {options} -o whole.exr"));
    bench.run(&format!("{run} {options} --tile 1/2 -o 1.exr"));
    let tile = format!("{run} {options} --tile 2/2 -o 2.exr --force");
    let mut child = bench.command(&tile).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(50));
    child.kill().unwrap();
    child.wait().unwrap();
    // Where it was faster than the signal, the part is whole.
    if !bench.path("2.exr").exists() {
        let message = refusal(&bench, "assemble 1.exr -o a.exr", 1);
        assert!(message.contains("are in no part"), "{message}");
    }
    let mut both = [0; 2].map(|_| bench.command(&tile).spawn().unwrap());
    assert!(both.iter_mut().all(|child| child.wait().unwrap().success()));
    bench.run("assemble 1.exr 2.exr -o a.exr");
    assert!(bench.read("a.exr") == bench.read("whole.exr"));
}

#[test]
fn parts_that_cannot_be_are_wrong_usage() {
    let bench = Bench::new();
    let refuses = |options: &str, message: &str| {
        bench.refuses(&format!("{RUN} {options} -o a.exr"), 2, message);
    };
    refuses(
        "--mode original --tile 1/7",
        "a picture of 150x90 pixels has 6 blocks of 64x64 pixels; ask for as many tiles at most",
    );
    refuses(
        "--mode original --crop 0,151,0,10",
        "--crop 0,151,0,10 isn't a part of a picture of 150x90 pixels; give x0,x1,y0,y1 with x0 < x1 <= 150 and y0 < y1 <= 90",
    );
    refuses(
        "--mode paper --tile 1/2 --save-cache a.cache",
        "--save-cache and --from-cache are of whole pictures; leave out --tile or --crop",
    );
    for options in
        ["--tile 0/2", "--tile 2", "--crop 0,1,2", "--crop a,b,c,d", "--crop 0,10,0,10 --tile 1/2"]
    {
        bench.command(&format!("{SMALL} {options} -o a.exr")).assert().code(2);
    }
    bench.refuses(
        "assemble 1.exr -o a.gif",
        2,
        "cannot tell the format of a.gif; end its name in .exr or .png",
    );
}

#[test]
fn tiles_of_mode_adaptive_are_those_of_the_whole() {
    let bench = Bench::new();
    let run = RUN.replace("150x90", "220x150");
    for options in ["", "--supersample 2 --filter tent --error 0.03"] {
        let options = format!("{run} --mode adaptive {options}");
        bench.run(&format!("{options} -o whole.exr --force -t 1"));
        bench.run(&format!("{options} --save-layers a.layers --force -t 2"));
        let names: Vec<String> = (1..=5).map(|i| format!("{i}.exr")).collect();
        for (i, name) in (1..).zip(&names) {
            let tile = format!("--from-layers a.layers --tile {i}/5 -o {name} --force");
            bench.run(&format!("{options} {tile} --stats a.json"));
            assert_eq!(bench.json("a.json")["threads"], 1, "as many as are of use");
        }
        bench.run(&format!("assemble {} -o a.exr --force", names.join(" ")));
        assert!(bench.read("a.exr") == bench.read("whole.exr"), "{options}");
        for threads in [1, 3] {
            let again =
                format!("--from-layers a.layers -o again.exr --force --stats a.json -t {threads}");
            bench.run(&format!("{options} {again}"));
            assert_eq!(bench.json("a.json")["threads"], threads);
            assert!(bench.read("again.exr") == bench.read("whole.exr"), "{options}");
        }
    }

    let options = format!("{run} --mode adaptive");
    bench.refuses(
        &format!("{options} --tile 1/2 -o b.exr"),
        2,
        "mode adaptive looks at the whole picture: save it with --save-layers and without --tile or --crop, \
         then give --from-layers with them",
    );
    bench.refuses(
        &format!("{run} --mode original --save-layers b.layers"),
        2,
        "--save-layers and --from-layers need --mode adaptive with an --error above 0",
    );
    let message =
        refusal(&bench, &format!("{options} --from-layers a.layers --tile 1/2 -o b.exr"), 1);
    assert!(
        message.starts_with("render-cached: a.layers is of another picture: of render-cached "),
        "{message}"
    );
    // The command in the message makes what is asked for.
    let remedy = message.trim_end().split("make it anew with: render-cached ").nth(1).unwrap();
    bench.run(remedy);
    bench.run(&format!("{options} --from-layers a.layers --tile 1/2 -o b.exr"));
    let message = refusal(
        &bench,
        &format!("{options} --seed 3 --from-layers a.layers --tile 1/2 -o c.exr"),
        1,
    );
    assert!(message.contains("a.layers is stale: the seed changed"), "{message}");
    let mut bad = bench.read("a.layers");
    *bad.last_mut().unwrap() ^= 4;
    bench.write("a.layers", bad);
    // Only who shows what is damaged has read it.
    bench.run(&format!("{options} --from-layers a.layers --tile 1/2 -o c.exr"));
    let message =
        refusal(&bench, &format!("{options} --from-layers a.layers --tile 2/2 -o d.exr"), 1);
    assert!(message.starts_with("render-cached: a.layers is damaged: "), "{message}");
}

#[test]
fn tiles_of_mode_adaptive_read_no_photons() {
    let bench = Bench::new();
    let options = format!("{RUN} --mode adaptive");
    bench.run(&format!("{options} -o whole.exr"));
    bench.run(&format!("{options} --save-layers a.layers"));

    // Of a damaged map nothing is missed that isn't used, but the same photons it must be.
    let photons = bench.read("a.photons");
    let mut damaged = photons.clone();
    *damaged.last_mut().unwrap() ^= 4;
    bench.write("a.photons", &damaged);
    refusal(&bench, &format!("{options} -o b.exr"), 1);
    bench.run(&format!("{options} --from-layers a.layers -o again.exr"));
    assert!(bench.read("again.exr") == bench.read("whole.exr"));

    bench.photon_build("scene.toml -o a.photons --photons 5K --seed 1 --force");
    let message = refusal(&bench, &format!("{options} --from-layers a.layers -o b.exr"), 1);
    assert!(message.contains("a.layers is stale: the photon map changed"), "{message}");

    bench.photon_build("scene.toml -o a.photons --photons 5K -t 1 --force");
    assert!(bench.read("a.photons") == photons);
    bench.run(&format!("{options} --from-layers a.layers -o again.exr --force"));
}

#[test]
fn tiles_of_mode_adaptive_look_through_masks() {
    let veil = "\n[[meshes]]\nname = \"veil\"\nfile = \"veil.obj\"\n";
    let bench = Bench::with(&format!("{SCENE}{veil}"), |bench| {
        bench.write("veil.mtl", "newmtl veil\nKd 0.2 0.5 0.2\nd 0.5\n");
        bench.write(
            "veil.obj",
            "mtllib veil.mtl\nusemtl veil\nv -1 0.2 1.5\nv 1 0.2 1.5\nv 1 1.5 1.5\nv -1 1.5 1.5\nf 1 2 3 4\n",
        );
    });
    let options = format!("{RUN} --mode adaptive");
    bench.run(&format!("{options} -o whole.exr"));
    bench.run(&format!("{options} --save-layers a.layers"));
    for i in 1..=2 {
        bench.run(&format!("{options} --from-layers a.layers --tile {i}/2 -o {i}.exr"));
    }
    bench.run("assemble 1.exr 2.exr -o a.exr");
    assert!(bench.read("a.exr") == bench.read("whole.exr"));
}
