//! x
use crate::Section;
/// x
pub fn measure() -> Section {
    Section::default()
}
