//! The path tracer on a graphics card: the estimator of [`crate::transport::path`] in WGSL compute shaders.
//!
//! ```text
//! card       adapters, the device, its errors
//! layout     the shader's source, and the structs and constants that it shares
//! shaders/   the path tracer, in modules named as in `transport`
//! pipelines  the compiled shaders
//! buffers    buffers on the card
//! geometry   triangles and their hierarchy on the card
//! materials  materials in the shader's layout
//! lights     emitters and environment in the shader's layout
//! tracer     a lit scene on the card: pictures, pairs of pictures, single rays
//! film       the dispatches that fill the film buffer
//! pace       the amount of work per dispatch
//! ```
//!
//! Random numbers are bit-identical to the processor's, so each sample is the same path up to rounding. The shader needs only what
//! WebGPU guarantees on Vulkan, Metal and DX12: eight storage buffers and no features. Every failure, including the loss of the
//! device, is an error value, after which callers continue on the processor.

mod buffers;
mod card;
mod film;
mod geometry;
mod layout;
mod lights;
mod materials;
mod pace;
mod pipelines;
mod tracer;

pub use card::{Adapters, Card};
pub use geometry::Geometry;
pub use materials::Inserted;
pub use pipelines::Checks;
pub use tracer::{PairSums, Tracer, View};
