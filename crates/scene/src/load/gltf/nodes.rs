//! The tree of nodes, and where each of them is.

use glam::{DAffine3, DMat4, DQuat, DVec3};

use super::file::File;
use super::tables::Node;
use crate::Error;

/// No number of a transform may be larger, so that products of a few don't overflow.
const MOST: f64 = 1e30;

/// A node that the scene shows.
pub(super) struct Placed<'f> {
    pub(super) index: usize,
    pub(super) node: &'f Node,
    /// From its own coordinates to those of the world.
    pub(super) map: DAffine3,
}

/// The nodes of the scene to be shown, each before those below it, in the order of the file.
pub(super) fn placed(file: &File) -> Result<Vec<Placed<'_>>, Error> {
    let nodes = &file.tables.nodes;
    let (roots, place) = roots(file)?;
    let mut rest: Vec<(usize, DAffine3, String)> =
        roots.iter().rev().map(|root| (*root, DAffine3::IDENTITY, place.clone())).collect();
    let mut is_seen = vec![false; nodes.len()];
    let mut placed = Vec::new();
    while let Some((index, above, named_at)) = rest.pop() {
        let node = file.get(nodes, "nodes", index, &named_at)?;
        // Which keeps nodes from standing below themselves, too.
        if std::mem::replace(&mut is_seen[index], true) {
            let fault = format!(
                "nodes[{index}] has another place already; every node needs one of its own"
            );
            return Err(file.fault(&named_at, fault));
        }
        let place = format!("nodes[{index}]");
        let map = above * local(node).map_err(|fault| file.fault(&place, fault))?;
        if !map.to_cols_array().iter().all(|x| x.abs() < MOST) {
            return Err(file.fault(&place, "its place in the world overflows; use smaller numbers"));
        }
        let below = node.children.iter().rev();
        rest.extend(below.map(|child| (*child, map, format!("{place}.children"))));
        placed.push(Placed { index, node, map });
    }
    Ok(placed)
}

/// The nodes at the top of the scene, and where they are named.
fn roots(file: &File) -> Result<(Vec<usize>, String), Error> {
    let tables = &file.tables;
    let index = tables.scene.unwrap_or(0);
    if tables.scene.is_some() || !tables.scenes.is_empty() {
        let scene = file.get(&tables.scenes, "scenes", index, "scene")?;
        return Ok((scene.nodes.clone(), format!("scenes[{index}].nodes")));
    }
    // A file of nodes alone: those that stand below no other.
    let mut is_below = vec![false; tables.nodes.len()];
    for child in tables.nodes.iter().flat_map(|node| &node.children) {
        if let Some(is_below) = is_below.get_mut(*child) {
            *is_below = true;
        }
    }
    let tops = (0..tables.nodes.len()).filter(|i| !is_below[*i]).collect();
    Ok((tops, "nodes".into()))
}

/// From the coordinates of a node to those of the one above.
fn local(node: &Node) -> Result<DAffine3, &'static str> {
    if let Some(matrix) = &node.matrix {
        if node.translation.is_some() || node.rotation.is_some() || node.scale.is_some() {
            return Err("it has a matrix and other transforms; keep one of the two");
        }
        if [matrix[3], matrix[7], matrix[11], matrix[15]] != [0.0, 0.0, 0.0, 1.0] {
            return Err("the last row of its matrix must be 0, 0, 0, 1");
        }
        return Ok(DAffine3::from_mat4(DMat4::from_cols_array(matrix)));
    }
    let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let length = rotation.length();
    if !(length.is_finite() && length > 1e-6) {
        return Err("its rotation is no quaternion of length 1");
    }
    Ok(DAffine3::from_scale_rotation_translation(
        DVec3::from_array(node.scale.unwrap_or([1.0; 3])),
        rotation * (1.0 / length),
        DVec3::from_array(node.translation.unwrap_or([0.0; 3])),
    ))
}
