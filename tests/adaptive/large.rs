//! Large pictures, in which the cache works on every fourth pixel: nothing that is a pixel wide may get lost between.

use super::bench::{Bench, metadata, work};

/// A mesh of wires as wide as a pixel over a floor and before a mirror, under a lamp and a bulb: their shadows have soft and hard edges.
const WIRES: &str = r#"
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
corner = [-1.9, 0.01, 0.6]
edges = [[0, 0.1, 1.1], [3.8, 0, 0]]
material = "silver"
[[quads]]
corner = [1.1, 3, -0.2]
edges = [[0.4, 0, 0], [0, 0, 0.4]]
material = "lamp"
[[lights]]
type = "point"
position = [1.3, 3, 0.3]
intensity = 8
"#;

const TARGET: f64 = 0.02;

/// Its width is odd, so that the last column stands alone.
#[test]
fn large_pictures_lose_nothing_thin() {
    let wires: String = (0..25)
        .map(|i| {
            let at = -0.9 + 0.075 * f64::from(i);
            let wire = |corner: [f64; 3], edges: [[f64; 3]; 2]| {
                format!("[[quads]]\ncorner = {corner:?}\nedges = {edges:?}\nmaterial = \"white\"\n")
            };
            let along = wire([at, 0.5, -0.9], [[0.0, 0.0, 1.8], [0.004, 0.0, 0.0]]);
            along + &wire([-0.9, 0.5, at], [[0.0, 0.0, 0.004], [1.8, 0.0, 0.0]])
        })
        .collect();
    let bench = Bench::of_text(&format!("{WIRES}{wires}"), "20K");
    let options = "--resolution 1025x1024 --shadow-rays 40 --gather 100";
    let pair = bench.both(&format!("{options} --error {TARGET}"));
    let [all, direct, specular] =
        ["", "direct", "specular"].map(|layer| pair.difference(layer).flip);
    let told = metadata(&pair.adaptive)["error"]["measured_mean"].as_f64().unwrap();
    let share = work(&pair.stats[0]) as f64 / work(&pair.stats[1]) as f64;
    let line = format!(
        "told {told:.5}, {all:?}; direct {direct:?}; specular {specular:?}; {share:.3} of the work"
    );
    println!("{line}");
    // Blended, both would have more than 0.005.
    if all.mean > 1.2 * TARGET
        || told > 2.0 * TARGET
        || direct.share_above_0_1 > 0.0002
        || direct.worst_block_8x8 > 0.15
        || specular.share_above_0_1 > 0.0005
        || share > 0.25
    {
        let folder = pair.show("adaptive-large", "");
        panic!("{line}, see {}", folder.display());
    }
}
