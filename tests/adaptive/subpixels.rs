//! Several eye rays a pixel: the cache works on one of them, and the others are told by those around.

use super::bench::{Bench, metadata, work};

/// Thin rods and a mirror over a floor, under a lamp and a bulb, whose shadows have soft and hard edges.
const RODS: &str = r#"
camera = { origin = [0, 4.6, 2.2], target = [0, 0, 0], fov = 42 }
[materials.white]
type = "diffuse"
albedo = 0.7
[materials.silver]
type = "mirror"
reflectance = 0.9
[materials.lamp]
type = "diffuse"
albedo = 0
emission = 12
[[quads]]
corner = [-2, 0, -2]
edges = [[0, 0, 4], [4, 0, 0]]
material = "white"
[[quads]]
corner = [-1.6, 0.02, -0.4]
edges = [[0, 0, 1.2], [1, 0.2, 0]]
material = "silver"
[[quads]]
corner = [1.1, 3, -0.2]
edges = [[0.4, 0, 0], [0, 0, 0.4]]
material = "lamp"
[[lights]]
type = "point"
position = [-1.3, 3, 0.3]
intensity = 5
"#;

/// A scene at 2x2 subpixels.
struct Case {
    name: &'static str,
    bench: Bench,
    options: &'static str,
    /// The share of the pixels that may be off by more than 0.1. Without the subpixels that are computed it is about twice as much.
    above: f64,
}

const TARGET: f64 = 0.02;

#[test]
fn subpixels_are_told_by_those_around() {
    let rods: String = (0..12)
        .map(|i| {
            let x = -1.8 + 0.3 * f64::from(i);
            format!(
                "[[quads]]\ncorner = [{x}, 0.6, -1.5]\nedges = [[0, 0, 3], [0.012, 0, 0]]\nmaterial = \"white\"\n"
            )
        })
        .collect();
    // White on black, and so small that most of it shows at subpixels between those that the cache works on.
    let dust: String = (0..81)
        .map(|i| {
            let (x, z) = (f64::from(i % 9), f64::from(i / 9));
            let (x, z) = (-1.63 + 0.3913 * x + 0.0171 * z, -1.31 + 0.3071 * z + 0.0133 * x);
            format!(
                "[[quads]]\ncorner = [{x}, 0.01, {z}]\nedges = [[0, 0, 0.014], [0.014, 0, 0]]\nmaterial = \"dust\"\n"
            )
        })
        .collect();
    let dust = format!("{dust}[materials.dust]\ntype = \"diffuse\"\nalbedo = 0.9\n");
    let cases = [
        Case {
            name: "box",
            bench: Bench::of_scene("cornell-box", "200K"),
            options: "--resolution 144x144 --shadow-rays 32 --gather 200",
            above: 0.0020,
        },
        Case {
            name: "rods",
            bench: Bench::of_text(&format!("{RODS}{rods}"), "20K"),
            options: "--resolution 144x144 --shadow-rays 32 --gather 200",
            above: 0.03,
        },
        Case {
            name: "dust",
            bench: Bench::of_text(&format!("{}{dust}", RODS.replace("0.7", "0.03")), "20K"),
            options: "--resolution 144x144 --shadow-rays 32 --gather 200",
            above: 0.001,
        },
        Case {
            name: "rough",
            bench: Bench::of_scene("rough", "100K"),
            options: "--resolution 128x128 --shadow-rays 16 --gather 200 --glossy-rays 4",
            above: 0.0030,
        },
    ];
    let mut faults = Vec::new();
    for Case { name, bench, options, above } in cases {
        let pair = bench.both(&format!("{options} --supersample 2 --error {TARGET}"));
        let flip = pair.difference("").flip;
        let told = metadata(&pair.adaptive)["error"]["measured_mean"].as_f64().unwrap();
        let share = work(&pair.stats[0]) as f64 / work(&pair.stats[1]) as f64;
        let line = format!("{name}: told {told:.5}, {flip:?}, {share:.3} of the work");
        println!("{line}");
        if flip.mean > 1.2 * TARGET
            || flip.share_above_0_1 > above
            || flip.worst_block_8x8 > 0.25
            || (told - flip.mean).abs() > 0.3 * flip.mean + 0.003
            || share > 0.31
        {
            let folder = pair.show(&format!("adaptive-subpixels-{name}"), "");
            faults.push(format!("{line}, see {}", folder.display()));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
