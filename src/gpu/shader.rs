//! The shader's text: a head written from the shared definitions, then its modules.

use crate::gpu::layout::head;

/// The modules, in any order that reads well.
const MODULES: [&str; 10] = [
    include_str!("shaders/random.wgsl"),
    include_str!("shaders/hierarchy.wgsl"),
    include_str!("shaders/texels.wgsl"),
    include_str!("shaders/surface.wgsl"),
    include_str!("shaders/microfacet.wgsl"),
    include_str!("shaders/bsdf.wgsl"),
    include_str!("shaders/emitters.wgsl"),
    include_str!("shaders/environment.wgsl"),
    include_str!("shaders/path.wgsl"),
    concat!(
        include_str!("shaders/film.wgsl"),
        "\n",
        include_str!("shaders/queries.wgsl")
    ),
];

/// What one thread can do, each an entry point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kernel {
    /// Radiance of a pixel.
    Render,
    /// Radiance of a pixel with and without inserted objects.
    Insert,
    /// A ray's hit.
    Trace,
}

impl Kernel {
    /// The entry point's name.
    pub fn entry(self) -> &'static str {
        match self {
            Self::Render => "render",
            Self::Insert => "insert",
            Self::Trace => "trace",
        }
    }
}

/// The whole text, for hierarchies whose traversal needs at most `stack_size` entries.
pub(super) fn source(stack_size: u32) -> String {
    let mut text = head(stack_size);
    for module in MODULES {
        text += "\n";
        text += module;
    }
    text
}
