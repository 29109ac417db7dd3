//! Rays through the BVH.
//!
//! All eight boxes of a node are tested at once; where the processor has AVX2, by its instructions. Both ways round alike, and
//! the order of what is met is the same, so hits are the same to the bit.

#[cfg(target_arch = "x86_64")]
mod avx2;

use std::ops::ControlFlow;

use glam::Vec3A;
use smallvec::SmallVec;

use crate::node::{Child, Node};
use crate::primitive::{Primitive, ShearedRay};

/// A ray, as boxes and primitives see it.
pub(crate) struct Query<'a> {
    pub(crate) nodes: &'a [Node],
    /// In the order of the leaves.
    pub(crate) primitives: &'a [Primitive],
    /// For boxes, in scaled units.
    pub(crate) slab: SlabRay,
    /// For primitives. It starts earlier, by `skipped`.
    pub(crate) sheared: ShearedRay,
    pub(crate) skipped: f64,
}

/// A ray, as boxes see it: between two planes along each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlabRay {
    origin: Vec3A,
    inverse_dir: Vec3A,
    is_negative: [bool; 3],
    t_max: f32,
}

/// Where a ray enters the boxes of a node. Of boxes that it doesn't meet, no meaning.
#[derive(Clone, Copy)]
#[repr(align(32))]
struct Entries([f32; 8]);

/// A child that a ray meets, and where it enters it: the nearer, the smaller, since no distance is negative.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Met(u64);

/// As long a stack as large scenes need; a longer one is left to the heap.
const STACK: usize = 64;

impl Met {
    /// Farther than any.
    const NONE: Self = Self(u64::MAX);

    #[inline(always)]
    fn new(entry: f32, child: Child) -> Self {
        Self(u64::from(entry.to_bits()) << 32 | u64::from(child.0))
    }

    #[inline(always)]
    fn entry(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn child(self) -> Child {
        Child(self.0 as u32)
    }
}

impl SlabRay {
    pub(crate) fn new(origin: Vec3A, dir: Vec3A, t_max: f32) -> Self {
        let is_negative = dir.to_array().map(|d| d < 0.0);
        Self { origin, inverse_dir: dir.recip(), is_negative, t_max }
    }

    /// The children whose boxes the ray meets before `t_max`, a bit for each, and where it enters them.
    ///
    /// What rounding or 0 / 0 makes doubtful is met.
    #[inline]
    fn children(&self, node: &Node, t_max: f32, entries: &mut Entries) -> u32 {
        let mut met = 0;
        for slot in 0..8 {
            let (mut near, mut far) = ([0.0; 3], [0.0; 3]);
            for axis in 0..3 {
                let at = |planes: &[[f32; 8]; 3]| {
                    (planes[axis][slot] - self.origin[axis]) * self.inverse_dir[axis]
                };
                (near[axis], far[axis]) = match self.is_negative[axis] {
                    false => (at(&node.min), at(&node.max)),
                    true => (at(&node.max), at(&node.min)),
                };
            }
            let near = larger(larger(near[0], larger(near[1], near[2])), 0.0);
            let far = smaller(smaller(far[0], smaller(far[1], far[2])), t_max);
            entries.0[slot] = near;
            met |= u32::from(near <= far) << slot;
        }
        met
    }
}

/// The second of two if one isn't a number, as processors have it.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

impl Query<'_> {
    /// Distance along the ray for boxes, and slot, of the nearest primitive.
    #[inline]
    pub(crate) fn nearest(&self) -> Option<(f32, u32)> {
        #[cfg(target_arch = "x86_64")]
        if avx2::is_available() {
            return avx2::nearest(self);
        }
        self.nearest_by(SlabRay::children)
    }

    /// Whether any primitive lies on the ray.
    #[inline]
    pub(crate) fn any(&self) -> bool {
        #[cfg(target_arch = "x86_64")]
        if avx2::is_available() {
            return avx2::any(self);
        }
        self.any_by(SlabRay::children)
    }

    #[inline(always)]
    fn nearest_by(
        &self,
        children: impl Fn(&SlabRay, &Node, f32, &mut Entries) -> u32,
    ) -> Option<(f32, u32)> {
        let mut nearest = None;
        self.walk(children, |slot, t| {
            nearest = Some((t, slot));
            ControlFlow::Continue(t)
        });
        nearest
    }

    #[inline(always)]
    fn any_by(&self, children: impl Fn(&SlabRay, &Node, f32, &mut Entries) -> u32) -> bool {
        let mut is_met = false;
        self.walk(children, |_, _| {
            is_met = true;
            ControlFlow::Break(())
        });
        is_met
    }

    /// Tells of primitives on the ray, by slot and distance, as long as that is wanted: what lies beyond the distance that is
    /// told to go on with is left out.
    #[inline(always)]
    fn walk(
        &self,
        children: impl Fn(&SlabRay, &Node, f32, &mut Entries) -> u32,
        mut found: impl FnMut(u32, f32) -> ControlFlow<(), f32>,
    ) {
        let mut t_max = self.slab.t_max;
        let mut entries = Entries([0.0; 8]);
        let mut stack: SmallVec<[Met; STACK]> = SmallVec::new();
        let Some(mut node) = self.nodes.first() else { return };
        loop {
            // The nearest is next. To sort the others, too, takes longer than it saves.
            let mut next = Met::NONE;
            let mut met = children(&self.slab, node, t_max, &mut entries);
            while met != 0 {
                let slot = met.trailing_zeros() as usize % 8;
                met &= met - 1;
                let child = Met::new(entries.0[slot], node.children[slot]);
                let farther = next.max(child);
                next = next.min(child);
                if farther != Met::NONE {
                    stack.push(farther);
                }
            }
            node = loop {
                if next == Met::NONE {
                    let Some(farther) = stack.pop() else { return };
                    next = farther;
                }
                let (child, entry) = (next.child(), next.entry());
                next = Met::NONE;
                if entry > t_max {
                    continue;
                }
                if child.n_primitives() == 0 {
                    break &self.nodes[child.index() as usize];
                }
                for slot in child.primitives() {
                    let t = self.distance(slot, t_max + self.skipped as f32);
                    if t < t_max {
                        match found(slot, t) {
                            ControlFlow::Continue(t) => t_max = t,
                            ControlFlow::Break(()) => return,
                        }
                    }
                }
            };
        }
    }

    #[inline(always)]
    fn distance(&self, slot: u32, t_max: f32) -> f32 {
        (self.primitives[slot as usize].intersect(&self.sheared, t_max) - self.skipped) as f32
    }
}
