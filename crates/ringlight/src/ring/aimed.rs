//! Sample points that look at a shooter of their own, which travels with them.

use super::packet::Samples;
use ringlight_visibility::{Cells, Grid, Layout, Points, PreparedShooter, Shooter};
use std::sync::Arc;

/// Sample points with masks of a shooter that only whoever asks has to know.
#[derive(Clone, Debug)]
pub struct Aimed {
    shooter: Shooter,
    prepared: Arc<PreparedShooter>,
    /// The points.
    pub samples: Samples,
}

/// Words of a shooter before its coordinates: kind of cells, their number or that along a side, plane, far.
const HEAD: usize = 4;

/// Kinds of cells.
const QUAD: u32 = 0;
const TRIANGLE: u32 = 1;
const POINTS: u32 = 2;
const DIRECTIONS: u32 = 3;

impl Aimed {
    /// Points that look at `shooter`.
    pub fn new(shooter: Shooter, samples: Samples) -> Aimed {
        let prepared = Arc::new(PreparedShooter::new(&shooter));
        Aimed { shooter, prepared, samples }
    }

    /// The shooter, made ready.
    pub fn shooter(&self) -> &PreparedShooter {
        &self.prepared
    }

    /// The shooter, the points, and the cells that are still seen from each, for occluders to clear bits.
    pub fn split_mut(&mut self) -> (&PreparedShooter, Points<'_>, &mut [u64]) {
        let (points, masks) = self.samples.split_mut();
        (&self.prepared, points, masks)
    }

    /// The shooter as it travels.
    pub(super) fn words(&self) -> Vec<u32> {
        let (kind, count, coordinates) = match &self.shooter.cells {
            Cells::Grid(grid) => {
                let kind = if grid.layout == Layout::Quad { QUAD } else { TRIANGLE };
                (kind, grid.side, vec![grid.origin, grid.edge_u, grid.edge_v, grid.twist])
            }
            Cells::Points(points) => (POINTS, points.len() as u32, points.clone()),
            Cells::Directions(directions) => (DIRECTIONS, directions.len() as u32, directions.clone()),
        };
        let head = [kind, count, self.shooter.plane, self.shooter.far.to_bits()];
        head.into_iter().chain(coordinates.into_iter().flatten().map(f32::to_bits)).collect()
    }

    /// Takes a shooter as it travels off some bytes; none if it is none.
    pub(super) fn take_shooter(bytes: &mut &[u8]) -> Option<Shooter> {
        let (head, mut rest) = bytes.split_at_checked(4 * HEAD)?;
        let word = |bytes: &[u8], k: usize| u32::from_ne_bytes(std::array::from_fn(|i| bytes[4 * k + i]));
        let [kind, count, plane, far] = std::array::from_fn(|k| word(head, k));
        let mut coordinates = |count: usize| {
            let taken;
            (taken, rest) = rest.split_at_checked(12 * count)?;
            let one = |point: &[u8]| std::array::from_fn(|axis| f32::from_bits(word(point, axis)));
            Some(taken.chunks_exact(12).map(one).collect::<Vec<[f32; 3]>>())
        };
        // No shooter has more cells than a mask has bits.
        let cells = match kind {
            QUAD | TRIANGLE if (1..=8).contains(&count) => {
                let [origin, edge_u, edge_v, twist] = coordinates(4)?[..] else { return None };
                let layout = if kind == QUAD { Layout::Quad } else { Layout::Triangle };
                Cells::Grid(Grid { origin, edge_u, edge_v, twist, layout, side: count })
            }
            POINTS if count <= u64::BITS => Cells::Points(coordinates(count as usize)?),
            DIRECTIONS if count <= u64::BITS => Cells::Directions(coordinates(count as usize)?),
            _ => return None,
        };
        *bytes = rest;
        Some(Shooter { cells, plane, far: f32::from_bits(far) })
    }
}

impl PartialEq for Aimed {
    fn eq(&self, other: &Aimed) -> bool {
        self.shooter == other.shooter && self.samples == other.samples
    }
}
