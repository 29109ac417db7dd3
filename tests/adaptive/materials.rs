//! Plastic, masks and lamps that aren't of one color.

use super::bench::{Bench, metadata};

const SCENE: &str = r#"<scene version="3.0.0">
<sensor type="perspective">
  <float name="fov" value="36"/>
  <transform name="to_world"><lookat origin="0.4, 2.6, 6" target="0, 0.5, 0" up="0, 1, 0"/></transform>
</sensor>
<texture type="checkerboard" id="holes">
  <rgb name="color0" value="0"/><rgb name="color1" value="1"/>
  <transform name="to_uv"><scale x="3" y="3"/></transform>
</texture>
<texture type="checkerboard" id="colors"><rgb name="color0" value="1 4 9"/><rgb name="color1" value="8 5 1"/></texture>
<bsdf type="diffuse" id="white"><rgb name="reflectance" value="0.7"/></bsdf>
<!-- In one plane: what both receive differs by their coats. -->
<shape type="rectangle">
  <transform name="to_world"><scale x="1.5" y="3"/><rotate x="1" angle="-90"/><translate x="-1.5"/></transform><ref id="white"/>
</shape>
<shape type="rectangle">
  <transform name="to_world"><scale x="1.5" y="3"/><rotate x="1" angle="-90"/><translate x="1.5"/></transform>
  <bsdf type="roughplastic">
    <string name="distribution" value="ggx"/><float name="alpha" value="0.1"/><rgb name="diffuse_reflectance" value="0.6 0.5 0.2"/>
  </bsdf>
</shape>
<shape type="rectangle">
  <transform name="to_world"><scale value="2.5"/><translate y="2" z="-2.5"/></transform><ref id="white"/>
</shape>
<shape type="rectangle">
  <transform name="to_world"><scale value="0.7"/><rotate y="1" angle="30"/><translate x="-1.3" y="0.8"/></transform>
  <bsdf type="mask"><ref name="opacity" id="holes"/><ref id="white"/></bsdf>
</shape>
<shape type="sphere">
  <point name="center" x="1" y="0.6" z="0.2"/><float name="radius" value="0.6"/>
  <bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.2 0.3 0.6"/></bsdf>
</shape>
<shape type="rectangle">
  <transform name="to_world"><scale value="0.8"/><rotate x="1" angle="90"/><translate y="3.4"/></transform>
  <bsdf type="diffuse"/><emitter type="area"><ref name="radiance" id="colors"/></emitter>
</shape>
<shape type="sphere">
  <point name="center" x="-2" y="2.2" z="1"/><float name="radius" value="0.25"/>
  <emitter type="area"><rgb name="radiance" value="9 8 7"/></emitter>
</shape>
</scene>"#;

#[test]
fn coats_masks_and_colored_lamps_are_cached() {
    let pair = Bench::of_files(&[("scene.xml", SCENE)], "200K")
        .both("--resolution 192x192 --shadow-rays 32 --gather 200");
    let flip = pair.difference("").flip;
    let told = metadata(&pair.adaptive)["error"]["measured_mean"].as_f64().unwrap();
    println!("materials: told {told:.5}, {flip:?}");
    if flip.mean > 0.02 || (told - flip.mean).abs() > 0.3 * flip.mean + 0.002 {
        panic!("told {told}, {flip:?}, see {}", pair.show("adaptive-materials", "").display());
    }
}
