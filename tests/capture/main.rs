//! What comes in: captures, photographs and what is made of them before a fit.

#[path = "../common/beside.rs"]
mod beside;
#[path = "../scenes/mod.rs"]
mod scenes;

mod agreement;
mod captures;
mod gbuffer;
mod overexposed;
mod prepare;
mod segments;
mod sharpness;
