// Draws a linear picture into egui's target: zoom, exposure, tone curve, sRGB curve or false colour.

struct View {
    // Picture pixel at the viewport's top-left corner, and picture pixels a screen pixel.
    origin: vec2f,
    step: vec2f,
    // The viewport's top-left corner on the screen, in pixels.
    corner: vec2f,
    exposure: f32,
    // 0 none, 1 Reinhard, 2 filmic.
    tone: u32,
    // 0 radiance, 1 reflectance, 2 signed false colour, 3 positive false colour.
    shading: u32,
    range: f32,
    // Object to outline, or -1.
    selected: f32,
    // Above 0: pixels are blended into each other.
    smoothed: f32,
    surround: vec4f,
    outline: vec4f,
    ramp: array<vec4f, 7>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var picture: texture_2d<f32>;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    // One triangle that covers the viewport.
    let corner = vec2f(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4f(corner * 2.0 - 1.0, 0.0, 1.0);
}

fn srgb(linear: vec3f) -> vec3f {
    let v = clamp(linear, vec3f(0.0), vec3f(1.0));
    return select(1.055 * pow(v, vec3f(1.0 / 2.4)) - 0.055, v * 12.92, v <= vec3f(0.0031308));
}

fn toned(x: vec3f) -> vec3f {
    if view.tone == 1u {
        return x / (1.0 + x);
    }
    if view.tone == 2u {
        return (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
    }
    return x;
}

fn false_color(t: f32) -> vec3f {
    let x = clamp(t, 0.0, 1.0) * 6.0;
    let below = min(u32(x), 5u);
    return mix(view.ramp[below].rgb, view.ramp[below + 1u].rgb, x - f32(below));
}

// Where nothing is known.
fn hatched(position: vec2f) -> vec3f {
    let stripe = fract((position.x + position.y) / 10.0) < 0.5;
    return select(vec3f(0.22), vec3f(0.32), stripe);
}

fn colored(value: vec3f, position: vec2f) -> vec3f {
    // What is not a number becomes magenta, so that it shows.
    if !all(abs(value) < vec3f(3.0e38)) {
        return vec3f(1.0, 0.0, 1.0);
    }
    let mean = (value.r + value.g + value.b) / 3.0;
    switch view.shading {
        case 1u: { return srgb(value); }
        case 2u: { return false_color(0.5 + 0.5 * mean / view.range); }
        case 3u: { return select(false_color(mean / view.range), hatched(position), mean < 0.0); }
        default: { return srgb(toned(max(value, vec3f(0.0)) * view.exposure)); }
    }
}

fn radiance_at(pixel: vec2i, size: vec2i) -> vec3f {
    return textureLoad(picture, clamp(pixel, vec2i(0), size - 1), 0).rgb;
}

fn object_at(pixel: vec2i, size: vec2i) -> f32 {
    return textureLoad(picture, clamp(pixel, vec2i(0), size - 1), 0).a;
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let size = vec2i(textureDimensions(picture));
    let at = view.origin + (position.xy - view.corner) * view.step;
    if any(at < vec2f(0.0)) || any(at >= vec2f(size)) {
        return view.surround;
    }

    // Smaller than the screen's pixels: the mean over up to 4 x 4 taps. Larger: the pixel itself.
    let taps = clamp(vec2i(ceil(view.step)), vec2i(1), vec2i(4));
    var sum = vec3f(0.0);
    for (var j = 0; j < taps.y; j++) {
        for (var i = 0; i < taps.x; i++) {
            let offset = (vec2f(f32(i), f32(j)) + 0.5) / vec2f(taps) - 0.5;
            let pixel = vec2i(floor(at + offset * view.step));
            sum += textureLoad(picture, clamp(pixel, vec2i(0), size - 1), 0).rgb;
        }
    }
    var mean = sum / f32(taps.x * taps.y);
    if view.smoothed > 0.0 {
        let low = floor(at - 0.5);
        let share = at - 0.5 - low;
        let corner = vec2i(low);
        mean = mix(
            mix(radiance_at(corner, size), radiance_at(corner + vec2i(1, 0), size), share.x),
            mix(radiance_at(corner + vec2i(0, 1), size), radiance_at(corner + 1, size), share.x),
            share.y,
        );
    }
    var color = colored(mean, position.xy);

    // The selected object's edge, two screen pixels wide.
    if view.selected >= 0.0 {
        let here = object_at(vec2i(floor(at)), size) == view.selected;
        var edge = false;
        for (var k = 0; k < 4; k++) {
            let sign = 1.0 - 2.0 * f32(k & 1);
            let along = select(vec2f(0.0, sign), vec2f(sign, 0.0), k < 2);
            let there = object_at(vec2i(floor(at + along * max(view.step, vec2f(0.5)) * 1.5)), size);
            edge = edge || ((there == view.selected) != here);
        }
        if edge {
            color = view.outline.rgb;
        }
    }
    return vec4f(color, 1.0);
}
