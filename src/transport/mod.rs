//! Light transport: paths, BSDFs, emitters, next-event estimation, multiple importance sampling.

pub mod arrival;
pub mod bsdf;
pub mod denoise;
pub mod emitters;
pub mod environment;
pub mod film;
pub mod guide;
pub mod layers;
pub mod lit;
pub mod material;
pub mod microfacet;
pub mod oidn;
pub mod path;
pub mod sun;
pub mod surroundings;
pub mod upsample;
pub mod world;
