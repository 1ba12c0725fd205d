//! A closed room with boxes in it where every surface has the radiosity 1.

use super::model::{Dice, Model, Paint, Rectangle, Solid, at};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// Each rectangle has a random reflectance ρ in each channel, between 0.2 and 0.8, and the exitance 1 − ρ.
pub fn model() -> Model {
    let mut model = Model { name: "furnace".into(), sizes: (0.5, 0.125), ..Model::default() };
    let mut dice = Dice(1994);
    let mut room = Solid::default();
    room.room(0, [0.0; 3], [4.0, 3.0, 5.0]);
    add(&mut model, &mut dice, "room", room);
    let boxes = [
        ("slab", [0.5, 0.4, 0.6], [1.9, 0.6, 2.2]),
        ("pillar", [2.7, 0.25, 0.7], [3.3, 2.75, 1.2]),
        ("cube", [1.3, 1.5, 2.9], [2.1, 2.3, 3.7]),
        ("screen", [0.4, 0.3, 4.3], [2.9, 2.2, 4.4]),
    ];
    for (name, low, high) in boxes {
        let mut solid = Solid::default();
        solid.block(0, low, high);
        add(&mut model, &mut dice, name, solid);
    }
    let mut tilted = Solid::default();
    let rotation = DQuat::from_rotation_y(0.6) * DQuat::from_rotation_x(0.4);
    tilted.turned_block(0, DVec3::new(3.0, 1.1, 2.9), DVec3::new(0.9, 0.5, 0.7), rotation);
    add(&mut model, &mut dice, "tilted box", tilted);
    model.camera("corner", [0.15, 2.85, 0.15], [2.6, 0.9, 3.4], 65.0);
    model
}

fn add(model: &mut Model, dice: &mut Dice, name: &str, mut solid: Solid) {
    for (face, Rectangle { paint, .. }) in ["-x", "+x", "-y", "+y", "-z", "+z"].iter().zip(&mut solid.0) {
        *paint = grey(model, dice, &format!("{name} {face}"));
    }
    let mesh = model.mesh(name, solid.0);
    model.node(name, None, Some(mesh), at(0.0, 0.0, 0.0));
}

/// A material with ρ in steps of 1/1024, so that single precision holds it exactly, and the radiance (1 − ρ)/π.
fn grey(model: &mut Model, dice: &mut Dice, name: &str) -> Paint {
    let reflectance = [0; 3].map(|_: u8| (205 + dice.below(615)) as f64 / 1024.0);
    model.light(name, reflectance, reflectance.map(|rho| (1.0 - rho) / PI), 1.0)
}
