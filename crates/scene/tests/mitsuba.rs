//! Scenes of Mitsuba: both dialects, every transform, every message.

use base::{ImageSize, Rgb};
use glam::{DAffine3, DVec3, Vec2, Vec3A};
use scene::{Loaded, Options, Specular, load_with};
use tempfile::TempDir;

/// A scene as version 3 writes it.
const NEW: &str = r#"<?xml version="1.0"?>
<!-- a room -->
<scene version="3.0.0">
  <default name="lamp" value="10"/>
  <default name="width" value="320"/>
  <integrator type="path"><integer name="max_depth" value="8"/></integrator>
  <sensor type="perspective">
    <string name="fov_axis" value="smaller"/>
    <float name="fov" value="40"/>
    <float name="near_clip" value="0.1"/>
    <transform name="to_world"><lookat origin="0, 1, 5" target="0, 1, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
    <film type="hdrfilm">
      <integer name="width" value="$width"/><integer name="height" value="240"/>
      <string name="pixel_format" value="rgb"/><rfilter type="gaussian"/>
    </film>
  </sensor>
  <bsdf type="twosided" id="white"><bsdf type="diffuse"><rgb name="reflectance" value="0.7 0.6 0.5"/></bsdf></bsdf>
  <bsdf type="dielectric" id="glass"><float name="int_ior" value="1.5"/><string name="ext_ior" value="vacuum"/></bsdf>
  <bsdf type="roughconductor" id="gilt">
    <string name="material" value="Au"/><string name="distribution" value="ggx"/><float name="alpha" value="0.25"/>
  </bsdf>
  <shape type="rectangle" id="floor">
    <ref id="white"/>
    <transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
  </shape>
  <shape type="rectangle" id="lamp">
    <transform name="to_world"><rotate x="1" angle="90"/><translate y="4"/></transform>
    <bsdf type="diffuse"><spectrum name="reflectance" value="0"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="$lamp"/></emitter>
  </shape>
  <shape type="sphere" id="ball">
    <point name="center" x="1" y="1" z="0"/><float name="radius" value="0.5"/><ref id="glass"/>
  </shape>
  <shape type="cube" id="block">
    <transform name="to_world"><scale x="0.4" y="0.5" z="0.3"/><translate x="-1" y="0.6"/></transform><ref id="gilt"/>
  </shape>
  <emitter type="point" id="bulb"><point name="position" x="0" y="3" z="1"/><rgb name="intensity" value="1, 2, 3"/></emitter>
  <emitter type="constant" id="sky"><rgb name="radiance" value="0.1"/></emitter>
</scene>
"#;

/// The same as versions 0.5 and 0.6 write it.
fn old() -> String {
    let mut text = NEW.to_owned();
    for (new, old) in [
        ("3.0.0", "0.5.0"),
        ("to_world", "toWorld"),
        ("lookat ", "lookAt "),
        ("fov_axis", "fovAxis"),
        ("near_clip", "nearClip"),
        ("int_ior", "intIOR"),
        ("ext_ior", "extIOR"),
        ("sample_count", "sampleCount"),
        ("pixel_format", "pixelFormat"),
        ("max_depth", "maxDepth"),
        ("scale value=\"3\"", "scale x=\"3\" y=\"3\" z=\"3\""),
        ("<rgb name=\"radiance\" value=\"0.1\"/>", "<spectrum name=\"radiance\" value=\"0.1\"/>"),
    ] {
        assert!(text.contains(new), "{new}");
        text = text.replace(new, old);
    }
    text
}

/// A folder with these files.
fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = TempDir::new().expect("a folder for tests");
    for (name, bytes) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("files lie in the folder")).expect("a folder");
        std::fs::write(path, bytes).expect("a file for tests");
    }
    folder
}

fn load_files(files: &[(&str, &str)], options: &Options) -> Result<Loaded, String> {
    let files: Vec<_> = files.iter().map(|(name, text)| (*name, text.as_bytes())).collect();
    let folder = folder(&files);
    let local = |text: &str| text.replace(&format!("{}/", folder.path().display()), "");
    match load_with(&folder.path().join("s.xml"), options) {
        Ok(mut loaded) => {
            loaded.warnings = loaded.warnings.iter().map(|w| local(w)).collect();
            Ok(loaded)
        }
        Err(error) => Err(local(&error.to_string())),
    }
}

fn options(definitions: &[(&str, &str)], lenient: bool) -> Options {
    let pair = |(name, value): &(&str, &str)| (name.to_string(), value.to_string());
    Options { definitions: definitions.iter().map(pair).collect(), lenient, no_external: false }
}

fn load(text: &str) -> Result<Loaded, String> {
    load_files(&[("s.xml", text)], &options(&[], false))
}

#[test]
fn both_dialects_make_the_same_world() {
    let [new, old] = [NEW, &old()].map(|text| load(text).unwrap());
    assert!(new.warnings.is_empty() && old.warnings.is_empty(), "{:?}", new.warnings);
    assert_eq!(new.scene.inventory(), old.scene.inventory());
    assert_eq!(new.scene.view_fingerprint(), old.scene.view_fingerprint());
    assert_eq!(new.scene.camera.film(), Some(ImageSize { width: 320, height: 240 }));
    let scene = new.scene;
    let material = |name: &str| scene.materials.iter().find(|m| m.name == name).unwrap();
    assert_eq!(material("white").albedo, Rgb::new(0.7, 0.6, 0.5));
    assert_eq!(material("glass").specular, Specular::Glass { ior: 1.5, absorption: Rgb::BLACK });
    assert_eq!(material("gilt").roughness, 0.5);
    let lights: Vec<_> = scene.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(lights, ["lamp", "bulb", "sky"]);
    // The lamp faces down, over 4 square units: its flux is 4 pi times its radiance.
    let flux = scene.lights[0].flux(&scene.bounds()).g;
    assert!((flux / (4.0 * std::f32::consts::PI * 10.0) - 1.0).abs() < 1e-5, "{flux}");
    let down = scene.lights[0].unshadowed_irradiance(Vec3A::new(0.0, 1.0, 0.0), Vec3A::Y);
    assert!(down.unwrap().g > 1.0, "{down:?}");
}

#[test]
fn parameters_includes_and_aliases() {
    let given = options(&[("lamp", "20"), ("width", "64")], false);
    let loaded = load_files(&[("s.xml", NEW)], &given).unwrap();
    assert_eq!(loaded.scene.camera.film(), Some(ImageSize { width: 64, height: 240 }));
    let twice = loaded.scene.lights[0].flux(&loaded.scene.bounds()).g;
    assert!((twice / (4.0 * std::f32::consts::PI * 20.0) - 1.0).abs() < 1e-5);
    // A shape in another file, in a folder of its own, referring to what stands here.
    let start = NEW.find("  <shape type=\"cube\"").unwrap();
    let end = NEW.find("  <emitter type=\"point\"").unwrap();
    let main = format!(
        "{}  <alias id=\"gilt\" as=\"gold\"/><include filename=\"sub/cube.xml\"/>\n{}",
        &NEW[..start],
        &NEW[end..]
    );
    let part = format!(
        "<scene>{}</scene>",
        NEW[start..end].replace("<ref id=\"gilt\"/>", "<ref id=\"gold\"/>")
    );
    let files = [("s.xml", main.as_str()), ("sub/cube.xml", &part)];
    let included = load_files(&files, &options(&[], false)).unwrap();
    assert_eq!(included.scene.inventory(), load(NEW).unwrap().scene.inventory());
}

/// Where the corner (1, 1, 0) of a rectangle comes to lie.
#[test]
fn transforms_are_those_of_glam() {
    let moved = |steps: &str| {
        let text = NEW.replace("<rotate x=\"1\" angle=\"-90\"/><scale value=\"3\"/>", steps);
        let bounds = load(&text).unwrap_or_else(|e| panic!("{steps}: {e}")).scene.bounds();
        (bounds.min, bounds.max)
    };
    let turn = |axis: DVec3, degrees: f64| {
        DAffine3::from_axis_angle(axis.normalize(), degrees.to_radians())
    };
    let shift = DAffine3::from_translation(DVec3::new(30.0, -20.0, 10.0));
    let cases = [
        (
            "<rotate x=\"1\" y=\"2\" z=\"-1\" angle=\"37\"/><scale x=\"7\" z=\"-2\"/><translate x=\"30\" y=\"-20\" z=\"10\"/>",
            shift
                * DAffine3::from_scale(DVec3::new(7.0, 1.0, -2.0))
                * turn(DVec3::new(1.0, 2.0, -1.0), 37.0),
        ),
        (
            "<rotate axis=\"0, 0, 1\" angle=\"120\"/><translate value=\"30, -20 10\"/>",
            shift * turn(DVec3::Z, 120.0),
        ),
        (
            "<matrix value=\"0 -2 0 30  1 0 0 -20  0 0 1 10  0 0 0 1\"/>",
            shift * turn(DVec3::Z, 90.0) * DAffine3::from_scale(DVec3::new(1.0, 2.0, 1.0)),
        ),
        (
            "<lookat origin=\"30, -20, 10\" target=\"31, -20, 10\" up=\"0, 1, 0\"/>",
            shift * turn(DVec3::Y, 90.0),
        ),
    ];
    for (steps, map) in cases {
        let (min, max) = moved(steps);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| map.transform_point3(DVec3::new(x, y, 0.0)).as_vec3());
        // The floor is far away from all else, on the right, below and in front.
        let low = corners.iter().fold(corners[0], |a, b| a.min(*b));
        let high = corners.iter().fold(corners[0], |a, b| a.max(*b));
        assert!((max.x - high.x).abs() < 1e-4, "{steps}: {max} {high}");
        assert!((min.y - low.y).abs() < 1e-4, "{steps}: {min} {low}");
        assert!((max.z - high.z).abs() < 1e-4, "{steps}: {max} {high}");
    }
}

#[test]
fn fields_of_view_span_what_they_name() {
    let size = ImageSize { width: 320, height: 240 };
    for (axis, edge) in [
        ("x", [320.0, 120.0]),
        ("y", [160.0, 0.0]),
        ("smaller", [160.0, 0.0]),
        ("larger", [320.0, 120.0]),
        ("diagonal", [320.0, 0.0]),
    ] {
        let camera =
            load(&NEW.replace("\"smaller\"", &format!("\"{axis}\""))).unwrap().scene.camera;
        let dir = camera.ray(size, Vec2::from_array(edge)).dir();
        let angle = f64::from(-dir.z).acos().to_degrees();
        assert!((angle - 20.0).abs() < 1e-3, "{axis}: {angle}");
        // Neither mirrored nor upside down.
        let corner = camera.ray(size, Vec2::new(320.0, 0.0)).dir();
        assert!(corner.x > 0.0 && corner.y > 0.0, "{corner}");
    }
    let lens = NEW
        .replace(
            "<float name=\"fov\" value=\"40\"/>",
            "<string name=\"focal_length\" value=\"50mm\"/>",
        )
        .replace("<string name=\"fov_axis\" value=\"smaller\"/>", "");
    let dir = load(&lens).unwrap().scene.camera.ray(size, Vec2::ZERO).dir();
    // Half of 43.27 mm, 50 mm away.
    assert!((f64::from(-dir.z).acos().tan() - 0.432_666).abs() < 1e-5);
}

#[test]
fn lenses_blur_unless_closed() {
    let with = |radius: &str| {
        let lens = format!(
            "<sensor type=\"thinlens\"><float name=\"aperture_radius\" value=\"{radius}\"/><float name=\"focus_distance\" value=\"4\"/>"
        );
        load(&NEW.replace("<sensor type=\"perspective\">", &lens)).unwrap().scene.camera
    };
    assert!(with("0").is_pinhole());
    let (size, at) = (ImageSize { width: 320, height: 240 }, Vec2::new(160.0, 120.0));
    let ray = with("0.25").lens_ray(size, at, Vec2::new(0.999_999, 0.5));
    let aside = (ray.origin() - Vec3A::new(0.0, 1.0, 5.0)).length();
    assert!((aside - 0.25).abs() < 1e-4, "{aside}");
    let sharp = ray.origin() + ray.dir() * (4.0 / -ray.dir().z);
    assert!((sharp - Vec3A::new(0.0, 1.0, 1.0)).length() < 1e-4, "{sharp}");
}

#[test]
fn textures_lie_as_in_mitsuba() {
    // The first texel of a file is the upper left; Mitsuba shows it where u and v are 0.
    let targa = b"\0\0\x02\0\0\0\0\0\0\0\0\0\x02\0\x02\0\x18\x20\xff\xff\xff\0\0\0\0\0\0\0\0\0";
    let texture = "<texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"t.tga\"/><string name=\"filter_type\" value=\"nearest\"/></texture>";
    let text = NEW.replace("<rgb name=\"reflectance\" value=\"0.7 0.6 0.5\"/>", texture);
    let text = text.replace("<ref id=\"glass\"/>", "<ref id=\"white\"/>");
    let folder = folder(&[("s.xml", text.as_bytes()), ("t.tga", targa)]);
    let scene = load_with(&folder.path().join("s.xml"), &options(&[], false)).unwrap().scene;
    let albedo = |origin: Vec3A, dir: Vec3A| {
        let ray = base::Ray::unbounded(origin, dir.normalize());
        let surface = scene.accel.surface(&ray, &scene.accel.closest_hit(&ray).unwrap());
        scene.albedo(&surface).g
    };
    // On the floor (-1, -1) of the rectangle lies at (-3, 0, 3).
    let floor = |x: f32, z: f32| albedo(Vec3A::new(x, 0.3, z), -Vec3A::Y);
    assert_eq!(
        [floor(-2.0, 2.0), floor(2.0, 2.0), floor(-2.0, -2.0), floor(2.5, -2.0)],
        [1.0, 0.0, 0.0, 0.0]
    );
    // On the sphere u goes around +z from +x, and v from +z down.
    let ball = |x: f32, y: f32, z: f32| {
        let out = Vec3A::new(x, y, z).normalize();
        albedo(Vec3A::new(1.0, 1.0, 0.0) + out * 0.6, -out)
    };
    assert_eq!(
        [ball(0.5, 0.5, 0.7), ball(-0.1, 0.5, 0.7), ball(0.5, -0.5, 0.7), ball(0.5, 0.5, -0.7)],
        [1.0, 1.0, 0.0, 0.0]
    );
}

#[test]
fn faults_are_named_with_their_place() {
    #[rustfmt::skip]
    let cases = [
        ("<scene version=\"3.0.0\">", "<!DOCTYPE scene [<!ENTITY a \"b\">]>\n<scene>",
         "s.xml:3:1: document types and entities are refused; remove <!DOCTYPE ...>"),
        ("value=\"$width\"", "value=\"$breadth\"",
         "s.xml:14:7: $breadth has no value; give it one by <default> before, or by -D breadth=..."),
        ("<ref id=\"glass\"/>", "<ref id=\"glas\"/>", "s.xml:33:79: nothing has the id \"glas\""),
        ("id=\"glass\"", "id=\"white\"", "s.xml:19:3: two elements have the id \"white\"; rename one"),
        ("type=\"cube\"", "type=\"hair\"",
         "s.xml:35:3: shape \"hair\" isn't supported; the shapes are rectangle, cube, disk, cylinder, sphere, obj, ply, serialized, shapegroup and instance"),
        ("type=\"dielectric\"", "type=\"principled\"",
         "s.xml:19:3: bsdf \"principled\" isn't supported; the bsdfs are diffuse, dielectric, thindielectric, conductor, roughdielectric, roughconductor, plastic, roughplastic, mask and twosided"),
        ("type=\"dielectric\"", "type=\"phong\"",
         "s.xml:19:3: bsdf \"phong\" isn't supported; with --lenient only its diffuse part is taken"),
        ("type=\"dielectric\"", "type=\"mask\"", "s.xml:19:3: bsdf \"mask\" needs a bsdf in it"),
        ("type=\"dielectric\"", "type=\"thindielectric\"", "no error; []"),
        ("value=\"ggx\"", "value=\"beckmann\"",
         "s.xml:20:3: bsdf \"roughconductor\" with microfacets by Beckmann isn't supported; with --lenient they are taken as those of GGX"),
        ("value=\"Au\"", "value=\"W\"",
         "s.xml:20:3: the metal \"W\" isn't known; give eta and k, or one of Ag, Al, Au, Cr, Cu and none"),
        ("<float name=\"radius\" value=\"0.5\"/>", "<float name=\"radius\" value=\"0.5\"/><float name=\"thickness\" value=\"1\"/>",
         "s.xml:33:79: shape \"sphere\" takes no `thickness`; with --lenient it is ignored"),
        ("<scale value=\"3\"/>", "<scale value=\"nan\"/>", "s.xml:25:59: `nan` in <scale> is no finite number"),
        ("<scale value=\"3\"/>", "<scale x=\"0\"/>",
         "s.xml:25:5: to_world of shape \"rectangle\" flattens it; every scale must differ from 0"),
        ("<rotate x=\"1\" angle=\"-90\"/>", "<shear x=\"1\"/>",
         "s.xml:25:32: <shear> is no part of a transform; they are translate, scale, rotate, lookat and matrix"),
        ("value=\"0.7 0.6 0.5\"", "value=\"0.7 0.6\"", "s.xml:18:57: `0.7 0.6` is no color; give one number or three"),
        ("value=\"0.7 0.6 0.5\"", "value=\"0.7 0.6 1.5\"",
         "s.xml:18:57: `reflectance` of bsdf \"diffuse\" reaches 1.5, which would create light; use at most 1"),
        ("<spectrum name=\"reflectance\" value=\"0\"/>", "<spectrum name=\"reflectance\" value=\"400:0.1 700:0.2\"/>",
         "no error; []"),
        ("<spectrum name=\"reflectance\" value=\"0\"/>", "<spectrum name=\"reflectance\" value=\"400:0.1 700\"/>",
         "s.xml:29:26: `700` is no entry of a spectrum; give a wavelength in nanometers and a value of at least 0, such as 550:0.2"),
        ("<spectrum name=\"reflectance\" value=\"0\"/>", "<spectrum name=\"reflectance\" value=\"400:0.1, 300:0.2\"/>",
         "s.xml:29:26: the wavelengths of a spectrum must rise, unlike 300"),
        ("<spectrum name=\"reflectance\" value=\"0\"/>", "<spectrum name=\"reflectance\" value=\"400:0.1\"/>",
         "s.xml:29:26: a spectrum needs two wavelengths at least"),
        ("<spectrum name=\"reflectance\" value=\"0\"/>", "<spectrum name=\"reflectance\" filename=\"a.spd\"/>",
         "s.xml:29:26: cannot read a.spd: there is no such file"),
        ("<spectrum name=\"reflectance\" value=\"0\"/>", "<spectrum name=\"reflectance\" type=\"d65\"/>",
         "s.xml:29:26: the spectrum \"d65\" isn't supported; use blackbody"),
        ("<rgb name=\"radiance\" value=\"0.1\"/>", "<blackbody name=\"radiance\" temperature=\"hot\"/>",
         "s.xml:39:37: a black body needs a temperature of at least 0, such as temperature=\"5000\""),
        ("<rgb name=\"radiance\" value=\"0.1\"/>", "<blackbody name=\"radiance\" temperature=\"5000K\" scale=\"1e-4\"/>", "no error; []"),
        ("<rgb name=\"radiance\" value=\"0.1\"/>",
         "<spectrum name=\"radiance\" type=\"blackbody\"><float name=\"temperature\" value=\"4000\"/></spectrum>", "no error; []"),
        ("type=\"constant\"", "type=\"sunsky\"",
         "s.xml:39:3: emitter \"sunsky\" isn't supported; the emitters are point, spot, directional, constant and envmap, and area in a shape"),
        ("type=\"constant\"", "type=\"sky\"",
         "s.xml:39:3: emitter \"sky\" isn't supported; the emitters are point, spot, directional, constant and envmap, and area in a shape"),
        ("type=\"constant\"", "type=\"envmap\"", "s.xml:39:3: emitter \"envmap\" needs a `filename`"),
        ("<emitter type=\"constant\" id=\"sky\">",
         "<emitter type=\"envmap\"><string name=\"filename\" value=\"a.hdr\"/><transform name=\"to_world\"><scale x=\"2\"/></transform>",
         "s.xml:39:3: to_world of emitter \"envmap\" distorts it; only turn it or mirror it"),
        ("<emitter type=\"constant\" id=\"sky\">", "<emitter type=\"envmap\"><string name=\"filename\" value=\"a.hdr\"/>",
         "s.xml:39:26: cannot read a.hdr: there is no such file"),
        ("<emitter type=\"constant\" id=\"sky\">",
         "<emitter type=\"envmap\"><string name=\"filename\" value=\"a.hdr\"/><float name=\"scale\" value=\"-1\"/>",
         "s.xml:39:3: `scale` of emitter \"envmap\" is -1; it lies between 0 and 1e15"),
        ("type=\"perspective\"", "type=\"orthographic\"", "s.xml:7:3: sensor \"orthographic\" isn't supported; use perspective or thinlens"),
        ("type=\"perspective\"", "type=\"thinlens\"", "s.xml:7:3: sensor \"thinlens\" needs an `aperture_radius`"),
        ("<sensor type=\"perspective\">", "<sensor type=\"thinlens\"><float name=\"aperture_radius\" value=\"0.1\"/>",
         "s.xml:7:3: sensor \"thinlens\" needs a `focus_distance`"),
        ("<sensor type=\"perspective\">",
         "<sensor type=\"thinlens\"><float name=\"aperture_radius\" value=\"-1\"/><float name=\"focus_distance\" value=\"4\"/>",
         "s.xml:7:3: aperture_radius is -1 and focus_distance 4; give lengths, the second above 0 and both up to 1e8"),
        ("\"smaller\"", "\"z\"", "s.xml:7:3: fov_axis is \"z\"; it may be one of x, y, diagonal, smaller and larger"),
        ("value=\"240\"", "value=\"0\"", "s.xml:13:5: the film has 320x0 pixels; give at least one"),
        ("</scene>", "<medium type=\"homogeneous\"/></scene>", "s.xml:40:1: <medium> isn't supported; with --lenient it is left out"),
        ("x=\"0\" y=\"3\" z=\"1\"", "x=\"0\" y=\"1e300\" z=\"1\"",
         "s.xml:38:35: `position` is too far away; keep coordinates within 1e8"),
        ("value=\"1, 2, 3\"", "value=\"0\"", "no error; [\"s.xml:38:3: emitter \\\"point\\\" is black and left out\"]"),
        ("</scene>", "</scene><scene/>", "s.xml:40:9: `scene` stands where one <scene> must be"),
        ("</scene>", "hello</scene>", "s.xml:39:81: there is text between elements; values stand in attributes"),
        ("</scene>", "<include filename=\"s.xml\"/></scene>",
         "s.xml:40:1: files include each other more than 16 deep; does one include itself?"),
        ("<ref id=\"gilt\"/>", "<bsdf type=\"twosided\" id=\"a\"><ref id=\"a\"/></bsdf>",
         "s.xml:36:103: bsdf \"twosided\" refers to itself"),
    ];
    for (from, to, expected) in cases {
        assert!(NEW.contains(from), "{from}");
        let result = load(&NEW.replacen(from, to, 1));
        let message = result.map(|l| format!("no error; {:?}", l.warnings)).unwrap_or_else(|e| e);
        assert_eq!(message, expected, "{to}");
    }
    let unknown = load_files(&[("s.xml", NEW)], &options(&[("lamps", "1")], false)).unwrap_err();
    assert_eq!(unknown, "s.xml: the scene has no parameter $lamps, which -D gives a value");
    let cut = load(&NEW[..NEW.len() - 10]).unwrap_err();
    assert!(cut.starts_with("s.xml:3:1: `scene` has no end"), "{cut}");
}

#[test]
fn lenient_replaces_and_tells() {
    let text = NEW
        .replace("type=\"dielectric\"", "type=\"phong\"")
        .replace("</scene>", "<medium type=\"homogeneous\"/></scene>");
    let loaded = load_files(&[("s.xml", text.as_str())], &options(&[], true)).unwrap();
    assert_eq!(
        loaded.warnings,
        [
            "s.xml:19:3: bsdf \"phong\" isn't supported; only its diffuse part is taken",
            "s.xml:40:1: <medium> isn't supported; it is left out",
        ]
    );
}

#[test]
fn plastic_masks_and_glowing_textures_are_taken() {
    let board = "<texture type=\"checkerboard\" name=\"NAME\"><rgb name=\"color0\" value=\"0\"/><rgb name=\"color1\" value=\"1\"/></texture>";
    let text = NEW
        .replace(
            "<bsdf type=\"dielectric\" id=\"glass\"><float name=\"int_ior\" value=\"1.5\"/>",
            "<bsdf type=\"plastic\" id=\"glass\"><float name=\"int_ior\" value=\"1.5\"/><boolean name=\"nonlinear\" value=\"true\"/>\
             <rgb name=\"diffuse_reflectance\" value=\"0.2 0.4 0.6\"/>",
        )
        .replace("type=\"roughconductor\"", "type=\"roughplastic\"")
        .replace("<string name=\"material\" value=\"Au\"/>", "")
        .replace("<ref id=\"white\"/>", &format!("<bsdf type=\"mask\" id=\"net\">{}<ref id=\"white\"/></bsdf>", board.replace("NAME", "opacity")))
        .replace("<rgb name=\"radiance\" value=\"$lamp\"/>", &board.replace("NAME", "radiance"))
        .replace("</scene>", "<shape type=\"sphere\"><point name=\"center\" x=\"-2\" y=\"5\" z=\"0\"/><emitter type=\"area\"><blackbody name=\"radiance\" temperature=\"3000\"/></emitter>\
             <bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf></shape></scene>")
        .replace("<bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf></shape>", "<bsdf type=\"bumpmap\"><bsdf type=\"diffuse\"/></bsdf></shape>");
    let loaded = load_files(&[("s.xml", &text)], &options(&[("lamp", "1")], true)).unwrap();
    let told: Vec<_> = loaded.warnings.iter().filter(|w| !w.contains("$lamp")).collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(
        told[0].ends_with("bsdf \"bumpmap\" is left out; its surface stays smooth"),
        "{told:?}"
    );
    let scene = loaded.scene;
    let material = |name: &str| scene.materials.iter().find(|m| m.name == name).unwrap();
    let Specular::Coat(coat) = material("glass").specular else { panic!("no plastic") };
    assert!(
        coat.is_nonlinear() && (coat.ior() - 1.5).abs() < 1e-6 && !material("glass").is_rough()
    );
    assert_eq!(material("glass").albedo, Rgb::new(0.2, 0.4, 0.6));
    let gilt = material("gilt");
    assert!(gilt.is_coated() && gilt.is_rough() && gilt.albedo == Rgb::splat(0.5));
    assert!(material("net").opacity_texture.is_some() && material("net").is_masked());
    // Half of the lamp glows, and the floor lets light through where it isn't.
    let flux = scene.lights[0].flux(&scene.bounds()).g;
    assert!((flux / (4.0 * std::f32::consts::PI * 0.5) - 1.0).abs() < 1e-3, "{flux}");
    let passing =
        |x: f32, z: f32| scene.passing(&base::Ray::unbounded(Vec3A::new(x, 0.05, z), -Vec3A::Y));
    assert_eq!([passing(-2.0, 2.0), passing(2.0, 2.0), passing(2.0, -2.0)], [1.0, 0.0, 1.0]);
    assert!(scene.lights.iter().any(|l| matches!(l.kind, scene::LightKind::Sphere(_))));
    for (bsdf, fault) in [
        (
            "<bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf>",
            "a shape with a mask cannot emit; give the emitter to another one",
        ),
        (
            "<bsdf type=\"plastic\"><rgb name=\"specular_reflectance\" value=\"2\"/></bsdf>",
            "bsdf \"plastic\" would create light; use at most 1",
        ),
        (
            "<bsdf type=\"mask\"><float name=\"opacity\" value=\"1.5\"/><bsdf type=\"diffuse\"/></bsdf>",
            "`opacity` of bsdf \"mask\" is 1.5; use 0 to 1",
        ),
    ] {
        let lamp = "<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"0\"/></bsdf>";
        let message = load(&NEW.replace(lamp, bsdf)).unwrap_err();
        assert!(message.ends_with(fault), "{message}");
    }
}

#[test]
fn environment_maps_turn_and_scale() {
    let image =
        image::ImageBuffer::from_fn(4, 2, |x, y| image::Rgb([(y * 4 + x) as f32, 1.0, 2.0]));
    let mut hdr = std::io::Cursor::new(Vec::new());
    image::DynamicImage::ImageRgb32F(image).write_to(&mut hdr, image::ImageFormat::Hdr).unwrap();
    let hdr = hdr.into_inner();
    let xml = NEW.replace(
        "<emitter type=\"constant\" id=\"sky\"><rgb name=\"radiance\" value=\"0.1\"/>",
        "<emitter type=\"envmap\"><string name=\"filename\" value=\"a.hdr\"/><float name=\"scale\" value=\"3\"/>\
         <transform name=\"to_world\"><rotate y=\"1\" angle=\"90\"/></transform>",
    );
    let toml = "camera = { origin = [0, 0, 5], target = [0, 0, 0], fov = 40 }\n\
        materials.white = { type = \"diffuse\", albedo = 0.5 }\n\
        quads = [{ corner = [0, 0, 0], edges = [[1, 0, 0], [0, 1, 0]], material = \"white\" }]\n\
        lights = [{ type = \"environment\", file = \"a.hdr\", radiance = [3, 3, 3], \
        rotate = { axis = [0, 1, 0], degrees = 90 } }]\n";
    let folder = folder(&[("s.xml", xml.as_bytes()), ("s.toml", toml.as_bytes()), ("a.hdr", &hdr)]);
    for name in ["s.xml", "s.toml"] {
        let loaded = load_with(&folder.path().join(name), &options(&[], false)).unwrap();
        let at = |x: f32, y: f32, z: f32| loaded.scene.background(Vec3A::new(x, y, z).normalize());
        // What lay towards +z, between the second column and the third, now lies towards +x.
        let found = at(1.0, 0.0, 0.0);
        let expected = Rgb::new(3.0 * 3.5, 3.0, 6.0);
        assert!((found - expected).map(f32::abs).max_channel() < 1e-4, "{name}: {found:?}");
        // And what lay towards +x, between the first two, towards -z.
        assert!((at(0.0, 0.0, -1.0).r - 7.5).abs() < 1e-4, "{name}");
    }
}

#[test]
fn nothing_overflows() {
    let deep = format!("<scene>{}{}</scene>", "<a>".repeat(10_000), "</a>".repeat(10_000));
    assert_eq!(load(&deep).unwrap_err(), "s.xml:1:197: elements nest more than 64 deep");
    let wide: String = (0..1000).map(|i| format!(" a{i}=\"\"")).collect();
    assert_eq!(
        load(&format!("<scene><a{wide}/></scene>")).unwrap_err(),
        "s.xml:1:8: an element has more than 32 attributes"
    );
    for end in (0..NEW.len()).step_by(11) {
        if NEW.is_char_boundary(end) {
            assert!(load(&NEW[..end]).is_err() || end + 1 >= NEW.len(), "cut at {end}");
        }
    }
}
