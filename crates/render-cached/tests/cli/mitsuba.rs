//! Scenes of Mitsuba through both programs.

use base::ImageSize;

use crate::bench::Bench;

const SCENE: &str = r#"<scene version="3.0.0">
<default name="lamp" value="5"/>
<sensor type="perspective">
  <float name="fov" value="45"/>
  <transform name="to_world"><lookat origin="0, 2, 6" target="0, 1, 0" up="0, 1, 0"/></transform>
  <film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="32"/></film>
</sensor>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform></shape>
<shape type="sphere"><point name="center" value="0, 1, 0"/><bsdf type="dielectric"/></shape>
<emitter type="point"><point name="position" value="0, 4, 1"/><rgb name="intensity" value="$lamp"/></emitter>
</scene>
"#;

#[test]
fn parameters_and_the_size_of_the_film_reach_both_programs() {
    let bench = Bench::new();
    bench.write("s.xml", SCENE);
    bench.photon_build("s.xml -o s.photons --photons 5K -Dlamp=20");
    bench.run("s.xml --photons s.photons -D lamp=20 --mode original --gather 50 -o a.exr");
    let picture = bench.picture("a.exr");
    assert_eq!(picture.size(), ImageSize { width: 48, height: 32 });
    assert!(picture.rgb("caustics").unwrap().values().iter().any(|c| !c.is_black()));
    bench.run("s.xml --photons s.photons -D lamp=20 --resolution 8x8 --mode original -o b.exr");
    assert_eq!(bench.picture("b.exr").size(), ImageSize { width: 8, height: 8 });
    // With another value it is another scene, and the remedy names it.
    bench.refuses(
        "s.xml --photons s.photons -D lamp=7 -o c.exr",
        1,
        "s.photons is stale: light `emitter 1` changed; make it anew with: photon-build s.xml -o s.photons --photons 5000 --seed 0 --max-bounces 1024 -Dlamp=7 --force",
    );
    bench.refuses(
        "s.xml --photons s.photons -D lamps=7 -o c.exr",
        1,
        "s.xml: the scene has no parameter $lamps, which -D gives a value",
    );
    bench.refuses(
        "scene.toml --photons a.photons --lenient -o c.exr",
        1,
        "scene.toml: only scenes of Mitsuba (.xml) and glTF take --lenient; leave it out",
    );
}
