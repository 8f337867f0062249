// Nearest-hit and any-hit traversal of a binary hierarchy. Node i is nodes[2 i] (low corner, first) and nodes[2 i + 1] (high
// corner, count): a leaf holds `count` triangles from `first`, an inner node has its children at `first` and `first + 1`.

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
    // Hits at or beyond this are ignored.
    t_max: f32,
}

struct Hit {
    t: f32,
    // Index into `triangles`; NONE without a hit.
    slot: u32,
    b1: f32,
    b2: f32,
    // The triangle's index in the scene.
    index: u32,
}

// Whether rays hit inserted objects, and whether an inserted object was hit.
var<private> with_inserted: bool;
var<private> affected: bool;

// A ray, precomputed for the triangle test: axes permuted so that the direction's largest component is last, and the shear.
struct Shear {
    axes: vec3<u32>,
    shear: vec3<f32>,
}

fn corner_of(slot: u32, corner: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(triangles[TRIANGLE_WORDS * slot + corner].xyz);
}

fn order_of(slot: u32) -> u32 {
    return triangles[TRIANGLE_WORDS * slot].w;
}

fn material_of(slot: u32) -> u32 {
    return triangles[TRIANGLE_WORDS * slot + 1u].w;
}

fn is_inserted(slot: u32) -> bool {
    return triangles[TRIANGLE_WORDS * slot + 2u].w != 0u;
}

fn normal_of(slot: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(triangles[TRIANGLE_WORDS * slot + 3u].xyz);
}

// The reciprocal of each component of a direction; tiny components are clamped, keeping their sign.
fn reciprocal(direction: vec3<f32>) -> vec3<f32> {
    let size = abs(direction);
    let tiny = max(max(size.x, size.y), size.z) * 1e-12;
    let signed_tiny = select(vec3<f32>(tiny), vec3<f32>(-tiny), direction < vec3<f32>(0.0));
    return 1.0 / select(direction, signed_tiny, size < vec3<f32>(tiny));
}

// Entry distance of a box; FAR if it is not hit before `t_max`.
fn enter(node: u32, ray: Ray, inverse: vec3<f32>, t_max: f32) -> f32 {
    let low = (bitcast<vec3<f32>>(nodes[2u * node].xyz) - ray.origin) * inverse;
    let high = (bitcast<vec3<f32>>(nodes[2u * node + 1u].xyz) - ray.origin) * inverse;
    let near3 = min(low, high);
    let far3 = max(low, high) * WIDEN;
    let near = max(max(near3.x, near3.y), max(near3.z, 0.0));
    let far = min(min(far3.x, far3.y), min(far3.z, t_max));
    return select(FAR, near, near <= far);
}

fn shear_of(direction: vec3<f32>, inverse: vec3<f32>) -> Shear {
    let size = abs(direction);
    var z = 2u;
    if size.z < size.x || size.z < size.y {
        z = select(0u, 1u, size.y > size.x);
    }
    let axes = vec3<u32>((z + 1u) % 3u, (z + 2u) % 3u, z);
    let scale = inverse[z];
    return Shear(axes, vec3<f32>(direction[axes.x] * scale, direction[axes.y] * scale, scale));
}

fn sheared(corner: vec3<f32>, ray: Ray, shear: Shear) -> vec3<f32> {
    let p = corner - ray.origin;
    let z = p[shear.axes.z];
    return vec3<f32>(p[shear.axes.x] - shear.shear.x * z, p[shear.axes.y] - shear.shear.y * z, shear.shear.z * z);
}

// Twice the signed area of the triangle of the ray and an edge, and a bound on its rounding error, including fused products.
fn edge(a: vec3<f32>, b: vec3<f32>) -> vec2<f32> {
    let first = a.x * b.y;
    let second = a.y * b.x;
    return vec2<f32>(first - second, (abs(first) + abs(second)) * ROUNDING);
}

// Updates `nearest` with a triangle's hit; ties go to the lowest index.
//
// As in Woop, Benthin and Wald 2013, but compilers may fuse products: edge functions within the rounding error count as inside for
// both triangles of an edge, and weights are clamped to one sign, so that the hit stays within the triangle.
fn test_triangle(slot: u32, ray: Ray, shear: Shear, nearest: ptr<function, Hit>) {
    let a = sheared(corner_of(slot, 0u), ray, shear);
    let b = sheared(corner_of(slot, 1u), ray, shear);
    let c = sheared(corner_of(slot, 2u), ray, shear);
    let u = edge(c, b);
    let v = edge(a, c);
    let w = edge(b, a);
    let weights = vec3<f32>(u.x, v.x, w.x);
    let slack = vec3<f32>(u.y, v.y, w.y);
    let side = select(1.0, -1.0, weights.x + weights.y + weights.z < 0.0);
    if any(side * weights < -slack) {
        return;
    }
    let inside = max(side * weights, vec3<f32>(0.0));
    let total = inside.x + inside.y + inside.z;
    if total <= 0.0 {
        return;
    }
    let t = (inside.x * a.z + inside.y * b.z + inside.z * c.z) / total;
    let index = order_of(slot);
    let tied = t == (*nearest).t && (*nearest).slot != NONE && index < (*nearest).index;
    if t > 0.0 && (t < (*nearest).t || tied) {
        *nearest = Hit(t, slot, inside.y / total, inside.z / total, index);
    }
}

// The stacks of a group's threads, entry by entry. In a thread's own memory they would be filled with zeros at each call, and some
// drivers compile an indexed array of its own into a branch for each entry.
var<workgroup> stacks: array<u32, STACK_SIZE * WORKGROUP>;
// The index of the thread in its group.
var<private> lane: u32;

fn traverse(ray: Ray, any_hit: bool) -> Hit {
    var nearest = Hit(ray.t_max, NONE, 0.0, 0.0, NONE);
    let inverse = reciprocal(ray.direction);
    let shear = shear_of(ray.direction, inverse);
    var depth = 0u;
    var node = 0u;
    if enter(0u, ray, inverse, nearest.t) >= FAR {
        return nearest;
    }
    loop {
        let first = nodes[2u * node].w;
        let count = nodes[2u * node + 1u].w;
        var descended = false;
        if count == 0u {
            // Descend to the nearer child; push the other.
            let left = enter(first, ray, inverse, nearest.t);
            let right = enter(first + 1u, ray, inverse, nearest.t);
            if min(left, right) < FAR {
                let swapped = right < left;
                if max(left, right) < FAR {
                    stacks[depth * WORKGROUP + lane] = select(first + 1u, first, swapped);
                    depth += 1u;
                }
                node = select(first, first + 1u, swapped);
                descended = true;
            }
        } else {
            for (var slot = first; slot < first + count; slot += 1u) {
                if with_inserted || !is_inserted(slot) {
                    test_triangle(slot, ray, shear, &nearest);
                }
            }
            if any_hit && nearest.slot != NONE {
                break;
            }
        }
        if descended {
            continue;
        }
        // Pop the next child. Boxes beyond the nearest hit are culled at their children.
        if depth == 0u {
            break;
        }
        depth -= 1u;
        node = stacks[depth * WORKGROUP + lane];
    }
    if nearest.slot != NONE && is_inserted(nearest.slot) {
        affected = true;
    }
    return nearest;
}

fn occluded(ray: Ray) -> bool {
    return traverse(ray, true).slot != NONE;
}

// Offsets a surface point from its triangle to the side of `w` by the bound on its rounding error (`scene::geometry`).
fn offset_origin(point: vec3<f32>, normal: vec3<f32>, slot: u32, w: vec3<f32>) -> vec3<f32> {
    let size = max(max(abs(corner_of(slot, 0u)), abs(corner_of(slot, 1u))), abs(corner_of(slot, 2u)));
    let distance = 2.0 * OFFSET_GAMMA * max(dot(size, abs(normal)), max(max(size.x, size.y), size.z) * 0.25);
    return point + normal * select(distance, -distance, dot(w, normal) < 0.0);
}
