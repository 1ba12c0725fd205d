//! Ringlight computes how light bounces through a 3D scene and leaves it in the scene.
//!
//! The modules in the order in which data flows: [`scene`] (bytes → checked scene) → [`mesh`] (patches, elements, sample
//! points, clusters) → [`form_factor`] → [`shooting`] → [`solve`] → [`solution`] → [`smooth`] (→ [`adapt`] → [`mesh`]) → [`probe`] → [`output`].
//! [`view_factor`] uses the same primitives without light; [`ring`] and [`transport`] let many ranks hold one scene; [`plan`]
//! foretells what that takes.

pub mod adapt;
pub mod column;
pub mod form_factor;
pub mod mesh;
pub mod output;
pub mod plan;
pub mod probe;
pub mod quantity;
pub mod resources;
pub mod ring;
pub mod scene;
pub mod shooting;
pub mod smooth;
pub mod solution;
pub mod solve;
pub mod transport;
pub mod view_factor;
