//! Dynamic load balancing: which pieces of geometry move from which member of a ring to which (paper, section 3.3).
//!
//! A state machine without a clock: it is fed with the times that the members of a ring were busy, and decides from these
//! alone, so that every member decides the same. Who holds what changes no mask.

use super::memory::most_held;
use super::partition::scatter;
use super::shard::bisect;
use super::{Piece, Shards};
use bytemuck::{Pod, Zeroable};
use std::collections::BTreeSet;
use std::ops::Add;
use std::sync::Arc;

#[cfg(test)]
mod tests;

/// When geometry moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Moves {
    /// When it pays.
    #[default]
    Balanced,
    /// Never; the times are only recorded.
    Never,
    /// To random members after every shot: a test of what must not change results.
    Random,
}

/// How busy a member of a ring was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Load {
    /// Testing packets, whosever they are, against the geometry it holds, CPU seconds: moves with the geometry.
    pub testing: f64,
    /// All else, CPU seconds: its own clusters, routing.
    pub other: f64,
    /// Sample points of its own clusters that were asked for: a measure of work that does not depend on who holds what.
    pub points: u64,
}

/// What was seen of a window: shots over which times were added up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Shots in it.
    pub shots: u64,
    /// Busy time of the slowest member, CPU seconds.
    pub slowest: f64,
    /// Busy time of the fastest over that of the slowest.
    pub balance: f64,
    /// Rank correlation of the members' busy times with those of the window before.
    pub correlation: Option<f64>,
    /// Pieces that moved when it ended.
    pub moved: usize,
}

/// The balance of one ring.
#[derive(Clone, Debug)]
pub struct Balance {
    pieces: Arc<[Piece]>,
    shards: Shards,
    moves: Moves,
    members: usize,
    holders: Vec<u32>,
    /// What each piece is thought to cost, relative to the others; see [`EXPONENT`]. In all as much as there are triangles.
    weights: Vec<f64>,
    /// What has been added up of the window that is not complete yet.
    open: Vec<Load>,
    open_shots: u64,
    shots: u64,
    /// Sum of the busiest members' times of all windows, seconds.
    work: f64,
    pause: u64,
    /// Busy times of the last window.
    busy: Vec<f64>,
    /// Before the last move: who held what, and how long the slowest member took for a point.
    before: Option<(Vec<u32>, f64)>,
    /// Windows in which nothing moves, and how many there are to be after the next move that was none for the better.
    rest: u32,
    next_rest: u32,
    windows: Vec<Window>,
}

/// A window holds at least so much work of the busiest member, seconds: enough that clocks and chance count little.
const WINDOW: f64 = 0.05;

/// And at least so much of the work that the busiest had in all windows before: what stays uneven in the long run is found
/// the better, the longer a window is.
const GROWTH: f64 = 0.25;

/// Geometry moves when the fastest member takes less than this share of the slowest's time.
const TARGET: f64 = 0.95;

/// Testing packets against pieces that weigh w takes about w to this power: a search takes less for each triangle the more
/// there are, and masks that are empty end it early. Measured on the office: 0.45 from 144 to 1088 of 5084 triangles.
const EXPONENT: f64 = 0.5;

/// The share of a difference between expected and measured time that is believed: the rest may be chance.
const TRUST: f64 = 0.35;

/// Building a hierarchy takes about so long for a triangle, seconds.
const BUILD: f64 = 0.5e-6;

/// Windows of rest after a move that was none for the better; twice as many after the next, and so on.
const REST: u32 = 2;

impl Balance {
    /// Of a ring of so many members, which hold the pieces as told; shards that move stay of the same kind.
    pub fn new(pieces: Arc<[Piece]>, holders: Vec<u32>, members: usize, shards: Shards, moves: Moves) -> Balance {
        assert!(pieces.len() == holders.len() && holders.iter().all(|&m| (m as usize) < members));
        let weights = pieces.iter().map(|p| f64::from(p.triangles.max(1))).collect();
        Balance {
            pieces,
            shards,
            moves,
            members,
            holders,
            weights,
            open: vec![Load::default(); members],
            open_shots: 0,
            shots: 0,
            work: 0.0,
            pause: 1,
            busy: Vec::new(),
            before: None,
            rest: 0,
            next_rest: REST,
            windows: Vec::new(),
        }
    }

    /// The member that holds each piece, for the shots to come.
    pub fn holders(&self) -> &[u32] {
        &self.holders
    }

    /// Shots until the next loads are wanted.
    pub fn pause(&self) -> u64 {
        self.pause
    }

    /// All windows so far.
    pub fn windows(&self) -> &[Window] {
        &self.windows
    }

    /// The loads of all members in the last shots, all of which saw the pieces held as [`Balance::holders`] says. Whether
    /// pieces move before the next shot.
    pub fn add(&mut self, shots: u64, loads: &[Load]) -> bool {
        assert_eq!(loads.len(), self.members);
        self.shots += shots;
        self.open_shots += shots;
        self.open.iter_mut().zip(loads).for_each(|(sum, &load)| *sum = *sum + load);
        let slowest = self.open.iter().map(Load::busy).fold(0.0, f64::max);
        let length = WINDOW.max(GROWTH * self.work);
        let complete = slowest >= length;
        self.pause = match self.moves {
            Moves::Random => 1,
            _ => {
                // As many shots as such a window is expected to take, but no more than have been seen.
                let missing = if complete { length } else { length - slowest };
                ((self.open_shots as f64 * missing / slowest).ceil() as u64).clamp(1, self.open_shots.max(1))
            }
        };
        let mut moved = 0;
        if complete {
            moved = self.end_window(slowest);
        }
        if self.moves == Moves::Random {
            moved = self.shuffle();
            self.windows.last_mut().filter(|_| complete).into_iter().for_each(|w| w.moved = moved);
        }
        moved > 0
    }

    fn end_window(&mut self, slowest: f64) -> usize {
        let loads = std::mem::replace(&mut self.open, vec![Load::default(); self.members]);
        let shots = std::mem::take(&mut self.open_shots);
        let busy: Vec<f64> = loads.iter().map(Load::busy).collect();
        let fastest = busy.iter().copied().fold(f64::INFINITY, f64::min);
        let balance = fastest / slowest;
        let correlation = (!self.windows.is_empty()).then(|| rank_correlation(&self.busy, &busy));
        self.busy = busy;
        self.work += slowest;
        self.windows.push(Window { shots, slowest, balance, correlation, moved: 0 });
        if self.moves != Moves::Balanced {
            return 0;
        }
        let holders = self.decide(&loads, slowest);
        let moved = self.replace(holders);
        self.windows.last_mut().into_iter().for_each(|w| w.moved = moved);
        moved
    }

    /// Who holds what from now on.
    fn decide(&mut self, loads: &[Load], slowest: f64) -> Vec<u32> {
        if loads.iter().all(|load| load.testing == 0.0) {
            return self.holders.clone();
        }
        let scale = self.learn(loads);
        let pace = slowest / loads.iter().map(|load| load.points).sum::<u64>() as f64;
        if let Some((holders, before)) = self.before.take() {
            if pace > before {
                self.rest = self.next_rest;
                self.next_rest *= 2;
                return holders;
            }
            self.next_rest = REST;
        }
        self.rest = self.rest.saturating_sub(1);
        if self.rest > 0 || self.windows.last().is_some_and(|w| w.balance >= TARGET) {
            return self.holders.clone();
        }
        let targets = self.targets(loads, scale);
        let Some(holders) = (0..5).find_map(|halved| self.towards(&targets, 0.5f64.powi(halved))) else {
            return self.holders.clone();
        };
        let expected = |&Load { other, .. }: &Load, weight: f64| other + scale * weight.powf(EXPONENT);
        let weights = self.held(&holders, &self.weights);
        let then = loads.iter().zip(weights).map(|(load, weight)| expected(load, weight)).fold(0.0, f64::max);
        // What is left to do is not known; as much as has been done is a fair guess.
        if (1.0 - then / slowest) * self.work < self.rebuilding(&holders) {
            return self.holders.clone();
        }
        // Compact shards of another shape may be visited more; random ones are all alike.
        self.before = (self.shards == Shards::Spatial).then(|| (self.holders.clone(), pace));
        holders
    }

    /// Compares the times with what the weights made expect, and changes the weights. Gives the time of a weight of 1.
    fn learn(&mut self, loads: &[Load]) -> f64 {
        let held = self.held(&self.holders, &self.weights);
        let holding = || loads.iter().zip(&held).filter(|(_, held)| **held > 0.0);
        let time: f64 = holding().map(|(load, _)| load.testing).sum();
        let scale = time / holding().map(|(_, held)| held.powf(EXPONENT)).sum::<f64>();
        let factors: Vec<f64> = loads
            .iter()
            .zip(&held)
            .map(|(load, held)| {
                let surprise = load.testing / (scale * held.powf(EXPONENT));
                // Nobody is thought to cost nothing, whatever the clock says.
                surprise.clamp(0.1, 10.0).powf(TRUST / EXPONENT)
            })
            .collect();
        let total: f64 = held.iter().sum();
        self.weights.iter_mut().zip(&self.holders).for_each(|(weight, &m)| *weight *= factors[m as usize]);
        // The scale of the weights means nothing, but is not to run away.
        let new: f64 = self.weights.iter().sum();
        self.weights.iter_mut().for_each(|weight| *weight *= total / new);
        let held = self.held(&self.holders, &self.weights);
        time / held.iter().map(|held| held.powf(EXPONENT)).sum::<f64>()
    }

    /// Weights of what the members hold.
    fn held(&self, holders: &[u32], weights: &[f64]) -> Vec<f64> {
        let mut held = vec![0.0; self.members];
        holders.iter().zip(weights).for_each(|(&m, weight)| held[m as usize] += weight);
        held
    }

    /// Who holds what if so large a part of the way is gone from equally many triangles each to these targets; none if a member
    /// had no memory for it.
    fn towards(&self, targets: &[f64], part: f64) -> Option<Vec<u32>> {
        let triangles: Vec<f64> = self.pieces.iter().map(|p| f64::from(p.triangles)).collect();
        let all = triangles.iter().sum::<f64>();
        let between = |even: f64, wanted: f64| even + part * (wanted - even);
        let weights: Vec<f64> = triangles.iter().zip(&self.weights).map(|(&n, &w)| between(n, w)).collect();
        let targets: Vec<f64> = targets.iter().map(|&target| between(all / self.members as f64, target)).collect();
        let holders = match self.shards {
            Shards::Spatial => bisect(&self.pieces, &weights, &targets),
            Shards::Random => self.even_out(&weights, &targets),
        };
        let most = most_held(all as u64, self.members) as f64;
        self.held(&holders, &triangles).iter().all(|&held| held <= most).then_some(holders)
    }

    /// How much each member is to hold so that all are equally busy.
    fn targets(&self, loads: &[Load], scale: f64) -> Vec<f64> {
        let total: f64 = self.weights.iter().sum();
        let at = |time: f64| -> Vec<f64> {
            loads.iter().map(|load| ((time - load.other).max(0.0) / scale).powf(1.0 / EXPONENT)).collect()
        };
        let (mut low, mut high) = (0.0, loads.iter().map(|load| load.other).fold(0.0, f64::max));
        high += scale * total.powf(EXPONENT);
        for _ in 0..60 {
            let time = 0.5 * (low + high);
            *(if at(time).iter().sum::<f64>() < total { &mut low } else { &mut high }) = time;
        }
        at(high)
    }

    /// Moves pieces, the largest that fit first, from members that hold too much to those that hold too little.
    fn even_out(&self, weights: &[f64], targets: &[f64]) -> Vec<u32> {
        let mut holders = self.holders.clone();
        let mut excess: Vec<f64> =
            self.held(&holders, weights).iter().zip(targets).map(|(held, target)| held - target).collect();
        let key = |piece: usize| (weights[piece].to_bits(), scatter(piece as u64), piece);
        let mut held = vec![BTreeSet::new(); self.members];
        holders.iter().enumerate().for_each(|(piece, &m)| {
            held[m as usize].insert(key(piece));
        });
        let good = (1.0 - TARGET) / 4.0 * weights.iter().sum::<f64>() / self.members as f64;
        // Every move lessens the sum of the squares; a bound all the same.
        for _ in 0..4 * self.pieces.len() {
            let members = 0..self.members;
            let Some(from) = members.clone().max_by(|&a, &b| excess[a].total_cmp(&excess[b])) else { break };
            let Some(to) = members.min_by(|&a, &b| excess[a].total_cmp(&excess[b])) else { break };
            let gap = excess[from] - excess[to];
            if gap <= good {
                break;
            }
            let fits = held[from].range(..(((0.5 * gap).to_bits()), 0, 0)).next_back();
            let Some(&(bits, tie, piece)) = fits.or(held[from].first()) else { break };
            let weight = f64::from_bits(bits);
            if weight >= gap {
                break;
            }
            held[from].remove(&(bits, tie, piece));
            held[to].insert((bits, tie, piece));
            excess[from] -= weight;
            excess[to] += weight;
            holders[piece] = to as u32;
        }
        holders
    }

    /// The time until the last member has built its hierarchy anew, seconds.
    fn rebuilding(&self, holders: &[u32]) -> f64 {
        let (mut changed, mut triangles) = (vec![false; self.members], vec![0.0; self.members]);
        for ((&old, &new), piece) in self.holders.iter().zip(holders).zip(&*self.pieces) {
            triangles[new as usize] += f64::from(piece.triangles);
            if old != new {
                changed[old as usize] = true;
                changed[new as usize] = true;
            }
        }
        let longest =
            triangles.iter().zip(changed).filter(|(_, changed)| *changed).map(|(n, _)| *n).fold(0.0, f64::max);
        BUILD * longest
    }

    /// Deals all pieces anew, otherwise after every shot.
    fn shuffle(&mut self) -> usize {
        let turn = scatter(self.shots);
        let random = |piece: u64| (scatter(piece ^ turn) % self.members as u64) as u32;
        let holders: Vec<u32> = (0..self.pieces.len() as u64).map(random).collect();
        self.replace(holders)
    }

    /// Takes new holders; gives the number of pieces that move.
    fn replace(&mut self, holders: Vec<u32>) -> usize {
        let moved = self.holders.iter().zip(&holders).filter(|(a, b)| a != b).count();
        self.holders = holders;
        moved
    }
}

impl Load {
    /// All of it.
    pub fn busy(&self) -> f64 {
        self.testing + self.other
    }
}

impl Add for Load {
    type Output = Load;

    fn add(self, other: Load) -> Load {
        Load {
            testing: self.testing + other.testing,
            other: self.other + other.other,
            points: self.points + other.points,
        }
    }
}

/// Spearman's rank correlation: 1 if the same order, −1 if the reverse; equal values share their places.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let places = |values: &[f64]| -> Vec<f64> {
        let place = |x: &f64| {
            let below = values.iter().filter(|y| *y < x).count();
            let equal = values.iter().filter(|y| *y == x).count();
            below as f64 + 0.5 * (equal as f64 - 1.0) - 0.5 * (values.len() as f64 - 1.0)
        };
        values.iter().map(place).collect()
    };
    let (a, b) = (places(a), places(b));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let size = (product(&a, &a) * product(&b, &b)).sqrt();
    if size > 0.0 { product(&a, &b) / size } else { 0.0 }
}
