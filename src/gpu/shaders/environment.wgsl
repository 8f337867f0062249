// The environment map, with its pole on the y axis. `environment` holds radiance and pdf per solid angle of each pixel, then the
// cumulative probability of each pixel in units of 2⁻⁵³, then the cosines of the edges of each row.

fn environment_pixel(direction: vec3<f32>) -> u32 {
    let width = dispatch.lights.z;
    let height = dispatch.lights.w;
    let row = min(u32(acos(clamp(direction.y, -1.0, 1.0)) / PI * f32(height)), height - 1u);
    var angle = atan2(direction.z, direction.x);
    if angle < 0.0 {
        angle += 2.0 * PI;
    }
    let column = min(u32(angle / (2.0 * PI) * f32(width)), width - 1u);
    return row * width + column;
}

// Radiance of a pixel and its pdf per solid angle.
fn environment_at(pixel: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(environment[pixel]);
}

fn sample_environment(surface: Surface, choice: vec2<u32>, u: vec2<f32>) -> LightSample {
    let width = dispatch.lights.z;
    let pixels = width * dispatch.lights.w;
    var low = 0u;
    var high = pixels - 1u;
    while low < high {
        let middle = low + (high - low) / 2u;
        if less(choice, environment[pixels + middle].xy) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    // Sample uniformly by solid angle within the pixel: uniformly in cosθ and φ.
    let edges = bitcast<vec2<f32>>(environment[2u * pixels + low / width].xy);
    let y = mix(edges.x, edges.y, u.x);
    let r = sqrt(max(1.0 - y * y, 0.0));
    let across = circle((f32(low % width) + u.y) / f32(width));
    let wi = vec3<f32>(r * across.x, y, r * across.y);
    let light = environment_at(low);
    let start = offset_origin(surface.point, surface.normal, surface.slot, wi);
    return LightSample(wi, light.xyz, light.w * (1.0 - dispatch.emitter_fraction.x), Ray(start, wi, FAR));
}
