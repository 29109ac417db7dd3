//! Meshes of scene files: what happens to them on the way in.

mod common;

use base::Ray;
use common::load_files;
use geometry::Surface;
use glam::Vec3A;
use scene::{Loaded, Scene};

/// A scene around one mesh, `keys` being its file and what else it takes.
fn mesh_scene(keys: &str) -> String {
    format!(
        r#"camera = {{ origin = [0, 1, 50], target = [0, 1, 0], fov = 40 }}
lights = [{{ type = "environment", radiance = 1 }}]
meshes = [{{ {keys} }}]
materials.white = {{ type = "diffuse", albedo = 0.5 }}
materials.glass = {{ type = "glass", ior = 1.5 }}
quads = [
    {{ corner = [-9, -9, 9], edges = [[18, 0, 0], [0, 0, -18]], material = "white" }},
]
spheres = [{{ center = [0, -5, 0], radius = 1, material = "glass" }}]
"#
    )
}

fn load(keys: &str, files: &[(&str, &str)]) -> Result<Loaded, String> {
    let files: Vec<_> = files.iter().map(|(name, text)| (*name, text.as_bytes())).collect();
    load_bytes(keys, &files)
}

fn load_bytes(keys: &str, files: &[(&str, &[u8])]) -> Result<Loaded, String> {
    let scene = mesh_scene(keys);
    let mut all = vec![("scene.toml", scene.as_bytes())];
    all.extend(files);
    load_files(&all)
}

fn hit(scene: &Scene, origin: [f32; 3], dir: [f32; 3]) -> Option<Surface> {
    let ray = Ray::unbounded(Vec3A::from_array(origin), Vec3A::from_array(dir));
    scene.accel.closest_hit(&ray).map(|hit| scene.accel.surface(&ray, &hit))
}

const TETRAHEDRON: &str =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

#[test]
fn glass_must_be_closed_and_right_side_out() {
    let warnings = |obj: &str| {
        load("file = \"a.obj\", material = \"glass\"", &[("a.obj", obj)]).unwrap().warnings
    };
    assert!(warnings(TETRAHEDRON).is_empty());
    let open = TETRAHEDRON.replace("f 2 3 4\n", "");
    assert_eq!(warnings(&open), ["a.obj: the glass has 3 open edges, where light leaks; close it"]);
    let twisted = TETRAHEDRON.replace("f 2 3 4\n", "f 2 4 3\n");
    assert_eq!(
        warnings(&twisted),
        [
            "a.obj: at 3 edges of the glass, inside and outside change places; make the winding consistent"
        ]
    );
    let reversed = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n";
    assert_eq!(
        warnings(reversed),
        ["a.obj: the glass is inside out and was turned around; reverse its faces"]
    );
    // Turned around, its front is outside.
    let loaded = load("file = \"a.obj\", material = \"glass\"", &[("a.obj", reversed)]).unwrap();
    let surface = hit(&loaded.scene, [0.25, 0.25, -1.0], [0.0, 0.0, 1.0]).unwrap();
    assert!(surface.geometric_normal.z < -0.99, "{}", surface.geometric_normal);
    // Mirrored, it still is.
    let keys = "file = \"a.obj\", material = \"glass\", transform = { scale = [1, 1, -1] }";
    let loaded = load(keys, &[("a.obj", TETRAHEDRON)]).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let surface = hit(&loaded.scene, [0.25, 0.25, 1.0], [0.0, 0.0, -1.0]).unwrap();
    assert!(surface.geometric_normal.z > 0.99, "{}", surface.geometric_normal);
}

#[test]
fn useless_triangles_are_dropped_with_a_warning() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nvn 0 0 0\n\
               f 1//1 2//1 3//1\nf 2//1 3//1 1//1\nf 1//1 2//1 4//1\n";
    let loaded = load("file = \"a.obj\", material = \"white\"", &[("a.obj", obj)]).unwrap();
    assert_eq!(
        loaded.warnings,
        [
            "a.obj: 1 triangles without area were dropped",
            "a.obj: 1 triangles were dropped that have the corners of others",
            "a.obj: 3 normals without length were replaced by those of the faces around"
        ]
    );
    assert_eq!(loaded.scene.accel.n_primitives(), 1 + 2 + 1);
}

#[test]
fn smooth_normals_can_be_declined() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 1 1\nf 1//1 2//1 3//1\n";
    for (smooth, expected) in
        [("", 0.707_106_77), (", smooth = true", 0.707_106_77), (", smooth = false", 1.0)]
    {
        let keys = format!("file = \"a.obj\", material = \"white\"{smooth}");
        let loaded = load(&keys, &[("a.obj", obj)]).unwrap();
        let surface = hit(&loaded.scene, [0.25, 0.25, 5.0], [0.0, 0.0, -1.0]).unwrap();
        assert!((surface.shading_normal.z - expected).abs() < 1e-6, "{keys}");
    }
}

#[test]
fn materials_of_a_mesh() {
    let mtl = "newmtl red\nKd 1 0 0\nnewmtl lamp\nKd 0\nKe 5 5 5\n";
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nusemtl red\nf 1 2 3\nusemtl lamp\nf 2 4 3\n";
    let files = [("m/a.obj", obj), ("m/a.mtl", mtl)];
    let loaded = load("name = \"tile\", file = \"m/a.obj\"", &files).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let surface = hit(&loaded.scene, [0.25, 0.25, 5.0], [0.0, 0.0, -1.0]).unwrap();
    assert_eq!(loaded.scene.material(&surface).name, "tile/red");
    let lights: Vec<_> = loaded.scene.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(lights, ["tile", "light 1"]);
    // A material of the scene file takes the place of all of them, and of a library that is missing.
    let loaded = load("file = \"m/a.obj\", material = \"white\"", &files[..1]).unwrap();
    let surface = hit(&loaded.scene, [0.75, 0.75, 5.0], [0.0, 0.0, -1.0]).unwrap();
    assert_eq!(loaded.scene.material(&surface).name, "white");
    assert_eq!(loaded.scene.lights.len(), 1);
}

#[test]
fn maps_color_meshes() {
    // Two texels, black and white, as an uncompressed Targa from below.
    let targa: &[u8] =
        &[0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 24, 0, 0, 0, 0, 255, 255, 255];
    let mtl = "newmtl a\nKd 0.5 0.25 1\nmap_Kd -o 0.5 t/m.tga\nnewmtl b\nmap_Kd -clamp on t\\m.tga\nnewmtl c\nKd 1\n";
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0.25 0\nvt 0.3 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 2/2 4/2 3/2\n";
    let obj = format!("{obj}v 5 0 0\nv 5 1 0\nusemtl c\nf 2 5 6\n");
    let files = [("a.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes()), ("t/m.tga", targa)];
    let loaded = load_bytes("name = \"tile\", file = \"a.obj\"", &files).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let albedo = |x: f32, y: f32| {
        let surface = hit(&loaded.scene, [x, y, 5.0], [0.0, 0.0, -1.0]).unwrap();
        loaded.scene.albedo(&surface).to_array()
    };
    // The second texel's middle by the offset; a tenth of the way from the first to the second.
    assert_eq!(albedo(0.2, 0.2), [0.5, 0.25, 1.0]);
    assert!(albedo(0.8, 0.8).iter().all(|c| (c - 0.1).abs() < 1e-5), "{:?}", albedo(0.8, 0.8));
    assert_eq!(albedo(2.0, 0.2), [1.0; 3]);
    // Another texel makes another inventory, and says which.
    let mut changed = targa.to_vec();
    changed[20] = 7;
    let files = [files[0], files[1], ("t/m.tga", &changed)];
    let other = load_bytes("name = \"tile\", file = \"a.obj\"", &files).unwrap();
    assert_eq!(
        loaded.scene.inventory().changes(other.scene.inventory()),
        ["texture `tile/map 1` changed", "texture `tile/map 2` changed"]
    );
}

#[test]
fn faults_of_meshes() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 0\n";
    let files = [("a.obj", TETRAHEDRON), ("b.ply", ply), ("folder/x", "")];
    let cases = [
        (
            "file = \"c.obj\", material = \"white\"",
            "scene.toml:3:20: cannot read c.obj: there is no such file; paths are relative to the scene file",
        ),
        (
            "file = \"folder\", material = \"white\"",
            "scene.toml:3:20: the file of mesh `mesh 1` must end in .obj or .ply",
        ),
        (
            "file = \"a.stl\", material = \"white\"",
            "scene.toml:3:20: the file of mesh `mesh 1` must end in .obj or .ply",
        ),
        (
            "file = \"b.ply\"",
            "scene.toml:3:20: mesh `mesh 1` needs the key `material`: PLY files have none",
        ),
        (
            "file = \"b.ply\", material = \"white\"",
            "b.ply: no triangle has an area; check the scale and the coordinates",
        ),
        (
            "file = \"a.obj\", material = \"blue\"",
            "scene.toml:3:40: mesh `mesh 1` names the unknown material \"blue\"; the materials are glass and white",
        ),
        (
            "file = \"a.obj\"",
            "a.obj:5:1: the face has no material; add `usemtl`, or give the mesh a material in the scene file",
        ),
        (
            "file = \"a.obj\", material = \"white\", transform = { scale = 0 }",
            "scene.toml:3:61: the transform of mesh `mesh 1` flattens it; every scale must differ from 0 and the axes from each other",
        ),
        (
            "file = \"a.obj\", material = \"white\", transform = { scale = 1e-20 }",
            "a.obj: no triangle has an area; check the scale and the coordinates",
        ),
        (
            "file = \"a.obj\", material = \"white\", transform = { scale = 1e9 }",
            "scene.toml:3:61: the transform of mesh `mesh 1` moves it too far away; keep coordinates within 1e8",
        ),
        ("material = \"white\"", "scene.toml:3:11: missing key `file`"),
    ];
    for (keys, expected) in cases {
        assert_eq!(load(keys, &files).unwrap_err(), expected);
    }
    // Within a mesh copies are dropped, but not those of other meshes.
    let copies = vec!["{ file = \"a.obj\", material = \"white\" }"; 1001].join(",\n");
    let scene = mesh_scene("@").replace("{ @ }", &copies);
    let message =
        load_files(&[("scene.toml", scene.as_bytes()), ("a.obj", TETRAHEDRON.as_bytes())]);
    assert_eq!(
        message.unwrap_err(),
        "scene.toml: 1001 triangles of `mesh 1` lie on one spot; remove all but one"
    );
}
