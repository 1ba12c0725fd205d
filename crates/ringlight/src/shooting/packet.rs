//! Receiving points that are lit together: the shot's light through the masks of what they see.
//!
//! Visibility clears bits and knows no light; form factors turn masks into light and need no occluder.

use super::gather::{Received, Receiver, Role, Spread, gather};
use super::shot::{Shot, Source};
use glam::{DVec3, Vec3};
use ringlight_visibility::{Cells, Hierarchy, Points, PreparedShooter, Tally};
use std::ops::Range;

/// Points with normals that receive one shot after another; the buffers are reused.
#[derive(Debug, Default)]
pub struct Packet {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    plane: Vec<u32>,
    masks: Vec<u64>,
    receivers: Vec<Receiver>,
    spreads: Vec<Spread>,
    received: Vec<Received>,
}

impl Packet {
    /// Removes all points.
    pub fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.plane.clear();
        self.masks.clear();
        self.receivers.clear();
        self.spreads.clear();
        self.received.clear();
    }

    /// Adds a point on a surface of plane id `plane` that sees no more of the shot's cells than `mask`, which
    /// [`Shot::above_horizon`] gives.
    pub fn push(&mut self, point: DVec3, normal: DVec3, plane: u32, mask: u64) {
        self.push_as(Role::Point, point, normal, plane, mask);
    }

    /// The same for a point that is more than a point. `Role::Alone` needs the spread pushed before.
    pub fn push_as(&mut self, role: Role, point: DVec3, normal: DVec3, plane: u32, mask: u64) {
        let single = point.as_vec3();
        self.x.push(single.x);
        self.y.push(single.y);
        self.z.push(single.z);
        self.plane.push(plane);
        self.masks.push(mask);
        self.receivers.push(Receiver { point, normal, role });
    }

    /// Adds how far the elements extend for which points stand from now on; gives their role.
    pub fn push_spread(&mut self, spread: Spread) -> Role {
        self.spreads.push(spread);
        Role::Alone(self.spreads.len() as u32 - 1)
    }

    /// Finds what each point sees of the shot, whose shooter is `shooter`, and what it receives.
    pub fn receive(&mut self, shot: &Shot, shooter: &PreparedShooter, hierarchy: &Hierarchy) -> Tally {
        let (points, masks) = self.split_mut();
        let tally = hierarchy.clear_blocked_of(shooter, points, masks);
        self.gather(shot);
        tally
    }

    /// Finds what each point receives, as far as its mask says that it sees the shot.
    pub fn gather(&mut self, shot: &Shot) {
        self.received.clear();
        gather(shot, &self.receivers, &self.spreads, &self.masks, &mut self.received);
    }

    /// The points, in the order in which they were pushed.
    pub fn points(&self) -> Points<'_> {
        Points { x: &self.x, y: &self.y, z: &self.z, plane: &self.plane }
    }

    /// Some of the points, with their masks.
    pub fn run(&self, range: Range<usize>) -> (Points<'_>, &[u64]) {
        let points = Points {
            x: &self.x[range.clone()],
            y: &self.y[range.clone()],
            z: &self.z[range.clone()],
            plane: &self.plane[range.clone()],
        };
        (points, &self.masks[range])
    }

    /// The masks, for occluders to clear bits.
    pub fn masks_mut(&mut self) -> &mut [u64] {
        &mut self.masks
    }

    /// The points with the masks, for occluders to clear bits.
    pub fn split_mut(&mut self) -> (Points<'_>, &mut [u64]) {
        (Points { x: &self.x, y: &self.y, z: &self.z, plane: &self.plane }, &mut self.masks)
    }

    /// The cells that each point sees, in the order in which they were pushed.
    pub fn masks(&self) -> &[u64] {
        &self.masks
    }

    /// What each point receives.
    pub fn received(&self) -> &[Received] {
        &self.received
    }
}

impl Shot {
    /// The cells that lie above the horizon of a point with this normal, and face it.
    pub fn above_horizon(&self, point: DVec3, normal: DVec3) -> u64 {
        match (&self.source, &self.shooter.cells) {
            (Source::Patch(source), Cells::Grid(grid)) => {
                if source.normal.dot(point - source.corners[0]) <= 0.0 {
                    return 0;
                }
                if source.corners[..source.count].iter().all(|&c| normal.dot(c - point) > 0.0) {
                    return self.shooter.cells.all();
                }
                above(normal, source.cells(self, grid).points().map(|cell| cell - point))
            }
            (Source::Group(normals), Cells::Points(points)) => {
                let (x, n) = (point.as_vec3(), normal.as_vec3());
                normals.iter().zip(points).enumerate().fold(0, |mask, (k, (normal, cell))| {
                    let to = Vec3::from(*cell) - x;
                    mask | u64::from(n.dot(to) > 0.0 && normal.dot(to) < 0.0) << k
                })
            }
            (_, Cells::Directions(d)) => above(normal, d.iter().map(|d| DVec3::from(d.map(f64::from)))),
            (_, Cells::Points(p)) => above(normal, p.iter().map(|p| DVec3::from(p.map(f64::from)) - point)),
            (_, Cells::Grid(_)) => 0,
        }
    }
}

/// Which of these directions, in turn, lie above the horizon of a surface with this normal, as bits.
fn above(normal: DVec3, directions: impl Iterator<Item = DVec3>) -> u64 {
    directions.enumerate().fold(0, |mask, (k, to)| mask | u64::from(normal.dot(to) > 0.0) << k)
}
