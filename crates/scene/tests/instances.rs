//! Groups and their instances, meshes of Mitsuba's own format, and crops of films.

use std::fs;
use std::io::Write;

use base::ImageSize;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::{Vec2, Vec3};
use scene::{Loaded, Options, Parts, load_parts, load_with};
use tempfile::TempDir;

const SENSOR: &str = r#"<sensor type="perspective"><float name="fov" value="45"/>
<transform name="to_world"><lookat origin="0, 2, 9" target="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="32"/></film></sensor>
<emitter type="constant"/>
"#;

const GROUP: &str = r#"<shape type="shapegroup" id="pair">
<shape type="cube" id="box"><transform name="to_world"><translate x="3"/></transform></shape>
<shape type="sphere" id="ball"><point name="center" value="0, 1, 0"/><float name="radius" value="0.5"/></shape>
</shape>
"#;

fn write(body: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder for the scene");
    let text = format!("<scene version=\"3.0.0\">\n{body}</scene>\n");
    fs::write(folder.path().join("s.xml"), text).expect("a scene file");
    folder
}

fn options() -> Options {
    Options { definitions: Vec::new(), lenient: false, no_external: false }
}

fn parts(body: &str) -> Result<Parts, String> {
    let folder = write(body);
    let parts = load_parts(&folder.path().join("s.xml"), &options());
    parts.map(|(parts, _)| parts).map_err(|e| message(&e.to_string()))
}

/// Without the folder.
fn message(text: &str) -> String {
    text.rsplit_once("s.xml").map_or(text, |(_, rest)| rest).to_owned()
}

#[test]
fn instances_show_their_group_wherever_they_are() {
    let body = format!(
        r#"{SENSOR}{GROUP}
<shape type="instance" id="a"><ref id="pair"/></shape>
<shape type="instance"><ref id="pair"/>
<transform name="to_world"><scale value="2"/><rotate y="1" angle="90"/><translate y="10"/></transform></shape>
<shape type="instance"><ref id="pair"/><transform name="to_world"><scale x="-1"/></transform></shape>
"#
    );
    let parts = parts(&body).unwrap();
    let names: Vec<_> = parts.meshes.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["a/box", "shape 2/box", "shape 3/box"]);
    let boxes: Vec<_> = parts.meshes.iter().map(|(_, mesh)| mesh.bounds()).collect();
    assert_eq!(
        (boxes[0].min, boxes[0].max),
        (Vec3::new(2.0, -1.0, -1.0), Vec3::new(4.0, 1.0, 1.0))
    );
    // Turned, +x is -z.
    assert_eq!(
        (boxes[1].min, boxes[1].max),
        (Vec3::new(-2.0, 8.0, -8.0), Vec3::new(2.0, 12.0, -4.0))
    );
    let outside = |i: usize| {
        let mesh = &parts.meshes[i].1;
        let center = mesh.bounds().center();
        (0..12).all(|t| {
            let [a, b, c] = mesh.corners(t);
            (b - a).cross(c - a).dot(a - center) > 0.0
        })
    };
    assert!(outside(0) && outside(1) && outside(2), "a front has turned inward");
    let balls: Vec<_> = parts.spheres.iter().map(|(_, s)| (s.center, s.radius)).collect();
    let expected = [(Vec3::Y, 0.5), (Vec3::new(0.0, 12.0, 0.0), 1.0), (Vec3::Y, 0.5)];
    for ((center, radius), (wanted, size)) in balls.into_iter().zip(expected) {
        assert!((center - wanted).length() < 1e-6 && (radius - size).abs() < 1e-6, "{center}");
    }
    // A group alone shows nothing.
    let error = self::parts(&format!("{SENSOR}{GROUP}")).err().unwrap();
    assert!(error.contains("there are no surfaces"), "{error}");
}

#[test]
fn instances_that_cannot_be_are_refused() {
    let instance = r#"<shape type="instance"><ref id="pair"/></shape>"#;
    for (group, expected) in [
        (r#"<shape type="cube" id="pair"/>"#, "an instance shows a shapegroup, not shape \"cube\""),
        (r#"<shape type="shapegroup" id="pair"/>"#, "the shapegroup holds no shapes"),
        (
            r#"<shape type="shapegroup" id="pair"><shape type="instance"><ref id="pair"/></shape></shape>"#,
            "a shapegroup holds no other groups and no instances; put its shapes in it",
        ),
        (
            r#"<shape type="shapegroup" id="pair"><ref id="pair"/></shape>"#,
            "a shapegroup holds no other groups and no instances; put its shapes in it",
        ),
        (
            r#"<shape type="shapegroup" id="pair"><shape type="cube"><emitter type="area"/></shape></shape>"#,
            "a shape that emits can't be instanced; place each lamp on its own",
        ),
    ] {
        let error = parts(&format!("{SENSOR}{group}\n{instance}")).err().unwrap();
        assert!(error.ends_with(expected), "{error}");
        assert!(error.starts_with(':'), "{error} tells no place");
    }
    let uneven = format!(
        "{SENSOR}{GROUP}<shape type=\"instance\"><ref id=\"pair\"/><transform name=\"to_world\"><scale x=\"2\"/></transform></shape>"
    );
    let error = parts(&uneven).err().unwrap();
    let expected = "ball of this instance is a sphere that is scaled unevenly, which isn't supported; use a mesh";
    assert!(error.ends_with(expected), "{error}");
    let alone = format!("{SENSOR}<shape type=\"instance\"/>");
    let error = parts(&alone).err().unwrap();
    assert!(
        error.ends_with("shape \"instance\" needs one shapegroup, by a <ref> or in it"),
        "{error}"
    );
}

#[test]
fn serialized_meshes_are_taken_by_number() {
    let quad = |size: f32| {
        let mut plain = 0x1000_u32.to_le_bytes().to_vec();
        plain.extend(b"\0");
        plain.extend([4_u64, 2].map(u64::to_le_bytes).concat());
        let places = [0.0, 0.0, 0.0, size, 0.0, 0.0, size, size, 0.0, 0.0, size, 0.0];
        plain.extend(places.map(f32::to_le_bytes).concat());
        plain.extend([0_u32, 1, 2, 0, 2, 3].map(u32::to_le_bytes).concat());
        let mut encoder = ZlibEncoder::new(vec![0x1c, 4, 4, 0], Compression::default());
        encoder.write_all(&plain).unwrap();
        encoder.finish().unwrap()
    };
    let (first, second) = (quad(1.0), quad(3.0));
    let places = [0, first.len() as u64].map(u64::to_le_bytes).concat();
    let file = [first, second, places, 2_u32.to_le_bytes().to_vec()].concat();
    let shape = |index: u32| {
        format!(
            r#"{SENSOR}<shape type="serialized"><string name="filename" value="a.serialized"/>
<integer name="shape_index" value="{index}"/></shape>"#
        )
    };
    for (index, size) in [(0, 1.0), (1, 3.0)] {
        let folder = write(&shape(index));
        fs::write(folder.path().join("a.serialized"), &file).unwrap();
        let Loaded { scene, .. } = load_with(&folder.path().join("s.xml"), &options()).unwrap();
        assert_eq!(scene.bounds().max.x, size);
    }
    let folder = write(&shape(2));
    fs::write(folder.path().join("a.serialized"), &file).unwrap();
    let error = load_with(&folder.path().join("s.xml"), &options()).unwrap_err().to_string();
    assert!(
        error
            .ends_with("a.serialized: the file holds 2 meshes, and shape_index is 2; count from 0"),
        "{error}"
    );
}

#[test]
fn crops_show_a_part_of_the_film() {
    let crop = |written: &str| {
        let body = format!("{SENSOR}<shape type=\"cube\"/>")
            .replace("</film>", &format!("{written}</film>"));
        parts(&body)
    };
    let whole = crop("").unwrap().camera;
    let film = ImageSize { width: 48, height: 32 };
    assert_eq!(whole.film(), Some(film));
    let names =
        [("crop_offset_x", 8), ("crop_offset_y", 4), ("crop_width", 16), ("crop_height", 10)];
    let new: String =
        names.iter().map(|(n, v)| format!("<integer name=\"{n}\" value=\"{v}\"/>")).collect();
    let old = new
        .replace("crop_offset_x", "cropOffsetX")
        .replace("crop_offset_y", "cropOffsetY")
        .replace("crop_width", "cropWidth")
        .replace("crop_height", "cropHeight");
    for written in [new, old] {
        let camera = crop(&written).unwrap().camera;
        let size = camera.film().unwrap();
        assert_eq!(size, ImageSize { width: 16, height: 10 });
        let place = Vec2::new(3.5, 7.5);
        let expected = whole.ray(film, place + Vec2::new(8.0, 4.0)).dir();
        assert!((camera.ray(size, place).dir() - expected).length() < 1e-6);
    }
    let error = crop(
        "<integer name=\"crop_offset_x\" value=\"40\"/><integer name=\"crop_width\" value=\"9\"/>",
    );
    assert!(
        error
            .err()
            .unwrap()
            .ends_with("the crop of 9x32 pixels at 40, 0 doesn't lie within the film of 48x32"),
    );
}
