//! Light goes back and forth over the links until it has settled.

use super::FLOOR;
use super::links::Links;
use crate::mesh::{Cluster, Mesh, Patch};
use crate::quantity::Rgb;
use crate::shooting::{self, ClusterLight, ElementLight, PatchLight, Radiosity, ShooterTree, TreeLight};
use crate::solve::Share;
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;

/// Most passes of a round.
const PASSES: usize = 100;

/// Passes end when none changes the light of an element by more than this share of it, or of the usual light.
const SETTLED: f32 = 1e-5;

/// Tag of the elements' light.
const LIGHT: u32 = 9;

/// Brings the light of all ranks' elements to all.
pub struct Exchange<'a> {
    mesh: &'a Mesh,
    share: &'a Share,
}

/// What stands for light that is not known, or is next to nothing.
pub struct Floor {
    /// Light that elements may have that have none yet.
    pub guess: f32,
    /// The least light that errors are relative to.
    pub least: f32,
}

impl<'a> Exchange<'a> {
    /// Among the ranks that own these clusters.
    pub fn new(mesh: &'a Mesh, share: &'a Share) -> Exchange<'a> {
        Exchange { mesh, share }
    }

    /// What all elements receive, on average over their areas. Every rank calls it.
    pub fn all(&self, ranks: &mut Communicator<'_>, own: &[ClusterLight]) -> Result<Vec<Rgb>, Failure> {
        let own: Vec<Rgb> = own.iter().flat_map(|c| c.elements.iter().map(ElementLight::mean)).collect();
        let parts = ranks.all_gather(LIGHT, bytemuck::cast_slice(&own).to_vec())?;
        let mut parts: Vec<_> = parts.iter().map(|part| part.chunks_exact(size_of::<Rgb>())).collect();
        let clusters = self.mesh.clusters.iter().zip(&self.share.owners);
        let elements = clusters.flat_map(|(cluster, &owner)| cluster.elements.clone().map(move |_| owner as usize));
        let take = |owner: usize| {
            let bytes = parts[owner].next();
            bytes.map_or([0.0; 3], bytemuck::pod_read_unaligned)
        };
        Ok(elements.map(take).collect())
    }
}

/// Radiosity of all elements that receive so much: W/m² or lm/m².
pub fn radiosities(mesh: &Mesh, received: &[Rgb]) -> Vec<Radiosity> {
    let of_cluster = |cluster: &Cluster| {
        let patches = cluster.patches.clone().map(|id| mesh.patch(id));
        let all = patches.flat_map(|patch| patch.elements().map(move |e| (patch, e)));
        let radiosity = |(patch, e): (Patch, u32)| {
            let light = ElementLight { shot: received[e as usize], ..ElementLight::default() };
            shooting::radiosity(mesh, &patch, e, &light).map(|x| x as f32)
        };
        all.map(radiosity).collect::<Vec<_>>()
    };
    mesh.clusters.par_iter().flat_map_iter(of_cluster).collect()
}

/// What is usual: a share of the median, or, while most is dark, what all exitance would give if it were spread over all surfaces.
pub fn floor(mesh: &Mesh, received: &[Rgb]) -> Floor {
    let mut lit: Vec<f32> = received.iter().map(|&e| shooting::strength(e)).filter(|&e| e > 0.0).collect();
    let elements = radiosities(mesh, received);
    let (mut power, mut area) = (0.0, 0.0);
    for id in 0..mesh.patch_count() as u32 {
        let patch = mesh.patch(id);
        for (k, e) in patch.elements().enumerate() {
            let free = patch.element_area(k as u32) * mesh.valid_share(e);
            power += free * f64::from(shooting::strength(elements[e as usize]));
            area += free;
        }
    }
    let guess = if area > 0.0 { (power / area) as f32 } else { 0.0 };
    if lit.len() * 2 <= received.len() {
        return Floor { guess, least: guess };
    }
    let middle = lit.len() / 2;
    Floor { guess, least: FLOOR * *lit.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

/// Passes light over the links of own receivers until that of no element changes: `received` is what all elements receive,
/// before and after. Gives the light of own clusters, all of it shot. Every rank calls it.
pub fn settle(
    exchange: &Exchange<'_>,
    tree: &ShooterTree,
    links: &[Links],
    direct: &[ClusterLight],
    light: &mut TreeLight,
    received: &mut Vec<Rgb>,
    ranks: &mut Communicator<'_>,
) -> Result<Vec<ClusterLight>, Failure> {
    let Exchange { mesh, share } = *exchange;
    let mut clusters = Vec::new();
    for _ in 0..PASSES {
        clusters = direct.to_vec();
        for cluster in &mut clusters {
            cluster.patches.fill(PatchLight::default());
            cluster.elements.iter_mut().for_each(|e| (e.shot, e.unshot) = (e.mean(), [0.0; 3]));
        }
        let found: Vec<Vec<(u32, Rgb, Rgb)>> = links.par_iter().map(|links| links.gather(light)).collect();
        let mut place = 0;
        for (element, mean, more) in found.into_iter().flatten() {
            // Links are in the order of own clusters.
            while !mesh.clusters[share.own[place] as usize].elements.contains(&element) {
                place += 1;
            }
            let first = mesh.clusters[share.own[place] as usize].elements.start;
            let own = &mut clusters[place].elements[(element - first) as usize];
            (0..3).for_each(|c| own.shot[c] += mean[c]);
            (0..3).for_each(|c| own.correction[c] += more[c]);
        }
        let next = exchange.all(ranks, &clusters)?;
        let usual = next.iter().map(|&e| f64::from(shooting::strength(e))).sum::<f64>() / next.len().max(1) as f64;
        let change = received.iter().zip(&next).map(|(&a, &b)| {
            let (a, b) = (shooting::strength(a), shooting::strength(b));
            (a - b).abs() / b.max(usual as f32)
        });
        let settled = change.fold(0.0, f32::max) <= SETTLED;
        *received = next;
        light.renew(tree, &radiosities(mesh, received));
        if settled {
            break;
        }
    }
    Ok(clusters)
}
