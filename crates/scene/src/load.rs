//! Reading scene files.

mod assembly;
mod enclosure;
mod gltf;
mod image;
mod keys;
mod lights;
mod lines;
mod materials;
mod mesh_checks;
mod meshes;
mod mitsuba;
mod mtl;
mod obj;
mod ply;
mod polygon;
mod reach;
mod serialized;
mod shapes;
mod source;
mod tables;
mod textures;
mod transform;
mod view;
mod whole;

use std::path::Path;

use assembly::Assembly;
use reach::Reach;
use source::Source;
use tables::SceneFile;

use crate::{Error, Parts, Scene};

/// A scene, and what its author should know about it.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What was ignored or repaired, one line each, with file and place.
    pub warnings: Vec<String>,
}

/// How a scene is read.
#[derive(Clone, Debug)]
pub struct Options {
    /// Of a scene of Mitsuba: values of parameters, `$name` in the file, by name.
    pub definitions: Vec<(String, String)>,
    /// Of a scene of Mitsuba or of glTF: whether what isn't supported is replaced, with a warning each, instead of refused.
    pub lenient: bool,
    /// Whether all that is read must lie in the folder of the scene file, or below.
    pub no_external: bool,
}

impl Options {
    fn reach(&self, scene: &Path) -> Reach {
        if self.no_external { Reach::beside(scene) } else { Reach::Everything }
    }
}

/// Reads a scene file: `scene.toml`, a scene of Mitsuba if its name ends in `.xml`, or one of glTF if it ends in `.gltf` or
/// `.glb`.
///
/// # Mitsuba
///
/// XML of versions 0.5 to 3, both ways of writing names (`toWorld`, `to_world`), `<default>` and `$name`, references,
/// aliases, includes.
///
/// - shapes: `rectangle`, `disk`, `cube`, `sphere`, `cylinder` (circles are polygons of 128 sides), `obj`, `ply`, `serialized`
///   (versions 3 and 4, with `shape_index`); `shapegroup` and `instance`, which are copies, of 2^24 triangles at most;
///   `to_world` of `translate`, `rotate`, `scale`, `lookat`, `matrix`; `flip_normals`, `face_normals`, `flip_tex_coords`
/// - bsdfs: `diffuse`, `dielectric`, `thindielectric`, `conductor` (by `eta` and `k`, or one of Ag, Al, Au, Cr, Cu, none),
///   `roughdielectric` and `roughconductor` of GGX, `plastic`, `roughplastic` of GGX, `mask`, `twosided`; every surface has
///   two equal sides; `bumpmap` and `normalmap` bring a warning, and their surfaces stay smooth
/// - textures: `bitmap`, `checkerboard`
/// - emitters: `area` (of one color or textured), `point`, `spot`, `directional`, `constant`, `envmap`
/// - sensor: `perspective` and `thinlens` with every `fov_axis` or `focal_length`; the size of the film, or of
///   its crop (`crop_offset_x`, `crop_width` ...), is the default of `--resolution`
/// - colors: `rgb`, `srgb`, hexadecimal, `spectrum` of one value, of pairs of wavelength and value or of a file of such pairs,
///   `blackbody` (in W/(m^2 sr nm))
///
/// Integrators, samplers and what films do beside their size are quality settings, and ignored. Anything else is an error
/// that names it; or, with [`Options::lenient`], a warning that says what takes its place.
///
/// # glTF
///
/// Version 2.0, text or binary; buffers and images (PNG, JPEG) in files, in data URIs or in the file itself.
///
/// - nodes: those of the default scene, or of the first one, or all that stand below no other; by `matrix` or by translation,
///   rotation and scale, which may mirror. Nodes that share a mesh show copies, of 2^24 triangles at most
/// - meshes: triangles, strips and fans, with or without indices; sparse accessors, integers as they are or as parts of 1
///   (`KHR_mesh_quantization`). What has no normals is flat
/// - what isn't metal is plastic: a coat of `KHR_materials_ior`, as rough as the material, over a diffuse base of the base color.
///   It is diffuse alone if that ior is 1 or `specularFactor` of `KHR_materials_specular` is 0
/// - what is metal is a conductor that reflects the base color at normal incidence, and at other angles nearly what Schlick's
///   approximation gives
/// - what transmits (`KHR_materials_transmission`) is a pane, or, with a thickness above 0 (`KHR_materials_volume`), a body of glass
///   that absorbs by its attenuation; its mesh must be closed
/// - `alphaMode`: `BLEND` lets pass what alpha leaves, of any color; `MASK` cuts texels at `alphaCutoff`
/// - emission, times `KHR_materials_emissive_strength`, leaves the front side; of `doubleSided` materials a warning says so.
///   Everything else has two equal sides, `doubleSided` or not
/// - textures of base color, alpha and emission, by any one set of texture coordinates, with `KHR_texture_transform`, filtered as
///   `magFilter` says; normal maps bring a warning, and their surfaces stay smooth; occlusion is computed, not read
/// - `KHR_lights_punctual`: `point`, `spot` and `directional`. Between its two angles a spot falls off smoothly; `range`, which
///   is a hint, changes nothing
/// - the first camera in perspective, of which `yfov` spans the height; `aspectRatio` times 512 by 512 pixels is the default of
///   `--resolution`. A file without one is refused: what its pictures should show isn't guessed
///
/// Light is photometric in glTF and radiometric here. Its numbers are taken as they are in every channel, a candela for 1 W/sr, a
/// lux for 1 W/m^2 and a nit for 1 W/(m^2 sr), so that lights keep their proportions and values of pixels are in nits.
///
/// Animations are left out with a warning. Refused, or replaced with [`Options::lenient`], are shares of metal or transmission
/// between 0 and 1, and shares and roughness that a texture varies (taken as the nearest, or the mean); textures on metals and colors of
/// glass; skins, weights of morph targets, colors of vertices, points, lines; a `wrapT` unlike `wrapS`; and other extensions
/// of materials, such as clearcoat and unlit. Other extensions that the file requires are refused in any case.
///
/// # scene.toml
///
/// A scene file is TOML. Paths in it are relative to it. Unknown keys are errors. A color is `[red, green, blue]`, linear
/// Rec. 709, or one number for gray; angles are in degrees; lengths are in any unit, as long as it is the same
/// everywhere. Names are optional except for those of materials; an object without one is called by its place, such as
/// `quad 3`, and no two objects may have the same.
///
/// ```toml
/// [camera]
/// origin = [0, 2, 10]      # where the eye is
/// target = [0, 2, 0]       # what the middle of the picture shows
/// up = [0, 1, 0]           # this is the default
/// fov = 40                 # whole angle of view
/// fov_axis = "x"           # across the width, which is the default; "y": the height; "smaller", "larger": that side;
///                          # "diagonal": from corner to corner
/// aperture_radius = 0.05   # optional: a thin lens of this radius, which blurs what isn't in focus
/// focus_distance = 8       # along the view axis; the default is that of the target
///
/// [textures.NAME]          # one of the two types
/// type = "bitmap"
/// file = "wood.png"        # or .jpg, .tga, .bmp, .hdr, .exr; at most 32768 texels a side, and 2^26 in all
/// raw = true               # take integers as linear values, not as sRGB; false is the default
/// filter = "nearest"       # "bilinear" is the default
/// wrap = "mirror"          # beyond the unit square; or "clamp"; "repeat" is the default
///
/// type = "checkerboard"    # the unit square in four, of two colors, repeated
/// colors = [0.2, [0.8, 0.7, 0.6]] # the first takes the square that touches (0, 0)
/// scale = [4, 4]           # what texture coordinates are multiplied with before they are looked up; [1, 1] is the default
/// rotate = 45              # by how much they are turned after that, counterclockwise
/// offset = [0.5, 0]        # and moved at last
///
/// [materials.NAME]         # one of the six types
/// type = "diffuse"
/// albedo = [0.7, 0.7, 0.7] # at most 1; both sides reflect alike
/// albedo_texture = "NAME"  # optional: what albedo is multiplied with from place to place; albedo is 1 by default then
/// emission = [17, 12, 4]   # radiance of the front side; optional; mirrors, metals and plastic take it, too
/// emission_texture = "NAME" # optional: what emission is multiplied with from place to place; emission is 1 by default then
/// opacity = 0.5            # the part of the surface that is there, 0 to 1; light passes the rest; optional; of all but glass
///                          # and what emits
/// opacity_texture = "NAME" # optional: what opacity, 1 by default, is multiplied with, in the mean of its channels
///
/// type = "mirror"
/// reflectance = 0.9        # at most 1, the same at every angle
/// albedo = 0.1             # optional; the sum of both is at most 1
/// roughness = 0.3          # optional, of mirrors, metals, plastic and glass: 0 to 1; below 0.02 they are perfectly sharp
///
/// type = "metal"
/// preset = "gold"          # or aluminium, chromium, copper, iron, platinum, silver
/// eta = [0.2, 0.4, 1.4]    # or complex index of refraction, eta + i k, instead of a preset
/// k = [3.4, 2.3, 1.8]
///
/// type = "plastic"         # a diffuse base, of an albedo and its texture as of diffuse, under a coat
/// ior = 1.5                # of the coat relative to the outside, 0.1 to 10
/// reflectance = 1          # what reflections by the coat are multiplied with; at most 1, which is the default
/// nonlinear = true         # let what the coat throws back to the base saturate its color; false is the default
///
/// type = "glass"
/// ior = 1.5                # inside relative to outside, 0.1 to 10
/// absorption = [0.1, 0, 0] # per unit of length inside; optional
///
/// type = "pane"            # of glass, too thin to have an inside: a surface that light passes straight through
/// ior = 1.5                # of the glass relative to what is around it, 0.1 to 10
///
/// [[meshes]]
/// name = "rabbit"
/// file = "rabbit.ply"      # or .obj
/// material = "NAME"        # needed for PLY; for OBJ it takes the place of the materials of the file
/// smooth = true            # use the normals of the file, if it has any; this is the default
/// transform = { scale = 2, rotate = { axis = [0, 1, 0], degrees = 30 }, translate = [0, 0, -1] }
///
/// [[quads]]                # a parallelogram; its front is the side that edges[0] x edges[1] points to
/// name = "floor"
/// corner = [-1, 0, -1]
/// edges = [[0, 0, 2], [2, 0, 0]]
/// material = "NAME"
///
/// [[boxes]]                # either min and max or center and size
/// name = "room"
/// min = [-1, 0, -1]
/// max = [1, 2, 1]
/// inward = true            # turn the front sides inward; false is the default
/// material = "NAME"        # takes a transform, too
///
/// [[spheres]]              # their front is outside
/// name = "ball"
/// center = [0, 1, 0]
/// radius = 0.5
/// material = "NAME"
///
/// [[lights]]               # besides the objects whose material emits; one of the four types
/// name = "lamp"
/// type = "point"
/// position = [0, 3, 0]
/// intensity = [5, 5, 5]    # per solid angle
///
/// type = "spot"
/// position = [0, 3, 0]
/// target = [0, 0, 0]
/// intensity = [5, 5, 5]    # per solid angle, along the axis
/// cone_angle = 30          # half angle beyond which it is dark, up to 180
/// falloff_angle = 20       # half angle at which it begins to fall off; optional: not before cone_angle
///
/// type = "directional"
/// direction = [0, -1, 0]   # in which the light travels
/// irradiance = [1, 1, 1]   # on a surface that faces it
///
/// type = "environment"
/// radiance = [1, 1, 1]     # from everywhere beyond the scene
/// file = "sky.exr"         # optional: an image around the scene, which radiance, 1 by default then, is multiplied with
/// rotate = { axis = [0, 1, 0], degrees = 90 } # optional, of images: once or for each of a list
/// ```
///
/// A texture needs texture coordinates. Quads have (0, 0) at the corner, (1, 0) at the end of the first edge and (0, 1) at
/// that of the second; on each side of a box they span the unit square, upright as seen from outside; on a sphere u goes
/// once around +y from +x, and v from -y to +y. Meshes have those of the file. An image has (0, 0) at its lower left.
///
/// The image of an environment shows longitudes along its width and latitudes along its height, as nearly all do: its upper
/// edge is +y, its middle lies towards +z and its left quarter towards +x.
///
/// A transform scales, by a number or `[x, y, z]`, then rotates, once or for each of a list, counterclockwise as seen
/// against the axis, then translates; or it is a `matrix` of four rows, the last `[0, 0, 0, 1]`. Mirrored bodies keep
/// their outside.
///
/// # Meshes
///
/// OBJ: polygons of any shape, normals if all corners of an object have them. Of MTL, `illum` 0, 1 and 2 are diffuse
/// (`Kd`), 3, 5 and 8 mirrors (`Ks`) with a diffuse part (`Kd`), 4, 6, 7 and 9 glass (`Ni`); `Ke` is emission. Ambient
/// light (`Ka`) means nothing to a renderer of global illumination; highlights and textures other than
/// `map_Kd` and `map_d` bring warnings. `d` (or `Tr`), times the values of `map_d` as they are, is the part of a surface that is
/// there, but of glass and lamps; light passes the rest. What `map_Kd` is multiplied with is `Kd`, or 1 if there is none; texture coordinates are
/// multiplied by its `-s` and moved by its `-o`, and `-clamp on` holds them in the unit square. `Pr` is the roughness of mirrors and
/// glass. Such materials are named `MESH/NAME`.
///
/// PLY: ASCII and binary; vertices with `x y z`, `nx ny nz`, and `u v`, `s t` or `texture_u texture_v`; faces with `vertex_indices`.
///
/// Triangles without area and copies of others are dropped with a warning. Glass must be closed: where it isn't, a
/// warning counts the open edges. Glass that is inside out is turned around.
///
/// # What is read
///
/// The scene file; what it includes; the meshes, buffers, images and libraries (`mtllib`) that these name, relative to the file that
/// names them: regular files, by whatever path, unless [`Options::no_external`] says that all must lie in the folder of the scene
/// file or below it, once links are followed. Nothing else is read, nothing is written, and no program is started.
///
/// # Errors
///
/// Whatever keeps the scene from being rendered: files that can't be read, syntax, values out of range, a scene without
/// light or surfaces, a camera shut in by something dark. Every message names file, line and column, or the object or its
/// place in the JSON, and what to do. Memory is proportional to the size of the files; no file makes this function panic.
pub fn load(path: &Path) -> Result<Loaded, Error> {
    load_with(path, &Options { definitions: Vec::new(), lenient: false, no_external: false })
}

/// Reads a scene file as [`load`] does.
///
/// # Errors
///
/// See [`load`].
pub fn load_with(path: &Path, options: &Options) -> Result<Loaded, Error> {
    let (parts, warnings) = load_parts(path, options)?;
    Ok(Loaded { scene: Scene::assemble(parts), warnings })
}

/// Reads a scene file as [`load`] does, but leaves its parts apart; with what its author should know.
///
/// # Errors
///
/// See [`load`].
pub fn load_parts(path: &Path, options: &Options) -> Result<(Parts, Vec<String>), Error> {
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    if ending.as_deref() == Some("xml") {
        return mitsuba::read(path, options);
    }
    if !options.definitions.is_empty() {
        return Err(Error::whole(path, "only scenes of Mitsuba (.xml) take -D; leave it out"));
    }
    if let Some("gltf" | "glb") = ending.as_deref() {
        return gltf::read(path, options);
    }
    if options.lenient {
        let fault = "only scenes of Mitsuba (.xml) and glTF take --lenient; leave it out";
        return Err(Error::whole(path, fault));
    }
    let source = Source::read(path, &options.reach(path))?;
    let file: SceneFile = toml::from_str(source.text()).map_err(|e| source.syntax(&e))?;
    let camera = view::camera(&source, &file.camera)?;
    let mut assembly = Assembly::new(&source);
    assembly.add_textures(&file.textures)?;
    assembly.add_materials(&file.materials)?;
    for (i, table) in file.meshes.iter().enumerate() {
        meshes::add(&mut assembly, i, table)?;
    }
    for (i, table) in file.quads.iter().enumerate() {
        assembly.add_quad(i, table)?;
    }
    for (i, table) in file.boxes.iter().enumerate() {
        assembly.add_box(i, table)?;
    }
    for (i, table) in file.spheres.iter().enumerate() {
        assembly.add_sphere(i, table)?;
    }
    for (i, table) in file.lights.iter().enumerate() {
        assembly.add_light(i, table)?;
    }
    assembly.warn_of_unused(&file);
    whole::finish(assembly, camera)
}
