//! Which lamps' light reaches which clusters, found by following it from the lamps.
//!
//! In a building most lamps are hidden from most rooms, and each group of receivers would have to prove it of each lamp, by more
//! rays the more lamps there are. Rays from the lamps tell it to all at once: each carries the same power, and where many of a
//! lamp's would arrive if it were in view and none has, it is not. Their number follows the number of clusters and the error alone.

use crate::mesh::{Inquiry, Mesh, Patch};
use crate::quantity::Rgb;
use crate::shooting::{Glance, Kind, ShooterTree, TreeLight, strength};
use crate::solve::{Ring, Share};
use crate::transport::{Communicator, Failure};
use glam::DVec2;
use rayon::prelude::*;
use ringlight_visibility::{Layout, Tally};
use std::ops::Range;

/// Rays for each cluster, times the error. Of rays of equal power in evenly lit surroundings a cluster gets as many.
const RAYS: f32 = 16.0;

/// Most rays for each element.
const MOST: u64 = 64;

/// What would send so many rays to a cluster if it were in view, and has sent none, is hidden.
const PROOF: f32 = 8.0;

/// Rays that are followed together.
const BLOCK: u64 = 256;

/// Tag of what the ranks tell each other of what their rays have met.
const REACHED: u32 = 10;

/// Steps of a sequence that fills the unit hypercube evenly (Roberts 2018): powers of the inverse of the root of x⁵ = x + 1.
const STEPS: [f64; 4] =
    [0.856_674_883_854_502_9, 0.733_891_856_627_126_2, 0.628_706_721_037_810_1, 0.538_597_257_223_613_6];

/// Tag of how much is hidden from the ranks' clusters.
const HIDDEN: u32 = 11;

/// Clusters that are asked how much is hidden from them.
const ASKED: usize = 1024;

/// Which sides of facets reach which clusters.
#[derive(Debug, Default)]
pub struct Reach {
    /// Own clusters and the nodes of the tree that are the sides of which some light reaches them, in order.
    pairs: Vec<(u32, u32)>,
    /// Free area of each own cluster, m²; 0 of others.
    areas: Vec<f32>,
    /// Power of a ray, W or lm.
    quantum: f32,
}

impl Reach {
    /// Of what emits, for an error of `error` in the end; every rank calls it with its share of the clusters.
    pub fn new<'r>(
        emitting: (&ShooterTree, &TreeLight),
        error: f32,
        (ring, share): (&mut Ring<'r>, &Share),
        ranks: &mut Communicator<'_>,
        tally: &mut Tally,
    ) -> Result<Reach, Failure> {
        let mesh = ring.mesh();
        let lamps = Lamps::new(emitting);
        let wanted = (RAYS * mesh.clusters.len() as f32 / error) as u64;
        let count = wanted.min(MOST * mesh.element_count() as u64);
        if lamps.total() <= 0.0 || count == 0 {
            return Ok(Reach::default());
        }
        let quantum = lamps.total() / count as f64;
        let blocks = (0..count.div_ceil(BLOCK)).skip(ranks.rank()).step_by(ranks.size());
        let task = |block: u64, inquiry: Inquiry<'r>| {
            let rays = block * BLOCK..count.min((block + 1) * BLOCK);
            let lamps = &lamps;
            async move {
                let (sides, glances): (Vec<u32>, Vec<_>) = rays.map(|ray| lamps.ray(mesh, quantum, ray)).unzip();
                let glances = inquiry.follow(glances).await;
                let seen = glances.iter().zip(sides).flat_map(|(glance, side)| {
                    glance.seen.iter().map(move |&(e, _)| (mesh.cluster_of(mesh.patch_of(e)) as u32, side))
                });
                in_order(seen.collect())
            }
        };
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        let mut crowd = 1 << 20;
        ring.ask(ranks, blocks, task, |found| {
            pairs.extend(found);
            if pairs.len() > crowd {
                pairs = in_order(std::mem::take(&mut pairs));
                crowd = 2 * pairs.len().max(1 << 19);
            }
        })?;
        tally.rays += if ranks.rank() == 0 { count } else { 0 };
        let pairs = in_order(pairs);
        let bytes = pairs.iter().flat_map(|&(cluster, side)| [cluster, side]).flat_map(u32::to_le_bytes).collect();
        let pair = |bytes: &[u8]| {
            let [cluster, side] = bytemuck::pod_read_unaligned::<[u32; 2]>(bytes);
            (cluster, side)
        };
        let own = |&(cluster, _): &(u32, u32)| share.owners[cluster as usize] as usize == share.rank;
        let parts = ranks.all_gather(REACHED, bytes)?;
        let pairs = parts.iter().flat_map(|part| part.chunks_exact(8).map(pair)).filter(own).collect();
        Ok(Reach { pairs: in_order(pairs), areas: free_areas(mesh, share), quantum: quantum as f32 })
    }

    /// Of the sides that face clusters which have light, the share that reaches none of it; by some of the clusters of all ranks.
    /// Every rank calls it.
    pub fn hidden_share(
        &self,
        mesh: &Mesh,
        tree: &ShooterTree,
        received: &[Rgb],
        (share, ranks): (&Share, &mut Communicator<'_>),
    ) -> Result<f64, Failure> {
        let step = mesh.clusters.len().div_ceil(ASKED) as u32;
        let sides: Vec<u32> = tree.sides().collect();
        let (mut facing, mut hidden) = (0u64, 0u64);
        for &number in share.own.iter().filter(|&number| number % step == 0) {
            let cluster = &mesh.clusters[number as usize];
            let lit = received[cluster.elements.start as usize..cluster.elements.end as usize].iter();
            if lit.clone().all(|light| *light == [0.0; 3]) {
                continue;
            }
            let (middle, reached) = ((cluster.low + cluster.high) / 2.0, self.of(number));
            for &side in &sides {
                let node = &tree.nodes[side as usize];
                if node.axis.dot(middle - node.middle()) > 0.0 {
                    facing += 1;
                    hidden += u64::from(!reached.holds(tree, side));
                }
            }
        }
        let both = bytemuck::cast([facing, hidden]);
        let join = |a: [u8; 16], b: [u8; 16]| {
            let [a, b]: [[u64; 2]; 2] = [a, b].map(|bytes| bytemuck::pod_read_unaligned(&bytes));
            bytemuck::cast([a[0] + b[0], a[1] + b[1]])
        };
        let [facing, hidden]: [u64; 2] = bytemuck::pod_read_unaligned(&ranks.all_reduce(HIDDEN, both, join)?);
        Ok(hidden as f64 / facing.max(1) as f64)
    }

    /// What reaches an own cluster.
    pub fn of(&self, cluster: u32) -> Reached<'_> {
        let end = |cluster: u32| self.pairs.partition_point(|&(c, _)| c < cluster);
        let area = self.areas.get(cluster as usize).map_or(0.0, |&area| area);
        Reached { sides: &self.pairs[end(cluster)..end(cluster + 1)], ray: self.quantum / area }
    }
}

/// What reaches a cluster.
#[derive(Clone, Copy, Debug)]
pub struct Reached<'a> {
    /// The cluster, and each of the sides of which light reaches it, in order.
    sides: &'a [(u32, u32)],
    /// Light of a ray, W/m² or lux.
    ray: f32,
}

impl Reached<'_> {
    /// Whether all of a node of the tree is hidden, which would give about `in_view` if it were in full view, W/m² or lux.
    pub fn hides(&self, tree: &ShooterTree, node: u32, in_view: f32) -> bool {
        in_view >= PROOF * self.ray && !self.holds(tree, node)
    }

    /// Whether light of a node, or part of it, reaches the cluster.
    fn holds(&self, tree: &ShooterTree, node: u32) -> bool {
        let any = |nodes: Range<u32>| {
            let at = self.sides.partition_point(|&(_, side)| side < nodes.start);
            self.sides.get(at).is_some_and(|&(_, side)| side < nodes.end)
        };
        let side = tree.sides[node as usize];
        any(side..side + 1) || any(tree.below(node))
    }
}

fn free_areas(mesh: &Mesh, share: &Share) -> Vec<f32> {
    let mut areas = vec![0.0; mesh.clusters.len()];
    for &cluster in &share.own {
        let patches = mesh.clusters[cluster as usize].patches.clone().map(|id| mesh.patch(id));
        let free = |patch: Patch| {
            let of = |(k, e)| patch.element_area(k) * mesh.valid_share(e);
            (0..).zip(patch.elements()).map(of).sum::<f64>()
        };
        areas[cluster as usize] = patches.map(free).sum::<f64>() as f32;
    }
    areas
}

fn in_order(mut pairs: Vec<(u32, u32)>) -> Vec<(u32, u32)> {
    pairs.par_sort_unstable();
    pairs.dedup();
    pairs
}

/// The elements that emit, in the order of the tree, and what they and those before them emit together.
struct Lamps<'a> {
    tree: &'a ShooterTree,
    /// For each its node, the node of its side, and the power up to its end, W or lm.
    elements: Vec<(u32, u32, f64)>,
}

impl<'a> Lamps<'a> {
    fn new((tree, light): (&'a ShooterTree, &TreeLight)) -> Lamps<'a> {
        let (mut elements, mut power) = (Vec::new(), 0.0);
        for (number, node) in (0..).zip(&tree.nodes) {
            let Kind::Piece(piece) = node.kind else { continue };
            if piece.element.is_some() {
                power += f64::from(node.area) * f64::from(strength(light.radiosity[number as usize]));
                elements.push((number, tree.sides[number as usize], power));
            }
        }
        Lamps { tree, elements }
    }

    fn total(&self) -> f64 {
        self.elements.last().map_or(0.0, |&(.., power)| power)
    }

    /// The side that ray `number` comes from, and the ray: places and directions fill all there are evenly.
    fn ray<'r>(&self, mesh: &'r Mesh, quantum: f64, number: u64) -> (u32, Glance<'r>) {
        let power = (number as f64 + 0.5) * quantum;
        let at = self.elements.partition_point(|&(.., end)| end <= power).min(self.elements.len() - 1);
        let (node, side, _) = self.elements[at];
        let [u, v, share, turn] = STEPS.map(|step| ((number + 1) as f64 * step).fract());
        let Kind::Piece(piece) = self.tree.nodes[node as usize].kind else { unreachable!("elements are pieces") };
        let patch = piece.patch(mesh);
        let within = if patch.frame.layout == Layout::Triangle && u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
        let point = patch.frame.at(DVec2::from(within));
        (side, Glance::along(mesh, point, (patch.normal, patch.plane), (share, turn)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::fixture;
    use crate::solve::group::passes;

    /// A closed room of 4 m from `x` on, lit by a lamp below its ceiling.
    fn room(x: f64) -> String {
        let mut obj = String::new();
        for [(a, b, c), (d, e, f)] in [[(0., 0., 0.), (4., 4., 4.)], [(1.5, 3.9, 1.5), (2.5, 3.9, 2.5)]] {
            for (px, py, pz) in [(a, b, c), (d, b, c), (d, b, f), (a, b, f), (a, e, c), (d, e, c), (d, e, f), (a, e, f)]
            {
                obj += &format!("v {} {py} {pz}\n", x + px);
            }
        }
        obj + "usemtl grey\nf -16 -15 -14 -13\nf -12 -11 -10 -9\nf -16 -15 -11 -12\nf -14 -13 -9 -10\nf -15 -14 -10 -11\n\
            f -13 -16 -12 -9\nusemtl lamp\nf -8 -7 -6 -5\n"
    }

    #[test]
    fn light_reaches_what_it_lights_and_stays_in_its_room() {
        // Every lamp is shot once: what has light has it of lamps.
        let solution = fixture::solve(fixture::read(&(room(0.0) + &room(6.0))), 0.25, 1.0);
        let mesh = &solution.mesh;
        let tree = ShooterTree::new(mesh);
        let elements = passes::radiosities(mesh, &vec![[0.0; 3]; mesh.element_count()]);
        let light = TreeLight::new(&tree, &elements);
        let (mut ring, mut ranks) = fixture::alone(&solution);
        let share = Share::new(mesh, 0, 1);
        let mut tally = Tally::default();
        let reach = Reach::new((&tree, &light), 0.01, (&mut ring, &share), &mut ranks, &mut tally).unwrap();
        assert!(tally.rays > 10_000);
        let sides: Vec<u32> = tree.sides().collect();
        assert_eq!(sides.len(), 4);
        for (number, cluster) in (0..).zip(&mesh.clusters) {
            let reached = reach.of(number);
            let lit = cluster.elements.clone().any(|e| solution.irradiance(e)[1] > 0.0);
            assert_eq!(reached.holds(&tree, 0), lit, "cluster {number}");
            for &side in &sides {
                let of_room = |x: f32| x > 5.0;
                let here = of_room(tree.nodes[side as usize].low.x) == of_room(cluster.low.x);
                assert!(here || !reached.holds(&tree, side), "cluster {number}");
            }
        }
        assert!(sides.iter().all(|&side| !reach.of(0).hides(&tree, side, 1e-9)));
        // Both lamps shine down on all of the other room, and a little more than that is hidden from nobody.
        let received: Vec<Rgb> = (0..mesh.element_count() as u32).map(|e| solution.irradiance(e)).collect();
        let hidden = reach.hidden_share(mesh, &tree, &received, (&share, &mut ranks)).unwrap();
        assert!((0.4..0.6).contains(&hidden), "{hidden}");
        let dark = vec![[0.0; 3]; mesh.element_count()];
        assert_eq!(reach.hidden_share(mesh, &tree, &dark, (&share, &mut ranks)).unwrap(), 0.0);
    }
}
