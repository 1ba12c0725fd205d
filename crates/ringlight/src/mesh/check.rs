//! Whether a mesh read from a file holds together.

use super::{Facet, Mesh, NONE};

impl Mesh {
    /// Whether all numbers refer to something that is there; for meshes read from files.
    pub fn check(&self) -> Result<(), String> {
        self.check_patches()?;
        self.check_clusters()?;
        match (0..).zip(&self.facets).find(|(_, facet)| !self.is_painted(facet)) {
            Some((f, _)) => Err(format!("facet {f} refers to what is not there")),
            None => Ok(()),
        }
    }

    /// Facets and patches refer to each other, each patch to the facet and the side that count it as theirs; and patches have
    /// as many elements as their grids.
    fn check_patches(&self) -> Result<(), String> {
        let (patches, elements) = (self.patch_facets.len() as u64, self.valid.len() as u64);
        if self.first_elements.len() as u64 != patches + 1
            || self.first_elements[0] != 0
            || u64::from(self.first_elements[patches as usize]) != elements
        {
            return Err("patches do not cover the elements".into());
        }
        let mut counted = 0;
        for (f, facet) in (0u32..).zip(&self.facets) {
            let product = |n: [u16; 2]| u64::from(n[0]) * u64::from(n[1]);
            let (of_side, unrefined) = (product(facet.patches), product(facet.elements));
            for back in facet.sides() {
                let first = u64::from(if back { facet.first_back_patch } else { facet.first_patch });
                let theirs = first..first + of_side;
                let code = f << 1 | u32::from(back);
                if of_side == 0
                    || theirs.end > patches
                    || !self.patch_facets[first as usize..theirs.end as usize].iter().all(|&c| c == code)
                {
                    return Err(format!("facet {f} counts patches as its own that are not"));
                }
                let refined = |id: u64| {
                    let [start, end] = [0, 1].map(|i| u64::from(self.first_elements[id as usize + i]));
                    let count = end.saturating_sub(start);
                    count > 0 && count == unrefined * count.checked_div(unrefined).unwrap_or(0).isqrt().pow(2)
                };
                if let Some(id) = theirs.clone().find(|&id| !refined(id)) {
                    return Err(format!("the elements of patch {id} are not a grid"));
                }
                counted += of_side;
            }
        }
        if counted == patches { Ok(()) } else { Err("a patch belongs to no facet".into()) }
    }

    /// Clusters are runs of patches with their elements, and together all of them.
    fn check_clusters(&self) -> Result<(), String> {
        let mut patch = 0;
        for cluster in &self.clusters {
            let range = &cluster.patches;
            if range.start != patch || range.end <= patch || range.end as usize > self.patch_facets.len() {
                return Err("clusters do not cover the patches".into());
            }
            let [start, end] = [range.start, range.end].map(|id| self.first_elements[id as usize]);
            if cluster.elements != (start..end) {
                return Err("clusters do not cover the elements".into());
            }
            patch = range.end;
        }
        if patch as usize == self.patch_facets.len() && patch > 0 {
            Ok(())
        } else {
            Err("clusters do not cover the patches".into())
        }
    }

    /// Whether a facet has finite corners, and its surface, texture coordinates and colours are there.
    fn is_painted(&self, facet: &Facet) -> bool {
        let within = |index: u32, len: usize| index == NONE || (index as usize) < len;
        let coloured = |back: bool| {
            let first = facet.colours[usize::from(back)];
            let end = u64::from(first) + self.side_elements(facet, back).len() as u64;
            first == NONE || end <= self.colours.len() as u64
        };
        (facet.surface as usize) < self.surface_colours.len()
            && within(facet.base_uv, self.base_uv.len())
            && within(facet.emission_uv, self.emission_uv.len())
            && within(facet.vertex_colour, self.vertex_colours.len())
            && facet.sides().all(coloured)
            && facet.corners.iter().all(|c| c.is_finite())
    }
}
