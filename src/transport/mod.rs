//! How light moves: paths, scattering, emitters, next-event estimation, multiple importance sampling.

pub mod material;
pub mod world;
