//! Meshes, and how nodes show them.
//!
//! Several nodes may show one mesh. As with instances of Mitsuba each of them has a copy, so what copies add is limited.

use std::collections::BTreeMap;

use geometry::Mesh;
use glam::{DAffine3, Vec2, Vec3};

use super::Context;
use super::accessor::Accessor;
use super::materials;
use super::nodes::Placed;
use super::tables::{MeshTable, Primitive};
use crate::Error;
use crate::load::mesh_checks::drop_useless;
use crate::load::meshes::admit;
use crate::load::source::MAX_LENGTH;
use crate::load::transform;

/// How many triangles copies may add: with the BVH each takes about 150 bytes, so 2.5 GB.
const MAX_COPIED: usize = 1 << 24;

/// What meshes of a file take while it is read.
#[derive(Default)]
pub(super) struct Counts {
    /// How many nodes will still show a mesh.
    uses: BTreeMap<usize, usize>,
    /// Meshes that more nodes will show.
    known: BTreeMap<usize, Vec<Mesh>>,
    /// Whether colors of vertices are white, by accessor.
    white: BTreeMap<usize, bool>,
    /// Triangles of meshes, each mesh once.
    n_read: usize,
    /// Triangles that further nodes have added.
    n_copied: usize,
}

impl Counts {
    pub(super) fn new(placed: &[Placed<'_>]) -> Self {
        let mut counts = Self::default();
        for mesh in placed.iter().filter_map(|placed| placed.node.mesh) {
            *counts.uses.entry(mesh).or_default() += 1;
        }
        counts
    }
}

/// Adds the mesh of a node.
pub(super) fn add(
    context: &mut Context<'_>,
    placed: &Placed<'_>,
    index: usize,
) -> Result<(), Error> {
    let file = context.file;
    let place = format!("nodes[{}]", placed.index);
    let table = file.get(&file.tables.meshes, "meshes", index, &place)?;
    if placed.node.skin.is_some() {
        let what = "skins aren't supported";
        context.refuse(&place, what, "its mesh is shown as it is stored")?;
    }
    if transform::is_flat(&placed.map) {
        let fault =
            "it flattens its mesh; every scale must differ from 0 and the axes from each other";
        return Err(file.fault(&place, fault));
    }
    check_pose(context, table, placed, index)?;
    let parts = match context.counts.known.remove(&index) {
        Some(parts) => {
            context.counts.n_copied += parts.iter().map(|mesh| mesh.triangles.len()).sum::<usize>();
            if let Some(text) = too_many(context.counts.n_copied) {
                return Err(file.fault(&place, text));
            }
            parts
        }
        None => read(context, table, index)?,
    };
    let rest = context.counts.uses.entry(index).or_default();
    *rest = rest.saturating_sub(1);
    if *rest > 0 {
        context.counts.known.insert(index, parts.clone());
    }
    let name = context.name(placed);
    let n_parts = parts.len();
    for (i, mut mesh) in parts.into_iter().enumerate() {
        place_in_world(&placed.map, &mut mesh).map_err(|text| file.fault(&place, text))?;
        if !mesh.triangles.is_empty() {
            let name = if n_parts == 1 { name.clone() } else { format!("{name}/{}", i + 1) };
            context.assembly.meshes.push((name, mesh));
        }
    }
    Ok(())
}

fn place_in_world(map: &DAffine3, mesh: &mut Mesh) -> Result<(), String> {
    if !transform::apply(map, mesh) {
        return Err(format!(
            "it moves its mesh too far away; keep coordinates within {MAX_LENGTH:e}"
        ));
    }
    // A small scale may round corners to one place.
    drop_useless(mesh);
    Ok(())
}

/// Why copies that add so many triangles are refused.
fn too_many(n: usize) -> Option<String> {
    (n > MAX_COPIED).then(|| {
        format!(
            "nodes that share a mesh have copies of it, and up to this one they add {n} triangles; use at most {MAX_COPIED} in all, or coarser meshes"
        )
    })
}

/// Morph targets that weigh something have no place here.
fn check_pose(
    context: &mut Context<'_>,
    table: &MeshTable,
    placed: &Placed<'_>,
    index: usize,
) -> Result<(), Error> {
    let weights = placed.node.weights.as_ref().unwrap_or(&table.weights);
    if weights.iter().any(|weight| *weight != 0.0)
        && table.primitives.iter().any(|primitive| !primitive.targets.is_empty())
    {
        let place = format!("meshes[{index}]");
        let what = "morph targets whose weights differ from 0 aren't supported";
        context.refuse(&place, what, "it is shown without them")?;
    }
    Ok(())
}

/// The parts of a mesh, in its own coordinates.
fn read(context: &mut Context<'_>, table: &MeshTable, index: usize) -> Result<Vec<Mesh>, Error> {
    let mut parts = Vec::new();
    for (i, primitive) in table.primitives.iter().enumerate() {
        let place = format!("meshes[{index}].primitives[{i}]");
        if let Some(mut mesh) = part(context, primitive, &place)? {
            let source = context.assembly.source;
            admit(&mut context.assembly, &mut mesh, &|text| {
                source.fault_of_whole(format!("{place}: {text}")).to_string()
            });
            parts.push(mesh);
        }
    }
    Ok(parts)
}

/// The surface of a primitive, if it is one.
fn part(
    context: &mut Context<'_>,
    primitive: &Primitive,
    place: &str,
) -> Result<Option<Mesh>, Error> {
    let file = context.file;
    let fault = |text: String| file.fault(place, text);
    let mode = primitive.mode.unwrap_or(4);
    match mode {
        0..=3 => {
            context.refuse(place, "points and lines aren't supported", "they are left out")?;
            return Ok(None);
        }
        4..=6 => {}
        _ => return Err(fault(format!("its mode {mode} is unknown"))),
    }
    let Some(&positions) = primitive.attributes.get("POSITION") else {
        return Err(fault("it has no POSITION".into()));
    };
    let positions = Accessor::new(file, positions, place)?;
    let indices = primitive.indices.map(|i| Accessor::new(file, i, place)).transpose()?;
    if indices.as_ref().is_some_and(|indices| !indices.is_index()) {
        return Err(fault("its indices must be whole numbers without a sign".into()));
    }
    let n_corners = indices.as_ref().map_or(positions.len(), Accessor::len);
    let n_triangles = match mode {
        4 if n_corners % 3 != 0 => {
            let text = format!("its {n_corners} corners don't make triangles; give three for each");
            return Err(fault(text));
        }
        4 => n_corners / 3,
        _ => n_corners.saturating_sub(2),
    };
    // A triangle takes at least one byte, of a strip; where views overlap there might be more of them.
    context.counts.n_read = context.counts.n_read.saturating_add(n_triangles);
    if context.counts.n_read > file.n_bytes() {
        let text = format!(
            "up to this one, primitives have {} triangles, more than fit the {} bytes of all buffers; let nodes share meshes instead",
            context.counts.n_read,
            file.n_bytes()
        );
        return Err(fault(text));
    }
    if positions.len() > u32::MAX as usize {
        return Err(fault("it has more than 2^32 vertices".into()));
    }
    let corner = |i: usize| indices.as_ref().map_or(i as u32, |indices| indices.index(i));
    let mut triangles: Vec<[u32; 3]> = match mode {
        4 => (0..n_triangles).map(|t| [0, 1, 2].map(|i| corner(3 * t + i))).collect(),
        // Every second triangle of a strip runs the other way.
        5 => (0..n_triangles).map(|t| [t, t + 1 + t % 2, t + 2 - t % 2].map(corner)).collect(),
        _ => (0..n_triangles).map(|t| [t + 1, t + 2, 0].map(corner)).collect(),
    };
    let largest = triangles.iter().flatten().max().map_or(0, |largest| *largest as usize);
    if largest >= positions.len() {
        let text = format!("an index is {largest}, but it has only {} vertices", positions.len());
        return Err(fault(text));
    }
    let (material, uv_set) = materials::material(context, primitive.material, place)?;
    check_colors(context, primitive, place)?;
    let vertices = needed_vertices(&mut triangles, positions.len());
    let attribute = |name: &str, least: usize| -> Result<Option<Accessor<'_>>, Error> {
        let Some(&accessor) = primitive.attributes.get(name) else { return Ok(None) };
        let accessor = Accessor::new(file, accessor, &format!("{place}.{name}"))?;
        if accessor.len() != positions.len() || accessor.width() < least {
            let text = format!(
                "its {name} has {} elements of {} numbers, for {} vertices",
                accessor.len(),
                accessor.width(),
                positions.len()
            );
            return Err(fault(text));
        }
        Ok(Some(accessor))
    };
    let normals = attribute("NORMAL", 3)?;
    let uvs = match uv_set {
        Some(set) => {
            let name = format!("TEXCOORD_{set}");
            let uvs = attribute(&name, 2)?.ok_or_else(|| {
                fault(format!("its material has a texture, for which it needs {name}"))
            })?;
            Some((name, uvs))
        }
        None => None,
    };
    let finite = |name: &str, vertex: usize, values: &[f32]| {
        if values.iter().all(|x| x.abs() <= MAX_LENGTH) {
            return Ok(());
        }
        let text = format!("its {name} {vertex} is {values:?}; keep numbers within {MAX_LENGTH:e}");
        Err(fault(text))
    };
    let of = |name: &str, from: &Accessor<'_>| -> Result<Vec<Vec3>, Error> {
        let mut values = Vec::with_capacity(vertices.len());
        for vertex in vertices.iter() {
            let value = from.floats::<3>(vertex);
            finite(name, vertex, &value)?;
            values.push(Vec3::from_array(value));
        }
        Ok(values)
    };
    let uvs = match &uvs {
        Some((name, from)) => {
            let mut values = Vec::with_capacity(vertices.len());
            for vertex in vertices.iter() {
                let value = from.floats::<2>(vertex);
                finite(name, vertex, &value)?;
                values.push(Vec2::from_array(value));
            }
            values
        }
        None => Vec::new(),
    };
    Ok(Some(Mesh {
        positions: of("POSITION", &positions)?,
        normals: normals.map_or(Ok(Vec::new()), |normals| of("NORMAL", &normals))?,
        uvs,
        materials: vec![material; triangles.len()],
        triangles,
    }))
}

/// Colors of vertices count only if they are white.
fn check_colors(
    context: &mut Context<'_>,
    primitive: &Primitive,
    place: &str,
) -> Result<(), Error> {
    let Some(&index) = primitive.attributes.get("COLOR_0") else { return Ok(()) };
    let is_white = match context.counts.white.get(&index) {
        Some(is_white) => *is_white,
        None => {
            let colors = Accessor::new(context.file, index, &format!("{place}.COLOR_0"))?;
            let width = colors.width().min(4);
            let is_white = |i| colors.floats::<4>(i)[..width].iter().all(|x| *x == 1.0);
            // What has no bytes of its own isn't white.
            colors.len() <= context.file.n_bytes() && (0..colors.len()).all(is_white)
        }
    };
    context.counts.white.insert(index, is_white);
    if !is_white {
        context.refuse(place, "colors of vertices aren't supported", "they are taken for white")?;
    }
    Ok(())
}

/// Which vertices are to be read.
enum Vertices {
    /// As many as that.
    All(usize),
    /// Those of these numbers.
    Some(Vec<u32>),
}

impl Vertices {
    fn len(&self) -> usize {
        match self {
            Self::All(n) => *n,
            Self::Some(vertices) => vertices.len(),
        }
    }

    fn iter(&self) -> impl Iterator<Item = usize> {
        let n = self.len();
        (0..n).map(move |i| match self {
            Self::All(_) => i,
            Self::Some(vertices) => vertices[i] as usize,
        })
    }
}

/// The vertices that triangles need, which are given the numbers of these. Primitives may share vertices: each takes
/// what is its own, so that memory doesn't grow by the product of both.
fn needed_vertices(triangles: &mut [[u32; 3]], n: usize) -> Vertices {
    if n <= 3 * triangles.len() {
        return Vertices::All(n);
    }
    let mut vertices = triangles.as_flattened().to_vec();
    vertices.sort_unstable();
    vertices.dedup();
    for corner in triangles.as_flattened_mut() {
        *corner = vertices.partition_point(|vertex| vertex < corner) as u32;
    }
    Vertices::Some(vertices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_copies_add_is_limited() {
        assert_eq!(too_many(MAX_COPIED), None);
        let text = too_many(MAX_COPIED + 1).unwrap();
        assert!(text.contains("16777217 triangles; use at most 16777216 in all"), "{text}");
    }

    #[test]
    fn only_the_vertices_of_the_triangles_are_read() {
        let mut triangles = [[7, 2, 9], [9, 2, 4]];
        let vertices = needed_vertices(&mut triangles, 1000);
        assert_eq!(vertices.iter().collect::<Vec<_>>(), [2, 4, 7, 9]);
        assert_eq!(triangles, [[2, 0, 3], [3, 0, 1]]);
        let mut triangles = [[1, 0, 2]];
        assert_eq!(needed_vertices(&mut triangles, 3).iter().collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(triangles, [[1, 0, 2]]);
    }
}
