//! The pieces of the office: each stands on y = 0 (hangs from it or on a wall where it says so), its front towards +z.

use super::model::{Dice, Model, Paint, Solid};
use glam::{DQuat, DVec3};

/// The materials of the office.
pub struct Paints {
    pub wall: Paint,
    pub accent: Paint,
    pub ceiling: Paint,
    pub carpet: Paint,
    pub white: Paint,
    pub beech: Paint,
    pub steel: Paint,
    pub black: Paint,
    pub fabric: Paint,
    pub paper: Paint,
    pub leaf: Paint,
    pub clay: Paint,
    pub night: Paint,
    pub diffuser: Paint,
    pub display: Paint,
    pub covers: [Paint; 6],
}

impl Paints {
    /// Adds the materials to `model`.
    pub fn new(model: &mut Model, luminance: f64) -> Paints {
        Paints {
            wall: model.paint("wall paint", [0.68, 0.66, 0.6]),
            accent: model.paint("accent wall", [0.22, 0.42, 0.4]),
            ceiling: model.paint("ceiling tiles", [0.8, 0.8, 0.78]),
            carpet: model.paint("carpet", [0.2, 0.22, 0.25]),
            white: model.paint("white lacquer", [0.75, 0.75, 0.73]),
            beech: model.paint("beech", [0.52, 0.36, 0.2]),
            steel: model.paint("steel", [0.42, 0.43, 0.44]),
            black: model.paint("black plastic", [0.04, 0.04, 0.045]),
            fabric: model.paint("blue fabric", [0.07, 0.13, 0.3]),
            paper: model.paint("paper", [0.82, 0.82, 0.8]),
            leaf: model.paint("leaf", [0.09, 0.24, 0.06]),
            clay: model.paint("clay", [0.45, 0.2, 0.11]),
            night: model.paint("window at night", [0.05, 0.06, 0.08]),
            diffuser: model.light("diffuser", [0.7, 0.7, 0.7], [1.0, 0.96, 0.9], luminance),
            display: model.light("display", [0.04, 0.04, 0.04], [0.85, 0.93, 1.0], 180.0),
            covers: [
                ("red cover", [0.46, 0.06, 0.05]),
                ("green cover", [0.07, 0.25, 0.12]),
                ("navy cover", [0.05, 0.08, 0.24]),
                ("yellow cover", [0.66, 0.48, 0.08]),
                ("cream cover", [0.7, 0.64, 0.5]),
                ("grey cover", [0.25, 0.25, 0.27]),
            ]
            .map(|(name, colour)| model.paint(name, colour)),
        }
    }
}

/// 1.6 m × 0.8 m, 0.74 m high, on four legs, with a modesty panel.
pub fn desk(paints: &Paints) -> Solid {
    let mut desk = Solid::default();
    desk.block(paints.beech, [-0.8, 0.715, -0.4], [0.8, 0.74, 0.4]);
    for x in [-0.77, 0.71] {
        for z in [-0.37, 0.31] {
            desk.block(paints.steel, [x, 0.0, z], [x + 0.06, 0.715, z + 0.06]);
        }
    }
    desk.block(paints.white, [-0.71, 0.34, -0.35], [0.71, 0.715, -0.33]);
    desk
}

/// Three drawers under a desk.
pub fn pedestal(paints: &Paints) -> Solid {
    let mut pedestal = Solid::default();
    pedestal.block(paints.white, [-0.21, 0.0, -0.28], [0.21, 0.57, 0.27]);
    for (low, high) in [(0.02, 0.25), (0.255, 0.41), (0.415, 0.56)] {
        pedestal.block(paints.beech, [-0.205, low, 0.27], [0.205, high, 0.288]);
        pedestal.block(paints.steel, [-0.06, high - 0.045, 0.288], [0.06, high - 0.033, 0.308]);
    }
    pedestal
}

/// A screen on its foot; it is on.
pub fn screen(paints: &Paints) -> Solid {
    let mut screen = Solid::default();
    screen.block(paints.black, [-0.13, 0.0, -0.1], [0.13, 0.012, 0.1]);
    screen.block(paints.black, [-0.03, 0.012, -0.055], [0.03, 0.34, -0.03]);
    let tilt = DQuat::from_rotation_x(-0.12);
    screen.turned_block(paints.black, DVec3::new(0.0, 0.33, 0.0), DVec3::new(0.55, 0.33, 0.03), tilt);
    let front = DVec3::new(0.0, 0.33, 0.0) + tilt * (DVec3::Z * 0.0165);
    screen.turned_block(paints.black, front, DVec3::new(0.53, 0.31, 0.003), tilt)[5].paint = paints.display;
    screen
}

/// Keyboard, mouse, mug and a pile of paper.
pub fn desk_things(paints: &Paints) -> Solid {
    let mut things = Solid::default();
    things.block(paints.black, [-0.22, 0.0, 0.13], [0.22, 0.02, 0.27]);
    things.block(paints.black, [0.3, 0.0, 0.16], [0.36, 0.03, 0.26]);
    things.turned_block(
        paints.covers[3],
        DVec3::new(0.52, 0.048, -0.14),
        DVec3::new(0.075, 0.096, 0.075),
        DQuat::from_rotation_y(0.5),
    );
    things.turned_block(
        paints.paper,
        DVec3::new(-0.46, 0.009, 0.16),
        DVec3::new(0.21, 0.018, 0.297),
        DQuat::from_rotation_y(0.2),
    );
    things
}

/// A swivel chair on five feet.
pub fn chair(paints: &Paints) -> Solid {
    let mut chair = Solid::default();
    for foot in 0..5 {
        let turn = DQuat::from_rotation_y((90.0 + 72.0 * f64::from(foot)).to_radians());
        let arm = turn * (DVec3::X * 0.16) + DVec3::Y * 0.075;
        chair.turned_block(paints.steel, arm, DVec3::new(0.32, 0.03, 0.045), turn);
        let caster = turn * (DVec3::X * 0.29) + DVec3::Y * 0.03;
        chair.turned_block(paints.black, caster, DVec3::new(0.05, 0.06, 0.035), turn);
    }
    chair.block(paints.steel, [-0.025, 0.09, -0.025], [0.025, 0.41, 0.025]);
    chair.block(paints.fabric, [-0.24, 0.41, -0.23], [0.24, 0.48, 0.22]);
    chair.block(paints.steel, [-0.03, 0.44, 0.22], [0.03, 0.66, 0.245]);
    let tilt = DQuat::from_rotation_x(0.17);
    chair.turned_block(paints.fabric, DVec3::new(0.0, 0.82, 0.285), DVec3::new(0.44, 0.5, 0.05), tilt);
    for side in [-1.0, 1.0] {
        let x = 0.265 * side;
        chair.block(paints.steel, [x - 0.02, 0.43, -0.06], [x + 0.02, 0.63, 0.06]);
        chair.block(paints.black, [x - 0.03, 0.63, -0.12], [x + 0.03, 0.66, 0.14]);
    }
    chair
}

/// Tops of the boards of a shelf.
const BOARDS: [f64; 5] = [0.08, 0.46, 0.84, 1.22, 1.6];

/// 1 m wide, 0.32 m deep, 2 m high, with five boards and a back.
pub fn shelf(paints: &Paints) -> Solid {
    let mut shelf = Solid::default();
    for x in [-0.5, 0.48] {
        shelf.block(paints.beech, [x, 0.0, -0.15], [x + 0.02, 2.0, 0.17]);
    }
    shelf.block(paints.beech, [-0.48, 0.0, -0.15], [0.48, 2.0, -0.14]);
    for top in BOARDS.into_iter().chain([2.0]) {
        shelf.block(paints.beech, [-0.48, top - 0.02, -0.14], [0.48, top, 0.16]);
    }
    shelf.block(paints.beech, [-0.48, 0.0, 0.12], [0.48, 0.06, 0.14]);
    shelf
}

/// How far the last book of a row leans, in radians.
const LEAN: f64 = 0.3;

/// Books on the boards of a shelf, `counts` on each, from the left; the last of a row leans if there is room.
pub fn books(paints: &Paints, counts: &[usize; 5], shelf: u64) -> Solid {
    let mut books = Solid::default();
    for (row, (&count, board)) in counts.iter().zip(BOARDS).enumerate() {
        let mut dice = Dice(shelf * 5 + row as u64);
        let mut x = -0.48 + 0.002;
        for _ in 0..count {
            let size = [dice.millimetres(18, 48), dice.millimetres(205, 312), dice.millimetres(148, 226)];
            let paint = paints.covers[dice.below(6) as usize];
            let gap = dice.millimetres(0, 2);
            let depth = dice.millimetres(0, 30);
            if x + size[0] > 0.478 {
                break;
            }
            let low = [x, board, 0.13 - depth - size[2]];
            books.block(paint, low, [low[0] + size[0], low[1] + size[1], low[2] + size[2]]);
            x += size[0] + gap;
        }
        let size = DVec3::new(dice.millimetres(18, 35), dice.millimetres(170, 200), dice.millimetres(148, 200));
        let (sine, cosine) = LEAN.sin_cos();
        if count > 0 && x + size.x * cosine + size.y * sine < 0.47 {
            // Its lower left edge stands on the board, its upper left edge touches the book before it.
            let foot = DVec3::new(x + size.y * sine, board, 0.02);
            let centre = DVec3::new(size.x * cosine - size.y * sine, size.x * sine + size.y * cosine, 0.0) / 2.0;
            let paint = paints.covers[dice.below(6) as usize];
            books.turned_block(paint, foot + centre, size, DQuat::from_rotation_z(LEAN));
        }
    }
    books
}

/// A low cabinet with two doors.
pub fn cabinet(paints: &Paints) -> Solid {
    let mut cabinet = Solid::default();
    cabinet.block(paints.black, [-0.77, 0.0, -0.2], [0.77, 0.06, 0.17]);
    cabinet.block(paints.white, [-0.8, 0.06, -0.225], [0.8, 0.76, 0.2]);
    cabinet.block(paints.beech, [-0.81, 0.76, -0.225], [0.81, 0.78, 0.225]);
    for (left, handle) in [(-0.795, -0.06), (0.003, 0.045)] {
        cabinet.block(paints.white, [left, 0.07, 0.2], [left + 0.792, 0.75, 0.218]);
        cabinet.block(paints.steel, [handle, 0.5, 0.218], [handle + 0.015, 0.66, 0.24]);
    }
    cabinet
}

/// A printer with paper in its tray; stands on y = 0.
pub fn printer(paints: &Paints) -> Solid {
    let mut printer = Solid::default();
    printer.block(paints.white, [-0.22, 0.0, -0.19], [0.22, 0.24, 0.19]);
    printer.block(paints.black, [-0.16, 0.24, -0.13], [0.16, 0.265, 0.1]);
    printer.block(paints.black, [-0.14, 0.06, 0.19], [0.14, 0.07, 0.29]);
    printer.block(paints.paper, [-0.105, 0.07, 0.19], [0.105, 0.078, 0.28]);
    printer
}

/// A whiteboard with a tray and a pen; hangs on a wall at z = 0, its lower edge at y = 0.
pub fn whiteboard(paints: &Paints) -> Solid {
    let mut board = Solid::default();
    board.block(paints.steel, [-0.9, 0.0, 0.0], [0.9, 1.1, 0.018]);
    board.block(paints.paper, [-0.88, 0.02, 0.018], [0.88, 1.08, 0.02]);
    board.block(paints.steel, [-0.4, 0.0, 0.018], [0.4, 0.012, 0.08]);
    board.block(paints.covers[0], [0.1, 0.012, 0.04], [0.23, 0.026, 0.055]);
    board
}

/// A framed picture of two colours; hangs on a wall at z = 0.
pub fn picture(paints: &Paints) -> Solid {
    let mut picture = Solid::default();
    picture.block(paints.black, [-0.36, 0.0, 0.0], [0.36, 0.94, 0.024]);
    picture.block(paints.paper, [-0.34, 0.02, 0.024], [0.34, 0.92, 0.026]);
    picture.block(paints.covers[0], [-0.24, 0.5, 0.026], [0.24, 0.83, 0.027]);
    picture.block(paints.covers[2], [-0.24, 0.12, 0.026], [0.24, 0.47, 0.027]);
    picture
}

/// A square clock; hangs on a wall at z = 0.
pub fn clock(paints: &Paints) -> Solid {
    let mut clock = Solid::default();
    clock.block(paints.black, [-0.15, 0.0, 0.0], [0.15, 0.3, 0.035]);
    clock.block(paints.paper, [-0.14, 0.01, 0.035], [0.14, 0.29, 0.037]);
    clock.block(paints.black, [-0.006, 0.15, 0.037], [0.006, 0.265, 0.04]);
    clock.block(paints.black, [0.006, 0.145, 0.037], [0.085, 0.157, 0.04]);
    clock
}

/// A pole with hooks and a coat.
pub fn coat_stand(paints: &Paints) -> Solid {
    let mut stand = Solid::default();
    stand.block(paints.steel, [-0.2, 0.0, -0.2], [0.2, 0.025, 0.2]);
    stand.block(paints.steel, [-0.02, 0.025, -0.02], [0.02, 1.75, 0.02]);
    stand.block(paints.steel, [-0.16, 1.6, -0.012], [0.16, 1.625, 0.012]);
    stand.block(paints.steel, [-0.012, 1.5, -0.16], [0.012, 1.525, 0.16]);
    stand.block(paints.covers[5], [-0.15, 0.7, 0.05], [0.15, 1.53, 0.13]);
    stand
}

/// A plant in a pot.
pub fn plant(paints: &Paints) -> Solid {
    let mut plant = Solid::default();
    plant.block(paints.clay, [-0.16, 0.0, -0.16], [0.16, 0.34, 0.16]);
    plant.block(paints.black, [-0.14, 0.34, -0.14], [0.14, 0.345, 0.14]);
    plant.block(paints.leaf, [-0.012, 0.345, -0.012], [0.012, 1.3, 0.012]);
    for leaf in 0..14 {
        let leaf = f64::from(leaf);
        let turn = DQuat::from_rotation_y(2.4 * leaf) * DQuat::from_rotation_z(0.35 + 0.03 * leaf);
        let length = 0.36 - 0.014 * leaf;
        let centre = DVec3::Y * (0.62 + 0.05 * leaf) + turn * (DVec3::X * (length / 2.0 + 0.01));
        plant.turned_block(paints.leaf, centre, DVec3::new(length, 0.004, 0.085), turn);
    }
    plant
}

/// An open box of four thin sides and a bottom.
pub fn basket(paints: &Paints) -> Solid {
    let mut basket = Solid::default();
    basket.block(paints.steel, [-0.14, 0.0, -0.14], [0.14, 0.008, 0.14]);
    for [low, high] in [[-0.14, -0.132], [0.132, 0.14]] {
        basket.block(paints.steel, [low, 0.008, -0.14], [high, 0.33, 0.14]);
        basket.block(paints.steel, [-0.132, 0.008, low], [0.132, 0.33, high]);
    }
    basket.turned_block(
        paints.paper,
        DVec3::new(0.02, 0.053, -0.01),
        DVec3::new(0.12, 0.09, 0.11),
        DQuat::from_rotation_y(0.7),
    );
    basket
}
