//! Materials of `scene.toml` that scenes of Mitsuba have, too: the same, whoever writes them.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

use std::fs;

use base::Rgb;
use scene::{Material, Options, Parts, Specular, Texture, load_parts};

const TOML: &str = "camera = { origin = [0, 1, 5], target = [0, 1, 0], fov = 40 }\n\
    lights = [{ type = \"point\", position = [0, 3, 0], intensity = 1 }]\n\
    quads = [{ corner = [-1, -1, 0], edges = [[2, 0, 0], [0, 2, 0]], material = \"m\" }]\n\
    textures.board = { type = \"checkerboard\", colors = [0.25, 0.5], scale = [2, 4] }\n";

const XML: &str = "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>\
    <emitter type=\"point\"/><texture type=\"checkerboard\" id=\"board\"><rgb name=\"color0\" value=\"0.25\"/>\
    <rgb name=\"color1\" value=\"0.5\"/><transform name=\"to_uv\"><scale x=\"2\" y=\"4\"/></transform></texture>\
    <shape type=\"rectangle\">";

fn read(name: &str, text: &str) -> Result<Parts, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    let options = Options { definitions: Vec::new(), lenient: false, no_external: false };
    let parts = load_parts(&path, &options).map(|(parts, _)| parts);
    parts.map_err(|e| e.to_string().replace(&format!("{}/", folder.path().display()), ""))
}

/// The material of a table, and the textures that the scene has if anything shows one.
fn toml(keys: &str) -> Result<(Material, Vec<Texture>), String> {
    let parts = read("scene.toml", &format!("{TOML}[materials.m]\n{keys}\n"))?;
    Ok(looks(parts))
}

fn looks(mut parts: Parts) -> (Material, Vec<Texture>) {
    let material = Material { name: String::new(), ..parts.materials.remove(0) };
    assert_eq!(parts.meshes[0].1.uvs.is_empty(), !material.is_textured());
    let textures = parts.textures.into_iter().map(|(_, texture)| texture);
    (material.clone(), textures.filter(|_| material.is_textured()).collect())
}

#[test]
fn materials_are_those_of_mitsuba() {
    let cases = [
        (
            "type = \"plastic\"\nalbedo = [0.5, 0.25, 0]\nior = 1.5",
            r#"<bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.5 0.25 0"/>
               <float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>"#,
        ),
        (
            "type = \"plastic\"\nalbedo_texture = \"board\"\nior = 1.25\nreflectance = 0.5\nnonlinear = true\nroughness = 0.5",
            r#"<bsdf type="roughplastic"><ref id="board" name="diffuse_reflectance"/><string name="distribution" value="ggx"/>
               <float name="alpha" value="0.25"/><float name="int_ior" value="1.25"/><float name="ext_ior" value="1"/>
               <boolean name="nonlinear" value="true"/><rgb name="specular_reflectance" value="0.5"/></bsdf>"#,
        ),
        (
            "type = \"diffuse\"\nalbedo = 0.5\nopacity = 0.25",
            r#"<bsdf type="mask"><float name="opacity" value="0.25"/><bsdf type="diffuse"/></bsdf>"#,
        ),
        (
            "type = \"pane\"\nior = 1.5\nopacity_texture = \"board\"",
            r#"<bsdf type="mask"><ref id="board" name="opacity"/><bsdf type="thindielectric">
               <float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf></bsdf>"#,
        ),
        (
            "type = \"diffuse\"\nalbedo = 0.5\nemission_texture = \"board\"",
            r#"<emitter type="area"><ref id="board" name="radiance"/></emitter>"#,
        ),
    ];
    for (keys, shape) in cases {
        let (material, textures) = toml(keys).unwrap();
        let parts = read("s.xml", &format!("{XML}{shape}</shape></scene>")).unwrap();
        assert_eq!((material, textures), looks(parts), "{keys}");
    }
}

#[test]
fn lights_may_show_a_texture() {
    let lamp = "type = \"plastic\"\nior = 1.5\nalbedo = 0\nemission = [8, 4, 2]\nemission_texture = \"board\"";
    let (material, textures) = toml(lamp).unwrap();
    assert_eq!((material.emission, textures.len()), (Rgb::new(8.0, 4.0, 2.0), 1));
    assert!(matches!(material.specular, Specular::Coat(_)));
    // Half of the light for each color of the board.
    let parts = read("scene.toml", &format!("{TOML}[materials.m]\n{lamp}\n")).unwrap();
    let bounds = geometry::Bounds { min: glam::Vec3::NEG_ONE, max: glam::Vec3::ONE };
    let flux = scene::Scene::assemble(parts).lights[0].flux(&bounds);
    let expected = 4.0 * std::f32::consts::PI * 0.375 * 8.0;
    assert!((flux.r / expected - 1.0).abs() < 0.01, "{} instead of {expected}", flux.r);
    // What is black doesn't shine, whatever its texture.
    let dark = "type = \"diffuse\"\nalbedo = 0.5\nemission = 0\nemission_texture = \"board\"";
    assert_eq!(toml(dark).unwrap().0.emission_texture, None);
}

#[test]
fn faults_of_opacity_and_coats() {
    let bright = "textures.bright = { type = \"checkerboard\", colors = [0, 3] }\n";
    for (keys, expected) in [
        (
            "type = \"plastic\"\nior = 1.5",
            "7:8: material `m` of type \"plastic\" needs the key `albedo`",
        ),
        (
            "type = \"plastic\"\nalbedo = 0.5",
            "7:8: material `m` of type \"plastic\" needs the key `ior`",
        ),
        (
            "type = \"plastic\"\nalbedo = 0.5\nior = 1.5\nreflectance = 2",
            "10:15: the reflectance of material `m` is above 1, which would create light; use at most 1 in every channel",
        ),
        (
            "type = \"diffuse\"\nalbedo = 0\nopacity = 1.5",
            "9:11: the opacity of material `m` is 1.5; use 0 to 1",
        ),
        (
            "type = \"diffuse\"\nalbedo = 0\nopacity = 0.5\nopacity_texture = \"bright\"",
            "10:19: the opacity of material `m` reaches 1.5 with its texture; use at most 1",
        ),
        (
            "type = \"diffuse\"\nalbedo = 0\nopacity = 0.5\nemission = 1",
            "9:11: material `m` emits and lets light pass; keep one of the two",
        ),
        (
            "type = \"glass\"\nior = 1.5\nopacity = 0.5",
            "9:11: material `m` of type \"glass\" takes no `opacity`; its keys are ior, absorption and roughness",
        ),
        (
            "type = \"pane\"\nior = 1.5\nemission_texture = \"board\"",
            "9:20: material `m` of type \"pane\" takes no `emission_texture`; its keys are ior, opacity and opacity_texture",
        ),
        (
            "type = \"diffuse\"\nalbedo = 0\nemission = 1e15\nemission_texture = \"bright\"",
            "10:20: the emission of material `m` reaches more than 1e15 with its texture; lower it",
        ),
        (
            "type = \"diffuse\"\nalbedo = 0\nnonlinear = true",
            "9:13: material `m` of type \"diffuse\" takes no `nonlinear`;",
        ),
    ] {
        let text = format!("{TOML}{bright}[materials.m]\n{keys}\n");
        let message = read("scene.toml", &text).map(|_| ()).unwrap_err();
        assert!(message.starts_with(&format!("scene.toml:{expected}")), "{message}");
    }
}
