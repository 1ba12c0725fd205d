//! An L-shaped gallery without lamps, lit through a doorway from the room next to it.

use super::model::{Model, Paint, Solid, at};

const HEIGHT: f64 = 3.0;

/// The lit room spans 4 m × 4 m; the gallery's arms are 3 m wide, 9 m and 6 m long.
pub fn model() -> Model {
    let mut model = Model { name: "gallery".into(), sizes: (0.6, 0.19), ..Model::default() };
    let wall = model.paint("plaster", [0.74, 0.72, 0.68]);
    let floor = model.paint("oak", [0.38, 0.27, 0.16]);
    let ceiling = model.paint("ceiling", [0.8, 0.8, 0.8]);
    let frame = model.paint("dark wood", [0.12, 0.08, 0.05]);
    let lamp = model.light("diffuser", [0.7; 3], [1.0, 0.95, 0.87], 9000.0);

    let mut room = Solid::default();
    let faces = room.room(wall, [0.0; 3], [4.0, HEIGHT, 4.0]);
    (faces[2].paint, faces[3].paint) = (floor, ceiling);
    room.0.remove(1);
    wall_with_doorway(&mut room, wall, 4.0, 0.0, 4.0, false);
    place(&mut model, "lit room", room);

    let mut doorway = Solid::default();
    doorway.rectangle(floor, [4.0, 0.0, 2.2], [0.2, 0.0, 0.0], [0.0, 0.0, -1.0]);
    doorway.rectangle(frame, [4.0, 0.0, 1.2], [0.2, 0.0, 0.0], [0.0, 2.1, 0.0]);
    doorway.rectangle(frame, [4.2, 0.0, 2.2], [-0.2, 0.0, 0.0], [0.0, 2.1, 0.0]);
    doorway.rectangle(frame, [4.0, 2.1, 1.2], [0.2, 0.0, 0.0], [0.0, 0.0, 1.0]);
    place(&mut model, "doorway", doorway);

    let mut gallery = Solid::default();
    wall_with_doorway(&mut gallery, wall, 4.2, 0.0, 9.0, true);
    let up = [0.0, HEIGHT, 0.0];
    gallery.rectangle(wall, [4.2, 0.0, 0.0], [3.0, 0.0, 0.0], up);
    gallery.rectangle(wall, [7.2, 0.0, 0.0], [0.0, 0.0, 6.0], up);
    gallery.rectangle(wall, [7.2, 0.0, 6.0], [6.0, 0.0, 0.0], up);
    gallery.rectangle(wall, [13.2, 0.0, 6.0], [0.0, 0.0, 3.0], up);
    gallery.rectangle(wall, [13.2, 0.0, 9.0], [-9.0, 0.0, 0.0], up);
    for (x, z, width, depth) in [(4.2, 0.0, 3.0, 9.0), (7.2, 6.0, 6.0, 3.0)] {
        gallery.rectangle(floor, [x, 0.0, z + depth], [width, 0.0, 0.0], [0.0, 0.0, -depth]);
        gallery.rectangle(ceiling, [x, HEIGHT, z], [width, 0.0, 0.0], [0.0, 0.0, depth]);
    }
    place(&mut model, "gallery", gallery);

    let mut luminaire = Solid::default();
    luminaire.block(ceiling, [1.2, 2.94, 1.2], [2.8, HEIGHT, 2.8])[2].paint = lamp;
    place(&mut model, "luminaire", luminaire);

    let colours = [
        ("vermilion", [0.62, 0.12, 0.06]),
        ("ochre", [0.6, 0.42, 0.1]),
        ("ultramarine", [0.08, 0.12, 0.5]),
        ("viridian", [0.1, 0.36, 0.22]),
        ("ivory", [0.78, 0.74, 0.62]),
    ];
    let panels = [
        ([7.14, 0.9, 1.1], [7.2, 2.3, 2.5]),
        ([7.14, 0.9, 3.4], [7.2, 2.3, 4.8]),
        ([4.9, 0.9, 8.94], [6.5, 2.3, 9.0]),
        ([8.3, 0.9, 8.94], [9.9, 2.3, 9.0]),
        ([10.6, 0.9, 6.0], [12.4, 2.3, 6.06]),
    ];
    for ((name, colour), (low, high)) in colours.into_iter().zip(panels) {
        let paint = model.paint(name, colour);
        let mut panel = Solid::default();
        panel.block(paint, low, high);
        place(&mut model, &format!("{name} panel"), panel);
    }

    let mut bench = Solid::default();
    bench.block(floor, [-0.8, 0.42, -0.2], [0.8, 0.47, 0.2]);
    for x in [-0.7, 0.62] {
        for z in [-0.17, 0.09] {
            bench.block(frame, [x, 0.0, z], [x + 0.08, 0.42, z + 0.08]);
        }
    }
    let bench = model.mesh("bench", bench.0);
    model.node("bench 1", None, Some(bench), at(5.7, 0.0, 4.4).turned(90.0));
    model.node("bench 2", None, Some(bench), at(10.2, 0.0, 7.5));

    model.camera("towards the doorway", [6.8, 1.6, 8.6], [4.4, 1.0, 1.6], 55.0);
    model.camera("around the corner", [12.9, 1.6, 8.7], [7.2, 1.1, 6.6], 60.0);
    model
}

/// A wall in the plane of `x` from z = `start` to `end` with the doorway cut out; it faces +x or −x.
fn wall_with_doorway(solid: &mut Solid, paint: Paint, x: f64, start: f64, end: f64, faces_right: bool) {
    for (from, to, bottom) in [(start, 1.2, 0.0), (1.2, 2.2, 2.1), (2.2, end, 0.0)] {
        let up = [0.0, HEIGHT - bottom, 0.0];
        if faces_right {
            solid.rectangle(paint, [x, bottom, to], [0.0, 0.0, from - to], up);
        } else {
            solid.rectangle(paint, [x, bottom, from], [0.0, 0.0, to - from], up);
        }
    }
}

fn place(model: &mut Model, name: &str, solid: Solid) {
    let mesh = model.mesh(name, solid.0);
    model.node(name, None, Some(mesh), at(0.0, 0.0, 0.0));
}
