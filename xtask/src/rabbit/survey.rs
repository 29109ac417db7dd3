//! What a mesh is like: closed or not, of one piece, its thinnest triangle.

use std::collections::HashMap;
use std::fmt;

use glam::DVec3;

use crate::rabbit::mesh::Mesh;

/// Counts and bounds of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Survey {
    /// The number of vertices.
    pub(crate) n_vertices: usize,
    /// The number of triangles.
    pub(crate) n_triangles: usize,
    /// Directed edges that do not have exactly one partner the other way: none on a closed manifold.
    pub(crate) n_bad_edges: usize,
    /// Vertices whose triangles do not form one fan: none on a manifold.
    pub(crate) n_bad_vertices: usize,
    /// Parts that share no vertex.
    pub(crate) n_pieces: usize,
    /// Vertices - edges + triangles: 2 for a deformed sphere, 2 less for each handle.
    pub(crate) euler: i64,
    /// The smallest angle of any triangle, in degrees.
    pub(crate) smallest_angle: f64,
    /// The smallest cosine between a triangle's normal and one of its vertices'.
    pub(crate) smallest_agreement: f64,
    /// The enclosed volume; negative when the surface is inside out.
    pub(crate) volume: f64,
}

/// No triangle of a sound mesh has an angle below this, in degrees.
const SMALLEST_ANGLE: f64 = 10.0;

/// Nor does a vertex's normal lean from a triangle's by more than 60 degrees.
const SMALLEST_AGREEMENT: f64 = 0.5;

impl Survey {
    /// Counts and measures `mesh`.
    pub(crate) fn of(mesh: &Mesh) -> Self {
        let mut edges: HashMap<[u32; 2], u32> = HashMap::new();
        for [a, b] in mesh.triangles.iter().flat_map(directed_edges) {
            *edges.entry([a, b]).or_default() += 1;
        }
        let n_edges = edges.keys().filter(|[a, b]| a < b || !edges.contains_key(&[*b, *a])).count();
        let n_bad_edges =
            edges.iter().filter(|([a, b], n)| **n != 1 || edges.get(&[*b, *a]) != Some(&1)).count();
        let (n_vertices, n_triangles) = (mesh.positions.len(), mesh.triangles.len());
        let mut survey = Self {
            n_vertices,
            n_triangles,
            n_bad_edges,
            n_bad_vertices: n_bad_vertices(mesh),
            n_pieces: n_pieces(mesh),
            euler: n_vertices as i64 - n_edges as i64 + n_triangles as i64,
            smallest_angle: f64::INFINITY,
            smallest_agreement: f64::INFINITY,
            volume: 0.0,
        };
        for triangle in &mesh.triangles {
            survey.measure(mesh, triangle);
        }
        survey
    }

    /// Whether the mesh is one closed, outward, smooth piece without handles or slivers.
    pub(crate) fn is_sound(&self) -> bool {
        self.n_bad_edges == 0
            && self.n_bad_vertices == 0
            && self.n_pieces == 1
            && self.euler == 2
            && self.smallest_angle >= SMALLEST_ANGLE
            && self.smallest_agreement >= SMALLEST_AGREEMENT
            && self.volume > 0.0
    }

    fn measure(&mut self, mesh: &Mesh, triangle: &[u32; 3]) {
        let at = |list: &[[f32; 3]], i: u32| DVec3::from(list[i as usize].map(f64::from));
        let [a, b, c] = triangle.map(|i| at(&mesh.positions, i));
        let face = (b - a).cross(c - a);
        for i in triangle {
            let agreement = face.normalize_or_zero().dot(at(&mesh.normals, *i));
            self.smallest_agreement = self.smallest_agreement.min(agreement);
        }
        for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
            // The arc tangent of a triangle without area is 0, where an arc cosine would be NaN.
            let angle = face.length().atan2((q - p).dot(r - p)).to_degrees();
            self.smallest_angle = self.smallest_angle.min(angle);
        }
        self.volume += a.dot(b.cross(c)) / 6.0;
    }
}

impl fmt::Display for Survey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "vertices        {}", self.n_vertices)?;
        writeln!(f, "triangles       {}", self.n_triangles)?;
        writeln!(f, "open edges      {}", self.n_bad_edges)?;
        writeln!(f, "pinched points  {}", self.n_bad_vertices)?;
        writeln!(f, "pieces          {}", self.n_pieces)?;
        writeln!(f, "Euler number    {}", self.euler)?;
        writeln!(f, "smallest angle  {:.1} degrees", self.smallest_angle)?;
        writeln!(f, "normals agree   {:.3} (smallest cosine)", self.smallest_agreement)?;
        write!(f, "volume          {:.4}", self.volume)
    }
}

fn directed_edges(&[a, b, c]: &[u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// Counts the vertices whose triangles, walked from one to the next around the vertex, are not met in one turn.
fn n_bad_vertices(mesh: &Mesh) -> usize {
    // From a vertex and the near end of the opposite edge to its far end: the next triangle starts there.
    let mut next: HashMap<[u32; 2], u32> = HashMap::new();
    let mut start: Vec<Option<u32>> = vec![None; mesh.positions.len()];
    let mut n_triangles = vec![0_usize; mesh.positions.len()];
    for &[a, b, c] in &mesh.triangles {
        for (center, from, to) in [(a, b, c), (b, c, a), (c, a, b)] {
            next.insert([center, from], to);
            start[center as usize] = Some(from);
            n_triangles[center as usize] += 1;
        }
    }
    let is_fan = |center: u32| {
        let Some(first) = start[center as usize] else { return false };
        let mut at = first;
        for step in 1..=n_triangles[center as usize] {
            match next.get(&[center, at]) {
                Some(to) => at = *to,
                None => return false,
            }
            if at == first {
                return step == n_triangles[center as usize];
            }
        }
        false
    };
    (0..mesh.positions.len() as u32).filter(|center| !is_fan(*center)).count()
}

/// Counts the connected parts, by union-find with path halving.
fn n_pieces(mesh: &Mesh) -> usize {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut n_pieces = parent.len();
    for [a, b] in mesh.triangles.iter().flat_map(directed_edges) {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        if a != b {
            parent[a as usize] = b;
            n_pieces -= 1;
        }
    }
    n_pieces
}

fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octahedron() -> Mesh {
        let corners = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]];
        let positions = corners.map(|c| c.map(|v| v as f32)).to_vec();
        let triangles = vec![
            [0, 1, 2],
            [1, 3, 2],
            [3, 4, 2],
            [4, 0, 2],
            [1, 0, 5],
            [3, 1, 5],
            [4, 3, 5],
            [0, 4, 5],
        ];
        Mesh { normals: positions.clone(), positions, triangles }
    }

    /// Two octahedra that share no vertex.
    fn pair() -> Mesh {
        let mut pair = octahedron();
        pair.positions.extend(octahedron().positions);
        pair.normals.extend(octahedron().normals);
        pair.triangles.extend(octahedron().triangles.iter().map(|t| t.map(|i| i + 6)));
        pair
    }

    #[test]
    fn an_octahedron_is_sound() {
        let survey = Survey::of(&octahedron());
        assert!(survey.is_sound(), "{survey}");
        assert_eq!((survey.euler, survey.n_pieces), (2, 1));
        assert!((survey.smallest_angle - 60.0).abs() < 1e-9, "{survey}");
        assert!((survey.smallest_agreement - (1.0_f64 / 3.0).sqrt()).abs() < 1e-9, "{survey}");
        assert!((survey.volume - 4.0 / 3.0).abs() < 1e-9, "{survey}");
    }

    #[test]
    fn open_and_turned_triangles_show() {
        let mut open = octahedron();
        open.triangles.pop();
        assert_eq!(Survey::of(&open).n_bad_edges, 3);

        let mut turned = octahedron();
        turned.triangles[0].swap(1, 2);
        assert_ne!(Survey::of(&turned).n_bad_edges, 0);

        let mut inside_out = octahedron();
        inside_out.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        let survey = Survey::of(&inside_out);
        assert!(survey.volume < 0.0 && survey.smallest_agreement < 0.0, "{survey}");
        assert!(!survey.is_sound());
    }

    #[test]
    fn thin_and_flat_triangles_show() {
        let mut thin = octahedron();
        thin.positions[0] = [20.0, 0.0, 0.0];
        assert!(Survey::of(&thin).smallest_angle < 5.0);
        thin.positions[0] = thin.positions[1];
        assert_eq!(Survey::of(&thin).smallest_angle, 0.0);
        assert!(!Survey::of(&thin).is_sound());
    }

    #[test]
    fn pieces_and_pinches_show() {
        let mut two = pair();
        let survey = Survey::of(&two);
        assert_eq!((survey.n_pieces, survey.euler, survey.n_bad_vertices), (2, 4, 0));

        // The second now hangs on the first by one vertex.
        two.triangles[8..].iter_mut().flatten().for_each(|i| *i = if *i == 6 { 0 } else { *i - 1 });
        two.positions.remove(6);
        two.normals.remove(6);
        let survey = Survey::of(&two);
        assert_eq!((survey.n_pieces, survey.n_bad_vertices, survey.n_bad_edges), (1, 1, 0));
    }
}
