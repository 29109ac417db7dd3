//! Nodes of the BVH, as rays meet them.

use std::ops::Range;

use glam::Vec3A;
use obvhs::aabb::Aabb;
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

/// The nodes of a compressed BVH, in its order: the first is the root. `of` is the box of a primitive.
///
/// Boxes are as small as they can be. Those of the compressed one lie on a grid and are larger: a twentieth more time for rays
/// that look for any hit.
pub(crate) fn expand(bvh: &CwBvh, of: impl Fn(u32) -> Aabb) -> Vec<Node> {
    let mut nodes = vec![Node::EMPTY; bvh.nodes.len()];
    // Children come later.
    for (i, packed) in bvh.nodes.iter().enumerate().rev() {
        for (slot, child) in children(packed).into_iter().enumerate() {
            let Some(child) = child else { continue };
            let aabb = match child.n_primitives() {
                0 => nodes[child.index() as usize].aabb(),
                _ => child.primitives().map(&of).fold(Aabb::INVALID, |all, one| all.union(&one)),
            };
            nodes[i].set(slot, child, &aabb);
        }
    }
    nodes
}

/// By their places in a node.
fn children(packed: &CwBvhNode) -> [Option<Child>; 8] {
    let mut inner = packed.child_base_idx;
    std::array::from_fn(|slot| {
        let meta = u32::from(packed.child_meta[slot]);
        if meta == 0 {
            None
        } else if packed.imask >> slot & 1 != 0 {
            inner += 1;
            Some(Child::new(0, inner - 1))
        } else {
            Some(Child::new((meta >> 5).count_ones(), packed.primitive_base_idx + (meta & 31)))
        }
    })
}

impl Node {
    /// Rays that aren't numbers meet all boxes, so that all places have a child.
    const EMPTY: Self = Self {
        min: [[f32::INFINITY; 8]; 3],
        max: [[f32::NEG_INFINITY; 8]; 3],
        children: [Child(1 << INDEX_BITS); 8],
    };

    fn set(&mut self, slot: usize, child: Child, aabb: &Aabb) {
        self.children[slot] = child;
        for axis in 0..3 {
            (self.min[axis][slot], self.max[axis][slot]) = (aabb.min[axis], aabb.max[axis]);
        }
    }

    /// The box around all children.
    pub(crate) fn aabb(&self) -> Aabb {
        let of = |planes: [[f32; 8]; 3], extreme: fn(f32, f32) -> f32| {
            Vec3A::from(planes.map(|all| all.into_iter().reduce(extreme).unwrap_or(f32::NAN)))
        };
        Aabb::new(of(self.min, f32::min), of(self.max, f32::max))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_places_have_the_first_primitive() {
        assert!(Node::EMPTY.children.iter().all(|&child| child == Child::new(1, 0)));
    }
}
