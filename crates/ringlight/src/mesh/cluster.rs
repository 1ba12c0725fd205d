//! Order of facets, and clusters: neighbours in space that face alike.

use super::{Cluster, Facet, Mesh, NONE};
use crate::column::{Column, Store};
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use std::io;

/// Elements per cluster aimed at. Small enough to deal out evenly, large enough that those lit as one with their neighbours, most of a
/// finely tessellated model, leave others enough to look together.
pub const CLUSTER_ELEMENTS: u32 = 256;

/// Elements that follow each other are neighbours: a cluster is ordered by halves down to so many.
const NEIGHBOURS: u32 = 16;

/// A facet on its way into order.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Item {
    /// Position of the middle, and normal.
    key: [f32; 6],
    facet: u32,
    elements: u32,
}

/// The order of facets, and the sizes of the groups of neighbours in it: recursive halving of (position, normal) along
/// its longest extent, a turn by 90° counting as much as `turn` metres.
pub fn order(facets: &[Facet], turn: f64, store: Store<'_>) -> io::Result<(Column<u32>, Column<u32>)> {
    let mut items: Column<Item> = store.column()?;
    items.reserve(facets.len())?;
    items.extend((0..).zip(facets).map(|(facet, f)| {
        let frame = f.frame();
        let middle = frame.at(super::Frame::middle(frame.layout));
        let normal = frame.area_vector().normalize() * turn;
        let key = [middle.x, middle.y, middle.z, normal.x, normal.y, normal.z].map(|x| x as f32);
        Item { key, facet, elements: f.unrefined_count() }
    }))?;
    let items: &mut [Item] = &mut items;
    let mut groups = store.column()?;
    let whole = 0..items.len();
    let mut stack = vec![whole];
    let mut grouped = 0;
    while let Some(range) = stack.pop() {
        let part = &mut items[range.clone()];
        let elements: u64 = part.iter().map(|item| u64::from(item.elements)).sum();
        if range.start >= grouped && (part.len() <= 1 || elements <= u64::from(CLUSTER_ELEMENTS)) {
            grouped = range.end;
            groups.push(part.len() as u32)?;
        }
        if part.len() <= 1 || elements <= u64::from(NEIGHBOURS) {
            part.sort_unstable_by_key(|item| item.facet);
            continue;
        }
        let mut extent = [(f32::INFINITY, f32::NEG_INFINITY); 6];
        for item in part.iter() {
            for (e, &x) in extent.iter_mut().zip(&item.key) {
                *e = (e.0.min(x), e.1.max(x));
            }
        }
        let axis = (0..6).max_by(|&a, &b| (extent[a].1 - extent[a].0).total_cmp(&(extent[b].1 - extent[b].0)));
        let axis = axis.unwrap_or(0);
        let half = part.len() / 2;
        // Ties by file order: the split depends on the scene alone.
        part.select_nth_unstable_by(half, |a, b| a.key[axis].total_cmp(&b.key[axis]).then(a.facet.cmp(&b.facet)));
        let middle = range.start + half;
        stack.push(middle..range.end);
        stack.push(range.start..middle);
    }
    let mut order = store.column()?;
    order.extend(items.iter().map(|item| item.facet))?;
    Ok((order, groups))
}

/// Numbers patches and elements of ordered facets, group by group: the fronts of a group, then its backs; and cuts them
/// into clusters.
pub fn number(mesh: &mut Mesh, groups: &[u32], double_sided: impl Fn(&Facet) -> bool) -> io::Result<()> {
    let (mut patch, mut element, mut start) = (0u32, 0u32, 0usize);
    mesh.first_elements.push(element)?;
    for &count in groups {
        let range = start..start + count as usize;
        start = range.end;
        for back in [false, true] {
            let first = patch;
            for f in range.clone() {
                let facet = &mut mesh.facets[f];
                if back && !double_sided(facet) {
                    facet.first_back_patch = NONE;
                    continue;
                }
                *if back { &mut facet.first_back_patch } else { &mut facet.first_patch } = patch;
                let code = (f as u32) << 1 | u32::from(back);
                let count = facet.unrefined_count() / facet.patch_count();
                for _ in 0..facet.patch_count() {
                    patch += 1;
                    element += count;
                    mesh.patch_facets.push(code)?;
                    mesh.first_elements.push(element)?;
                }
            }
            if patch > first {
                cut(mesh, first, patch);
            }
        }
    }
    mesh.clusters.shrink_to_fit();
    Ok(())
}

/// Cuts the patches from `first` up to `end` into clusters.
fn cut(mesh: &mut Mesh, first: u32, end: u32) {
    let mut start = first;
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for id in first..end {
        let patch = mesh.patch(id);
        let (corners, n) = patch.frame.corners();
        for c in &corners[..n] {
            (low, high) = (low.min(down(*c)), high.max(up(*c)));
        }
        let elements = mesh.first_elements[start as usize]..patch.elements().end;
        if elements.len() >= CLUSTER_ELEMENTS as usize || id + 1 == end {
            mesh.clusters.push(Cluster { patches: start..id + 1, elements, low, high });
            start = id + 1;
            (low, high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        }
    }
}

fn down(p: DVec3) -> Vec3 {
    p.as_vec3().map(f32::next_down)
}

fn up(p: DVec3) -> Vec3 {
    p.as_vec3().map(f32::next_up)
}
