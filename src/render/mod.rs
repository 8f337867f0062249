//! Renders pictures with the graphics card where there is one and it is wanted, else with the processor. Both compute the same
//! estimator.

mod device;
mod pictures;
mod renderer;

pub use device::Device;
pub use pictures::Pictures;
pub use renderer::Renderer;
