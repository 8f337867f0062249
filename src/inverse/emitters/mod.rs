//! Classifies objects as emitters or reflectors, and accounts for the light that lamps reflect.

pub mod classify;
pub mod lamp_albedo;
