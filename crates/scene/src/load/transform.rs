//! Affine maps of objects.

use geometry::Mesh;
use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::source::{MAX_LENGTH, Source};
use super::tables::{Rotations, TransformTable};
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
        if let Some(rotate) = &table.rotate {
            map.matrix3 = rotations(source, &what, rotate)? * map.matrix3;
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
    if is_flat(&map) {
        let fault = format!(
            "{what} flattens it; every scale must differ from 0 and the axes from each other"
        );
        return Err(source.fault(span, fault));
    }
    Ok(map)
}

/// The rotations of a list, one after the other.
pub(super) fn rotations(source: &Source, what: &str, list: &Rotations) -> Result<DMat3, Error> {
    let mut matrix = DMat3::IDENTITY;
    for table in &list.0 {
        let axis = source.direction(&table.axis, &format!("the axis of {what}"))?;
        let degrees = f64::from(source.number(&table.degrees, &format!("the angle of {what}"))?);
        matrix = rotation(axis, degrees) * matrix;
    }
    Ok(matrix)
}

/// What a map does to directions, as a matrix that changes no length: it may turn and mirror, and scale evenly; `None`
/// if it does more.
pub(super) fn orthogonal(map: &DMat3) -> Option<DMat3> {
    let size = map.x_axis.length();
    let matrix = *map * (1.0 / size);
    let off = matrix.transpose() * matrix - DMat3::IDENTITY;
    let largest = off.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    (largest < 1e-4).then_some(matrix)
}

/// Whether nothing keeps a volume under a map.
pub(super) fn is_flat(map: &DAffine3) -> bool {
    // Relative to the product of the three lengths, so that scales of any size pass.
    let lengths =
        map.matrix3.x_axis.length() * map.matrix3.y_axis.length() * map.matrix3.z_axis.length();
    let volume = map.matrix3.determinant().abs() / lengths;
    !(volume.is_finite() && volume > 1e-9)
}

/// A rotation about a unit vector, in degrees, counterclockwise as seen against it (Rodrigues' formula).
pub(super) fn rotation(axis: DVec3, degrees: f64) -> DMat3 {
    let (sin, cos) = sin_cos(degrees);
    let cross = DMat3::from_cols(axis.cross(DVec3::X), axis.cross(DVec3::Y), axis.cross(DVec3::Z));
    let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
    cross * sin + DMat3::IDENTITY * cos + outer * (1.0 - cos)
}

/// Sine and cosine of an angle in degrees; those of quarter turns are exact.
pub(super) fn sin_cos(degrees: f64) -> (f64, f64) {
    let quarters = (degrees / 90.0).round();
    let (sin, cos) = libm::sincos((degrees - quarters * 90.0).to_radians());
    match quarters.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::reach::Reach;
    use crate::load::shapes::cuboid;
    use geometry::MaterialId;
    use serde::Deserialize;
    use toml::Spanned;

    fn map(text: &str) -> DAffine3 {
        #[derive(Deserialize)]
        struct File {
            t: Spanned<TransformTable>,
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.toml");
        std::fs::write(&path, format!("t = {{ {text} }}")).unwrap();
        let source = Source::read(&path, &Reach::Everything).unwrap();
        let file: File = toml::from_str(source.text()).unwrap();
        affine(&source, "box `a`", &file.t).unwrap()
    }

    fn moved(text: &str, p: [f64; 3]) -> [f64; 3] {
        map(text).transform_point3(DVec3::from_array(p)).to_array()
    }

    #[test]
    fn scale_comes_first_then_rotations_then_translation() {
        let p = [1.0, 2.0, 3.0];
        assert_eq!(moved("", p), p);
        assert_eq!(moved("scale = 2", p), [2.0, 4.0, 6.0]);
        assert_eq!(moved("scale = [1, -1, 0.5], translate = [10, 0, 0]", p), [11.0, -2.0, 1.5]);
        // Quarter turns are exact: about y, z becomes x.
        assert_eq!(moved("rotate = { axis = [0, 7, 0], degrees = 90 }", p), [3.0, 2.0, -1.0]);
        assert_eq!(moved("rotate = { axis = [0, 0, 1], degrees = -270 }", p), [-2.0, 1.0, 3.0]);
        let both = "scale = [1, 1, 2], rotate = [{ axis = [0, 1, 0], degrees = 90 }, { axis = [1, 0, 0], degrees = 180 }], translate = [0, 0, 1]";
        assert_eq!(moved(both, p), [6.0, -2.0, 2.0]);
        let matrix = "matrix = [[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]]";
        assert_eq!(moved(matrix, p), [3.0, 7.0, 10.0]);
    }

    #[test]
    fn rotations_are_rotations() {
        for degrees in [-400.0_f64, -30.0, 1.0, 45.0, 89.0, 137.5, 271.0] {
            let m = map(&format!("rotate = {{ axis = [1, 2, -3], degrees = {degrees} }}")).matrix3;
            let error = m * m.transpose() - DMat3::IDENTITY;
            assert!(error.to_cols_array().iter().all(|e| e.abs() < 1e-14), "{error}");
            assert!((m.determinant() - 1.0).abs() < 1e-14);
            let axis = DVec3::new(1.0, 2.0, -3.0);
            assert!((m * axis - axis).length() < 1e-14);
            // The trace is 1 + 2 cos.
            let trace = m.x_axis.x + m.y_axis.y + m.z_axis.z;
            assert!((trace - 1.0 - 2.0 * degrees.to_radians().cos()).abs() < 1e-14, "{degrees}");
        }
    }

    #[test]
    fn mirrored_bodies_keep_their_outside() {
        for text in [
            "scale = [-1, 1, 1]",
            "scale = [-2, -1, -0.5], rotate = { axis = [1, 1, 0], degrees = 20 }",
            "scale = [1, 3, 2]",
        ] {
            let mut mesh = cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), MaterialId(0));
            // Normals of the sphere around the box: they point away from the middle.
            let center = mesh.bounds().center();
            mesh.normals = mesh.positions.iter().map(|p| (p - center).normalize()).collect();
            assert!(apply(&map(text), &mut mesh));
            let center = mesh.bounds().center();
            for t in 0..12 {
                let [a, b, c] = mesh.corners(t);
                assert!((b - a).cross(c - a).dot(a - center) > 0.0, "{text}, triangle {t}");
            }
            for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
                assert!(n.is_normalized() && n.dot(p - center) > 0.0, "{text}: {n} at {p}");
            }
        }
    }

    #[test]
    fn normals_stay_perpendicular_under_uneven_scales() {
        let mut mesh = Mesh {
            positions: vec![Vec3::X, Vec3::Y, Vec3::Z],
            normals: vec![Vec3::ONE.normalize(); 3],
            triangles: vec![[0, 1, 2]],
            materials: vec![MaterialId(0)],
            ..Mesh::default()
        };
        assert!(apply(&map("scale = [1, 2, 4]"), &mut mesh));
        let [a, b, c] = mesh.corners(0);
        let normal = (b - a).cross(c - a).normalize();
        assert!((mesh.normals[0] - normal).length() < 1e-6);
        assert!(!apply(&map("scale = 1e9"), &mut mesh));
    }
}
