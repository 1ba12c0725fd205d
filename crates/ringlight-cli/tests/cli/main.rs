//! The command as its users meet it: small scenes in temporary folders, real processes.

mod contract;
mod damage;
mod group;
mod interruption;
mod probe;
mod ranks;
mod readers;
mod sameness;
#[cfg(unix)]
mod view;
mod viewfactors;
#[cfg(unix)]
mod watcher;
mod workshop;
