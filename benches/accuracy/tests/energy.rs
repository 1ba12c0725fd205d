//! Energy: what is sent out is absorbed, escapes or is left; nothing else.

use ringlight::scene::{Light, LightKind};
use ringlight_accuracy::scene::{Builder, meshed, solve};

fn room(builder: &mut Builder) {
    builder.cuboid([0.0; 3], [4.0, 3.0, 4.0], true, |b| b.material([0.7, 0.6, 0.5], [0.0; 3]));
}

fn lamp(range: f64) -> Light {
    let kind = LightKind::Point { position: [1.9, 2.1, 2.2], range };
    Light { name: "lamp".into(), intensity: [100.0, 90.0, 80.0], kind, node: 0 }
}

#[test]
fn a_room_with_a_lamp_and_a_box_on_the_floor_closes() {
    let mut builder = Builder::default();
    room(&mut builder);
    // It stands on the floor: its bottom and the floor below it face each other and have no light.
    builder.cuboid([1.0, 0.0, 1.0], [1.63, 0.7, 1.57], false, |b| b.material([0.3; 3], [0.0; 3]));
    let mut scene = builder.scene(true);
    scene.lights.push(lamp(f64::INFINITY));
    let scene = meshed(scene, 0.5, 0.25);
    let world = scene.world(16);
    let energy = solve(&world, 0.01).0.energy(&world);
    assert_eq!(energy.escaped, 0.0);
    assert!(energy.closure_error.abs() < 0.005, "{energy:?}");
}

#[test]
fn what_a_lamps_range_cuts_off_is_accounted_for() {
    let mut builder = Builder::default();
    room(&mut builder);
    let mut scene = builder.scene(true);
    scene.lights.push(lamp(2.5));
    let scene = meshed(scene, 0.5, 0.25);
    let world = scene.world(16);
    let energy = solve(&world, 0.01).0.energy(&world);
    assert!(energy.escaped > 0.1 * energy.emitted, "{energy:?}");
    assert!(energy.closure_error.abs() < 0.005, "{energy:?}");
}

#[test]
fn surfaces_that_lie_in_each_other_do_not_double_the_light() {
    let mut builder = Builder::default();
    room(&mut builder);
    // A bright plate in the ceiling's own plane, and a lamp just below: counted twice, light would grow between them.
    let plate = builder.material([0.95; 3], [0.0; 3]);
    let panel = builder.material([0.95; 3], [50.0; 3]);
    let rectangle = |y: f64| [[1.5, y, 1.5], [2.5, y, 1.5], [2.5, y, 2.5], [1.5, y, 2.5]];
    builder.face(&plate, &rectangle(3.0));
    builder.face(&panel, &rectangle(2.9));
    let scene = meshed(builder.scene(false), 0.5, 0.125);
    let world = scene.world(16);
    let energy = solve(&world, 0.01).0.energy(&world);
    assert!(energy.closure_error.abs() < 0.01, "{energy:?}");
    let covered = scene.mesh.valid.iter().filter(|&&v| v == 0).count();
    assert!(covered > 0, "the plate hides a part of the ceiling");
}

#[test]
fn rows_of_form_factors_close() {
    // Every surface shines alike and absorbs all: what arrives is the sum of all rows. One point for each element was
    // 5e-4 too bright.
    let mut builder = Builder::default();
    builder.cuboid([0.0; 3], [4.0; 3], true, |b| b.material([0.0; 3], [1.0; 3]));
    let room = meshed(builder.scene(true), 1.0, 0.25);
    let world = room.world(16);
    let energy = solve(&world, 0.0).0.energy(&world);
    assert!(energy.closure_error.abs() < 5e-5, "{energy:?}");
}
