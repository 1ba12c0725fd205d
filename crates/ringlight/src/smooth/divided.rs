//! Light between the sample points, divided among ranks: each finds and keeps that of a run of neighbouring facets, and is
//! asked for it by the others. While it is found, an index of all facets, some bytes for each, is held as well.

use super::sheet::Sheets;
use super::{Smooth, find_splits};
use crate::quantity::Rgb;
use crate::solution::Solution;
use crate::solve::Ring;
use crate::transport::{Communicator, Failure};
use rayon::prelude::*;

/// Tags of the elements that ranks ask each other for, and of the light at their corners.
const ELEMENTS: u32 = 45;
const CORNERS: u32 = 46;

/// What a rank has of the light between the sample points, and who has the rest.
pub struct Divided<'a> {
    own: Smooth<'a>,
    /// Where the run of each rank ends.
    ends: Vec<u32>,
    /// Memory that the light at sample points took while this was found, bytes.
    finding: usize,
}

impl<'a> Divided<'a> {
    /// Of a solution. Every rank calls it: they look for walls together.
    pub fn new(
        solution: &'a Solution,
        ring: &mut Ring<'a>,
        ranks: &mut Communicator<'_>,
    ) -> Result<Divided<'a>, Failure> {
        let (rank, ends) = (ranks.rank(), ends(&Sheets::new(&solution.mesh), ranks.size()));
        let start = if rank == 0 { 0 } else { ends[rank - 1] };
        let (smooth, field, suspects) = Smooth::without_walls(solution, start..ends[rank]);
        let own = Smooth { splits: find_splits(&field, suspects, ring, ranks)?, ..smooth };
        Ok(Divided { own, ends, finding: field.bytes() })
    }

    /// The light at the corners of elements, see [`Smooth::corners`], whoever has it: of `wanted`, (facet, element) in
    /// ascending order. Every rank calls it.
    pub fn corners(&self, wanted: &[(u32, u32)], ranks: &mut Communicator<'_>) -> Result<Vec<[Rgb; 4]>, Failure> {
        let mut rest = wanted;
        let questions = self.ends.iter().map(|&end| {
            let (of_rank, after) = rest.split_at(rest.partition_point(|&(facet, _)| facet < end));
            rest = after;
            of_rank.iter().flat_map(|(_, element)| element.to_ne_bytes()).collect()
        });
        let asked = ranks.exchange(ELEMENTS, questions.collect())?;
        let answers = asked.into_iter().map(|question| {
            let elements: Vec<u32> = bytemuck::pod_collect_to_vec(&question);
            let corners: Vec<[Rgb; 4]> = elements.into_par_iter().map(|element| self.own.corners(element)).collect();
            bytemuck::cast_slice(&corners).to_vec()
        });
        let answers = ranks.exchange(CORNERS, answers.collect())?;
        // Runs follow each other like ranks.
        Ok(answers.iter().flat_map(|answer| bytemuck::pod_collect_to_vec::<u8, [Rgb; 4]>(answer)).collect())
    }

    /// Memory that this rank's part takes, bytes.
    pub fn bytes(&self) -> usize {
        self.own.bytes()
    }

    /// Memory that the light at sample points took while it was found, bytes.
    pub fn bytes_while_found(&self) -> usize {
        self.finding
    }
}

/// Where the ranks' runs of facets end. They have about as many vertices each, by less than a facet's: a function of the mesh
/// and the number of ranks.
fn ends(sheets: &Sheets<'_>, ranks: usize) -> Vec<u32> {
    let facets = sheets.mesh().facets.len() as u32;
    let mut end = 0;
    let ends = (1..=ranks).map(|rank| {
        // A facet goes where its middle lies.
        let share = 2 * (sheets.vertex_count() * rank) as u128;
        let middle = |f: u32| (sheets.first_vertex_of(f) + sheets.first_vertex_of(f + 1)) as u128;
        while end < facets && middle(end) * ranks as u128 <= share {
            end += 1;
        }
        end
    });
    ends.collect()
}
