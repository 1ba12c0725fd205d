//! Links: what receivers see of nodes of the shooter tree, as form factors.

use crate::shooting::TreeLight;

/// The links of some receivers.
#[derive(Debug, Default)]
pub struct Links {
    /// Elements of the mesh, in the order of their factors.
    elements: Vec<u32>,
    /// Nodes, and whether the value at the sample points differs from the area average: then it follows.
    nodes: Vec<(u32, bool)>,
    /// For each link: a factor for every receiver, then, if they differ, what is to be added at the sample point.
    factors: Vec<f32>,
}

impl Links {
    /// None yet.
    pub fn new(elements: impl Iterator<Item = u32>) -> Links {
        Links { elements: elements.collect(), ..Links::default() }
    }

    /// Adds a link to a node, given names of receivers with area average and value at the sample point; unless nothing is
    /// seen.
    pub fn push(&mut self, node: u32, received: impl Iterator<Item = (u32, [f64; 3], [f64; 3])>) {
        let (start, count) = (self.factors.len(), self.elements.len());
        self.factors.resize(start + 2 * count, 0.0);
        let (mut seen, mut differs) = (false, false);
        for (name, mean, point) in received {
            let (mean, point) = (mean[0] as f32, point[0] as f32);
            seen |= mean != 0.0 || point != 0.0;
            differs |= (point - mean).abs() > 1e-3 * mean;
            self.factors[start + name as usize] = mean;
            self.factors[start + count + name as usize] = point - mean;
        }
        if !differs {
            self.factors.truncate(start + count);
        }
        if seen {
            self.nodes.push((node, differs));
        } else {
            self.factors.truncate(start);
        }
    }

    /// Adds a link to a far node, given names of receivers and what they receive.
    pub fn push_far(&mut self, node: u32, names: &[u32], received: &[f32]) {
        let start = self.factors.len();
        self.factors.resize(start + self.elements.len(), 0.0);
        for (&name, &received) in names.iter().zip(received) {
            self.factors[start + name as usize] = received;
        }
        self.nodes.push((node, false));
    }

    /// What each receiver gets: element, area average, and what is to be added at the sample point.
    pub fn gather(&self, light: &TreeLight) -> Vec<(u32, [f32; 3], [f32; 3])> {
        let count = self.elements.len();
        let mut sums = vec![[[0.0f32; 3]; 2]; count];
        let mut rest = self.factors.as_slice();
        for &(node, differs) in &self.nodes {
            let radiosity = light.radiosity[node as usize];
            for part in 0..=usize::from(differs) {
                let (factors, others) = rest.split_at(count);
                rest = others;
                for (sum, factor) in sums.iter_mut().zip(factors) {
                    (0..3).for_each(|c| sum[part][c] += factor * radiosity[c]);
                }
            }
        }
        self.elements.iter().zip(sums).map(|(&element, [mean, more])| (element, mean, more)).collect()
    }
}
