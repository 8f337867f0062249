// Emitter sampling: an object by its weight, then a triangle by its area. Both are tables of cumulative probabilities as
// 64-bit integers: (low word, high word, first or slot, count), in units of 2⁻⁵³ for objects and of 2⁻⁴⁸ for triangles.

struct LightSample {
    // Unit direction.
    wi: vec3<f32>,
    // Unoccluded radiance.
    radiance: vec3<f32>,
    // Pdf per solid angle; zero without a sample.
    pdf: f32,
    // Shadow ray.
    ray: Ray,
}

fn no_light() -> LightSample {
    let nowhere = vec3<f32>(0.0);
    return LightSample(nowhere, nowhere, 0.0, Ray(nowhere, nowhere, 0.0));
}

// The first entry from `first` whose cumulative probability exceeds `target_bits`, else the last.
fn draw_entry(first: u32, count: u32, target_bits: vec2<u32>) -> u32 {
    var low = first;
    var high = first + count - 1u;
    while low < high {
        let middle = low + (high - low) / 2u;
        if less(target_bits, emitters[middle].xy) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// Barycentric weights (b1, b2) of a point uniform in area on a triangle (Heitz 2019).
fn uniform_triangle(u: vec2<f32>) -> vec2<f32> {
    if u.y > u.x {
        return vec2<f32>(0.5 * u.x, u.y - 0.5 * u.x);
    }
    return vec2<f32>(u.x - 0.5 * u.y, 0.5 * u.y);
}

// Samples a point on an emitter's front for a surface point, from 53 bits for the choice and two numbers for the point.
fn sample_emitter(surface: Surface, choice: vec2<u32>, u: vec2<f32>) -> LightSample {
    let object = emitters[draw_entry(0u, dispatch.lights.x, choice)];
    // The lowest bits of the choice extend the 24 bits of the first number.
    let bits = u32(u.x * 16777216.0);
    let target_bits = vec2<u32>((bits << 24u) | (choice.x & 0xffffffu), bits >> 8u);
    let drawn = draw_entry(object.z, object.w, target_bits);
    let entry = emitters[drawn];
    var below = vec2<u32>(0u);
    if drawn > object.z {
        below = emitters[drawn - 1u].xy;
    }
    let size = as_float(subtract(entry.xy, below));
    let within = select(0.0, as_float(subtract(target_bits, below)) / max(size, 1.0), size > 0.0);
    let b = uniform_triangle(vec2<f32>(clamp(within, 0.0, 1.0), u.y));

    let slot = entry.z;
    let point = corner_of(slot, 0u) * (1.0 - b.x - b.y) + corner_of(slot, 1u) * b.x + corner_of(slot, 2u) * b.y;
    let normal = normal_of(slot);
    let material = materials[material_of(slot)];
    let to_light = point - surface.point;
    let distance2 = dot(to_light, to_light);
    let wi = normal_or(to_light, vec3<f32>(0.0));
    let cosine = -dot(normal, wi);
    if cosine <= 0.0 || distance2 <= 0.0 {
        return no_light();
    }
    let start = offset_origin(surface.point, surface.normal, surface.slot, wi);
    let end = offset_origin(point, normal, slot, -wi);
    let pdf = dispatch.emitter_fraction.x * material.emission.w * distance2 / cosine;
    return LightSample(wi, material.emission.xyz, pdf, Ray(start, end - start, 1.0));
}
