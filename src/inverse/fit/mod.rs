//! The bounded, robust least-squares fit of all unknowns to the transport cache, with standard errors.

pub mod accumulate;
pub mod equations;
pub mod errors;
pub mod gauss_newton;
pub mod linear;
pub mod model_error;
pub mod path_noise;
pub mod prior;
pub mod prior_terms;
pub mod robust_weights;
pub mod sky_prior;
pub mod sparse_rows;
pub mod sparse_step;
pub mod step;
