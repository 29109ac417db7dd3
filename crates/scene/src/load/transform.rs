//! Affine maps of objects.

use geometry::Mesh;
use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::source::{MAX_LENGTH, Source};
use super::tables::{RotationTable, TransformTable};
use crate::Error;

/// The map that a table describes.
pub(super) fn affine(
    source: &Source,
    object: &str,
    table: &toml::Spanned<TransformTable>,
) -> Result<DAffine3, Error> {
    let span = table.span();
    let table = table.get_ref();
    let what = format!("the transform of {object}");
    let map = if let Some(matrix) = &table.matrix {
        if table.scale.is_some() || table.rotate.is_some() || table.translate.is_some() {
            let fault = format!("{what} has a matrix and other keys; keep one of the two");
            return Err(source.fault(span, fault));
        }
        let rows = *matrix.get_ref();
        if rows[3] != [0.0, 0.0, 0.0, 1.0] {
            let fault = format!("the last row of {what} must be [0, 0, 0, 1]");
            return Err(source.fault(matrix.span(), fault));
        }
        let column = |i: usize| DVec3::new(rows[0][i], rows[1][i], rows[2][i]);
        DAffine3 {
            matrix3: DMat3::from_cols(column(0), column(1), column(2)),
            translation: column(3),
        }
    } else {
        let mut map = DAffine3::IDENTITY;
        if let Some(scale) = &table.scale {
            map.matrix3 = DMat3::from_diagonal(DVec3::from_array(scale.get_ref().0));
        }
        for rotation in table.rotate.iter().flat_map(|r| &r.0) {
            map.matrix3 = rotation_matrix(source, &what, rotation)? * map.matrix3;
        }
        if let Some(translate) = &table.translate {
            map.translation = DVec3::from_array(*translate.get_ref());
        }
        map
    };
    if !map.is_finite() {
        let fault = format!("{what} holds values that are not finite; give finite numbers");
        return Err(source.fault(span, fault));
    }
    // Relative to the product of the three lengths, so that scales of any size pass.
    let lengths =
        map.matrix3.x_axis.length() * map.matrix3.y_axis.length() * map.matrix3.z_axis.length();
    let volume = map.matrix3.determinant().abs() / lengths;
    if !(volume.is_finite() && volume > 1e-9) {
        let fault = format!(
            "{what} flattens it; every scale must differ from 0 and the axes from each other"
        );
        return Err(source.fault(span, fault));
    }
    Ok(map)
}

/// A rotation about an axis through the origin, counterclockwise as seen against it (Rodrigues' formula).
fn rotation_matrix(source: &Source, what: &str, table: &RotationTable) -> Result<DMat3, Error> {
    let axis = source.direction(&table.axis, &format!("the axis of {what}"))?;
    let degrees = f64::from(source.number(&table.degrees, &format!("the angle of {what}"))?);
    // Quarter turns are exact.
    let quarters = (degrees / 90.0).round();
    let (sin, cos) = libm::sincos((degrees - quarters * 90.0).to_radians());
    let (sin, cos) = match quarters.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    };
    let cross = DMat3::from_cols(axis.cross(DVec3::X), axis.cross(DVec3::Y), axis.cross(DVec3::Z));
    let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
    Ok(cross * sin + DMat3::IDENTITY * cos + outer * (1.0 - cos))
}

/// Applies the map. A map that mirrors keeps the front sides where they were.
///
/// `false` if a coordinate left the allowed range.
pub(super) fn apply(map: &DAffine3, mesh: &mut Mesh) -> bool {
    let mut fits = true;
    for p in &mut mesh.positions {
        let moved = map.transform_point3(p.as_dvec3());
        fits &= moved.abs().max_element() <= f64::from(MAX_LENGTH);
        *p = moved.as_vec3();
    }
    let normal_map = map.matrix3.inverse().transpose();
    for n in &mut mesh.normals {
        let moved = normal_map * n.as_dvec3();
        *n = moved.try_normalize().map_or(Vec3::ZERO, |n| n.as_vec3());
    }
    if map.matrix3.determinant() < 0.0 {
        flip(mesh);
    }
    fits
}

/// Swaps front and back of every triangle; normals stay.
pub(super) fn flip(mesh: &mut Mesh) {
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
}
