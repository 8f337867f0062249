//! Which objects give light, and what lamps reflect behind their own light.

pub mod classify;
pub mod lamp_albedo;
