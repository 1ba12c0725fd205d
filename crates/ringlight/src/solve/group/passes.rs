//! Light goes back and forth over the rows until it has settled.

use super::FLOOR;
use super::rows::Rows;
use crate::mesh::{Cluster, Mesh, Patch};
use crate::quantity::Rgb;
use crate::shooting::{self, Between, ClusterLight, ElementLight, Faces, PatchLight, Radiosity};
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

/// What an element gets from something, W/m² or lux.
#[derive(Clone, Copy, Debug)]
pub struct Arrived {
    /// The element.
    pub element: u32,
    /// On average over its area.
    pub mean: Rgb,
    /// What is to be added at its sample point.
    pub more: Rgb,
}

impl Arrived {
    /// Nothing.
    pub fn none(element: u32) -> Arrived {
        Arrived { element, mean: [0.0; 3], more: [0.0; 3] }
    }

    /// Adds what comes from this radiosity by a factor for the area average, and what is to be added to it at the sample point.
    pub fn add(&mut self, radiosity: Radiosity, mean: f32, more: f32) {
        (0..3).for_each(|c| self.mean[c] += mean * radiosity[c]);
        (0..3).for_each(|c| self.more[c] += more * radiosity[c]);
    }
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

/// What is usual: a share of the median by area, or, while most is dark, what all exitance would give if it were spread over all
/// surfaces.
pub fn floor(mesh: &Mesh, received: &[Rgb]) -> Floor {
    let elements = radiosities(mesh, received);
    let (mut power, mut area) = (0.0, 0.0);
    let mut lit: Vec<(f32, f64)> = Vec::new();
    for id in 0..mesh.patch_count() as u32 {
        let patch = mesh.patch(id);
        for (k, e) in patch.elements().enumerate() {
            let free = patch.element_area(k as u32) * mesh.valid_share(e);
            power += free * f64::from(shooting::strength(elements[e as usize]));
            area += free;
            lit.push((shooting::strength(received[e as usize]), free));
        }
    }
    let guess = if area > 0.0 { (power / area) as f32 } else { 0.0 };
    lit.retain(|(light, _)| *light > 0.0);
    lit.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let half = lit.iter().map(|(_, area)| area).sum::<f64>() / 2.0;
    if half * 4.0 <= area {
        return Floor { guess, least: guess };
    }
    let mut passed = 0.0;
    let middle = lit.iter().find(|(_, area)| {
        passed += area;
        passed >= half
    });
    Floor { guess, least: FLOOR * middle.map_or(guess, |(light, _)| *light) }
}

/// What each element returns of the light that it receives: reflectance × coverage.
pub fn returned(mesh: &Mesh) -> Vec<Rgb> {
    let of_cluster = |cluster: &Cluster| {
        let patches = cluster.patches.clone().map(|id| mesh.patch(id));
        let all = patches.flat_map(|patch| patch.elements().map(move |e| mesh.colour(&patch, e).returned()));
        all.collect::<Vec<_>>()
    };
    mesh.clusters.par_iter().flat_map_iter(of_cluster).collect()
}

/// What elements reflect of what they receive: W/m² or lm/m².
pub fn reflected(returned: &[Rgb], received: &[Rgb]) -> Vec<Radiosity> {
    let of = |(returned, received): (&Rgb, &Rgb)| [0, 1, 2].map(|c| returned[c] * received[c].max(0.0));
    returned.par_iter().zip(received).map(of).collect()
}

/// Passes light over the rows of own elements until that of no element changes; `lamps` is what comes from surfaces that emit,
/// `direct` from lamps without surface, and `received` what all elements receive, before and after. Elements of face clusters get
/// what their representatives get, and in the end what lies between. Gives the light of own clusters, all of it shot. Every rank
/// calls it.
pub fn settle(
    exchange: &Exchange<'_>,
    faces: &Faces,
    (lamps, rows): (&[Arrived], &[Rows]),
    direct: &[ClusterLight],
    received: &mut Vec<Rgb>,
    ranks: &mut Communicator<'_>,
) -> Result<Vec<ClusterLight>, Failure> {
    let Exchange { mesh, share } = *exchange;
    let returned = returned(mesh);
    let add = |shone: &mut [ClusterLight], Arrived { element, mean, more }: Arrived| {
        let place = share.own.partition_point(|&c| mesh.clusters[c as usize].elements.end <= element);
        let first = mesh.clusters[share.own[place] as usize].elements.start;
        let light = &mut shone[place].elements[(element - first) as usize];
        (0..3).for_each(|c| light.shot[c] += mean[c]);
        (0..3).for_each(|c| light.correction[c] += more[c]);
    };
    let mut lit = dark(direct);
    lamps.iter().for_each(|&arrived| add(&mut lit, arrived));
    let mut shone = Vec::new();
    for _ in 0..PASSES {
        shone = lit.clone();
        let reflected = reflected(&returned, received);
        let found: Vec<Vec<Arrived>> = rows.par_iter().map(|rows| rows.gather(&reflected).collect()).collect();
        found.into_iter().flatten().for_each(|arrived| add(&mut shone, arrived));
        for (&cluster, light) in share.own.iter().zip(&mut shone) {
            let first = mesh.clusters[cluster as usize].elements.start;
            for k in 0..light.elements.len() {
                light.elements[k] = light.elements[(faces.representative(first + k as u32) - first) as usize];
            }
        }
        let next = exchange.all(ranks, &join(direct, &shone))?;
        let usual = next.iter().map(|&e| f64::from(shooting::strength(e))).sum::<f64>() / next.len().max(1) as f64;
        let change = received.iter().zip(&next).map(|(&a, &b)| {
            let (a, b) = (shooting::strength(a), shooting::strength(b));
            (a - b).abs() / b.max(usual as f32)
        });
        let settled = change.fold(0.0, f32::max) <= SETTLED;
        *received = next;
        if settled {
            break;
        }
    }
    if let Some(between) = Between::new(mesh, faces) {
        let of_all = exchange.all(ranks, &shone)?;
        let own: Vec<_> = share.own.iter().zip(&mut shone).collect();
        own.into_par_iter().for_each(|(&cluster, light)| {
            let Cluster { patches, elements, .. } = &mesh.clusters[cluster as usize];
            for patch in patches.clone().map(|id| mesh.patch(id)) {
                let element = patch.first_element;
                if !faces.is_own(element) {
                    light.elements[(element - elements.start) as usize].shot = between.light(&patch, &of_all);
                }
            }
        });
        *received = exchange.all(ranks, &join(direct, &shone))?;
    }
    Ok(join(direct, &shone))
}

/// Clusters like these that receive nothing.
fn dark(clusters: &[ClusterLight]) -> Vec<ClusterLight> {
    let dark = |cluster: &ClusterLight| ClusterLight {
        elements: vec![ElementLight::default(); cluster.elements.len()],
        patches: vec![PatchLight::default(); cluster.patches.len()],
    };
    clusters.par_iter().map(dark).collect()
}

/// What comes from lamps without surface, and all else, together: all of it shot.
fn join(direct: &[ClusterLight], shone: &[ClusterLight]) -> Vec<ClusterLight> {
    let both = |(direct, shone): (&ClusterLight, &ClusterLight)| {
        let mut joined = shone.clone();
        for (light, direct) in joined.elements.iter_mut().zip(&direct.elements) {
            let mean = direct.mean();
            (0..3).for_each(|c| light.shot[c] += mean[c]);
            (0..3).for_each(|c| light.correction[c] += direct.correction[c]);
        }
        joined
    };
    direct.par_iter().zip(shone).map(both).collect()
}
