//! Caustics so thin that few samples see them.

use super::bench::Bench;

/// What a picture of a million pixels may show: no block that stands out.
const WORST_BLOCK: f64 = 0.15;

/// A floor of 4 x 4 seen from above, 320 pixels wide, under a small lamp.
const SCENE: &str = r#"
camera = { origin = [0, 4.6, 2.2], target = [0, 0, 0], fov = 42 }
[materials.white]
type = "diffuse"
albedo = 0.7
[materials.glass]
type = "glass"
ior = 1.5
[[quads]]
corner = [-2, 0, -2]
edges = [[0, 0, 4], [4, 0, 0]]
material = "white"
[materials.lamp]
type = "diffuse"
albedo = 0
emission = 400
[[quads]]
corner = [0.3, 3, 0.2]
edges = [[0.1, 0, 0], [0, 0, 0.1]]
material = "lamp"
"#;

#[test]
fn thin_caustics_are_not_missed() {
    let balls: String = (0..9)
        .map(|i| {
            let (x, z) = ((i % 3) as f32 * 1.1 - 1.13, (i / 3) as f32 * 1.1 - 1.07);
            format!("[[spheres]]\ncenter = [{x}, 0.12, {z}]\nradius = 0.06\nmaterial = \"glass\"\n")
        })
        .collect();
    let bench = Bench::of_text(&format!("{SCENE}{balls}"), "300K");
    // An estimate looks 1 to 4 pixels far: fewer than samples lie apart.
    for radius in [0.012, 0.025, 0.05] {
        let options = "--resolution 320x320 --shadow-rays 64 --gather 50 --caustic-radius";
        let pair = bench.both(&format!("{options} {radius}"));
        let flip = pair.difference("caustics").flip;
        let n_traced = pair.stats[0]["traced"]["caustic"].as_u64().unwrap();
        println!("{radius}: worst block {:.3}, {n_traced} traced", flip.worst_block_8x8);
        assert!(n_traced > 500 && n_traced < 10_000, "{radius}: {n_traced}");
        if flip.worst_block_8x8 > WORST_BLOCK {
            let folder = pair.show(&format!("adaptive-caustics-{radius}"), "caustics");
            panic!("{radius}: worst block {}, see {}", flip.worst_block_8x8, folder.display());
        }
    }
}
