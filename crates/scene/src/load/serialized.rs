//! Mitsuba's own format of meshes: streams of zlib, one a mesh, and behind them where each begins.
//!
//! Memory is proportional to the file: no count is believed before so much was there, and a stream that grows out of
//! proportion is refused.

use std::io::{BufReader, Read};
use std::path::Path;

use flate2::bufread::ZlibDecoder;
use geometry::{MaterialId, Mesh};
use glam::{DVec2, DVec3};

use super::source::MAX_LENGTH;
use crate::Error;

/// How a mesh begins.
const MAGIC: u16 = 0x041c;

/// How many times its size a stream may grow. Meshes shrink to a half or a tenth; zlib can reach a thousandth.
const MAX_GROWTH: u64 = 256;

/// What a stream may grow to in any case.
const SMALL: u64 = 1 << 16;

/// Bits that tell what a mesh holds.
const NORMALS: u32 = 0x0001;
const UVS: u32 = 0x0002;
const COLORS: u32 = 0x0008;
const FACE_NORMALS: u32 = 0x0010;
const DOUBLE: u32 = 0x2000;

/// Reads the mesh with that number, counted from 0. Normals are as written; texture coordinates are read only if they are
/// needed.
pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    index: u32,
    material: MaterialId,
    textured: bool,
) -> Result<Mesh, Error> {
    let whole = |fault: String| Error::whole(path, fault);
    let (version, stream) = find(bytes, index).map_err(whole)?;
    let most = (stream.len() as u64 * MAX_GROWTH).max(SMALL);
    let mut reader = Reader { decoder: BufReader::new(ZlibDecoder::new(stream)), left: most };
    mesh(&mut reader, version, material, textured)
        .map_err(|fault| whole(format!("mesh {index} {fault}")))
}

/// The version of a mesh, and its stream up to whatever follows.
fn find(bytes: &[u8], index: u32) -> Result<(u16, &[u8]), String> {
    let short = |at: usize| {
        let pair = bytes.get(at..at + 2)?;
        Some(u16::from_le_bytes([pair[0], pair[1]]))
    };
    if short(0) != Some(MAGIC) {
        return Err("this is no file of serialized meshes; it must begin with 1c 04".into());
    }
    let first = short(2).unwrap_or(0);
    let at = if index == 0 { 0 } else { offset(bytes, first, index)? };
    match (short(at), short(at + 2)) {
        (Some(MAGIC), Some(version @ (3 | 4))) => Ok((version, &bytes[at + 4..])),
        (Some(MAGIC), Some(version)) => {
            Err(format!("mesh {index} is of version {version}; save it as version 3 or 4"))
        }
        _ => Err(format!(
            "mesh {index} should begin at byte {at}, where there is none; the file is damaged"
        )),
    }
}

/// Where a mesh begins, from the list at the end of the file: places of 4 bytes in version 3 and of 8 in version 4, and how
/// many there are.
fn offset(bytes: &[u8], version: u16, index: u32) -> Result<usize, String> {
    let size = if version < 4 { 4 } else { 8 };
    let damaged = || "the list of meshes at the end of the file is damaged".to_owned();
    let (rest, count) = bytes.split_last_chunk::<4>().ok_or_else(damaged)?;
    let count = u32::from_le_bytes(*count);
    if index >= count {
        return Err(format!(
            "the file holds {count} meshes, and shape_index is {index}; count from 0"
        ));
    }
    let from_end = (count - index) as usize * size;
    let at = rest.len().checked_sub(from_end).ok_or_else(damaged)?;
    let mut place = [0; 8];
    place[..size].copy_from_slice(&rest[at..at + size]);
    // Something must follow the place, so nothing overflows behind it.
    usize::try_from(u64::from_le_bytes(place)).ok().filter(|&p| p < bytes.len()).ok_or_else(damaged)
}

fn mesh(
    reader: &mut Reader<'_>,
    version: u16,
    material: MaterialId,
    textured: bool,
) -> Result<Mesh, String> {
    let flags = u32::from_le_bytes(reader.take()?);
    if version == 4 {
        // A name, of no use here.
        while reader.take::<1>()? != [0] {}
    }
    let n_vertices = u64::from_le_bytes(reader.take()?);
    let n_triangles = u64::from_le_bytes(reader.take()?);
    if n_vertices == 0 || n_triangles == 0 {
        return Err("holds no triangles".into());
    }
    if n_vertices > 1 << 31 || n_triangles > 1 << 31 {
        return Err(format!(
            "tells of {n_vertices} vertices and {n_triangles} triangles; use less than 2^31"
        ));
    }
    let is_double = flags & DOUBLE != 0;
    if textured && flags & UVS == 0 {
        return Err("has no texture coordinates, which the material needs".into());
    }
    let mut mesh = Mesh::default();
    for i in 0..n_vertices {
        let p = DVec3::from_array(reader.numbers(is_double)?);
        if !p.is_finite() || p.abs().max_element() > f64::from(MAX_LENGTH) {
            return Err(format!(
                "has vertex {i} at ({}, {}, {}); coordinates must be finite and within {MAX_LENGTH:e}",
                p.x, p.y, p.z
            ));
        }
        mesh.positions.push(p.as_vec3());
    }
    if flags & NORMALS != 0 {
        for _ in 0..n_vertices {
            let n = DVec3::from_array(reader.numbers(is_double)?);
            if flags & FACE_NORMALS == 0 {
                mesh.normals.push(n.try_normalize().unwrap_or(DVec3::ZERO).as_vec3());
            }
        }
    }
    if flags & UVS != 0 {
        for i in 0..n_vertices {
            let uv = DVec2::from_array(reader.numbers(is_double)?);
            if !textured {
                continue;
            }
            if !uv.as_vec2().is_finite() {
                return Err(format!("has a texture coordinate at vertex {i} that isn't finite"));
            }
            mesh.uvs.push(uv.as_vec2());
        }
    }
    if flags & COLORS != 0 {
        for _ in 0..n_vertices {
            reader.numbers::<3>(is_double)?;
        }
    }
    for i in 0..n_triangles {
        let mut corners = [0; 3];
        for corner in &mut corners {
            *corner = u32::from_le_bytes(reader.take()?);
        }
        if let Some(c) = corners.into_iter().find(|&c| u64::from(c) >= n_vertices) {
            return Err(format!("has triangle {i} with vertex {c}, of {n_vertices} vertices"));
        }
        mesh.triangles.push(corners);
    }
    mesh.materials = vec![material; mesh.triangles.len()];
    Ok(mesh)
}

/// A stream and how much may still come out of it.
struct Reader<'b> {
    decoder: BufReader<ZlibDecoder<&'b [u8]>>,
    left: u64,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        self.left = self.left.checked_sub(N as u64).ok_or_else(|| {
            format!("grows to more than {MAX_GROWTH} times its size; is it damaged?")
        })?;
        let mut bytes = [0; N];
        match self.decoder.read_exact(&mut bytes) {
            Ok(()) => Ok(bytes),
            Err(error) => Err(format!("ends too early or is damaged ({error})")),
        }
    }

    fn numbers<const N: usize>(&mut self, is_double: bool) -> Result<[f64; N], String> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = match is_double {
                true => f64::from_le_bytes(self.take()?),
                false => f64::from(f32::from_le_bytes(self.take()?)),
            };
        }
        Ok(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use std::io::Write;

    /// A mesh of two triangles with normals, texture coordinates and colors, `size` times as large.
    fn stream(version: u16, is_double: bool, size: f64) -> Vec<u8> {
        let mut plain = Vec::new();
        let flags = NORMALS | UVS | COLORS | if is_double { DOUBLE } else { 0x1000 };
        plain.extend(flags.to_le_bytes());
        if version == 4 {
            plain.extend(b"a quad\0");
        }
        plain.extend(4_u64.to_le_bytes());
        plain.extend(2_u64.to_le_bytes());
        let positions = [0.0, 0.0, 0.0, size, 0.0, 0.0, size, size, 0.0, 0.0, size, 0.0];
        let normals = [0.0, 0.0, 2.0].repeat(4);
        let uvs = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0];
        for number in positions.into_iter().chain(normals).chain(uvs).chain([0.5; 12]) {
            match is_double {
                true => plain.extend(f64::to_le_bytes(number)),
                false => plain.extend((number as f32).to_le_bytes()),
            }
        }
        for corner in [0_u32, 1, 2, 0, 2, 3] {
            plain.extend(corner.to_le_bytes());
        }
        packed(version, &plain)
    }

    fn packed(version: u16, plain: &[u8]) -> Vec<u8> {
        let mut bytes = [MAGIC.to_le_bytes(), version.to_le_bytes()].concat();
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(plain).unwrap();
        bytes.extend(encoder.finish().unwrap());
        bytes
    }

    /// Meshes one after the other, and their places.
    fn file(version: u16, meshes: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut places = Vec::new();
        for mesh in meshes {
            match version {
                3 => places.extend((bytes.len() as u32).to_le_bytes()),
                _ => places.extend((bytes.len() as u64).to_le_bytes()),
            }
            bytes.extend(mesh);
        }
        bytes.extend(places);
        bytes.extend((meshes.len() as u32).to_le_bytes());
        bytes
    }

    fn read(bytes: &[u8], index: u32) -> Result<Mesh, String> {
        let mesh = super::read(Path::new("a.serialized"), bytes, index, MaterialId(0), true);
        mesh.map_err(|e| e.to_string())
    }

    #[test]
    fn meshes_are_found_and_read() {
        for (version, is_double) in [(3, false), (3, true), (4, false), (4, true)] {
            let meshes = [1.0, 2.0, 3.0].map(|size| stream(version, is_double, size));
            let bytes = file(version, &meshes);
            for index in 0..3 {
                let mesh = read(&bytes, index).unwrap();
                assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
                assert_eq!(mesh.positions[2].x, index as f32 + 1.0, "version {version}");
                assert_eq!(mesh.normals, [glam::Vec3::Z; 4]);
                assert_eq!(mesh.uvs[3], glam::Vec2::Y);
            }
            // Without a list the first one can be had.
            assert_eq!(read(&meshes[0], 0).unwrap().positions.len(), 4);
        }
    }

    #[test]
    fn damaged_files_are_refused() {
        let bytes = file(4, &[stream(4, false, 1.0), stream(4, true, 2.0)]);
        for end in 0..bytes.len() {
            // Whatever is cut off, the last mesh isn't there, or isn't where a list says.
            assert!(read(&bytes[..end], 1).is_err(), "cut at {end}");
        }
        for (i, bit) in (0..bytes.len()).flat_map(|i| [(i, 1), (i, 0x80)]) {
            let mut damaged = bytes.clone();
            damaged[i] ^= bit;
            let _ = [read(&damaged, 0), read(&damaged, 1)];
        }
        assert_eq!(
            read(&bytes, 2).unwrap_err(),
            "a.serialized: the file holds 2 meshes, and shape_index is 2; count from 0"
        );
        assert_eq!(
            read(&packed(5, b""), 0).unwrap_err(),
            "a.serialized: mesh 0 is of version 5; save it as version 3 or 4"
        );
    }

    #[test]
    fn bombs_are_refused() {
        let mut plain = 0_u32.to_le_bytes().to_vec();
        plain.extend((1_u64 << 24).to_le_bytes());
        plain.extend((1_u64 << 24).to_le_bytes());
        plain.resize(1 << 25, 0);
        let bytes = packed(3, &plain);
        assert!(bytes.len() < 40_000, "{}", bytes.len());
        assert_eq!(
            read(&bytes, 0).unwrap_err(),
            "a.serialized: mesh 0 has no texture coordinates, which the material needs"
        );
        let mesh = super::read(Path::new("a.serialized"), &bytes, 0, MaterialId(0), false);
        assert_eq!(
            mesh.unwrap_err().to_string(),
            "a.serialized: mesh 0 grows to more than 256 times its size; is it damaged?"
        );
    }
}
