// Albedo at a hit: a constant, a texel, or an image.

fn albedo_at(material: Material, triangle: u32, hit: Hit) -> vec3<f32> {
    if material.kind.x == ALBEDO_TEXELS {
        return color(material.kind.z + 3u * texel_of(material.kind.y, triangle, hit));
    }
    if material.kind.x == ALBEDO_IMAGE {
        return image_at(material, triangle, hit) * material.albedo.xyz;
    }
    return material.albedo.xyz;
}

// The texel of a hit; `table` holds each triangle's first texel, and the total number at the end.
fn texel_of(table: u32, triangle: u32, hit: Hit) -> u32 {
    let first = data[table + triangle];
    let count = data[table + triangle + 1u] - first;
    if count <= 1u {
        return first;
    }
    // A triangle with 4^level texels has n = 2^level strips along b2.
    let n = 1u << (firstLeadingBit(count) / 2u);
    let along = vec2<f32>(hit.b1, hit.b2) * f32(n);
    let row = min(u32(along.y), n - 1u);
    let column = min(u32(along.x), n - 1u - row);
    let part = fract(along);
    let inverted = part.x + part.y > 1.0 && column + 1u < n - row;
    return first + row * (2u * n - row) + 2u * column + select(0u, 1u, inverted);
}

fn corner_uv(at: u32) -> vec2<f32> {
    return vec2<f32>(number(at), number(at + 1u));
}

fn wrapped(i: i32, size: i32) -> i32 {
    return ((i % size) + size) % size;
}

fn image_pixel(material: Material, at: vec2<i32>) -> vec3<f32> {
    let size = vec2<i32>(material.image.xy);
    let pixel = wrapped(at.y, size.y) * size.x + wrapped(at.x, size.x);
    return color(material.kind.y + 3u * u32(pixel));
}

// Bilinear lookup at a hit in the tiled image.
fn image_at(material: Material, triangle: u32, hit: Hit) -> vec3<f32> {
    let corners = material.kind.z + 6u * triangle;
    let uv = corner_uv(corners) * (1.0 - hit.b1 - hit.b2) + corner_uv(corners + 2u) * hit.b1 + corner_uv(corners + 4u) * hit.b2;
    let at = vec2<f32>(uv.x, 1.0 - uv.y) * vec2<f32>(material.image.xy) - 0.5;
    let low = vec2<i32>(floor(at));
    let part = fract(at);
    let top = mix(image_pixel(material, low), image_pixel(material, low + vec2<i32>(1, 0)), part.x);
    let bottom = mix(image_pixel(material, low + vec2<i32>(0, 1)), image_pixel(material, low + vec2<i32>(1, 1)), part.x);
    return mix(top, bottom, part.y);
}
