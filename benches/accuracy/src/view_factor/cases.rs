//! Pairs of polygons with occluders between them, of all kinds: what `obstructed_view_factors` is measured on.

use glam::DVec3;

/// A pair of polygons and what may stand between them.
#[derive(Clone, Debug)]
pub struct Case {
    /// What it is.
    pub name: String,
    /// Corners of the two polygons, metres.
    pub pair: [Vec<DVec3>; 2],
    /// Triangles, metres.
    pub occluders: Vec<[DVec3; 3]>,
}

/// Random numbers, always the same.
struct Random(u64);

impl Random {
    /// In 0…1.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In the cube between two corners.
    fn within(&mut self, low: [f64; 3], high: [f64; 3]) -> DVec3 {
        DVec3::from([0, 1, 2].map(|i| low[i] + (high[i] - low[i]) * self.unit()))
    }
}

fn points<const N: usize>(corners: [[f64; 3]; N]) -> Vec<DVec3> {
    corners.into_iter().map(DVec3::from).collect()
}

/// Two triangles of a parallelogram.
fn panel(origin: [f64; 3], u: [f64; 3], v: [f64; 3]) -> Vec<[DVec3; 3]> {
    let [o, u, v] = [origin, u, v].map(DVec3::from);
    vec![[o, o + u, o + u + v], [o, o + u + v, o + v]]
}

/// Twelve triangles of a box turned about the vertical axis through its centre.
fn cuboid(low: [f64; 3], high: [f64; 3], degrees: f64) -> Vec<[DVec3; 3]> {
    let (low, high) = (DVec3::from(low), DVec3::from(high));
    let centre = low.midpoint(high);
    let turn = glam::DQuat::from_rotation_z(degrees.to_radians());
    let corner = |k: usize| {
        let pick = |i: usize| if k >> i & 1 == 1 { high[i] } else { low[i] };
        centre + turn * (DVec3::new(pick(0), pick(1), pick(2)) - centre)
    };
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        .into_iter()
        .flat_map(|[p, q, r, s]| [[corner(p), corner(q), corner(r)], [corner(p), corner(r), corner(s)]])
        .collect()
}

/// A wall at height `z` over x and y in −3…4, with a rectangular hole.
fn wall_with_hole(z: f64, [x0, x1]: [f64; 2], [y0, y1]: [f64; 2]) -> Vec<[DVec3; 3]> {
    [
        panel([-3., -3., z], [3. + x0, 0., 0.], [0., 7., 0.]),
        panel([x1, -3., z], [4. - x1, 0., 0.], [0., 7., 0.]),
        panel([x0, -3., z], [x1 - x0, 0., 0.], [0., 3. + y0, 0.]),
        panel([x0, y1, z], [x1 - x0, 0., 0.], [0., 4. - y1, 0.]),
    ]
    .concat()
}

/// Unit square z = 0, facing up.
fn floor() -> Vec<DVec3> {
    points([[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]])
}

/// Unit square at this height, facing down.
fn ceiling(z: f64) -> Vec<DVec3> {
    points([[0., 0., z], [0., 1., z], [1., 1., z], [1., 0., z]])
}

/// Unit square x = 0, facing +x; meets the floor in a common edge.
fn side() -> Vec<DVec3> {
    points([[0., 0., 0.], [0., 1., 0.], [0., 1., 1.], [0., 0., 1.]])
}

/// All cases.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let mut add = |name: &str, a: Vec<DVec3>, b: Vec<DVec3>, occluders: Vec<[DVec3; 3]>| {
        cases.push(Case { name: name.into(), pair: [a, b], occluders });
    };
    // Squares that face each other.
    let (x, y) = ([1., 0., 0.], [0., 1., 0.]);
    let half = |v: [f64; 3]| v.map(|c| 0.5 * c);
    add("half screen, halfway", floor(), ceiling(1.), panel([0., 0., 0.5], half(x), y));
    add("half screen, nearer", floor(), ceiling(1.), panel([0., 0., 0.2], half(x), y));
    add("half screen, close to one", floor(), ceiling(1.), panel([0., 0., 0.01], half(x), y));
    add("quarter screen of View3D's square obstruction", floor(), ceiling(1.), panel([0., 0., 0.5], half(x), half(y)));
    add("screen in the middle", floor(), ceiling(1.), panel([0.3, 0.3, 0.5], [0.4, 0., 0.], [0., 0.4, 0.]));
    add("almost all hidden", floor(), ceiling(1.), panel([0.02, 0.02, 0.5], [0.97, 0., 0.], [0., 0.97, 0.]));
    add(
        "screen larger than the view, through the middle",
        floor(),
        ceiling(1.),
        panel([-5., -5., 0.5], [5.4, 0., 0.], [0., 10., 0.]),
    );
    add(
        "tilted screen larger than the view",
        floor(),
        ceiling(1.),
        panel([0.5, -5., -1.], [1., 0., 3.], [0., 10., 0.]),
    );
    add("upright screen from plane to plane", floor(), ceiling(1.), panel([0.4, -1., 0.], [0., 3., 0.], [0., 0., 1.]));
    add("upright screen on one", floor(), ceiling(1.), panel([0.4, 0.2, 0.], [0.1, 0.5, 0.], [0., 0., 0.6]));
    add("box between", floor(), ceiling(1.), cuboid([0.3, 0.2, 0.3], [0.6, 0.7, 0.6], 0.));
    add("turned box between", floor(), ceiling(1.), cuboid([0.3, 0.2, 0.3], [0.6, 0.7, 0.6], 25.));
    add("box standing on one", floor(), ceiling(1.), cuboid([0.3, 0.2, 0.0], [0.6, 0.7, 0.6], 10.));
    add("box from one to the other", floor(), ceiling(1.), cuboid([0.3, 0.2, 0.0], [0.6, 0.7, 1.0], 10.));
    add("small box standing on one", floor(), ceiling(1.), cuboid([0.45, 0.45, 0.0], [0.55, 0.55, 0.1], 30.));
    add("far squares, box between", floor(), ceiling(8.), cuboid([0.3, -0.2, 3.0], [0.6, 0.7, 4.0], 15.));
    for (name, count, tilt, width) in [
        ("flat slats", 5, 0.0, 0.1),
        ("tilted slats", 6, 0.08, 0.08),
        ("steep slats", 10, 0.1, 0.02),
        ("thin bars", 4, 0.0, 0.01),
    ] {
        let slats = (0..count)
            .flat_map(|i| panel([-1., (f64::from(i) + 0.4) / f64::from(count), 0.45], [3., 0., 0.], [0., width, tilt]));
        add(name, floor(), ceiling(1.), slats.collect());
    }
    add("crossed thin bars", floor(), ceiling(1.), {
        let bars = [0.2, 0.5, 0.8].map(|t| {
            [panel([t, -1., 0.3], [0.005, 0., 0.], [0., 3., 0.]), panel([-1., t, 0.7], [0., 0.005, 0.], [3., 0., 0.])]
                .concat()
        });
        bars.concat()
    });
    add("window in a wall", floor(), ceiling(1.), wall_with_hole(0.6, [0.2, 0.5], [0.3, 0.9]));
    add("slit in a wall", floor(), ceiling(1.), wall_with_hole(0.5, [0.49, 0.51], [0.0, 1.0]));
    add("two walls with windows", floor(), ceiling(2.), {
        [wall_with_hole(0.6, [0.2, 0.5], [0.3, 0.9]), wall_with_hole(1.2, [0.3, 0.8], [0.1, 0.7])].concat()
    });
    // Squares with a common edge.
    add("common edge, box on the floor", floor(), side(), cuboid([0.2, 0.3, 0.0], [0.5, 0.7, 0.4], 20.));
    add("common edge, box in the corner", floor(), side(), cuboid([0.0, 0.3, 0.0], [0.3, 0.6, 0.2], 0.));
    add("common edge, upright panel along it", floor(), side(), panel([0.05, 0., 0.], y, [0., 0., 0.3]));
    add("common edge, shelf", floor(), side(), panel([0., 0., 0.3], y, [0.4, 0., 0.]));
    add("common edge, gable across it", floor(), side(), panel([0., 0.4, 0.], x, [0., 0., 1.]));
    add("common edge, thin bars", floor(), side(), {
        (0..4).flat_map(|i| panel([0.1 + 0.2 * f64::from(i), -1., 0.2], [0.01, 0., 0.01], [0., 3., 0.])).collect()
    });
    // Of different sizes; needles; triangles; partly behind each other's plane.
    let patch = points([[0.4, 0.4, 0.], [0.45, 0.4, 0.], [0.45, 0.45, 0.], [0.4, 0.45, 0.]]);
    add(
        "small and large, box between",
        patch.clone(),
        points([[-3., -3., 2.], [-3., 4., 2.], [4., 4., 2.], [4., -3., 2.]]),
        cuboid([0., 0., 0.5], [0.6, 0.5, 0.9], 40.),
    );
    add(
        "small and large, box beside the small one",
        patch,
        points([[-3., -3., 2.], [-3., 4., 2.], [4., 4., 2.], [4., -3., 2.]]),
        cuboid([0.46, 0.3, 0.0], [0.6, 0.5, 0.3], 0.),
    );
    let needle = points([[0., 0.5, 0.], [1., 0.5, 0.], [1., 0.502, 0.], [0., 0.502, 0.]]);
    add("needle and square, turned box", needle, ceiling(0.7), cuboid([0.3, 0.2, 0.2], [0.6, 0.7, 0.4], 25.));
    let leaning = points([[0.3, -0.5, -0.4], [0.9, 1.2, -0.3], [0.1, 0.6, 1.1]]);
    add("leaning triangle through the plane, box", floor(), leaning, cuboid([0.5, 0.3, 0.1], [0.8, 0.6, 0.3], 10.));
    // Anything.
    for seed in 0..12 {
        let mut random = Random(1000 + seed);
        let triangles = 1 + 2 * seed as usize;
        let size = 1.2 / (triangles as f64).sqrt();
        let occluders = (0..triangles).map(|_| {
            let centre = random.within([-0.2, -0.2, 0.0], [1.2, 1.2, 1.0]);
            [(); 3].map(|()| centre + size * random.within([-0.5; 3], [0.5; 3]))
        });
        let occluders = occluders.collect();
        let lift = random.within([-0.3, -0.3, 0.8], [0.3, 0.3, 1.2]);
        let tilt = glam::DQuat::from_scaled_axis(random.within([-0.6; 3], [0.6; 3]));
        let above = ceiling(0.).into_iter().map(|c| lift + tilt * c).collect();
        add(&format!("{triangles} random triangles"), floor(), above, occluders);
    }
    cases
}
