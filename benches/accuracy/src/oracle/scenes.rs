//! Small scenes for the oracles: each shows one thing.

use crate::scene::{Builder, Meshed, Whole, meshed};
use ringlight::mesh::NONE;
use ringlight::scene::{Light, LightKind, Scene};
use ringlight::shooting::Shoot;
use ringlight::solve::{SolveSettings, Solver};
use std::ops::Range;

/// A scene with what it is solved with.
pub struct Case {
    /// What it shows.
    pub name: &'static str,
    /// Cut into patches and elements.
    pub scene: Meshed,
    /// Cells, sky, and what a patch shoots.
    pub settings: SolveSettings,
}

impl Case {
    /// What is solved.
    pub fn world(&self) -> Whole<'_> {
        self.scene.world_of(self.settings)
    }
}

fn settings(cells: u32, shoot: Shoot, sky: Option<[f32; 3]>) -> SolveSettings {
    SolveSettings { solver: Solver::Plain, cells, shoot, sky, shooters_in_flight: 1 }
}

/// All scenes.
pub fn all() -> Vec<Case> {
    let case = |name, scene, cells, shoot| Case { name, scene, settings: settings(cells, shoot, None) };
    // Three elements along a patch's edge do not divide evenly among two, four or eight cells.
    let cut = |scene: Scene| meshed(scene, 0.7, 0.25);
    vec![
        case("empty room", cut(room().scene(true)), 16, Shoot::Elements),
        case("empty room, averages shot", cut(room().scene(true)), 16, Shoot::Average),
        case("two boxes in a room", cut(boxes().scene(true)), 16, Shoot::Elements),
        case("two boxes in a room, averages shot", cut(boxes().scene(true)), 4, Shoot::Average),
        case("two rooms and a doorway", cut(rooms().scene(true)), 4, Shoot::Elements),
        case("double-sided screen", cut(screen()), 16, Shoot::Elements),
        case("triangles and a trapezium", cut(pyramid().scene(true)), 16, Shoot::Elements),
        case("a colour for every element", coloured(), 16, Shoot::Elements),
        case("box on the floor, plate in the ceiling", cut(covered().scene(true)), 16, Shoot::Elements),
        Case {
            name: "lamp, sun and sky",
            scene: cut(yard()),
            settings: settings(4, Shoot::Elements, Some([0.5, 0.7, 1.0])),
        },
    ]
}

const SIZE: [f64; 3] = [2.0, 1.6, 1.8];

/// A room of six colours; its ceiling (the upper y side) glows a little, one wall reflects nothing.
fn room() -> Builder {
    let mut builder = Builder::default();
    let mut side = 0;
    builder.cuboid([0.0; 3], SIZE, true, |b| {
        side += 1;
        let exitance = if side == 4 { [10.0, 8.0, 6.0] } else { [0.0; 3] };
        let reflectance = [[0.8, 0.3, 0.2], [0.2, 0.3, 0.8], [0.6; 3], [0.7; 3], [0.0; 3], [0.5, 0.7, 0.4]];
        b.material(reflectance[side - 1], exitance)
    });
    builder
}

fn boxes() -> Builder {
    let mut builder = room();
    builder.cuboid([0.3, 0.2, 0.4], [0.8, 1.0, 0.9], false, |b| b.material([0.7, 0.6, 0.2], [0.0; 3]));
    builder.cuboid([1.2, 0.4, 0.9], [1.7, 0.6, 1.5], false, |b| b.material([0.3, 0.6, 0.7], [3.0, 0.0, 1.0]));
    builder
}

/// A wall with a doorway between two halves; light in one of them only.
fn rooms() -> Builder {
    let mut builder = Builder::default();
    let mut side = 0;
    builder.cuboid([0.0; 3], SIZE, true, |b| {
        side += 1;
        b.material([0.7, 0.65, 0.6], if side == 1 { [10.0; 3] } else { [0.0; 3] })
    });
    // Two blocks from floor to ceiling leave a doorway; they reach a little into the walls.
    builder.cuboid([0.9, -0.1, -0.1], [1.1, 1.7, 0.6], false, |b| b.material([0.5, 0.6, 0.7], [0.0; 3]));
    builder.cuboid([0.9, -0.1, 1.1], [1.1, 1.7, 1.9], false, |b| b.material([0.5, 0.6, 0.7], [0.0; 3]));
    builder
}

fn screen() -> Scene {
    let mut builder = room();
    let screen = builder.material([0.4, 0.5, 0.6], [0.0, 2.0, 0.0]);
    builder.face(&screen, &[[0.5, 0.3, 0.4], [1.5, 0.3, 0.6], [1.5, 1.1, 0.6], [0.5, 1.1, 0.4]]);
    let mut scene = builder.scene(true);
    scene.materials.iter_mut().filter(|m| m.name == screen).for_each(|m| m.double_sided = true);
    scene
}

/// A pyramid without its tip: four trapezia, and triangles that hang over it.
fn pyramid() -> Builder {
    let mut builder = room();
    let material = builder.material([0.6, 0.5, 0.7], [0.0; 3]);
    let bottom = [[0.4, 0.3, 0.3], [1.6, 0.3, 0.3], [1.6, 0.3, 1.5], [0.4, 0.3, 1.5]];
    let top = [[0.8, 0.7, 0.7], [1.2, 0.7, 0.7], [1.2, 0.7, 1.1], [0.8, 0.7, 1.1]];
    for (i, j) in [(0, 1), (1, 2), (2, 3), (3, 0)] {
        builder.face(&material, &[top[i], top[j], bottom[j], bottom[i]]);
    }
    builder.face(&material, &[top[3], top[2], top[1], top[0]]);
    builder.face(&material, &bottom);
    let lamp = builder.material([0.5; 3], [0.0, 3.0, 6.0]);
    let (tip, [a, b, c]) = ([1.0, 1.4, 0.9], [[0.6, 1.1, 0.6], [1.5, 1.1, 0.8], [0.9, 1.1, 1.4]]);
    for corners in [[tip, b, a], [tip, c, b], [tip, a, c], [a, b, c]] {
        builder.face(&lamp, &corners);
    }
    builder
}

/// Reflectance and exitance that change from element to element, as textures give.
fn coloured() -> Meshed {
    let mut meshed = meshed(boxes().scene(true), 0.7, 0.25);
    let mesh = &mut meshed.mesh;
    for facet in &mut mesh.facets {
        assert_eq!(facet.colours, [NONE; 2], "OBJ without images has the colours of its materials");
        let plain = mesh.surface_colours[facet.surface as usize];
        facet.colours = [mesh.colours.len() as u32; 2];
        let Range { start, end } = facet.patch_range(false);
        for element in mesh.first_elements[start as usize]..mesh.first_elements[end as usize] {
            let mut colour = plain;
            for c in 0..3 {
                // Any pattern will do: the golden section spreads it over 0…1.
                let share = (f64::from(3 * element + c as u32) * 0.618_033_988_75).fract() as f32;
                colour.reflectance[c] *= share;
                colour.exitance[c] *= 1.0 - share;
            }
            mesh.colours.push(colour).unwrap();
        }
    }
    meshed
}

/// A box whose bottom and the floor hide parts of each other, and a plate in the ceiling's own plane.
fn covered() -> Builder {
    let mut builder = room();
    builder.cuboid([0.5, 0.0, 0.4], [1.13, 0.7, 0.97], false, |b| b.material([0.6, 0.7, 0.3], [0.0; 3]));
    let plate = builder.material([0.9; 3], [20.0, 10.0, 5.0]);
    builder.face(&plate, &[[0.7, 1.6, 0.6], [1.45, 1.6, 0.6], [1.45, 1.6, 1.35], [0.7, 1.6, 1.35]]);
    builder
}

/// A yard without a roof.
fn yard() -> Scene {
    let mut builder = Builder::default();
    let ground = builder.material([0.4, 0.5, 0.3], [0.0; 3]);
    builder.face(&ground, &[[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, 0.0]]);
    let wall = builder.material([0.7, 0.6, 0.6], [0.0; 3]);
    builder.face(&wall, &[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.2, 0.0], [0.0, 1.2, 0.0]]);
    builder.cuboid([0.6, 0.1, 0.7], [1.1, 0.8, 1.3], false, |b| b.material([0.7, 0.4, 0.3], [0.0; 3]));
    let mut scene = builder.scene(true);
    let mut light = |intensity, kind| {
        scene.lights.push(Light { name: "light".into(), intensity, kind, node: 0 });
    };
    light([5.0, 4.0, 3.0], LightKind::Point { position: [1.5, 1.0, 0.4], range: f64::INFINITY });
    let direction = glam::DVec3::new(-0.5, -1.0, -0.3).normalize().to_array();
    light([9.0, 9.0, 8.0], LightKind::Directional { direction });
    scene
}
