// The environment (`transport::environment`): a map with its pole on the y axis, infinitely far or on a box, and a sun.
//
// `environment` holds radiance and pdf per solid angle of each pixel; the cumulative probability of each pixel in units of 2⁻⁵³ and
// whether the sun shines through it; the cosines of the edges of each row; and the radiance of each pixel from above the horizon,
// if it differs.

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

// Where a ray leaves the box.
struct Exit {
    // From the middle of the box.
    point: vec3<f32>,
    // Normal axis of the face.
    axis: u32,
    // FAR or not positive if the ray does not leave the box.
    distance: f32,
}

fn exit_of(origin: vec3<f32>, direction: vec3<f32>) -> Exit {
    let low = dispatch.box_low.xyz;
    let high = dispatch.box_high.xyz;
    let ahead = select(low, high, direction > vec3<f32>(0.0)) - origin;
    var axis = 0u;
    var distance = FAR;
    for (var side = 0u; side < 3u; side += 1u) {
        if direction[side] != 0.0 {
            let t = ahead[side] / direction[side];
            if t < distance {
                axis = side;
                distance = t;
            }
        }
    }
    return Exit(origin + direction * distance - (low + high) * 0.5, axis, distance);
}

fn leaves_box(exit: Exit) -> bool {
    return dispatch.box_low.w != 0.0 && exit.distance > 0.0 && exit.distance < FAR;
}

// The map's direction for a direction at a point, and the ratio of both densities per solid angle.
fn map_direction(origin: vec3<f32>, direction: vec3<f32>) -> vec4<f32> {
    let exit = exit_of(origin, direction);
    if !leaves_box(exit) {
        return vec4<f32>(direction, 1.0);
    }
    let square = dot(exit.point, exit.point);
    let cos_middle = abs(exit.point[exit.axis]) / sqrt(square);
    let ratio = (cos_middle / square) * (exit.distance * exit.distance / abs(direction[exit.axis]));
    return vec4<f32>(normal_or(exit.point, vec3<f32>(0.0)), ratio);
}

fn is_sun(direction: vec3<f32>) -> bool {
    let chord = direction - dispatch.sun.xyz;
    return dispatch.sun.w > 0.0 && dot(chord, chord) <= SUN_RADIUS * SUN_RADIUS;
}

// Radiance from a direction through a pixel, and the pdf per solid angle of `draw_direction`.
fn light_through(pixel: u32, ratio: f32, direction: vec3<f32>) -> vec4<f32> {
    let width = dispatch.lights.z;
    let pixels = width * dispatch.lights.w;
    var light = bitcast<vec4<f32>>(environment[pixel]);
    if dispatch.above.w != 0.0 && dot(direction, dispatch.above.xyz) > 0.0 {
        let above = bitcast<vec4<f32>>(environment[2u * pixels + dispatch.lights.w + pixel]);
        light = vec4<f32>(above.xyz, light.w);
    }
    light.w *= ratio * (1.0 - dispatch.sun.w);
    if is_sun(direction) {
        light.w += dispatch.sun.w * dispatch.sun_light.w;
        if environment[pixels + pixel].z != 0u {
            light += vec4<f32>(dispatch.sun_light.xyz, 0.0);
        }
    }
    return light;
}

// Radiance that arrives at a point, and the pdf per solid angle of `draw_direction` there.
fn environment_at(origin: vec3<f32>, direction: vec3<f32>) -> vec4<f32> {
    let mapped = map_direction(origin, direction);
    return light_through(environment_pixel(mapped.xyz), mapped.w, direction);
}

// A direction, and the pixel that it was drawn from; NONE for the sun's.
struct Drawn {
    wi: vec3<f32>,
    pixel: u32,
}

// A direction at a point, drawn in proportion to luminance.
fn draw_direction(origin: vec3<f32>, choice: vec2<u32>, u: vec2<f32>) -> Drawn {
    if less(choice, dispatch.sun_choice.xy) {
        let beside = SUN_RADIUS * sqrt(u.x) * circle(u.y);
        let wi = normalize(to_world(frame_around(dispatch.sun.xyz), vec3<f32>(beside, 1.0)));
        return Drawn(wi, NONE);
    }
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
    var wi = vec3<f32>(r * across.x, y, r * across.y);
    let middle = (dispatch.box_low.xyz + dispatch.box_high.xyz) * 0.5;
    let exit = exit_of(middle, wi);
    if leaves_box(exit) {
        wi = normal_or(middle + exit.point - origin, vec3<f32>(0.0));
    }
    return Drawn(wi, low);
}

fn sample_environment(surface: Surface, choice: vec2<u32>, u: vec2<f32>) -> LightSample {
    let drawn = draw_direction(surface.point, choice, u);
    let wi = drawn.wi;
    let mapped = map_direction(surface.point, wi);
    var pixel = drawn.pixel;
    if pixel == NONE {
        pixel = environment_pixel(mapped.xyz);
    }
    let light = light_through(pixel, mapped.w, wi);
    let start = offset_origin(surface.point, surface.normal, surface.slot, wi);
    return LightSample(wi, light.xyz, light.w * (1.0 - dispatch.emitter_fraction.x), Ray(start, wi, FAR));
}
