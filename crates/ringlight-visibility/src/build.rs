//! The hierarchy's shape: a binary tree split by the surface area heuristic in bins (Wald 2007), collapsed to wide nodes.
//!
//! Every choice depends on the triangles and their order alone, so the result is the same for any number of threads.

use crate::items::{Item, facets, items};
use crate::predicate::Vector;
use crate::{Triangle, predicate};

/// Children of a node: as many as the widest register has lanes.
pub(crate) const WIDTH: usize = 16;

/// Most triangles in a leaf, unless it is one item.
const LEAF: u32 = 4;

const BINS: usize = 16;

/// Below this depth of the binary tree, halves by count bound the depth, and with it the stack of a search.
const MAX_SAH_DEPTH: usize = 32;

/// Entries that a search's stack never exceeds: each level leaves at most WIDTH − 1 siblings, and there are at most
/// MAX_SAH_DEPTH levels and as many as halve 2²⁷ triangles.
pub(crate) const STACK: usize = (MAX_SAH_DEPTH + 28) * (WIDTH - 1) + 1;

/// Boxes of the children, structure of arrays, the largest first; an empty box where there is none.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    pub low: [[f32; WIDTH]; 3],
    pub high: [[f32; WIDTH]; 3],
    pub child: [Child; WIDTH],
}

/// A node's number, or a run of triangles: bit 31 set, bits 27 to 30 their number, the rest the first.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Child(u32);

/// What a child is.
pub(crate) enum Target {
    Node(usize),
    Triangles(std::ops::Range<usize>),
}

impl Child {
    pub const ROOT: Child = Child(0);
    const MOST: usize = 1 << 27;

    fn leaf(first: usize, count: usize) -> Child {
        Child(1 << 31 | (count as u32) << 27 | first as u32)
    }

    #[inline(always)]
    pub fn target(self) -> Target {
        if self.0 >> 31 == 0 {
            Target::Node(self.0 as usize)
        } else {
            let first = (self.0 & (Self::MOST as u32 - 1)) as usize;
            Target::Triangles(first..first + (self.0 >> 27 & 15) as usize)
        }
    }
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub low: Vector,
    pub high: Vector,
}

impl Bounds {
    pub const EMPTY: Bounds = Bounds { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    #[inline(always)]
    pub fn join(&mut self, other: &Bounds) {
        // Not `f32::min` and `max`, which look for NaN.
        for i in 0..3 {
            self.low[i] = if other.low[i] < self.low[i] { other.low[i] } else { self.low[i] };
            self.high[i] = if other.high[i] > self.high[i] { other.high[i] } else { self.high[i] };
        }
    }

    #[inline(always)]
    fn half_area(&self) -> f32 {
        let [x, y, z] = predicate::sub(self.high, self.low);
        if x < 0.0 { 0.0 } else { x * y + y * z + z * x }
    }
}

/// A subtree: its boxes, and what is below.
enum Tree {
    Leaf(Bounds, usize, usize),
    Inner(Bounds, Vec<Tree>),
}

impl Tree {
    fn bounds(&self) -> &Bounds {
        match self {
            Tree::Leaf(bounds, ..) | Tree::Inner(bounds, _) => bounds,
        }
    }

    fn inner_nodes(&self) -> usize {
        match self {
            Tree::Leaf(..) => 0,
            Tree::Inner(_, children) => 1 + children.iter().map(Tree::inner_nodes).sum::<usize>(),
        }
    }
}

/// Part of the items during the building of one wide node.
struct Part<'a> {
    items: &'a mut [Item],
    first: usize,
    extent: Extent,
    depth: usize,
    whole: bool,
}

impl<'a> Part<'a> {
    /// Whether it may be a leaf.
    fn is_small(&self) -> bool {
        self.items.len() <= LEAF as usize && self.items.iter().map(|item| item.triangles).sum::<u32>() <= LEAF
    }

    fn new(items: &'a mut [Item], extent: Extent, first: usize, depth: usize) -> Part<'a> {
        Part { whole: items.len() <= 1, items, first, extent, depth }
    }
}

/// The box of items, and that of their centres (twice).
#[derive(Clone, Copy)]
struct Extent {
    bounds: Bounds,
    centres: Bounds,
}

impl Extent {
    const EMPTY: Extent = Extent { bounds: Bounds::EMPTY, centres: Bounds::EMPTY };

    fn of(items: &[Item]) -> Extent {
        let mut extent = Extent::EMPTY;
        items.iter().for_each(|item| extent.add(item));
        extent
    }

    #[inline(always)]
    fn add(&mut self, item: &Item) {
        let centre = [item.centre(0), item.centre(1), item.centre(2)];
        self.bounds.join(&item.bounds);
        self.centres.join(&Bounds { low: centre, high: centre });
    }
}

/// Orders the triangles, and makes the nodes; the first is the root. Also returns the box of all, and of each triangle
/// whether it makes a parallelogram with the next one, see [`SINGLE`].
pub(crate) fn build(triangles: &mut [Triangle]) -> (Vec<Node>, Bounds, Vec<u8>) {
    assert!(triangles.len() <= Child::MOST, "a hierarchy holds at most {} triangles", Child::MOST);
    let facets = facets(triangles);
    let mut items = items(triangles, &facets);
    if items.is_empty() {
        return (Vec::new(), Bounds::EMPTY, Vec::new());
    }
    let extent = Extent::of(&items);
    let bounds = extent.bounds;
    let root = Part::new(&mut items, extent, 0, 0);
    let tree = match grow(root) {
        leaf @ Tree::Leaf(..) => Tree::Inner(bounds, vec![leaf]),
        inner => inner,
    };
    // Exactly as many as there are: vectors that grow hold twice as much.
    let mut order = Vec::with_capacity(triangles.len());
    let mut firsts = Vec::with_capacity(items.len() + 1);
    for item in items {
        firsts.push(order.len() as u32);
        order.extend(item.index..item.index + item.triangles);
    }
    firsts.push(order.len() as u32);
    let facets = order.iter().map(|&index| facets[index as usize]).collect();
    reorder(triangles, order);
    let mut nodes = Vec::with_capacity(tree.inner_nodes());
    flatten(&tree, &firsts, &mut nodes);
    (nodes, bounds, facets)
}

/// Puts the triangles in this order, in place, cycle by cycle of the permutation.
fn reorder(triangles: &mut [Triangle], mut order: Vec<u32>) {
    for start in 0..order.len() {
        let first = triangles[start];
        let mut here = start;
        loop {
            let from = std::mem::replace(&mut order[here], here as u32) as usize;
            if from == start {
                triangles[here] = first;
                break;
            }
            triangles[here] = triangles[from];
            here = from;
        }
    }
}

/// Splits the costliest part until there are WIDTH of them, then grows each, in parallel.
fn grow(part: Part) -> Tree {
    let bounds = part.extent.bounds;
    let mut parts = vec![part];
    while parts.len() < WIDTH {
        let cost = |p: &Part| if p.whole { -1.0 } else { p.extent.bounds.half_area() * p.items.len() as f32 };
        let Some(costliest) = (0..parts.len()).reduce(|a, b| if cost(&parts[b]) > cost(&parts[a]) { b } else { a })
        else {
            break;
        };
        if parts[costliest].whole {
            break;
        }
        let part = parts.swap_remove(costliest);
        match split(part) {
            Ok((left, right)) => parts.extend([left, right]),
            Err(leaf) => parts.push(leaf),
        }
    }
    if parts.len() == 1 {
        let part = &parts[0];
        return Tree::Leaf(bounds, part.first, part.items.len());
    }
    parts.sort_by(|a, b| {
        b.extent.bounds.half_area().total_cmp(&a.extent.bounds.half_area()).then(a.first.cmp(&b.first))
    });
    Tree::Inner(bounds, grow_all(parts))
}

fn grow_all(mut parts: Vec<Part>) -> Vec<Tree> {
    let count: usize = parts.iter().map(|p| p.items.len()).sum();
    if parts.len() == 1 || count < 2048 {
        return parts.into_iter().map(grow_one).collect();
    }
    let rest = parts.split_off(parts.len() / 2);
    let (mut left, right) = rayon::join(|| grow_all(parts), || grow_all(rest));
    left.extend(right);
    left
}

fn grow_one(part: Part) -> Tree {
    if part.whole || part.is_small() {
        Tree::Leaf(part.extent.bounds, part.first, part.items.len())
    } else {
        grow(part)
    }
}

/// The cheapest of the splits between bins of centres; `Err` gives the part back as a leaf where none is cheaper.
fn split(mut part: Part<'_>) -> Result<(Part<'_>, Part<'_>), Part<'_>> {
    let count = part.items.len();
    let centres = part.extent.centres;
    // More bins than twice the items would mostly be empty.
    let used = BINS.min(2 * count);
    let scale: Vector = std::array::from_fn(|i| used as f32 / (centres.high[i] - centres.low[i]));
    let bin = |item: &Item, axis: usize| {
        // The cast saturates, and takes NaN (an axis without extent) to 0.
        (((item.centre(axis) - centres.low[axis]) * scale[axis]) as usize).min(used - 1)
    };
    let mut bins = [[(Bounds::EMPTY, 0usize); BINS]; 3];
    for item in part.items.iter() {
        for (axis, bins) in bins.iter_mut().enumerate() {
            let (bounds, count) = &mut bins[bin(item, axis)];
            bounds.join(&item.bounds);
            *count += 1;
        }
    }
    let mut best = (f32::INFINITY, 0, 0);
    for (axis, bins) in bins.iter().enumerate().filter(|&(axis, _)| centres.high[axis] > centres.low[axis]) {
        let mut above = [f32::INFINITY; BINS];
        let (mut bounds, mut inside) = (Bounds::EMPTY, 0);
        for i in (1..used).rev() {
            bounds.join(&bins[i].0);
            inside += bins[i].1;
            above[i] = if inside == 0 { f32::INFINITY } else { bounds.half_area() * inside as f32 };
        }
        (bounds, inside) = (Bounds::EMPTY, 0);
        for i in 1..used {
            bounds.join(&bins[i - 1].0);
            inside += bins[i - 1].1;
            let cost = bounds.half_area() * inside as f32 + above[i];
            if inside > 0 && cost < best.0 {
                best = (cost, axis, i);
            }
        }
    }
    let (cost, axis, border) = best;
    let keep = part.extent.bounds.half_area() * count as f32;
    // A child costs a share of a node's test, about a quarter of a triangle's.
    if part.is_small() && (!cost.is_finite() || cost + 0.5 * part.extent.bounds.half_area() >= keep) {
        part.whole = true;
        return Err(part);
    }
    let (middle, extents) = if cost.is_finite() && part.depth < MAX_SAH_DEPTH {
        partition(part.items, |item| bin(item, axis) < border)
    } else {
        // By centre, so that halves stay apart as far as they can.
        let axis = (0..3)
            .fold(0, |a, b| if centres.high[b] - centres.low[b] > centres.high[a] - centres.low[a] { b } else { a });
        part.items.sort_unstable_by(|a, b| a.centre(axis).total_cmp(&b.centre(axis)).then(a.index.cmp(&b.index)));
        let (left, right) = part.items.split_at(count / 2);
        (count / 2, [Extent::of(left), Extent::of(right)])
    };
    let (left, right) = part.items.split_at_mut(middle);
    Ok((
        Part::new(left, extents[0], part.first, part.depth + 1),
        Part::new(right, extents[1], part.first + middle, part.depth + 1),
    ))
}

/// Moves those with `first` to the front; returns how many, and the extents of both.
fn partition(items: &mut [Item], first: impl Fn(&Item) -> bool) -> (usize, [Extent; 2]) {
    let mut front = 0;
    let mut extents = [Extent::EMPTY; 2];
    for i in 0..items.len() {
        let item = items[i];
        if first(&item) {
            extents[0].add(&item);
            items.swap(i, front);
            front += 1;
        } else {
            extents[1].add(&item);
        }
    }
    (front, extents)
}

/// Appends the nodes of an inner tree, depth first.
fn flatten(tree: &Tree, firsts: &[u32], nodes: &mut Vec<Node>) -> Child {
    let children = match tree {
        Tree::Leaf(_, first, count) => {
            let (first, end) = (firsts[*first] as usize, firsts[*first + *count] as usize);
            return Child::leaf(first, end - first);
        }
        Tree::Inner(_, children) => children,
    };
    let number = nodes.len();
    let mut node = Node {
        low: [[f32::INFINITY; WIDTH]; 3],
        high: [[f32::NEG_INFINITY; WIDTH]; 3],
        child: [Child::default(); WIDTH],
    };
    for (i, child) in children.iter().enumerate() {
        for axis in 0..3 {
            (node.low[axis][i], node.high[axis][i]) = (child.bounds().low[axis], child.bounds().high[axis]);
        }
    }
    nodes.push(node);
    for (i, child) in children.iter().enumerate() {
        nodes[number].child[i] = flatten(child, firsts, nodes);
    }
    Child(number as u32)
}
