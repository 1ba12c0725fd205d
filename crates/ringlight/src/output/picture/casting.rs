//! The samples of a rank's part of a picture: cast, given their light by the ranks that have it, and composed.
//!
//! A round takes some pixels of every rank. First their rays find through the ring, which has the nearest hits of its shards
//! joined, what they meet: fragments, in the order of their depth. Then each rank asks the others for the light at the corners
//! of the elements in its fragments, once for each element; and then it composes its samples alone. So nobody needs the light
//! of all elements, and what is under way does not grow with the picture.

use super::paint::{Fragment, Painter, Sample, Sight};
use super::pixel_ray;
use super::split::{Part, Split};
use crate::mesh::Inquiry;
use crate::output::View;
use crate::quantity::Rgb;
use crate::smooth::{Divided, interpolate};
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;
use std::cell::Cell;
use std::ops::Range;

/// Most samples of a rank in a round: some megabytes of fragments.
const ROUND: usize = 1 << 16;

/// Most pixels whose rays travel together.
const RUN: usize = 64;

/// What is cast.
pub struct Casting<'c, 'a> {
    /// Follows rays.
    pub painter: &'c Painter<'a>,
    /// This rank's part of the light, and the way to the rest.
    pub light: &'c Divided<'a>,
    /// From where.
    pub view: &'c View,
    /// Size of the picture, pixels.
    pub size: [u32; 2],
    /// How many pixels of the picture one that is cast is wide and high.
    pub step: f64,
    /// Columns and rows that are cast.
    pub grid: [u32; 2],
    /// Who casts which of them.
    pub split: Split,
    /// Places of the samples in a pixel.
    pub places: Vec<[f64; 2]>,
}

/// What casting took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// Rays of sight.
    pub rays: u64,
    /// Elements whose light was asked for.
    pub elements: u64,
}

/// The samples of a run of pixels before they have light.
#[derive(Default)]
struct Run {
    /// What the rays met, sample by sample.
    fragments: Vec<Fragment>,
    /// For each sample, the end of its fragments, and what of the sky comes through all of them.
    ends: Vec<(usize, Rgb)>,
    /// Rays that were followed.
    rays: u64,
}

impl<'a> Casting<'_, 'a> {
    /// Casts the pixels of this rank's part and gives what `finish` makes of the samples of each. Every rank calls it.
    pub fn cast<T: Send>(
        &self,
        finish: impl Fn(&[Sample]) -> T + Sync,
        ring: &mut Ring<'a>,
        ranks: &mut Communicator<'_>,
    ) -> Result<(Vec<T>, Cost), Failure> {
        let (rank, size) = (ranks.rank(), ranks.size());
        let part = self.split.part(self.grid, rank, size);
        let most = (0..size).map(|rank| self.split.part(self.grid, rank, size).pixels()).max().unwrap_or(0);
        let in_round = (ROUND / self.places.len()).max(1);
        let in_run = (ring.packet_size() / self.places.len()).clamp(1, RUN);
        let (mut pixels, mut cost) = (Vec::with_capacity(part.pixels()), Cost::default());
        for first in (0..most).step_by(in_round) {
            let end = part.pixels().min(first + in_round);
            let mut runs: Vec<Run> = Vec::new();
            runs.resize_with(end.saturating_sub(first).div_ceil(in_run), Run::default);
            let tasks = (first..end).step_by(in_run).map(|k| k..end.min(k + in_run)).enumerate();
            let task = |(number, pixels), inquiry: Inquiry<'a>| {
                let part = &part;
                async move { (number, Run::new(inquiry.follow(self.rays(part, pixels).collect::<Vec<_>>()).await)) }
            };
            ring.ask(ranks, tasks, task, |(number, run): (usize, Run)| runs[number] = run)?;
            let mut wanted: Vec<(u32, u32)> = runs.par_iter().flat_map_iter(Run::elements).collect();
            wanted.par_sort_unstable();
            wanted.dedup();
            cost.elements += wanted.len() as u64;
            let corners = self.light.corners(&wanted, ranks)?;
            cost.rays += runs.iter().map(|run| run.rays).sum::<u64>();
            let finished = runs.par_iter().map(|run| {
                // Most samples show the same element as the one before.
                let place = Cell::new(0);
                let light = |fragment: &Fragment| {
                    let element = (fragment.facet, fragment.element);
                    if wanted[place.get()] != element {
                        place.set(wanted.binary_search(&element).expect("all elements that are met are asked for"));
                    }
                    interpolate(&corners[place.get()], self.painter.layout(fragment), fragment.within)
                };
                let samples: Vec<Sample> = run.samples(|fragments, sky| self.painter.compose(fragments, sky, light));
                samples.chunks(self.places.len()).map(&finish).collect::<Vec<T>>()
            });
            pixels.extend(finished.collect::<Vec<_>>().into_iter().flatten());
        }
        Ok((pixels, cost))
    }

    /// The rays of some pixels of a part.
    fn rays(&self, part: &Part, pixels: Range<usize>) -> impl Iterator<Item = Sight<'_, 'a>> {
        let at = |pixel: usize, [x, y]: [f64; 2]| {
            let [column, row] = part.place(pixel).map(f64::from);
            [(column + x) * self.step, (row + y) * self.step]
        };
        let of_pixel = move |pixel| self.places.iter().map(move |&place| at(pixel, place));
        pixels.flat_map(of_pixel).map(|at| self.painter.follow(pixel_ray(self.view, at, self.size)))
    }
}

impl Run {
    fn new(rays: Vec<Sight<'_, '_>>) -> Run {
        let mut run = Run::default();
        for ray in rays {
            run.fragments.extend(ray.fragments);
            run.ends.push((run.fragments.len(), ray.sky));
            run.rays += ray.rays;
        }
        run
    }

    /// Facets and elements whose light it needs, each once.
    fn elements(&self) -> Vec<(u32, u32)> {
        let mut elements: Vec<_> = self.fragments.iter().map(|f| (f.facet, f.element)).collect();
        elements.sort_unstable();
        elements.dedup();
        elements
    }

    /// Composes its samples from their fragments.
    fn samples(&self, compose: impl Fn(&[Fragment], Rgb) -> Sample) -> Vec<Sample> {
        let starts = std::iter::once(0).chain(self.ends.iter().map(|&(end, _)| end));
        let of_sample = starts.zip(&self.ends).map(|(start, &(end, sky))| compose(&self.fragments[start..end], sky));
        of_sample.collect()
    }
}
