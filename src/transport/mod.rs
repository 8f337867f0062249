//! How light moves: paths, scattering, emitters, next-event estimation, multiple importance sampling.

pub mod bsdf;
pub mod material;
pub mod world;
