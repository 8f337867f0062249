// Ray queries: reads (origin, t_max) and (direction, any), writes (t, b1, b2) and the triangle's index.

@compute @workgroup_size(WORKGROUP)
fn trace(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) index_in_group: u32) {
    lane = index_in_group;
    let index = pixel_of(id.x);
    if index == NONE {
        return;
    }
    with_inserted = true;
    let start = rays[2u * index];
    let along = rays[2u * index + 1u];
    let hit = traverse(Ray(start.xyz, along.xyz, start.w), along.w != 0.0);
    film[index - dispatch.paths.w] = vec4<u32>(bitcast<vec3<u32>>(vec3<f32>(hit.t, hit.b1, hit.b2)), hit.index);
}
