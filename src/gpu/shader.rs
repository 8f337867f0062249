//! The shader's source: a generated head of shared definitions, then the modules.

use crate::gpu::layout::head;

/// The modules; their order does not matter.
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

/// The entry points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kernel {
    /// Accumulates radiance of a pixel.
    Render,
    /// Accumulates radiance of a pixel with and without inserted objects.
    Insert,
    /// Intersects a ray.
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

/// The source for traversals with a stack of `stack_size` entries.
pub(super) fn source(stack_size: u32) -> String {
    let mut text = head(stack_size);
    for module in MODULES {
        text += "\n";
        text += module;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::naga::front::wgsl::parse_str;
    use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};

    #[test]
    fn the_shader_is_valid_without_an_adapter() {
        let text = source(32);
        let parsed = parse_str(&text).map_err(|error| error.emit_to_string(&text));
        let module = parsed.unwrap_or_else(|error| panic!("{error}"));
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        let valid = validator.validate(&module);
        assert!(valid.is_ok(), "{valid:?}");
        for kernel in [Kernel::Render, Kernel::Insert, Kernel::Trace] {
            let mut entries = module.entry_points.iter();
            assert!(entries.any(|entry| entry.name == kernel.entry()));
        }
    }
}
