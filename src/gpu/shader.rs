//! The shader's source: a generated head of shared definitions, then the modules.

use crate::gpu::layout::head;

/// The modules; their order does not matter.
const MODULES: [&str; 11] = [
    include_str!("shaders/random.wgsl"),
    include_str!("shaders/hierarchy.wgsl"),
    include_str!("shaders/texels.wgsl"),
    include_str!("shaders/surface.wgsl"),
    include_str!("shaders/microfacet.wgsl"),
    include_str!("shaders/bsdf.wgsl"),
    include_str!("shaders/emitters.wgsl"),
    include_str!("shaders/environment.wgsl"),
    include_str!("shaders/path.wgsl"),
    include_str!("shaders/film.wgsl"),
    include_str!("shaders/queries.wgsl"),
];

/// The entry point that accumulates radiance of a pixel.
pub(super) const RENDER: &str = "render";
/// The entry point that accumulates radiance of a pixel with and without inserted objects.
pub(super) const INSERT: &str = "insert";
/// The entry point that intersects a ray.
pub(super) const TRACE: &str = "trace";

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
        for kernel in [RENDER, INSERT, TRACE] {
            let mut entries = module.entry_points.iter();
            assert!(entries.any(|entry| entry.name == kernel));
        }
    }
}
