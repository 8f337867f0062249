//! What comes in: captures, photographs and what is made of them before a fit.

#[path = "../common/beside.rs"]
mod beside;
#[path = "../common/mod.rs"]
mod common;
#[path = "../scenes/mod.rs"]
mod scenes;

mod agreement;
mod captures;
mod gbuffer;
mod overexposed;
mod photographs;
mod prepare;
mod segments;
mod sharpness;
