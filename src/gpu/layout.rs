//! The shader's source, and what it shares with the processor: structs with one layout, bindings and constants.

use bytemuck::{Pod, Zeroable};
use std::fmt::Write;

/// Threads per workgroup.
pub(super) const WORKGROUP: u32 = 64;
/// Marks a missing triangle or table.
pub(super) const NONE: u32 = u32::MAX;
/// Four-component words per triangle: three corners and the normal.
pub(super) const TRIANGLE_WORDS: usize = 4;
/// Kinds of albedo: a constant colour, one colour per texel, and an image times a constant.
pub(super) const ALBEDO_CONSTANT: u32 = 0;
pub(super) const ALBEDO_TEXELS: u32 = 1;
pub(super) const ALBEDO_IMAGE: u32 = 2;

/// A type with the same bytes in Rust and WGSL: 16 of them, so that fields of such types lie at WGSL's offsets.
trait Shared {
    const WGSL: &'static str;
}

impl Shared for [f32; 4] {
    const WGSL: &'static str = "vec4<f32>";
}

impl Shared for [u32; 4] {
    const WGSL: &'static str = "vec4<u32>";
}

/// Defines structs for Rust and WGSL.
macro_rules! shared {
    ($($(#[$about:meta])* struct $name:ident { $($(#[$field_about:meta])* $field:ident: $kind:ty,)* })*) => {
        $(
            $(#[$about])*
            #[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
            #[repr(C, align(16))]
            pub(super) struct $name {
                $($(#[$field_about])* pub $field: $kind,)*
            }
        )*

        /// The structs as WGSL.
        fn structs() -> String {
            let mut text = String::new();
            $(
                text += concat!("struct ", stringify!($name), " {\n");
                $(text += &format!("    {}: {},\n", stringify!($field), <$kind as Shared>::WGSL);)*
                text += "}\n\n";
            )*
            text
        }
    };
}

shared! {
    /// Parameters of a dispatch.
    struct Dispatch {
        center: [f32; 4],
        axis_x: [f32; 4],
        axis_y: [f32; 4],
        axis_z: [f32; 4],
        /// Focal lengths and principal point in pixels.
        lens: [f32; 4],
        /// Radial k1, k2, tangential p1, p2.
        distortion: [f32; 4],
        /// Hash of seed and frame, the low word first.
        key: [u32; 4],
        /// Width of the picture, first pixel, end of pixels, first sample.
        slice: [u32; 4],
        /// Number of samples, maximum bounces, bounces before Russian roulette, first pixel of the film buffer.
        paths: [u32; 4],
        /// Number of emitting objects, unused, width and height of the environment map (0 without one).
        lights: [u32; 4],
        /// Probability of sampling an emitter of the mesh rather than the environment.
        emitter_fraction: [f32; 4],
        /// Smallest coordinates of the environment's box, and 1 if there is one.
        box_low: [f32; 4],
        box_high: [f32; 4],
        /// Up vector, and 1 if radiance from above the horizon differs.
        above: [f32; 4],
        /// Direction towards the sun, and the fraction of light samples of the environment that are drawn from it.
        sun: [f32; 4],
        /// Radiance of the sun, and its pdf per solid angle.
        sun_light: [f32; 4],
        /// That fraction in units of 2⁻⁵³, low and high word.
        sun_choice: [u32; 4],
    }

    struct Material {
        /// Constant albedo, or factor on the image.
        albedo: [f32; 4],
        /// Emitted radiance, and the pdf per square metre of light sampling.
        emission: [f32; 4],
        /// Specular reflectance at normal incidence, and the roughness (negative without a lobe).
        specular: [f32; 4],
        /// Kind of albedo, and indices into `data`: texel table and colours, or image and texture coordinates.
        kind: [u32; 4],
        /// Size of the image, and the index of the first triangle in the tables.
        image: [u32; 4],
        /// Indices into `data` of corner normals and corner colours, or [`NONE`].
        corners: [u32; 4],
    }
}

/// The head of the shader: constants, structs and bindings. `stack_size` entries bound the hierarchy's depth.
fn head(stack_size: u32) -> String {
    use crate::scene::geometry::OFFSET_GAMMA;
    use crate::transport::bsdf::{COUPLING_SLOPE, coupling_scale};
    use crate::transport::path::RR_MAX_SURVIVAL;
    // Rounding errors of slab distances, as on the processor.
    let widen = 1.0 + 8.0 * f32::EPSILON;
    // Rounding errors of two products and a difference.
    let rounding = 2.0 * f32::EPSILON;
    let mut text = String::new();
    for (name, value) in [
        ("WIDEN", widen),
        ("ROUNDING", rounding),
        ("OFFSET_GAMMA", OFFSET_GAMMA),
        ("FAR", f32::MAX),
        ("SMALLEST", f32::MIN_POSITIVE),
        ("PI", std::f32::consts::PI),
        ("COUPLING_SLOPE", COUPLING_SLOPE as f32),
        ("COUPLING_SCALE", coupling_scale() as f32),
        ("NORMAL_MARGIN", crate::transport::world::NORMAL_MARGIN),
        ("RR_MAX_SURVIVAL", RR_MAX_SURVIVAL),
        ("SUN_RADIUS", crate::transport::sun::RADIUS),
    ] {
        let _ = writeln!(text, "const {name} = {value:e}f;");
    }
    for (name, value) in [
        ("WORKGROUP", WORKGROUP),
        ("NONE", NONE),
        ("TRIANGLE_WORDS", TRIANGLE_WORDS as u32),
        ("ALBEDO_TEXELS", ALBEDO_TEXELS),
        ("ALBEDO_IMAGE", ALBEDO_IMAGE),
        ("STACK_SIZE", stack_size),
        ("INSERT_WORDS", INSERT.words),
    ] {
        let _ = writeln!(text, "const {name} = {value}u;");
    }
    text += "\n";
    text += &structs();
    text += "@group(0) @binding(0) var<uniform> dispatch: Dispatch;\n";
    for (index, (name, kind)) in BINDINGS.iter().enumerate() {
        let access = if *name == FILM { "read_write" } else { "read" };
        let _ = writeln!(
            text,
            "@group(0) @binding({}) var<storage, {access}> {name}: array<{kind}>;",
            index + 1
        );
    }
    text
}

/// The writable binding: words of four numbers, some per pixel or ray ([`Kernel::words`]).
pub(super) const FILM: &str = "film";

/// The storage bindings after the uniform one, with their element types. WebGPU guarantees eight.
pub(super) const BINDINGS: [(&str, &str); 8] = [
    ("nodes", "vec4<u32>"),
    ("triangles", "vec4<u32>"),
    ("materials", "Material"),
    ("data", "u32"),
    ("emitters", "vec4<u32>"),
    ("environment", "vec4<u32>"),
    ("rays", "vec4<f32>"),
    (FILM, "vec4<u32>"),
];

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

/// An entry point of the shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kernel {
    pub name: &'static str,
    /// Words of the film buffer per pixel or ray.
    pub words: u32,
}

/// Accumulates radiance: its sum, and the number of rays plus 2²⁴ times that of rejected samples.
pub(super) const RENDER: Kernel = Kernel {
    name: "render",
    words: 1,
};
/// Accumulates radiance with and without inserted objects. Its words:
///
/// 1. the sum with them, and the number of samples whose first hit is an inserted object,
/// 2. the sum without them,
/// 3. the sum with them over those samples,
/// 4. the sum without them over those samples,
/// 5. the numbers of rays, of rejected samples and of samples that the objects change.
pub(super) const INSERT: Kernel = Kernel {
    name: "insert",
    words: 5,
};
/// Intersects a ray: distance, barycentric weights and the triangle's index.
pub(super) const TRACE: Kernel = Kernel {
    name: "trace",
    words: 1,
};

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
            assert!(entries.any(|entry| entry.name == kernel.name));
        }
    }
}
