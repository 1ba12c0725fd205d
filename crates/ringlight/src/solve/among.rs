//! Who receives a shot.

use std::sync::Arc;

/// Patches of own clusters that receive a shot: all, or those of one level.
#[derive(Clone, Debug, Default)]
pub struct Among(Option<(Arc<Levels>, u8)>);

/// The level of each patch of own clusters.
#[derive(Debug)]
pub struct Levels {
    /// Where those of each own cluster begin, by its place in the share; and the end.
    pub starts: Arc<[u32]>,
    /// Levels, cluster by cluster.
    pub of: Vec<u8>,
}

impl Among {
    /// Those of each of `count` levels.
    pub fn of_levels(levels: Levels, count: usize) -> Vec<Among> {
        let levels = Arc::new(levels);
        (0..count).map(|level| Among(Some((levels.clone(), level as u8)))).collect()
    }

    /// Whether the patch at a place in the own cluster at `place` in the share receives.
    pub fn at(&self, place: usize) -> impl Fn(usize) -> bool {
        let of_cluster = self.0.as_ref().map(|(levels, level)| {
            let [start, end] = [place, place + 1].map(|place| levels.starts[place] as usize);
            (&levels.of[start..end], *level)
        });
        move |patch| of_cluster.is_none_or(|(levels, level)| levels[patch] == level)
    }
}
