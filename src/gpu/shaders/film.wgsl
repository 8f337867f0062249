// Accumulates path samples; each dispatch covers a slice of pixels and samples, each thread one pixel.

// The ray through a point of the image plane, in pixels from the top-left corner (`scene::camera`).
fn camera_ray(pixel: vec2<f32>) -> Ray {
    let distorted = (pixel - dispatch.lens.zw) / dispatch.lens.xy;
    let p = undistorted(distorted);
    let direction = dispatch.axis_x.xyz * p.x - dispatch.axis_y.xyz * p.y - dispatch.axis_z.xyz;
    return Ray(dispatch.center.xyz, normal_or(direction, vec3<f32>(0.0)), FAR);
}

// Undistorted image coordinates, by fixed-point iteration (`capture::camera`).
fn undistorted(image: vec2<f32>) -> vec2<f32> {
    let k = dispatch.distortion;
    var p = image;
    if all(k == vec4<f32>(0.0)) {
        return p;
    }
    for (var i = 0; i < 20; i += 1) {
        let r2 = dot(p, p);
        if 1.0 + 3.0 * k.x * r2 + 5.0 * k.y * r2 * r2 <= 0.0 {
            break;
        }
        let tangential = vec2<f32>(
            2.0 * k.z * p.x * p.y + k.w * (r2 + 2.0 * p.x * p.x),
            k.z * (r2 + 2.0 * p.y * p.y) + 2.0 * k.w * p.x * p.y,
        );
        p += image - (p * (1.0 + k.x * r2 + k.y * r2 * r2) + tangential);
    }
    return p;
}

// The pixel of a thread; NONE beyond the slice.
fn pixel_of(thread: u32) -> u32 {
    let pixel = dispatch.slice.y + thread;
    return select(NONE, pixel, pixel < dispatch.slice.z);
}

fn begin_sample(pixel: u32, sample: u32) -> Ray {
    begin_stream(pixel, sample);
    let corner = vec2<f32>(f32(pixel % dispatch.slice.x), f32(pixel / dispatch.slice.x));
    return camera_ray(corner + uniform2());
}

fn add_to_film(word: u32, value: vec4<f32>) {
    film[word] = bitcast<vec4<u32>>(bitcast<vec4<f32>>(film[word]) + value);
}

// A thread begins its next sample as soon as a path ends: threads of a group would otherwise wait for the longest path.
@compute @workgroup_size(WORKGROUP)
fn render(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) index_in_group: u32) {
    lane = index_in_group;
    let pixel = pixel_of(id.x);
    if pixel == NONE {
        return;
    }
    with_inserted = true;
    var sum = vec3<f32>(0.0);
    var counts = 0u;
    var done = 0u;
    var path = begin_path(begin_sample(pixel, dispatch.slice.w));
    loop {
        if extend(&path) {
            continue;
        }
        let found = end_path(path);
        sum += found.radiance;
        counts += found.rays + (u32(found.rejected) << 24u);
        done += 1u;
        if done >= dispatch.paths.x {
            break;
        }
        path = begin_path(begin_sample(pixel, dispatch.slice.w + done));
    }
    let word = pixel - dispatch.paths.w;
    let before = film[word];
    film[word] = vec4<u32>(bitcast<vec3<u32>>(bitcast<vec3<f32>>(before.xyz) + sum), before.w + counts);
}

// Pairs of paths with and without the inserted objects, from the same random numbers (`compose::insert`).
@compute @workgroup_size(WORKGROUP)
fn insert(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) index_in_group: u32) {
    lane = index_in_group;
    let pixel = pixel_of(id.x);
    if pixel == NONE {
        return;
    }
    var over = vec4<f32>(0.0);
    var under = vec4<f32>(0.0);
    var covered_over = vec4<f32>(0.0);
    var covered_under = vec4<f32>(0.0);
    var counts = vec4<u32>(0u);
    for (var i = 0u; i < dispatch.paths.x; i += 1u) {
        let ray = begin_sample(pixel, dispatch.slice.w + i);
        let state = stream_state;
        affected = false;
        var pair = array(vec3<f32>(0.0), vec3<f32>(0.0));
        var rays = 0u;
        var rejected = false;
        var covered = false;
        // Both paths in one loop: drivers compile each place that traces a path anew.
        for (var objects = 1i; objects >= 0i; objects -= 1i) {
            with_inserted = objects == 1i;
            stream_state = state;
            let path = radiance(ray);
            rays += path.rays;
            rejected = rejected || path.rejected;
            if with_inserted {
                covered = path.starts_on_inserted;
                pair[0] = path.radiance;
            }
            pair[1] = path.radiance;
            // A path that no object affected is the same without them.
            if !affected {
                break;
            }
        }
        // Drop pairs as a whole, else the difference would be biased.
        let keep = select(1.0, 0.0, rejected);
        pair[0] *= keep;
        pair[1] *= keep;
        over += vec4<f32>(pair[0], f32(covered));
        under += vec4<f32>(pair[1], 0.0);
        covered_over += vec4<f32>(pair[0], 0.0) * f32(covered);
        covered_under += vec4<f32>(pair[1], 0.0) * f32(covered);
        let changed = covered || any(pair[0] != pair[1]);
        counts += vec4<u32>(rays, u32(rejected), u32(changed), 0u);
    }
    let word = INSERT_WORDS * (pixel - dispatch.paths.w);
    add_to_film(word, over);
    add_to_film(word + 1u, under);
    add_to_film(word + 2u, covered_over);
    add_to_film(word + 3u, covered_under);
    film[word + 4u] += counts;
}
