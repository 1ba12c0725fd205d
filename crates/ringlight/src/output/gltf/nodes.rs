//! The node hierarchy and its cameras, as they were.

use crate::scene::Node;
use crate::solution::Solution;
use glam::{DMat3, DMat4, DVec3};
use serde_json::{Value, json};

/// Writes nodes and cameras into a document. `mesh_of_node` has the mesh of each node; `roots` are meshes in world space
/// with their names.
pub fn describe(document: &mut Value, solution: &Solution, mesh_of_node: &[Option<usize>], roots: &[(String, usize)]) {
    let description = &solution.description;
    let mut cameras = Vec::new();
    let mut nodes: Vec<Value> = Vec::with_capacity(description.nodes.len() + roots.len());
    for (node, mesh) in description.nodes.iter().zip(mesh_of_node) {
        let mut made = transformation(node);
        if !node.name.is_empty() {
            made["name"] = json!(node.name);
        }
        if let Some(mesh) = mesh {
            made["mesh"] = json!(mesh);
        }
        if let Some(camera) = node.camera.and_then(|c| camera(solution, c)) {
            made["camera"] = json!(cameras.len());
            cameras.push(camera);
        }
        if let Some(extras) = &node.extras {
            made["extras"] = extras.clone();
        }
        nodes.push(made);
    }
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    let mut top = Vec::new();
    for (i, node) in description.nodes.iter().enumerate() {
        match node.parent.map(|p| p as usize).filter(|&p| p < i) {
            Some(parent) => children[parent].push(i),
            None => top.push(i),
        }
    }
    for (node, children) in nodes.iter_mut().zip(children).filter(|(_, c)| !c.is_empty()) {
        node["children"] = json!(children);
    }
    for (name, mesh) in roots {
        top.push(nodes.len());
        nodes.push(json!({ "name": name, "mesh": mesh }));
    }
    let mut scene = json!({ "nodes": top });
    if !description.name.is_empty() {
        scene["name"] = json!(description.name);
    }
    document["scene"] = json!(0);
    document["scenes"] = json!([scene]);
    document["nodes"] = json!(nodes);
    if !cameras.is_empty() {
        document["cameras"] = json!(cameras);
    }
}

/// A node's transformation as translation, rotation and scale, leaving out what is the default; as a matrix if it cannot
/// be taken apart.
fn transformation(node: &Node) -> Value {
    let local = DMat4::from_cols_array_2d(&node.local);
    let mut made = json!({});
    if local == DMat4::IDENTITY || !local.is_finite() {
        return made;
    }
    let linear = DMat3::from_mat4(local);
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let lengths = DVec3::new(x.length(), y.length(), z.length());
    let square = |a: DVec3, b: DVec3| a.dot(b).abs() <= 1e-6 * a.length() * b.length();
    if !(square(x, y) && square(y, z) && square(z, x)) {
        made["matrix"] = json!(local.to_cols_array());
        return made;
    }
    let translation = local.w_axis.truncate();
    if translation != DVec3::ZERO {
        made["translation"] = json!(translation.to_array());
    }
    if lengths.min_element() > 0.0 {
        let (scale, rotation, _) = local.to_scale_rotation_translation();
        let rotation = rotation.normalize().to_array();
        if rotation[3].abs() < 1.0 {
            made["rotation"] = json!(rotation);
        }
        if scale != DVec3::ONE {
            made["scale"] = json!(scale.to_array());
        }
    } else {
        made["scale"] = json!(lengths.to_array());
    }
    made
}

/// A camera; none if its numbers make no view.
fn camera(solution: &Solution, number: u32) -> Option<Value> {
    let camera = solution.description.cameras.get(number as usize)?;
    let size = solution.mesh.diagonal.max(1e-6);
    let aspect = camera.aspect.filter(|a| a.is_finite() && *a > 0.0);
    let mut made = if camera.vertical_field_of_view > 0.0 {
        let mut view = json!({ "yfov": camera.vertical_field_of_view, "znear": 1e-4 * size });
        if let Some(aspect) = aspect {
            view["aspectRatio"] = json!(aspect);
        }
        json!({ "type": "perspective", "perspective": view })
    } else if camera.half_height > 0.0 {
        let view = json!({
            "xmag": camera.half_height * aspect.unwrap_or(1.0),
            "ymag": camera.half_height,
            "znear": 1e-4 * size,
            "zfar": 10.0 * size,
        });
        json!({ "type": "orthographic", "orthographic": view })
    } else {
        return None;
    };
    if !camera.name.is_empty() {
        made["name"] = json!(camera.name);
    }
    Some(made)
}
