//! The one ray–triangle predicate; everything faster must give the same bits.
