//! Balance of simulated members, whose times are known functions of what they hold.

use super::{Balance, Load, Moves, Window, rank_correlation};
use crate::ring::memory::most_held;
use crate::ring::{Bounds, Piece, Shards, deal};
use std::sync::Arc;

/// A grid of pieces, which differ in size.
fn pieces() -> Arc<[Piece]> {
    let piece = |i: u32| {
        let low = [i % 10, i / 10 % 10, i / 100].map(|c| c as f32);
        Piece { bounds: Bounds { low, high: low.map(|c| c + 1.0) }, triangles: 20 + i * 7 % 24, plane: i }
    };
    (0..700).map(piece).collect()
}

/// Numbers between -1 and 1 that look random.
fn noise(i: u64) -> f64 {
    super::scatter(i) as f64 / (1u64 << 63) as f64 - 1.0
}

/// All at one member, or in proportion 1 : 2 : 3 : …
fn worst(pieces: &[Piece], members: usize) -> [Vec<u32>; 2] {
    let last: Vec<usize> = (1..=members).map(|m| m * (m + 1) / 2).collect();
    let parts = deal(pieces, last[members - 1], Shards::Random);
    let ramp = parts.iter().map(|&part| last.partition_point(|&last| last <= part as usize) as u32).collect();
    [vec![members as u32 - 1; pieces.len()], ramp]
}

/// Runs so many windows in which a shot takes a member `cost` of what it holds, seconds, give or take a twentieth; gives the
/// time of all shots and builds as well.
fn simulate(balance: &mut Balance, windows: usize, cost: impl Fn(&[u32], usize) -> f64) -> f64 {
    let (mut shot, mut time) = (0, 0.0);
    while balance.windows().len() < windows {
        let mut sum = vec![Load::default(); balance.members];
        let pause = balance.pause();
        for _ in 0..pause {
            shot += 1;
            for (m, sum) in sum.iter_mut().enumerate() {
                let chance = 1.0 + 0.05 * noise(shot << 8 | m as u64);
                let testing = chance * cost(balance.holders(), m);
                *sum = *sum + Load { testing, other: 2e-4 + 1e-5 * m as f64, points: 1000 };
            }
        }
        time += sum.iter().map(Load::busy).fold(0.0, f64::max);
        if balance.add(pause, &sum) {
            // The largest shard at half a microsecond a triangle.
            time +=
                (0..balance.members).map(|m| 0.5e-6 * held(&balance.pieces, balance.holders(), m)).fold(0.0, f64::max);
        }
    }
    time
}

fn held(pieces: &[Piece], holders: &[u32], member: usize) -> f64 {
    pieces.iter().zip(holders).filter(|(_, m)| **m as usize == member).map(|(p, _)| f64::from(p.triangles)).sum()
}

fn balances(windows: &[Window]) -> Vec<f64> {
    windows.iter().map(|window| window.balance).collect()
}

#[test]
fn the_worst_starts_are_balanced_soon() {
    let pieces = pieces();
    // One piece in thirty is where the rays pass.
    let hot = |piece: usize| if piece.is_multiple_of(30) { 15.0 } else { 1.0 };
    let weight = |holders: &[u32], member: usize| -> f64 {
        let own = holders.iter().enumerate().filter(|(_, m)| **m as usize == member);
        own.map(|(piece, _)| hot(piece) * f64::from(pieces[piece].triangles)).sum()
    };
    let triangles = |holders: &[u32], member: usize| held(&pieces, holders, member);
    type Cost<'a> = Box<dyn Fn(&[u32], usize) -> f64 + 'a>;
    let costs: [(&str, Cost); 4] = [
        ("linear", Box::new(|holders, m| 1e-6 * triangles(holders, m))),
        ("root", Box::new(|holders, m| 1e-4 + 8e-5 * triangles(holders, m).sqrt())),
        ("logarithm", Box::new(|holders, m| 3e-4 * (1.0 + triangles(holders, m) / 100.0).log2())),
        ("hot pieces", Box::new(|holders, m| 1e-4 + 5e-5 * weight(holders, m).sqrt())),
    ];
    for members in [4, 8] {
        for (name, cost) in &costs {
            for start in worst(&pieces, members) {
                let mut balance = Balance::new(pieces.clone(), start, members, Shards::Random, Moves::Balanced);
                simulate(&mut balance, 16, cost);
                let found = balances(balance.windows());
                assert!(found[0] < 0.75, "{name}: {found:?}");
                assert!(found[3] >= 0.8 && found[10..].iter().all(|&b| b >= 0.9), "{members}, {name}: {found:?}");
            }
        }
    }
}

/// Nearly all packets come to a few pieces: by time alone, those who do not hold these had to hold nearly all others.
#[test]
fn nobody_holds_more_than_memory_was_foretold_for() {
    let pieces: Arc<[Piece]> = pieces().iter().map(|p| Piece { triangles: 100 * p.triangles, ..*p }).collect();
    let all: u64 = pieces.iter().map(|p| u64::from(p.triangles)).sum();
    let most = most_held(all, 8);
    assert!(most < all / 4);
    let hot = |piece: usize| if piece < 70 { 1.0 } else { 0.03 };
    for shards in [Shards::Spatial, Shards::Random] {
        let start = deal(&pieces, 8, shards);
        let mut balance = Balance::new(pieces.clone(), start.clone(), 8, shards, Moves::Balanced);
        let (mut largest, mut moves) = (0, 0);
        for windows in 1..20 {
            simulate(&mut balance, windows, |holders, member| {
                let own = holders.iter().enumerate().filter(|(_, m)| **m as usize == member);
                4e-4 * own.map(|(piece, _)| hot(piece) * f64::from(pieces[piece].triangles)).sum::<f64>().sqrt()
            });
            moves += balance.windows()[windows - 1].moved;
            let held = (0..8).map(|m| held(&pieces, balance.holders(), m) as u64).max().unwrap();
            largest = largest.max(held);
        }
        assert!(moves > 0 && largest <= most, "{largest} of {most}, {shards:?}");
    }
}

#[test]
fn compact_shards_stay_compact_and_get_faster() {
    let pieces = pieces();
    // The lower the pieces are, the more packets come.
    let weight = |p: &Piece| f64::from(p.triangles) * (-0.5 * f64::from(p.bounds.low[2])).exp();
    let cost = |holders: &[u32], member: usize| {
        let own = pieces.iter().zip(holders).filter(|(_, m)| **m as usize == member);
        4e-5 * own.map(|(p, _)| weight(p)).sum::<f64>().powf(0.7)
    };
    let run = |moves| {
        let start = deal(&pieces, 8, Shards::Spatial);
        let mut balance = Balance::new(pieces.clone(), start, 8, Shards::Spatial, moves);
        let time = simulate(&mut balance, 12, cost);
        // Seconds for a shot, so that numbers of shots do not matter.
        (time / balance.shots as f64, balance)
    };
    let (still, _) = run(Moves::Never);
    let (moving, balance) = run(Moves::Balanced);
    assert!(moving < 0.9 * still, "{moving} {still}");
    let found = balances(balance.windows());
    assert!(found[8..].iter().all(|&b| b >= 0.85), "{found:?}");
    let extent = |holders: &[u32]| -> f32 {
        let of = |m| pieces.iter().zip(holders).filter(move |(_, h)| **h == m).map(|(p, _)| p.bounds);
        (0..8)
            .map(|m| of(m).fold(Bounds::EMPTY, Bounds::join))
            .map(|b| (b.high[0] - b.low[0]) * (b.high[1] - b.low[1]))
            .sum()
    };
    // Boxes may overlap by a piece where a cut passes.
    assert!(extent(balance.holders()) <= 8.0 * 60.0, "{}", extent(balance.holders()));
}

#[test]
fn moves_for_the_worse_are_taken_back_and_become_rare() {
    let pieces = pieces();
    let start = worst(&pieces, 8)[1].clone();
    // Whatever is done about it makes it worse.
    let cost = |holders: &[u32], member: usize| {
        (if holders == start { 1.0 } else { 2.0 }) * (1e-4 + 8e-5 * held(&pieces, &start, member).sqrt())
    };
    let run = |moves| {
        let mut balance = Balance::new(pieces.clone(), start.clone(), 8, Shards::Spatial, moves);
        let time = simulate(&mut balance, 20, cost);
        (time / balance.shots as f64, balance)
    };
    let (still, _) = run(Moves::Never);
    let (moving, balance) = run(Moves::Balanced);
    let moves = balance.windows().iter().filter(|window| window.moved > 0).count();
    assert!(moves <= 8 && moving < 1.25 * still, "{moves} moves, {moving} {still}");
}

#[test]
fn windows_are_long_enough_and_all_members_decide_the_same() {
    let pieces = pieces();
    let [start, _] = worst(&pieces, 4);
    let mut balance = Balance::new(pieces.clone(), start, 4, Shards::Random, Moves::Balanced);
    let mut other = balance.clone();
    for shot in 0..2000 {
        let loads: Vec<Load> = (0..4)
            .map(|m| Load { testing: 1e-3 + 1e-6 * held(&pieces, balance.holders(), m), other: 0.0, points: 1 + shot })
            .collect();
        assert_eq!(balance.add(1, &loads), other.add(1, &loads));
        assert_eq!((balance.holders(), balance.pause()), (other.holders(), other.pause()));
    }
    assert!(balance.windows().len() > 10);
    assert!(balance.windows().iter().all(|window| window.slowest >= 0.05 && window.shots > 0));
    assert!(balance.windows().iter().map(|window| window.shots).sum::<u64>() + balance.open_shots == 2000);
}

#[test]
fn nothing_is_made_of_nothing() {
    let mut idle = Balance::new(pieces(), vec![0; 700], 3, Shards::Spatial, Moves::Balanced);
    assert!(!idle.add(1, &[Load::default(); 3]));
    assert!(idle.windows().is_empty() && idle.pause() == 1);
    let busy_otherwise = Load { other: 1.0, ..Load::default() };
    assert!(!idle.add(1, &[busy_otherwise; 3]) && idle.windows().len() == 1);
    let mut empty = Balance::new(Arc::new([]), Vec::new(), 2, Shards::Random, Moves::Balanced);
    let testing = |testing| Load { testing, ..Load::default() };
    assert!(!empty.add(1, &[testing(1.0), testing(0.1)]));
    let mut single = Balance::new(pieces(), vec![0; 700], 1, Shards::Random, Moves::Balanced);
    assert!(!single.add(1, &[testing(1.0)]) && single.windows()[0].balance == 1.0);
}

#[test]
fn random_moves_come_after_every_shot() {
    let mut balance = Balance::new(pieces(), vec![0; 700], 5, Shards::Spatial, Moves::Random);
    for _ in 0..10 {
        let before = balance.holders().to_vec();
        assert!(balance.pause() == 1 && balance.add(1, &[Load::default(); 5]));
        let moved = before.iter().zip(balance.holders()).filter(|(a, b)| a != b).count();
        assert!(moved > 400, "{moved}");
    }
}

#[test]
fn ranks_correlate() {
    assert_eq!(rank_correlation(&[1.0, 2.0, 3.0, 9.0], &[2.0, 3.0, 5.0, 7.0]), 1.0);
    assert_eq!(rank_correlation(&[1.0, 2.0, 3.0, 9.0], &[8.0, 3.0, 2.0, 1.0]), -1.0);
    // 1 − 6 Σd²/(n(n² − 1)) with d = 0, 1, 1, 0.
    assert!((rank_correlation(&[1.0, 2.0, 3.0, 4.0], &[1.0, 3.0, 2.0, 4.0]) - 0.8).abs() < 1e-12);
    assert_eq!(rank_correlation(&[1.0, 1.0], &[1.0, 2.0]), 0.0);
    assert_eq!(rank_correlation(&[1.0, 1.0, 4.0], &[2.0, 2.0, 3.0]), 1.0);
}
