//! A furnished office for four, lit by eight ceiling luminaires.

use super::furniture::{self, Paints};
use super::model::{Model, Solid, at};

/// Width, height and depth of the room in metres.
const ROOM: [f64; 3] = [7.2, 2.8, 5.4];

/// Left and right edge of the door, its height, and how deep its niche lies in the wall z = 0.
const DOOR: [f64; 4] = [5.68, 6.67, 2.05, -0.09];

/// Edges of the window, its sill and lintel, and how deep its niche lies in the wall x = 0.
const WINDOW: [f64; 5] = [1.1, 4.1, 0.88, 2.35, -0.12];

/// How far the coloured part of the wall behind the shelves reaches from the window.
const ACCENT: f64 = 3.95;

/// Largest patch and element, in metres, at which the office has the numbers of the paper.
pub const SIZES: (f64, f64) = (0.475, 0.1945);

/// Luminance of the ceiling panels in cd/m²: gives about 500 lux on the floor.
const LUMINANCE: f64 = 5300.0;

/// Books on the boards of the three shelves, from the lowest of the first to the highest of the last.
const BOOKS: [[usize; 5]; 3] = [[8, 8, 11, 5, 10], [6, 9, 5, 9, 0], [9, 5, 5, 7, 12]];

/// The whole office. Every solid is closed; feet stand on the floor, books on their boards, screens on the desks.
pub fn model() -> Model {
    let mut model = Model { name: "office".into(), sizes: SIZES, ..Model::default() };
    let paints = Paints::new(&mut model, LUMINANCE);
    room(&mut model, &paints);
    luminaires(&mut model, &paints);
    workplaces(&mut model, &paints);
    shelves(&mut model, &paints);
    furnishings(&mut model, &paints);
    let [width, _, depth] = ROOM;
    model.camera("from the door", [width - 0.35, 1.65, 0.4], [2.3, 0.75, 3.4], 58.0);
    model.camera("from the window", [0.5, 1.5, depth - 0.4], [5.4, 0.8, 1.3], 58.0);
    model
}

fn add(model: &mut Model, name: &str, solid: Solid) {
    let mesh = model.mesh(name, solid.0);
    model.node(name, None, Some(mesh), at(0.0, 0.0, 0.0));
}

fn room(model: &mut Model, paints: &Paints) {
    let [width, _, depth] = ROOM;
    add(model, "room", shell(paints, DOOR, WINDOW));

    let mut skirting = Solid::default();
    skirting.block(paints.white, [0.0, 0.0, 0.0], [0.015, 0.07, depth]);
    skirting.block(paints.white, [width - 0.015, 0.0, 0.0], [width, 0.07, depth]);
    skirting.block(paints.white, [0.015, 0.0, 0.0], [DOOR[0] - 0.08, 0.07, 0.015]);
    skirting.block(paints.white, [DOOR[1] + 0.08, 0.0, 0.0], [width - 0.015, 0.07, 0.015]);
    skirting.block(paints.white, [0.015, 0.0, depth - 0.015], [width - 0.015, 0.07, depth]);
    add(model, "skirting", skirting);

    let mut door = Solid::default();
    let [left, right, top, back] = DOOR;
    door.block(paints.white, [left - 0.08, 0.0, 0.0], [left, top + 0.08, 0.02]);
    door.block(paints.white, [right, 0.0, 0.0], [right + 0.08, top + 0.08, 0.02]);
    door.block(paints.white, [left, top, 0.0], [right, top + 0.08, 0.02]);
    door.block(paints.steel, [left + 0.07, 1.02, back], [left + 0.11, 1.06, back + 0.05]);
    door.block(paints.steel, [left + 0.07, 1.02, back + 0.05], [left + 0.2, 1.06, back + 0.07]);
    add(model, "door frame and handle", door);

    let mut window = Solid::default();
    let [near, far, sill, lintel, back] = WINDOW;
    let front = back + 0.05;
    window.block(paints.white, [back, sill, near], [0.18, sill + 0.03, far]);
    for z in [near, 2.6, far - 0.07] {
        window.block(paints.white, [back, sill + 0.03, z], [front, lintel, z + 0.07]);
    }
    for (from, to) in [(near + 0.07, 2.6), (2.67, far - 0.07)] {
        window.block(paints.white, [back, sill + 0.03, from], [front, sill + 0.1, to]);
        window.block(paints.white, [back, lintel - 0.07, from], [front, lintel, to]);
    }
    add(model, "window", window);

    let mut radiator = Solid::default();
    for fin in 0..16 {
        let z = 1.9 + 0.1 * fin as f64;
        radiator.block(paints.white, [0.06, 0.15, z], [0.16, 0.72, z + 0.06]);
    }
    for y in [0.2, 0.63] {
        radiator.block(paints.white, [0.09, y, 1.85], [0.13, y + 0.04, 3.51]);
    }
    for z in [2.035, 3.335] {
        radiator.block(paints.steel, [0.09, 0.0, z], [0.12, 0.15, z + 0.03]);
    }
    add(model, "radiator", radiator);
}

/// Walls, floor and ceiling, with niches for the door and the window.
fn shell(paints: &Paints, door: [f64; 4], window: [f64; 5]) -> Solid {
    let [width, height, depth] = ROOM;
    let up = [0.0, height, 0.0];
    let mut shell = Solid::default();
    shell.rectangle(paints.carpet, [0.0, 0.0, depth], [width, 0.0, 0.0], [0.0, 0.0, -depth]);
    shell.rectangle(paints.ceiling, [0.0, height, 0.0], [width, 0.0, 0.0], [0.0, 0.0, depth]);
    shell.rectangle(paints.wall, [width, 0.0, 0.0], [0.0, 0.0, depth], up);
    shell.rectangle(paints.accent, [ACCENT, 0.0, depth], [-ACCENT, 0.0, 0.0], up);
    shell.rectangle(paints.wall, [width, 0.0, depth], [ACCENT - width, 0.0, 0.0], up);
    // The wall with the door, seen towards −z, and its niche.
    let [left, right, top, back] = door;
    shell.rectangle(paints.wall, [0.0; 3], [left, 0.0, 0.0], up);
    shell.rectangle(paints.wall, [right, 0.0, 0.0], [width - right, 0.0, 0.0], up);
    shell.rectangle(paints.wall, [left, top, 0.0], [right - left, 0.0, 0.0], [0.0, height - top, 0.0]);
    shell.rectangle(paints.white, [left, 0.0, 0.0], [0.0, 0.0, back], [0.0, top, 0.0]);
    shell.rectangle(paints.white, [right, 0.0, back], [0.0, 0.0, -back], [0.0, top, 0.0]);
    shell.rectangle(paints.white, [left, top, back], [right - left, 0.0, 0.0], [0.0, 0.0, -back]);
    shell.rectangle(paints.carpet, [left, 0.0, 0.0], [right - left, 0.0, 0.0], [0.0, 0.0, back]);
    shell.rectangle(paints.beech, [left, 0.0, back], [right - left, 0.0, 0.0], [0.0, top, 0.0]);
    // The wall with the window, seen towards −x, and its niche.
    let [near, far, sill, lintel, back] = window;
    let (across, rise) = ([0.0, 0.0, near - far], [0.0, lintel - sill, 0.0]);
    shell.rectangle(paints.wall, [0.0, 0.0, near], [0.0, 0.0, -near], up);
    shell.rectangle(paints.wall, [0.0, 0.0, depth], [0.0, 0.0, far - depth], up);
    shell.rectangle(paints.wall, [0.0, 0.0, far], across, [0.0, sill, 0.0]);
    shell.rectangle(paints.wall, [0.0, lintel, far], across, [0.0, height - lintel, 0.0]);
    shell.rectangle(paints.white, [back, sill, near], [-back, 0.0, 0.0], rise);
    shell.rectangle(paints.white, [0.0, sill, far], [back, 0.0, 0.0], rise);
    shell.rectangle(paints.white, [back, sill, far], [-back, 0.0, 0.0], across);
    shell.rectangle(paints.white, [0.0, lintel, far], [back, 0.0, 0.0], across);
    shell.rectangle(paints.night, [back, sill, far], across, rise);
    shell
}

fn luminaires(model: &mut Model, paints: &Paints) {
    let mut luminaire = Solid::default();
    luminaire.block(paints.white, [-0.3, -0.05, -0.3], [0.3, 0.0, 0.3]);
    luminaire.block(paints.white, [-0.28, -0.06, -0.28], [0.28, -0.05, 0.28])[2].paint = paints.diffuser;
    let luminaire = model.mesh("luminaire", luminaire.0);
    for number in 0..8 {
        let (column, row) = (number % 4, number / 4);
        let place = at(0.9 + 1.8 * column as f64, ROOM[1], 1.35 + 2.7 * row as f64);
        model.node(&format!("luminaire {}", number + 1), None, Some(luminaire), place);
    }
}

fn workplaces(model: &mut Model, paints: &Paints) {
    let meshes = [
        ("desk", furniture::desk(paints), at(0.0, 0.0, 0.0)),
        ("pedestal", furniture::pedestal(paints), at(0.46, 0.0, 0.02)),
        ("screen", furniture::screen(paints), at(-0.1, 0.74, -0.16)),
        ("desk things", furniture::desk_things(paints), at(-0.1, 0.74, 0.0)),
    ]
    .map(|(name, solid, place)| (name, model.mesh(name, solid.0), place));
    let chair = furniture::chair(paints);
    let chair = model.mesh("chair", chair.0);
    let places = [(2.2, 2.15, 180.0, 14.0), (2.2, 2.95, 0.0, -25.0), (3.8, 2.15, 180.0, -8.0), (3.8, 2.95, 0.0, 40.0)];
    for (number, (x, z, turn, chair_turn)) in places.into_iter().enumerate() {
        let number = number + 1;
        let workplace = model.node(&format!("workplace {number}"), None, None, at(x, 0.0, z).turned(turn));
        for (name, mesh, place) in &meshes {
            model.node(&format!("{name} {number}"), Some(workplace), Some(*mesh), place.clone());
        }
        let place = at(-0.12, 0.0, 0.72).turned(chair_turn);
        model.node(&format!("chair {number}"), Some(workplace), Some(chair), place);
    }
}

fn shelves(model: &mut Model, paints: &Paints) {
    let shelf = furniture::shelf(paints);
    let shelf = model.mesh("shelf", shelf.0);
    for (number, books) in BOOKS.iter().enumerate() {
        let place = at(1.2 + 1.05 * number as f64, 0.0, ROOM[2] - 0.17).turned(180.0);
        let name = format!("shelf {}", number + 1);
        let node = model.node(&name, None, Some(shelf), place);
        let books = furniture::books(paints, books, number as u64);
        let books = model.mesh(&format!("books {}", number + 1), books.0);
        model.node(&format!("books {}", number + 1), Some(node), Some(books), at(0.0, 0.0, 0.0));
    }
}

fn furnishings(model: &mut Model, paints: &Paints) {
    let [width, _, depth] = ROOM;
    let pieces = [
        ("cabinet", furniture::cabinet(paints), at(width - 0.24, 0.0, 3.6).turned(-90.0)),
        ("printer", furniture::printer(paints), at(width - 0.26, 0.78, 3.25).turned(-90.0)),
        ("whiteboard", furniture::whiteboard(paints), at(3.0, 1.0, 0.0)),
        ("picture", furniture::picture(paints), at(width, 1.25, 1.8).turned(-90.0)),
        ("clock", furniture::clock(paints), at(width, 2.1, 3.6).turned(-90.0)),
        ("coat stand", furniture::coat_stand(paints), at(width - 0.4, 0.0, depth - 0.45).turned(20.0)),
        ("plant", furniture::plant(paints), at(0.45, 0.0, 0.5).turned(12.0)),
    ];
    for (name, solid, place) in pieces {
        let mesh = model.mesh(name, solid.0);
        model.node(name, None, Some(mesh), place);
    }
    let basket = furniture::basket(paints);
    let basket = model.mesh("waste basket", basket.0);
    model.node("waste basket 1", None, Some(basket), at(0.95, 0.0, 2.0).turned(9.0));
    model.node("waste basket 2", None, Some(basket), at(4.95, 0.0, 3.1).turned(-31.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_office_has_the_numbers_of_the_paper() {
        let (patches, elements, margin) = model().count(SIZES.0, SIZES.1);
        assert_eq!((patches, elements), (4738, 17251));
        assert!(margin > 1e-4, "a length is too close to a multiple of a size: {margin}");
    }
}
