//! The node hierarchy (glTF 2.0, section 3.5), without recursion: chains of nodes may be as long as the file.

use super::json::Document;
use super::views::find;
use crate::scene::{Node, Place, SceneError};
use glam::{DMat4, DQuat, DVec3};

/// The checked hierarchy.
pub(super) struct Hierarchy {
    /// World transformation of every node of the file, whether the default scene shows it or not: joints need not be in it.
    pub world: Vec<DMat4>,
    /// Indices of the nodes of the default scene, parents before children.
    pub shown: Vec<u32>,
    /// These nodes.
    pub nodes: Vec<Node>,
    /// Name of the default scene, may be empty.
    pub scene_name: String,
}

/// Resolves the hierarchy and the default scene.
pub(super) fn resolve(name: &str, document: &Document) -> Result<Hierarchy, SceneError> {
    let error = |at: String, found: String, expected: String| SceneError::new(Place::new(name, at), found, expected);
    let parents = parents(name, document)?;
    let all_roots: Vec<u32> =
        (0_u32..).zip(&parents).filter(|(_, parent)| parent.is_none()).map(|(index, _)| index).collect();
    let order = depth_first(document, &all_roots);
    if order.len() < document.nodes.len() {
        return Err(cycle(name, &parents, &order));
    }
    let mut world = vec![DMat4::IDENTITY; document.nodes.len()];
    for &index in &order {
        let parent = parent_of(&parents, index).and_then(|parent| find(&world, parent)).copied();
        let own = parent.unwrap_or(DMat4::IDENTITY) * local(document, index);
        if !own.is_finite() {
            let found = "a world transformation with infinite or undefined entries".to_owned();
            return Err(error(format!("nodes[{index}]"), found, "finite numbers".to_owned()));
        }
        if let Some(slot) = world.get_mut(index as usize) {
            *slot = own;
        }
    }
    let (scene_name, roots) = default_scene(name, document, &parents)?;
    let roots = roots.unwrap_or(all_roots);
    let mut slots: Vec<Option<u32>> = vec![None; document.nodes.len()];
    let mut shown = depth_first(document, &roots);
    shown.retain(|&index| find(&document.nodes, index).is_some());
    let mut nodes = Vec::with_capacity(shown.len());
    for (slot, &index) in (0_u32..).zip(&shown) {
        let Some(node) = find(&document.nodes, index) else { continue };
        if let Some(entry) = slots.get_mut(index as usize) {
            *entry = Some(slot);
        }
        nodes.push(Node {
            name: node.name.clone().unwrap_or_default(),
            parent: parent_of(&parents, index).and_then(|parent| find(&slots, parent).copied().flatten()),
            local: local(document, index).to_cols_array_2d(),
            world: find(&world, index).copied().unwrap_or_default().to_cols_array_2d(),
            camera: None,
            extras: node.extras.clone(),
        });
    }
    Ok(Hierarchy { world, shown, nodes, scene_name })
}

fn parent_of(parents: &[Option<u32>], index: u32) -> Option<u32> {
    find(parents, index).copied().flatten()
}

/// The parent of each node. Section 3.5.3: no node has two.
fn parents(name: &str, document: &Document) -> Result<Vec<Option<u32>>, SceneError> {
    let mut parents: Vec<Option<u32>> = vec![None; document.nodes.len()];
    for (parent, node) in (0_u32..).zip(&document.nodes) {
        for (place, &child) in node.children.iter().enumerate() {
            let at = || Place::new(name, format!("nodes[{parent}].children[{place}]"));
            match parents.get_mut(child as usize) {
                None => {
                    let expected = format!("an index below {}", document.nodes.len());
                    return Err(SceneError::new(at(), format!("node {child}"), expected));
                }
                Some(Some(first)) => {
                    let found = format!("node {child}, which is already a child of node {first}");
                    return Err(SceneError::new(at(), found, "nodes with one parent each"));
                }
                Some(slot) => *slot = Some(parent),
            }
        }
    }
    Ok(parents)
}

/// The error for nodes that no root leads to.
fn cycle(name: &str, parents: &[Option<u32>], reached: &[u32]) -> SceneError {
    let mut is_reached = vec![false; parents.len()];
    for &index in reached {
        if let Some(flag) = is_reached.get_mut(index as usize) {
            *flag = true;
        }
    }
    let first = is_reached.iter().position(|reached| !reached).unwrap_or(0) as u32;
    // Every ancestor of an unreached node has a parent, so after as many steps as there are nodes we are on the cycle.
    let on_cycle = parents.iter().fold(first, |index, _| parent_of(parents, index).unwrap_or(index));
    let place = Place::new(name, format!("nodes[{on_cycle}].children"));
    SceneError::new(place, "a node that is its own ancestor", "a hierarchy without cycles")
}

/// Nodes under `roots`, each before its children, children in file order.
fn depth_first(document: &Document, roots: &[u32]) -> Vec<u32> {
    let mut order = Vec::new();
    let mut stack: Vec<u32> = roots.iter().rev().copied().collect();
    while let Some(index) = stack.pop() {
        order.push(index);
        if let Some(node) = find(&document.nodes, index) {
            stack.extend(node.children.iter().rev());
        }
    }
    order
}

/// Name and root nodes of the default scene; no roots where the file has no scenes.
fn default_scene(
    name: &str,
    document: &Document,
    parents: &[Option<u32>],
) -> Result<(String, Option<Vec<u32>>), SceneError> {
    let index = document.scene.unwrap_or(0);
    let Some(scene) = find(&document.scenes, index) else {
        if document.scene.is_some() {
            let expected = format!("an index below {}", document.scenes.len());
            return Err(SceneError::new(Place::new(name, "scene"), format!("scene {index}"), expected));
        }
        return Ok((String::new(), None));
    };
    let mut listed = vec![false; parents.len()];
    for (place, &root) in scene.nodes.iter().enumerate() {
        let at = || Place::new(name, format!("scenes[{index}].nodes[{place}]"));
        let Some(flag) = listed.get_mut(root as usize) else {
            let expected = format!("an index below {}", parents.len());
            return Err(SceneError::new(at(), format!("node {root}"), expected));
        };
        if std::mem::replace(flag, true) {
            return Err(SceneError::new(at(), format!("node {root} a second time"), "each root node once"));
        }
        if let Some(parent) = parent_of(parents, root) {
            let found = format!("node {root}, which is a child of node {parent}");
            return Err(SceneError::new(at(), found, "root nodes"));
        }
    }
    Ok((scene.name.clone().unwrap_or_default(), Some(scene.nodes.clone())))
}

/// The local transformation: a matrix, or translation × rotation × scale.
fn local(document: &Document, index: u32) -> DMat4 {
    let Some(node) = find(&document.nodes, index) else { return DMat4::IDENTITY };
    match &node.matrix {
        Some(matrix) => DMat4::from_cols_array(matrix),
        None => compose(node.translation, node.rotation, node.scale),
    }
}

/// Translation × rotation × scale. Rotations come as rounded floats, so they are normalised; one of length 0 turns nothing.
pub(super) fn compose(translation: Option<[f64; 3]>, rotation: Option<[f64; 4]>, scale: Option<[f64; 3]>) -> DMat4 {
    let rotation = DQuat::from_array(rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let length = rotation.length();
    let rotation = if length > 0.0 && length.is_finite() { rotation / length } else { DQuat::IDENTITY };
    DMat4::from_scale_rotation_translation(
        DVec3::from_array(scale.unwrap_or([1.0; 3])),
        rotation,
        DVec3::from_array(translation.unwrap_or([0.0; 3])),
    )
}
