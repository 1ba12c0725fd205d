//! Edges of shadow that run between the parts of a shooter.
//!
//! When a part's cells are all seen, or all hidden, an edge may still run between its outermost cells and the border: a
//! part does not tell. Its parent does, whose cells on both sides of the border differ. Edges of tables and lamps are
//! parallel as a rule, so this is no rare case.

use ringlight_visibility::Layout;

/// Sides of a part along which an edge of shadow may run: bits for low u, high u, low v, high v.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sides(u8);

impl Sides {
    /// No side.
    pub const NONE: Sides = Sides(0);
    /// Every side.
    pub const ALL: Sides = Sides(0b1111);

    /// The sides of quarter `quarter` (its tile's number) of a part with these sides and `side`² cells, of which `seen` are
    /// seen.
    pub fn of_quarter(self, quarter: u32, layout: Layout, side: u32, seen: u64) -> Sides {
        let all = u64::MAX >> (64 - side * side);
        if layout == Layout::Triangle {
            // Its quarters border in three directions: all are suspected.
            let mixed = seen & all != all && seen & all != 0;
            return if mixed || self != Sides::NONE { Sides::ALL } else { Sides::NONE };
        }
        let (column, row) = (quarter % 2, quarter / 2);
        let mut sides = self.0 & (1 << column | 4 << row);
        let half = side / 2;
        if half == 0 {
            return Sides(sides);
        }
        let sees = |column: u32, row: u32| seen >> (row * side + column) & 1 == 1;
        // One cell beyond the quarter, where an oblique edge may come in.
        let along = |q: u32| (q * half).saturating_sub(1)..=(q * half + half).min(side - 1);
        if along(row).any(|r| sees(half - 1, r) != sees(half, r)) {
            sides |= 2 >> column;
        }
        if along(column).any(|c| sees(c, half - 1) != sees(c, half)) {
            sides |= 8 >> row;
        }
        Sides(sides)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_between_quarters_is_suspected_on_both_sides_and_handed_down() {
        // The left half of 8 × 8 cells is seen.
        let seen = 0x0f0f_0f0f_0f0f_0f0f;
        let of = |sides: Sides, quarter, seen| sides.of_quarter(quarter, Layout::Quad, 8, seen);
        assert_eq!([0, 1, 2, 3].map(|q| of(Sides::NONE, q, seen)), [Sides(2), Sides(1), Sides(2), Sides(1)]);
        // The lower half: row by row.
        assert_eq!([0, 1, 2, 3].map(|q| of(Sides::NONE, q, 0xffff_ffff)), [8, 8, 4, 4].map(Sides));
        // A part that sees all hands its suspicion to the quarters on that side.
        assert_eq!([0, 1, 2, 3].map(|q| of(Sides(2), q, u64::MAX)), [0, 2, 0, 2].map(Sides));
        assert_eq!([0, 1, 2, 3].map(|q| of(Sides::NONE, q, u64::MAX)), [Sides::NONE; 4]);
        assert_eq!(Sides::NONE.of_quarter(3, Layout::Triangle, 8, seen), Sides::ALL);
    }
}
