//! Every message about a scene file, read aloud.

mod common;

use common::load_files;

/// A scene without faults, in which each case breaks one thing.
const GOOD: &str = r#"[camera]
origin = [0, 1, 5]
target = [0, 1, 0]
fov = 40

[materials.white]
type = "diffuse"
albedo = [0.7, 0.7, 0.7]
emission = 0

[materials.gilt]
type = "metal"
preset = "gold"

[materials.pane]
type = "glass"
ior = 1.5
absorption = 0

[materials.chrome]
type = "mirror"
reflectance = 0.75
albedo = 0.25

[materials.tube]
type = "diffuse"
albedo = 0
emission = 3

[[quads]]
name = "floor"
corner = [-2, 0, -2]
edges = [[0, 0, 4], [4, 0, 0]]
material = "white"

[[quads]]
corner = [-1, 4, -1]
edges = [[2, 0, 0], [0, 0, 2]]
material = "tube"

[[boxes]]
name = "crate"
min = [-1.5, 0.5, -1]
max = [-0.5, 1.5, 0]
material = "gilt"
transform = { rotate = { axis = [0, 1, 0], degrees = 30 } }

[[spheres]]
name = "ball"
center = [1, 1, 0]
radius = 0.5
material = "pane"

[[spheres]]
name = "globe"
center = [0, 1, -1]
radius = 0.25
material = "chrome"

[[lights]]
name = "lamp"
type = "spot"
position = [0, 3, 0]
target = [0, 0, 0]
intensity = [10, 10, 10]
cone_angle = 30
falloff_angle = 20

[[lights]]
type = "directional"
direction = [0, -1, 0]
irradiance = 1

[[lights]]
type = "environment"
radiance = 0.1

[[lights]]
type = "point"
position = [1, 2, 3]
intensity = 4
"#;

#[test]
fn good_scene_loads() {
    let loaded = load_files(&[("scene.toml", GOOD.as_bytes())]).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let names: Vec<_> = loaded.scene.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["quad 2", "lamp", "light 2", "light 3", "light 4"]);
}

/// What breaking the good scene gives. The text that is replaced must occur; its first occurrence counts.
fn broken(old: &str, new: &str) -> String {
    assert!(GOOD.contains(old), "`{old}` isn't in the good scene");
    let text = GOOD.replacen(old, new, 1);
    outcome(&text)
}

fn outcome(text: &str) -> String {
    load_files(&[("scene.toml", text.as_bytes())])
        .map(|loaded| format!("no error; warnings: {:?}", loaded.warnings))
        .unwrap_or_else(|e| e)
}

#[test]
fn faults_of_syntax() {
    #[rustfmt::skip]
    let cases = [
        ("fov = 40", "fov = 40\nlens = 3",
         "scene.toml:5:1: unknown key `lens`, expected one of `origin`, `target`, `up`, `fov`, `fov_axis`, `aperture_radius`, `focus_distance`"),
        ("[camera]\norigin = [0, 1, 5]", "[camera]",
         "scene.toml:1:1: missing key `origin`"),
        ("fov = 40", "fov = ",
         "scene.toml:4:7: string values must be quoted, expected literal string"),
        ("fov = 40", "fov = \"wide\"",
         "scene.toml:4:7: invalid type: string \"wide\", expected a number"),
        ("origin = [0, 1, 5]", "origin = [0, 1]",
         "scene.toml:2:10: invalid length 2, expected an array of length 3"),
        ("albedo = [0.7, 0.7, 0.7]", "albedo = [0.7, 0.7]",
         "scene.toml:8:10: invalid length 2, expected a number or three numbers [r, g, b]"),
        ("albedo = [0.7, 0.7, 0.7]", "albedo = [0.7, 0.7, 0.7, 1]",
         "scene.toml:8:10: invalid length 4, expected a number or three numbers [r, g, b]"),
        ("albedo = [0.7, 0.7, 0.7]", "albedo = true",
         "scene.toml:8:10: invalid type: boolean `true`, expected a number or three numbers [r, g, b]"),
        ("[materials.gilt]", "[materials.white]",
         "scene.toml:11:12: duplicate key"),
        ("[[quads]]", "[quads]",
         "scene.toml:36:3: duplicate key"),
        ("transform = {", "transform = 3 #",
         "scene.toml:46:13: invalid type: integer `3`, expected a table"),
        ("transform = { rotate = {", "transform = { rotate = 3 } # {",
         "scene.toml:46:24: invalid type: integer `3`, expected { axis = [x, y, z], degrees = angle } or a list of such"),
        ("degrees = 30", "radians = 30",
         "scene.toml:46:44: unknown key `radians`, expected `axis` or `degrees`"),
    ];
    for (old, new, expected) in cases {
        assert_eq!(broken(old, new), expected);
    }
}

#[test]
fn faults_of_the_camera() {
    #[rustfmt::skip]
    let cases = [
        ("origin = [0, 1, 5]", "origin = [0, nan, 5]",
         "scene.toml:2:10: the origin of the camera holds NaN; give finite numbers"),
        ("origin = [0, 1, 5]", "origin = [0, 1, 2e8]",
         "scene.toml:2:10: the origin of the camera is too far away; keep coordinates within 1e8, such as by a larger unit of length"),
        ("target = [0, 1, 0]", "target = [0, 1, 5]",
         "scene.toml:3:10: target and origin of the camera are the same point; move one"),
        ("target = [0, 1, 0]", "target = [0, 3, 5]",
         "scene.toml:3:10: the camera looks along its up vector; give another `up`, such as [0, 0, 1]"),
        ("fov = 40", "fov = 40\naperture_radius = 0",
         "scene.toml:5:19: the aperture_radius of the camera is 0; give a length above 0 and up to 1e8"),
        ("fov = 40", "fov = 40\naperture_radius = 1\nfocus_distance = nan",
         "scene.toml:6:18: the focus_distance of the camera is NaN; give a finite number"),
        ("fov = 40", "fov = 40\nfocus_distance = 1",
         "scene.toml:5:18: focus_distance needs an aperture_radius; without one everything is sharp"),
        ("fov = 40", "fov = 40\nup = [0, 0, 0]",
         "scene.toml:5:6: the up vector of the camera has no length; give a direction"),
        ("fov = 40", "fov = 40\nup = [0, 0, -1]",
         "scene.toml:5:6: the camera looks along its up vector; give another `up`, such as [0, 0, 1]"),
        ("fov = 40", "fov = 180",
         "scene.toml:4:7: the fov of the camera is 180; give degrees between 0 and 180, such as 40"),
        ("fov = 40", "fov = 0",
         "scene.toml:4:7: the fov of the camera is 0; give degrees between 0 and 180, such as 40"),
        ("fov = 40", "fov = inf",
         "scene.toml:4:7: the fov of the camera is inf; give a finite number"),
        ("fov = 40", "fov = 40\nfov_axis = \"z\"",
         "scene.toml:5:12: the fov_axis \"z\" is unknown; the axes are x, y, smaller, larger and diagonal"),
        ("origin = [0, 1, 5]", "origin = [-1, 1, -0.5]",
         "scene.toml: the camera is shut in by `crate`, which is opaque and has no light inside; move one of them"),
        ("origin = [0, 1, 5]", "origin = [0, 1, -1.125]",
         "scene.toml: the camera is shut in by `globe`, which is opaque and has no light inside; move one of them"),
    ];
    for (old, new, expected) in cases {
        assert_eq!(broken(old, new), expected);
    }
}

#[test]
fn faults_of_materials() {
    #[rustfmt::skip]
    let cases = [
        ("albedo = [0.7, 0.7, 0.7]", "albedo = [0.7, nan, 0.7]",
         "scene.toml:8:10: the albedo of material `white` holds NaN; give finite numbers"),
        ("albedo = [0.7, 0.7, 0.7]", "albedo = [0.7, -0.1, 0.7]",
         "scene.toml:8:10: the albedo of material `white` is negative; use 0 or more in every channel"),
        ("albedo = [0.7, 0.7, 0.7]", "albedo = 1.01",
         "scene.toml:8:10: the albedo of material `white` is above 1, which would create light; use at most 1 in every channel"),
        ("emission = 3", "emission = [1, -1, 0]",
         "scene.toml:28:12: the emission of material `tube` is negative; use 0 or more in every channel"),
        ("emission = 3", "emission = 1e30",
         "scene.toml:28:12: the emission of material `tube` is too large; use at most 1e15"),
        ("albedo = [0.7, 0.7, 0.7]\n", "",
         "scene.toml:7:8: material `white` of type \"diffuse\" needs the key `albedo`"),
        ("type = \"diffuse\"", "type = \"matte\"",
         "scene.toml:7:8: material `white` has the unknown type \"matte\"; the types are diffuse, mirror, metal, plastic, glass and pane"),
        ("emission = 0", "ior = 1.5",
         "scene.toml:9:7: material `white` of type \"diffuse\" takes no `ior`; its keys are albedo, albedo_texture, emission, emission_texture, opacity and opacity_texture"),
        ("preset = \"gold\"", "preset = \"tin\"",
         "scene.toml:13:10: material `gilt` names the unknown preset \"tin\"; the presets are aluminium, chromium, copper, gold, iron, platinum and silver"),
        ("preset = \"gold\"", "preset = \"gold\"\nk = 3",
         "scene.toml:14:5: material `gilt` has a preset and values of its own; keep one of the two"),
        ("preset = \"gold\"", "",
         "scene.toml:12:8: material `gilt` of type \"metal\" needs the keys `eta` and `k`, or `preset`"),
        ("preset = \"gold\"", "eta = 0.2",
         "scene.toml:12:8: material `gilt` of type \"metal\" needs the key `k`"),
        ("preset = \"gold\"", "eta = 0\nk = 3",
         "scene.toml:13:7: the eta of material `gilt` is too small; use at least 0.001 in every channel"),
        ("preset = \"gold\"", "eta = 1\nk = 3000",
         "scene.toml:14:5: the k of material `gilt` is too large; use at most 1000"),
        ("ior = 1.5", "ior = 0",
         "scene.toml:17:7: the ior of material `pane` is 0; indices of refraction lie between 0.1 and 10"),
        ("ior = 1.5", "ior = -1.5",
         "scene.toml:17:7: the ior of material `pane` is -1.5; indices of refraction lie between 0.1 and 10"),
        ("ior = 1.5", "",
         "scene.toml:16:8: material `pane` of type \"glass\" needs the key `ior`"),
        ("absorption = 0", "absorption = -1",
         "scene.toml:18:14: the absorption of material `pane` is negative; use 0 or more in every channel"),
        ("absorption = 0", "emission = 1",
         "scene.toml:18:12: material `pane` is glass, which cannot emit; give the emission to a diffuse material"),
        ("absorption = 0", "roughness = -0.1",
         "scene.toml:18:13: the roughness of material `pane` is -0.1; use 0 to 1"),
        ("preset = \"gold\"", "preset = \"gold\"\nroughness = 1.5",
         "scene.toml:14:13: the roughness of material `gilt` is 1.5; use 0 to 1"),
        ("preset = \"gold\"", "preset = \"gold\"\nroughness = nan",
         "scene.toml:14:13: the roughness of material `gilt` is NaN; give a finite number"),
        ("emission = 0", "roughness = 0.5",
         "scene.toml:9:13: material `white` of type \"diffuse\" takes no `roughness`; its keys are albedo, albedo_texture, emission, emission_texture, opacity and opacity_texture"),
        ("preset = \"gold\"", "preset = \"gold\"\nroughness = 0.3", "no error; warnings: []"),
        ("albedo = 0.25", "roughness = 0.01",
         "no error; warnings: [\"scene.toml:23:13: the roughness of material `chrome` is rendered as 0, since it is below 0.02\"]"),
        ("ior = 1.5\nabsorption = 0", "ior = 1.005\nroughness = 0.5",
         "no error; warnings: [\"scene.toml:18:13: the roughness of material `pane` is rendered as 0, since glass of this ior doesn't bend light\"]"),
        ("albedo = 0.25", "albedo = 0.3",
         "scene.toml:23:10: albedo and reflectance of material `chrome` add up to more than 1, which would create light; lower one of them"),
    ];
    for (old, new, expected) in cases {
        assert_eq!(broken(old, new), expected);
    }
    // Exactly 1 is allowed.
    assert_eq!(broken("albedo = [0.7, 0.7, 0.7]", "albedo = 1"), "no error; warnings: []");
    assert_eq!(
        broken("ior = 1.5", "ior = 1"),
        "no error; warnings: [\"scene.toml:17:7: the ior of material `pane` is 1, so it is invisible\"]"
    );
    assert_eq!(
        broken("material = \"white\"", "material = \"tube\""),
        "no error; warnings: [\"scene.toml:6:1: material `white` is not used\"]"
    );
}

#[test]
fn faults_of_textures() {
    let board = "[textures.tiles]\ntype = \"checkerboard\"\ncolors = [0.5, 1]\n\n[materials.white]";
    let textured = |from: &str, to: &str| {
        let text = GOOD
            .replace("[materials.white]", board)
            .replace("albedo = [0.7, 0.7, 0.7]", "albedo_texture = \"tiles\"");
        assert!(text.contains(from), "{from}");
        outcome(&text.replacen(from, to, 1))
    };
    #[rustfmt::skip]
    let cases = [
        ("colors", "colors", "no error; warnings: []"),
        ("type = \"checkerboard\"", "type = \"stripes\"",
         "scene.toml:7:8: texture `tiles` has the unknown type \"stripes\"; the types are bitmap and checkerboard"),
        ("colors = [0.5, 1]\n", "",
         "scene.toml:7:8: texture `tiles` of type \"checkerboard\" needs the key `colors`"),
        ("colors = [0.5, 1]", "colors = [0.5, -1]",
         "scene.toml:8:16: a color of texture `tiles` is negative; use 0 or more in every channel"),
        ("colors = [0.5, 1]", "colors = [0.5, 2]",
         "scene.toml:12:18: the texture of material `white` reaches 2, with which more light would leave than arrives; lower `albedo`, which it is multiplied with"),
        ("colors = [0.5, 1]", "colors = [0.5, 1]\nscale = [1, inf]",
         "scene.toml:9:9: the scale of texture `tiles` is [1, inf]; keep both within 1e5"),
        ("colors = [0.5, 1]", "colors = [0.5, 1]\noffset = [1e6, 0]",
         "scene.toml:9:10: the offset of texture `tiles` is [1000000, 0]; keep both within 1e5"),
        ("colors = [0.5, 1]", "colors = [0.5, 1]\nrotate = nan",
         "scene.toml:9:10: the rotation of texture `tiles` is NaN; give a finite number"),
        ("\"tiles\"", "\"tile\"",
         "scene.toml:12:18: material `white` names the unknown texture \"tile\"; the textures are tiles"),
        ("reflectance = 0.75\nalbedo = 0.25", "reflectance = 0.75\nalbedo = 0.5\nalbedo_texture = \"tiles\"",
         "scene.toml:27:10: the texture of material `chrome` reaches 1, with which more light would leave than arrives; lower `albedo`, which it is multiplied with"),
        ("preset = \"gold\"", "preset = \"gold\"\nalbedo_texture = \"tiles\"",
         "scene.toml:18:18: material `gilt` of type \"metal\" takes no `albedo_texture`; its keys are eta, k, preset, roughness, emission, emission_texture, opacity and opacity_texture"),
        ("albedo_texture = \"tiles\"", "albedo = 0.5",
         "no error; warnings: [\"scene.toml:6:1: texture `tiles` is not used\"]"),
    ];
    for (from, to, expected) in cases {
        assert_eq!(textured(from, to), expected, "{to}");
    }
    let bitmap = |keys: &str| textured("type = \"checkerboard\"\ncolors = [0.5, 1]", keys);
    #[rustfmt::skip]
    let cases = [
        ("type = \"bitmap\"",
         "scene.toml:7:8: texture `tiles` of type \"bitmap\" needs the key `file`"),
        ("type = \"bitmap\"\nfile = \"a.png\"",
         "scene.toml:8:8: cannot read a.png: there is no such file"),
        ("type = \"bitmap\"\nfile = \"scene.toml\"",
         "scene.toml:8:8: the format of scene.toml is unknown; use .png, .jpg, .tga, .bmp, .hdr or .exr"),
        ("type = \"bitmap\"\nfile = \"a.png\"\nfilter = \"cubic\"",
         "scene.toml:9:10: the filter of texture `tiles` is \"cubic\"; it may be one of bilinear and nearest"),
        ("type = \"bitmap\"\nfile = \"a.png\"\nwrap = \"zero\"",
         "scene.toml:9:8: the wrap of texture `tiles` is \"zero\"; it may be one of repeat, mirror and clamp"),
        ("type = \"bitmap\"\nfile = \"a.png\"\ncolors = [0, 1]",
         "scene.toml:9:11: texture `tiles` of type \"bitmap\" takes no `colors`; its keys are file, raw, filter, wrap, scale, rotate and offset"),
    ];
    for (keys, expected) in cases {
        assert_eq!(bitmap(keys), expected);
    }
}

#[test]
fn faults_of_surfaces() {
    #[rustfmt::skip]
    let cases = [
        ("edges = [[0, 0, 4], [4, 0, 0]]", "edges = [[0, 0, 4], [0, 0, 2]]",
         "scene.toml:33:21: quad `floor` has no area; give two edges that are not parallel"),
        ("edges = [[2, 0, 0], [0, 0, 2]]", "edges = [[2, 0, 0], [0, 0, 0]]",
         "scene.toml:38:21: quad `quad 2` has no area; give two edges that are not parallel"),
        ("edges = [[2, 0, 0], [0, 0, 2]]", "edges = [[2, 0, inf], [0, 0, 0]]",
         "scene.toml:38:10: an edge of quad `quad 2` holds inf; give finite numbers"),
        ("material = \"white\"", "material = \"whit\"",
         "scene.toml:34:12: quad `floor` names the unknown material \"whit\"; the materials are chrome, gilt, pane, tube and white"),
        ("name = \"ball\"", "name = \"floor\"",
         "scene.toml:49:8: two objects are named \"floor\"; rename one"),
        ("name = \"ball\"", "name = \"\"",
         "scene.toml:49:8: a name must be one line of at least one character"),
        ("max = [-0.5, 1.5, 0]", "max = [-0.5, 0.5, 0]",
         "scene.toml:41:1: box `crate` has no volume; make it larger than 0 along every axis"),
        ("max = [-0.5, 1.5, 0]", "size = [1, 1, 1]",
         "scene.toml:41:1: box `crate` needs either `min` and `max` or `center` and `size`"),
        ("radius = 0.5", "radius = 0",
         "scene.toml:51:10: the radius of sphere `ball` is 0; give one above 0 and up to 1e8"),
        ("radius = 0.5", "radius = -0.5",
         "scene.toml:51:10: the radius of sphere `ball` is -0.5; give one above 0 and up to 1e8"),
        ("{ axis = [0, 1, 0], degrees = 30 }", "{ axis = [0, 0, 0], degrees = 30 }",
         "scene.toml:46:33: the axis of the transform of box `crate` has no length; give a direction"),
        ("transform = { rotate", "transform = { scale = [1, 0, 1], rotate",
         "scene.toml:46:13: the transform of box `crate` flattens it; every scale must differ from 0 and the axes from each other"),
        ("{ rotate = { axis = [0, 1, 0], degrees = 30 } }", "{ translate = [nan, 0, 0] }",
         "scene.toml:46:13: the transform of box `crate` holds values that are not finite; give finite numbers"),
        ("{ rotate = { axis = [0, 1, 0], degrees = 30 } }", "{ translate = [1e9, 0, 0] }",
         "scene.toml:46:13: the transform of box `crate` moves it too far away; keep coordinates within 1e8"),
        ("{ rotate = { axis = [0, 1, 0], degrees = 30 } }", "{ scale = 1e-12 }",
         "scene.toml:41:1: box `crate` is too thin for single precision; make it thicker"),
        ("transform = { rotate", "transform = { matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], rotate",
         "scene.toml:46:13: the transform of box `crate` has a matrix and other keys; keep one of the two"),
        ("{ rotate = { axis = [0, 1, 0], degrees = 30 } }", "{ matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]] }",
         "scene.toml:46:24: the last row of the transform of box `crate` must be [0, 0, 0, 1]"),
    ];
    for (old, new, expected) in cases {
        assert_eq!(broken(old, new), expected);
    }
    assert_eq!(
        broken("material = \"white\"", "material = \"pane\""),
        "no error; warnings: [\"scene.toml:30:1: quad `floor`: the glass has 4 open edges, where light leaks; close it\", \"scene.toml:6:1: material `white` is not used\"]"
    );
}

#[test]
fn faults_of_lights() {
    #[rustfmt::skip]
    let cases = [
        ("type = \"spot\"", "type = \"laser\"",
         "scene.toml:62:8: light `lamp` has the unknown type \"laser\"; the types are point, spot, directional and environment"),
        ("radiance = 0.1", "radiance = 0.1\nrotate = { axis = [0, 1, 0], degrees = 9 }",
         "scene.toml:77:10: light `light 3` of type \"environment\" takes no `rotate`; its keys are radiance and file"),
        ("radiance = 0.1", "file = \"sky.hdr\"", "scene.toml:76:8: cannot read sky.hdr: there is no such file"),
        ("radiance = 0.1", "file = \"sky.gif\"",
         "scene.toml:76:8: the format of sky.gif is unknown; use .png, .jpg, .tga, .bmp, .hdr or .exr"),
        ("target = [0, 0, 0]\n", "",
         "scene.toml:62:8: light `lamp` of type \"spot\" needs the key `target`"),
        ("target = [0, 0, 0]", "target = [0, 3, 0]",
         "scene.toml:64:10: target and position of light `lamp` are the same point; move one"),
        ("target = [0, 0, 0]", "direction = [0, 0, 0]",
         "scene.toml:64:13: light `lamp` of type \"spot\" takes no `direction`; its keys are position, target, intensity, cone_angle and falloff_angle"),
        ("intensity = [10, 10, 10]", "intensity = [10, -10, 10]",
         "scene.toml:65:13: the intensity of light `lamp` is negative; use 0 or more in every channel"),
        ("cone_angle = 30", "cone_angle = 0",
         "scene.toml:66:14: the cone_angle of light `lamp` is 0; half angles of cones lie above 0 and up to 180 degrees"),
        ("cone_angle = 30", "cone_angle = 0.001\nfalloff_angle = 0",
         "scene.toml:68:1: duplicate key"),
        ("falloff_angle = 20", "falloff_angle = 31",
         "scene.toml:67:17: the falloff_angle of light `lamp` is 31; it lies between 0 and the cone_angle, 30"),
        ("cone_angle = 30\nfalloff_angle = 20", "cone_angle = 1e-6",
         "scene.toml:66:14: the cone_angle of light `lamp` is too small to hold any direction; widen it"),
        ("direction = [0, -1, 0]", "direction = [0, 0, 0]",
         "scene.toml:71:13: the direction of light `light 2` has no length; give a direction"),
        ("irradiance = 1", "intensity = 1",
         "scene.toml:72:13: light `light 2` of type \"directional\" takes no `intensity`; its keys are direction and irradiance"),
        ("radiance = 0.1", "radiance = inf",
         "scene.toml:76:12: the radiance of light `light 3` holds inf; give finite numbers"),
    ];
    for (old, new, expected) in cases {
        assert_eq!(broken(old, new), expected);
    }
    assert_eq!(
        broken("radiance = 0.1", "radiance = [0, 0, -0.0]"),
        "no error; warnings: [\"scene.toml:74:1: light `light 3` is black and left out\"]"
    );
}

/// Camera, a white quad of a given size and place, and what else is given.
fn small(quad: &str, rest: &str) -> String {
    let text = format!(
        "camera = {{ origin = [0, 1, 5], target = [0, 1, 0], fov = 40 }}\n\
         materials.white = {{ type = \"diffuse\", albedo = 0.5 }}\n\
         quads = [{quad}]\n{rest}"
    );
    load_files(&[("scene.toml", text.as_bytes())])
        .map(|loaded| format!("no error; warnings: {:?}", loaded.warnings))
        .unwrap_or_else(|e| e)
}

#[test]
fn faults_of_the_whole() {
    let quad = |corner: &str, size: &str| {
        format!(
            "{{ corner = {corner}, edges = [[{size}, 0, 0], [0, {size}, 0]], material = \"white\" }}"
        )
    };
    let lights = "lights = [{ type = \"environment\", radiance = 1 }]";
    assert_eq!(small(&quad("[0, 0, 0]", "1"), lights), "no error; warnings: []");
    assert_eq!(
        small(&quad("[0, 0, 0]", "1"), ""),
        "scene.toml: nothing emits light; add a light or an emissive material"
    );
    assert_eq!(
        small("", lights),
        "scene.toml: there are no surfaces; add a mesh, a quad, a box or a sphere"
    );
    assert_eq!(
        small(&quad("[0, 0, 0]", "1e-7"), lights),
        "scene.toml: the scene is only 1.4142135e-7 across; use a smaller unit of length"
    );
    assert_eq!(
        small(&quad("[0, 0, 32768]", "0.5"), lights),
        "no error; warnings: [\"scene.toml: the scene is 0.70710677 across but 32768 away from the origin, where single precision is coarse; move it closer\"]"
    );
    // Emission that no surface has is no light.
    let unused = "materials.lamp = { type = \"diffuse\", albedo = 0, emission = 1 }";
    assert_eq!(
        small(&quad("[0, 0, 0]", "1"), unused),
        "scene.toml: nothing emits light; add a light or an emissive material"
    );
    let copies = vec![quad("[0, 0, 0]", "1"); 1001].join(", ");
    assert_eq!(
        small(&copies, lights),
        "scene.toml: 1001 triangles of `quad 1` lie on one spot; remove all but one"
    );
}

#[test]
fn walls_around_the_camera_are_told_from_rooms() {
    let room = |material: &str, rest: &str| {
        let text = format!(
            "camera = {{ origin = [0, 1, 5], target = [0, 1, 0], fov = 40 }}\n\
             materials.white = {{ type = \"diffuse\", albedo = 0.5 }}\n\
             materials.glow = {{ type = \"diffuse\", albedo = 0.5, emission = 1 }}\n\
             materials.glass = {{ type = \"glass\", ior = 1.5 }}\n\
             boxes = [{{ center = [0, 0, 0], size = [12, 12, 12], inward = {}, material = \"{material}\" }}]\n\
             {rest}",
            material != "glass"
        );
        match load_files(&[("scene.toml", text.as_bytes())]) {
            Ok(_) => "fine".to_string(),
            Err(e) => e,
        }
    };
    let dark = "scene.toml: the camera is shut in by `box 1`, which is opaque and has no light inside; move one of them";
    let sky = "lights = [{ type = \"environment\", radiance = 1 }]";
    assert_eq!(room("white", sky), dark);
    assert_eq!(room("glow", sky), "fine");
    assert_eq!(room("glass", sky), "fine");
    let inside = "lights = [{ type = \"point\", position = [1, 2, 3], intensity = 1 }]";
    assert_eq!(room("white", inside), "fine");
    let outside = "lights = [{ type = \"point\", position = [1, 7, 3], intensity = 1 }]";
    assert_eq!(room("white", outside), dark);
    let quad =
        "quads = [{ corner = [0, 4, 0], edges = [[1, 0, 0], [0, 0, 1]], material = \"glow\" }]";
    assert_eq!(room("white", quad), "fine");
}

#[test]
fn faults_of_files() {
    let folder = common::folder(&[("latin.toml", b"# caf\xe9\n"), ("a.toml/scene.toml", b"")]);
    let message = |name: &str| {
        let text = scene::load(&folder.path().join(name)).unwrap_err().to_string();
        text.replace(&format!("{}/", folder.path().display()), "")
    };
    assert_eq!(message("b.toml"), "cannot read b.toml: there is no such file");
    assert_eq!(message("a.toml"), "cannot read a.toml: it is a folder; add the name of a file");
    assert_eq!(
        message("latin.toml"),
        "latin.toml:1:6: the text is not UTF-8; save it in that encoding"
    );
    assert_eq!(message("a.toml/scene.toml"), "a.toml/scene.toml:1:1: missing key `camera`");
    assert_eq!(
        scene::load(std::path::Path::new("/dev/null")).unwrap_err().to_string(),
        "cannot read /dev/null: it is not a regular file"
    );
}
