//! Shows a solve in the browser while it goes on.
//!
//! The solver puts what has changed on a [`Stage`]; a [`Server`], in a thread of its own, shows it to those who open its
//! link. The README describes what they say to each other.

pub mod display;
mod guard;
mod page;
pub mod protocol;
mod server;
mod stage;

pub use page::is_built;
pub use server::{MOST_WATCHERS, Server};
pub use stage::{Image, Model, Promise, Stage};
