// The surface point of a hit: position, normals and material.

struct Surface {
    point: vec3<f32>,
    normal: vec3<f32>,
    shading_normal: vec3<f32>,
    albedo: vec3<f32>,
    emission: vec3<f32>,
    // Pdf per square metre of light sampling.
    emitter_pdf: f32,
    specular: vec3<f32>,
    // Negative without a lobe.
    roughness: f32,
    slot: u32,
    t: f32,
}

fn normal_or(v: vec3<f32>, fallback: vec3<f32>) -> vec3<f32> {
    let size = length(v);
    return select(fallback, v / max(size, SMALLEST), size > 0.0);
}

fn number(at: u32) -> f32 {
    return bitcast<f32>(data[at]);
}

fn color(at: u32) -> vec3<f32> {
    return vec3<f32>(number(at), number(at + 1u), number(at + 2u));
}

// Interpolates RGB values at the corners, nine numbers per triangle.
fn interpolated(at: u32, triangle: u32, hit: Hit) -> vec3<f32> {
    let first = at + 9u * triangle;
    return color(first) * (1.0 - hit.b1 - hit.b2) + color(first + 3u) * hit.b1 + color(first + 6u) * hit.b2;
}

// The shading normal, bent minimally so that it faces `wo` on the side on which the geometric normal does.
fn towards_viewer(shading: vec3<f32>, geometric: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    let side = select(wo, -wo, dot(geometric, wo) < 0.0);
    let cosine = dot(shading, side);
    if cosine >= NORMAL_MARGIN {
        return shading;
    }
    return normal_or(shading + side * (NORMAL_MARGIN - cosine), geometric);
}

fn surface_at(hit: Hit, ray: Ray) -> Surface {
    let slot = hit.slot;
    let material = materials[material_of(slot)];
    let normal = normal_of(slot);
    // Tables of inserted objects start at their own first triangle.
    let triangle = hit.index - material.image.z;
    var surface: Surface;
    surface.point = corner_of(slot, 0u) * (1.0 - hit.b1 - hit.b2) + corner_of(slot, 1u) * hit.b1 + corner_of(slot, 2u) * hit.b2;
    surface.normal = normal;
    surface.shading_normal = normal;
    if is_inserted(slot) {
        var shading = normal;
        if material.corners.x != NONE {
            shading = normal_or(interpolated(material.corners.x, triangle, hit), normal);
        }
        surface.shading_normal = towards_viewer(shading, normal, -normal_or(ray.direction, vec3<f32>(0.0)));
    }
    surface.albedo = albedo_at(material, triangle, hit);
    if material.corners.y != NONE {
        surface.albedo = clamp(surface.albedo * interpolated(material.corners.y, triangle, hit), vec3<f32>(0.0), vec3<f32>(1.0));
    }
    surface.emission = material.emission.xyz;
    surface.emitter_pdf = material.emission.w;
    surface.specular = material.specular.xyz;
    surface.roughness = material.specular.w;
    surface.slot = slot;
    surface.t = hit.t;
    return surface;
}
