// Draws the mesh's faces into a picture of the 3D view's own, and that picture into egui's target.

struct Scene {
    clip_from_scene: mat4x4f,
    eye: vec3f,
    exposure: f32,
    accent: vec4f,
    background: vec4f,
    selected: f32,
    // 1 where exposure and tone curve apply, 0 where faces are shaded by the direction of view.
    radiance: u32,
    tone: u32,
    // 1 where faces seen from behind are left out.
    cull: u32,
}

@group(0) @binding(0) var<uniform> scene: Scene;
// One texel a face: linear colour, object index.
@group(0) @binding(1) var faces: texture_2d<f32>;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) point: vec3f,
    @location(1) @interpolate(flat) color: vec4f,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @location(0) point: vec3f) -> Corner {
    let face = index / 3u;
    let columns = textureDimensions(faces).x;
    var corner: Corner;
    corner.clip = scene.clip_from_scene * vec4f(point, 1.0);
    corner.point = point;
    corner.color = textureLoad(faces, vec2u(face % columns, face / columns), 0);
    return corner;
}

fn srgb(linear: vec3f) -> vec3f {
    let v = clamp(linear, vec3f(0.0), vec3f(1.0));
    return select(1.055 * pow(v, vec3f(1.0 / 2.4)) - 0.055, v * 12.92, v <= vec3f(0.0031308));
}

fn toned(x: vec3f) -> vec3f {
    if scene.tone == 1u {
        return x / (1.0 + x);
    }
    if scene.tone == 2u {
        return (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
    }
    return x;
}

@fragment
fn fragment(corner: Corner, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let across = cross(dpdx(corner.point), dpdy(corner.point));
    if scene.cull == 1u && !front {
        discard;
    }
    var color = corner.color.rgb;
    if color.r < 0.0 {
        // No photograph sees the face: stripes across the screen.
        let stripe = fract((corner.clip.x + corner.clip.y) / 8.0) < 0.5;
        color = mix(scene.background.rgb, vec3f(0.5), select(0.18, 0.30, stripe));
    } else if scene.radiance == 1u {
        color = srgb(toned(color * scene.exposure));
    } else {
        let to_eye = normalize(scene.eye - corner.point);
        let facing = abs(dot(across, to_eye)) / max(length(across), 1e-30);
        color = srgb(color * (0.4 + 0.6 * facing));
    }
    if corner.color.a == scene.selected {
        color = mix(color, scene.accent.rgb, 0.45);
    }
    return vec4f(color, 1.0);
}

@group(0) @binding(0) var drawn: texture_2d<f32>;

struct Screen {
    @builtin(position) clip: vec4f,
    @location(0) at: vec2f,
}

@vertex
fn screen_vertex(@builtin(vertex_index) index: u32) -> Screen {
    let corner = vec2f(f32((index << 1u) & 2u), f32(index & 2u));
    var screen: Screen;
    screen.clip = vec4f(corner * 2.0 - 1.0, 0.0, 1.0);
    screen.at = vec2f(corner.x, 1.0 - corner.y);
    return screen;
}

@fragment
fn screen_fragment(screen: Screen) -> @location(0) vec4f {
    let size = textureDimensions(drawn);
    let pixel = min(vec2u(screen.at * vec2f(size)), size - 1u);
    return textureLoad(drawn, pixel, 0);
}
