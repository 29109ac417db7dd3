//! Nodes of the BVH, as rays meet them.

use std::ops::Range;

use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::node::CwBvhNode;

/// Eight children, and the boxes around them.
///
/// Planes are kept in single precision. Obvhs packs them into bytes: a third of the memory, which is small beside that of the
/// primitives, but all rays took an eighth longer.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct Node {
    /// Along x, y and z. The box of an empty place is inside out, and never met.
    pub(crate) min: [[f32; 8]; 3],
    pub(crate) max: [[f32; 8]; 3],
    pub(crate) children: [Child; 8],
}

/// Another node, or a few primitives that lie one after the other.
///
/// The highest two bits are the number of primitives, none for a node; the others an index, that of the node or of the first
/// primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Child(pub(crate) u32);

const INDEX_BITS: u32 = 30;

/// As many as two bits can tell.
pub(crate) const MAX_PRIMITIVES_PER_LEAF: u32 = 3;

/// As many triangles and spheres as a scene can hold.
pub const MAX_PRIMITIVES: usize = 1 << INDEX_BITS;

impl Child {
    fn new(n_primitives: u32, index: u32) -> Self {
        assert!(n_primitives <= MAX_PRIMITIVES_PER_LEAF && index < 1 << INDEX_BITS);
        Self(n_primitives << INDEX_BITS | index)
    }

    /// None for a node.
    #[inline(always)]
    pub(crate) fn n_primitives(self) -> u32 {
        self.0 >> INDEX_BITS
    }

    /// Of the node, or of the first primitive.
    #[inline(always)]
    pub(crate) fn index(self) -> u32 {
        self.0 & ((1 << INDEX_BITS) - 1)
    }

    #[inline(always)]
    pub(crate) fn primitives(self) -> Range<u32> {
        self.index()..self.index() + self.n_primitives()
    }
}

/// The nodes of a compressed BVH, in its order: the first is the root.
pub(crate) fn expand(bvh: &CwBvh) -> Vec<Node> {
    bvh.nodes.iter().map(Node::new).collect()
}

impl Node {
    fn new(packed: &CwBvhNode) -> Self {
        let extent = packed.compute_extent();
        let is_empty = |slot: usize| packed.child_meta[slot] == 0;
        let planes = |bytes: [u8; 8], axis: usize, of_none: f32| {
            std::array::from_fn(|slot| match is_empty(slot) {
                true => of_none,
                false => packed.p[axis] + f32::from(bytes[slot]) * extent[axis],
            })
        };
        let (above, below) = (f32::INFINITY, f32::NEG_INFINITY);
        let mut inner = packed.child_base_idx;
        let children = std::array::from_fn(|slot| {
            let meta = u32::from(packed.child_meta[slot]);
            if is_empty(slot) {
                // Rays that aren't numbers meet all boxes.
                Child::new(1, 0)
            } else if packed.imask >> slot & 1 != 0 {
                inner += 1;
                Child::new(0, inner - 1)
            } else {
                Child::new((meta >> 5).count_ones(), packed.primitive_base_idx + (meta & 31))
            }
        });
        Self {
            min: [
                planes(packed.child_min_x, 0, above),
                planes(packed.child_min_y, 1, above),
                planes(packed.child_min_z, 2, above),
            ],
            max: [
                planes(packed.child_max_x, 0, below),
                planes(packed.child_max_y, 1, below),
                planes(packed.child_max_z, 2, below),
            ],
            children,
        }
    }
}
