//! The same surfaces with smaller elements where they are wanted.

use super::{ALL_VALID, Cluster, Mesh, build, colour};
use crate::column::Store;
use crate::scene::{Scene, SceneError};

impl Mesh {
    /// The mesh of the same facets, patches and clusters in which each side of an unrefined element of patch `id` is cut into
    /// `subdivisions[id]` parts (at least 1). Subdivisions are absolute: refining again starts from unrefined elements. What
    /// occludes stays as it is; colours are averages over the new elements, and all samples count as valid until
    /// [`super::find_valid_samples`] has looked at them. What grows with the elements is in `store`.
    pub fn refined(&self, scene: &Scene, subdivisions: &[u8], store: Store<'_>) -> Result<Mesh, SceneError> {
        assert_eq!(subdivisions.len(), self.patch_count(), "a subdivision for each patch");
        let unrefined = |id: u32| {
            let [columns, rows] = self.facets[self.side_of(id).0 as usize].elements.map(u64::from);
            columns * rows
        };
        let counts = (0..).zip(subdivisions).map(|(id, &s)| unrefined(id) * u64::from(s.max(1)).pow(2));
        let total: u64 = counts.clone().sum();
        build::limit(total, scene)?;
        let mut first_elements = store.column()?;
        first_elements.reserve(subdivisions.len() + 1)?;
        first_elements.push(0)?;
        let mut end = 0;
        for count in counts {
            end += count as u32;
            first_elements.push(end)?;
        }
        let mut valid = store.column()?;
        valid.resize(total as usize, ALL_VALID)?;
        let elements = |cluster: &Cluster| {
            let [start, end] = [cluster.patches.start, cluster.patches.end].map(|id| first_elements[id as usize]);
            Cluster { elements: start..end, ..cluster.clone() }
        };
        let clusters = self.clusters.iter().map(elements).collect();
        let mut facets = store.column()?;
        facets.extend_from_slice(&self.facets)?;
        let mut mesh = Mesh {
            origin: self.origin,
            diagonal: self.diagonal,
            sizes: self.sizes,
            facets,
            patch_facets: self.patch_facets.clone(),
            first_elements,
            clusters,
            base_uv: self.base_uv.clone(),
            emission_uv: self.emission_uv.clone(),
            vertex_colours: self.vertex_colours.clone(),
            colours: store.column()?,
            valid,
            skipped: self.skipped.clone(),
            ..Mesh::default()
        };
        colour::assign(&mut mesh, scene, store)?;
        // What occludes stays, and what is to be said of colours has been said.
        Ok(Mesh { occluder: self.occluder.clone(), warnings: self.warnings.clone(), ..mesh })
    }
}
