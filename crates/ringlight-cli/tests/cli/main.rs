//! The command as its users meet it: small scenes in temporary folders, real processes.

mod contract;
mod damage;
mod interruption;
mod probe;
mod ranks;
mod readers;
mod sameness;
mod viewfactors;
mod workshop;
