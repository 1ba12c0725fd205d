//! What each process keeps of a scene that is large for a test.

use super::run;
use super::workshop::Workshop;
use std::fmt::Write;

/// Closed boxes along x, y and z: 245,760 triangles in 122,880 squares.
const BOXES: [usize; 3] = [32, 32, 20];

/// Private memory of a process that keeps next to nothing, with room for MPI and packets, MiB.
const SMALL: f64 = 9.0;

/// Boxes of 1 m, a centimetre apart, so that light and rays stay near where they start; a lamp in the first.
fn boxes() -> String {
    let mut obj = String::from("mtllib box.mtl\nusemtl white\n");
    let [columns, rows, _] = BOXES;
    for number in 0..BOXES.iter().product() {
        let cell = [number % columns, number / columns % rows, number / columns / rows];
        for corner in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|axis| 1.01 * cell[axis] as f64 + f64::from(corner >> axis & 1));
            writeln!(obj, "v {x:.2} {y:.2} {z:.2}").unwrap();
        }
        obj += "f -8 -7 -5 -6\nf -4 -3 -1 -2\nf -8 -7 -3 -4\nf -6 -5 -1 -2\nf -8 -6 -2 -4\nf -7 -5 -1 -3\n";
    }
    obj + "usemtl lamp\nv 0.4 0.9 0.4\nv 0.6 0.9 0.4\nv 0.6 0.9 0.6\nv 0.4 0.9 0.6\nf -4 -3 -2 -1\n"
}

/// Peaks of private memory, MiB, of the ranks of a run.
fn peaks(workshop: &Workshop, ranks: usize) -> Vec<f64> {
    let bake = "bake boxes.obj -o boxes.ringlight --solver plain --patch-size 10 --element-size 10 --cells 1 --max-shots 1 --rings 1 \
                --threads 1 --scratch . --report boxes.json --force";
    let (code, words) = run(workshop, ranks, bake);
    assert_eq!(code, Some(0), "{words}");
    let report = workshop.json("boxes.json");
    let peak = |rank: &serde_json::Value| rank["peak_memory_bytes"].as_f64().unwrap() / f64::from(1 << 20);
    report["ranks"].as_array().unwrap().iter().map(peak).collect()
}

/// What `inspect` foretells of each of so many ranks in one ring, MiB.
fn foretold(workshop: &Workshop, ranks: u64) -> f64 {
    let inspect = "inspect boxes.obj --solver plain --patch-size 10 --element-size 10 --cells 1 --scratch . --rays-per-second 1e6 --json";
    let run = workshop.ringlight(inspect).assert().code(0);
    let inspection: serde_json::Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    let memory = inspection["memory_per_rank"].as_array().unwrap();
    let of_these = |memory: &&serde_json::Value| memory["ranks"] == ranks && memory["rings"] == 1;
    memory.iter().find(of_these).unwrap()["bytes"].as_f64().unwrap() / f64::from(1 << 20)
}

/// Geometry, mesh or light that every rank held, or that one gathered while geometry is held, would be above the bound.
#[test]
fn each_of_four_ranks_keeps_about_a_quarter() {
    let workshop = Workshop::new();
    workshop.put("boxes.obj", boxes());
    let alone = peaks(&workshop, 1)[0];
    let solution = workshop.bytes("boxes.ringlight");
    let many = peaks(&workshop, 4);
    println!("{alone:.1} MiB alone, {many:.1?} MiB of four");
    assert!(alone > 3.0 * SMALL, "the scene is too small to tell: {alone} MiB");
    assert!(many.iter().all(|&peak| peak <= 1.3 * alone / 4.0 + SMALL), "{alone} MiB alone, {many:?} MiB of four");
    assert!(workshop.bytes("boxes.ringlight") == solution);
    let (foretold, most) = (foretold(&workshop, 4), many.iter().copied().fold(0.0, f64::max));
    println!("{foretold:.1} MiB were foretold of each");
    assert!((most..1.7 * most).contains(&foretold), "{foretold} MiB foretold, {many:?} MiB of four");
}
