//! Paths traced by a graphics card: the estimator of [`crate::transport::path`] in WGSL, by compute shaders alone.
//!
//! ```text
//! card       adapters, the device, its failures
//! layout     what both sides share: structs and constants, written into the shader's text
//! shaders/   the path tracer, modules with the names of `transport`
//! hierarchy  the binary hierarchy, flattened
//! scene      triangles, materials and lights as the shader reads them
//! tracer     a scene on the card: pictures, pairs of pictures, single rays
//! pace       how much work a dispatch gets
//! ```
//!
//! Random numbers are the processor's, key by key and bit for bit, so that a pixel's sample is the same path up to rounding.
//! What the shader needs is what WebGPU grants on Vulkan, Metal and DX12: eight storage buffers, no feature. Every failure, the
//! loss of the device included, is an error value; whoever called goes on with the processor.

mod card;
mod hierarchy;
mod layout;
mod lights;
mod materials;
mod pace;
mod scene;
mod shader;
mod tracer;

pub use card::{Adapters, Card};
pub use scene::Inserted;
pub use tracer::{PairSums, Tracer, View};
