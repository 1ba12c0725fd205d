//! Light at points that are no elements: work planes, calculation grids, comparisons.
