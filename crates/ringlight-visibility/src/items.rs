//! What the hierarchy is built of: triangles, two of which may make a parallelogram, of which four to six may make a box.
//!
//! What belongs together comes together in most scenes, so only neighbours in the given order are looked at.

use arrayvec::ArrayVec;

use crate::Triangle;
use crate::build::Bounds;
use crate::predicate::{Vector, norm, sub};
use crate::sieve::FLAT;

/// What stays together in the tree: a triangle, a parallelogram, or a box.
#[derive(Clone, Copy)]
pub(crate) struct Item {
    pub bounds: Bounds,
    /// Of its first triangle, as given.
    pub index: u32,
    /// How many triangles.
    pub triangles: u32,
}

/// A triangle that is a facet of its own; other numbers are those of [`parallelogram`].
pub(crate) const SINGLE: u8 = 3;

impl Item {
    /// Twice the centre.
    #[inline(always)]
    pub fn centre(&self, axis: usize) -> f32 {
        self.bounds.low[axis] + self.bounds.high[axis]
    }
}

/// Of each triangle the number of [`parallelogram`] with the next one, or else [`SINGLE`], as of the second one.
pub(crate) fn facets(triangles: &[Triangle]) -> Vec<u8> {
    let mut facets = vec![SINGLE; triangles.len()];
    let mut index = 0;
    while index + 1 < triangles.len() {
        if let Some(corners) = parallelogram(&triangles[index], &triangles[index + 1]) {
            facets[index] = corners;
            index += 1;
        }
        index += 1;
    }
    facets
}

/// Neighbours that make a parallelogram, or four to six of them that make a box, open or closed, are one item.
pub(crate) fn items(triangles: &[Triangle], facets: &[u8]) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::with_capacity(triangles.len());
    let mut index = 0;
    while index < triangles.len() {
        let count = if facets[index] == SINGLE { 1 } else { box_of(&triangles[index..], &facets[index..]).max(2) };
        let mut bounds = Bounds::EMPTY;
        triangles[index..index + count].iter().for_each(|t| bounds.join(&around(t)));
        items.push(Item { bounds, index: index as u32, triangles: count as u32 });
        index += count;
    }
    items
}

/// How many of the first triangles make four to six sides of a box; 0 if they do not.
fn box_of(triangles: &[Triangle], facets: &[u8]) -> usize {
    let mut corners = ArrayVec::<Vector, 8>::new();
    let mut sides = 0;
    for (pair, facet) in triangles.chunks_exact(2).zip(facets.chunks_exact(2)).take(6) {
        if facet[0] == SINGLE {
            break;
        }
        let known = corners.len();
        for corner in pair.iter().flat_map(|t| t.corners) {
            if !corners.contains(&corner) && corners.try_push(corner).is_err() {
                corners.truncate(known);
                return if sides >= 4 && known == 8 { 2 * sides } else { 0 };
            }
        }
        sides += 1;
    }
    if sides >= 4 && corners.len() == 8 { 2 * sides } else { 0 }
}

/// Whether the two triangles are one facet, a parallelogram in one plane: the number of the corner that only the first
/// one has, and four times the number of the one that only the second one has.
pub(crate) fn parallelogram(a: &Triangle, b: &Triangle) -> Option<u8> {
    if a.plane != b.plane || a.filter != crate::OPAQUE || b.filter != crate::OPAQUE {
        return None;
    }
    let only_first = (0..3).find(|&i| !b.corners.contains(&a.corners[i]))?;
    let shared = [a.corners[(only_first + 1) % 3], a.corners[(only_first + 2) % 3]];
    if !shared.iter().all(|c| b.corners.contains(c)) {
        return None;
    }
    let only_second = (0..3).find(|&i| !shared.contains(&b.corners[i]))?;
    let fourth = b.corners[only_second];
    let corner = a.corners[only_first];
    let (e, g) = (sub(shared[0], corner), sub(shared[1], corner));
    let off = sub(sub(fourth, corner), [e[0] + g[0], e[1] + g[1], e[2] + g[2]]);
    let longest = norm(e).max(norm(g));
    (norm(off) <= FLAT * longest).then_some((only_first | only_second << 2) as u8)
}

fn around(t: &Triangle) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    t.corners.iter().for_each(|&c| bounds.join(&Bounds { low: c, high: c }));
    bounds
}
