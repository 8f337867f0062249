// The unidirectional path tracer with next-event estimation and multiple importance sampling (`transport::path`).

struct Frame {
    s: vec3<f32>,
    t: vec3<f32>,
    n: vec3<f32>,
}

// A path on its way.
struct Path {
    ray: Ray,
    throughput: vec3<f32>,
    total: vec3<f32>,
    rays: u32,
    bounce: u32,
    starts_on_inserted: bool,
    // Of `ray`'s direction; negative for the camera ray, which has no competing light sample.
    bsdf_pdf: f32,
}

// The result of one path.
struct PathSample {
    radiance: vec3<f32>,
    rays: u32,
    rejected: bool,
    // Whether the first hit is an inserted object.
    starts_on_inserted: bool,
}

// The frame around a unit vector (Duff et al. 2017).
fn frame_around(n: vec3<f32>) -> Frame {
    let side = select(1.0, -1.0, (bitcast<u32>(n.z) & 0x80000000u) != 0u);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    return Frame(
        vec3<f32>(1.0 + side * n.x * n.x * a, side * b, -side * n.x),
        vec3<f32>(b, side + n.y * n.y * a, -n.y),
        n,
    );
}

fn to_local(f: Frame, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(v, f.s), dot(v, f.t), dot(v, f.n));
}

fn to_world(f: Frame, v: vec3<f32>) -> vec3<f32> {
    return f.s * v.x + f.t * v.y + f.n * v.z;
}

// MIS weight of a sample with pdf `a` against a technique with pdf `b`: power heuristic, β = 2.
fn power_heuristic(a: f32, b: f32) -> f32 {
    if a <= 0.0 {
        return 0.0;
    }
    let ratio = min(b / a, 1e18);
    return 1.0 / (1.0 + ratio * ratio);
}

fn is_finite(v: vec3<f32>) -> bool {
    let exponents = bitcast<vec3<u32>>(v) & vec3<u32>(0x7f800000u);
    return all(exponents != vec3<u32>(0x7f800000u));
}

fn largest(v: vec3<f32>) -> f32 {
    return max(max(v.x, v.y), v.z);
}

// Direct light scattered towards `wo`, estimated by one light sample.
fn direct_light(surface: Surface, local: Frame, wo: vec3<f32>, rays: ptr<function, u32>) -> vec3<f32> {
    let pick = uniform1();
    let choice = uniform53();
    let u = uniform2();
    var light = no_light();
    if pick < dispatch.emitter_fraction.x {
        if dispatch.lights.x > 0u {
            light = sample_emitter(surface, choice, u);
        }
    } else if dispatch.lights.z > 0u {
        light = sample_environment(surface, choice, u);
    }
    if light.pdf <= 0.0 {
        return vec3<f32>(0.0);
    }
    let scattered = bsdf_eval(surface, wo, to_local(local, light.wi));
    if all(scattered.xyz == vec3<f32>(0.0)) {
        return vec3<f32>(0.0);
    }
    *rays += 1u;
    if occluded(light.ray) {
        return vec3<f32>(0.0);
    }
    return scattered.xyz * light.radiance / light.pdf * power_heuristic(light.pdf, scattered.w);
}

fn begin_path(camera_ray: Ray) -> Path {
    return Path(camera_ray, vec3<f32>(1.0), vec3<f32>(0.0), 0u, 0u, false, -1.0);
}

fn end_path(path: Path) -> PathSample {
    let rejected = !is_finite(path.total);
    let total = select(path.total, vec3<f32>(0.0), rejected);
    return PathSample(total, path.rays, rejected, path.starts_on_inserted);
}

// Adds the next vertex; false if the path ended there.
fn extend(path: ptr<function, Path>) -> bool {
    // Find the vertex.
    let ray = (*path).ray;
    let throughput = (*path).throughput;
    let bsdf_pdf = (*path).bsdf_pdf;
    (*path).rays += 1u;
    let hit = traverse(ray, false);
    if hit.slot == NONE {
        if dispatch.lights.z > 0u {
            let light = environment_at(ray.origin, normal_or(ray.direction, vec3<f32>(0.0)));
            let weight = select(power_heuristic(bsdf_pdf, light.w * (1.0 - dispatch.emitter_fraction.x)), 1.0, bsdf_pdf < 0.0);
            (*path).total += throughput * light.xyz * weight;
        }
        return false;
    }
    let surface = surface_at(hit, ray);
    if (*path).bounce == 0u {
        (*path).starts_on_inserted = is_inserted(hit.slot);
    }

    // Add emission.
    let wo = -normal_or(ray.direction, vec3<f32>(0.0));
    let cos_emitter = dot(surface.normal, wo);
    if cos_emitter > 0.0 && any(surface.emission != vec3<f32>(0.0)) {
        let along = ray.direction * surface.t;
        let light_pdf = dispatch.emitter_fraction.x * surface.emitter_pdf * dot(along, along) / cos_emitter;
        let weight = select(power_heuristic(bsdf_pdf, light_pdf), 1.0, bsdf_pdf < 0.0);
        (*path).total += throughput * surface.emission * weight;
    }
    if (*path).bounce >= dispatch.paths.y {
        return false;
    }

    // Next-event estimation.
    let local = frame_around(surface.shading_normal * select(1.0, -1.0, cos_emitter < 0.0));
    let local_wo = to_local(local, wo);
    var shadow_rays = 0u;
    (*path).total += throughput * direct_light(surface, local, local_wo, &shadow_rays);
    (*path).rays += shadow_rays;

    // Continue the path by sampling the BSDF.
    let choice = uniform1();
    let next = bsdf_sample(surface, local_wo, choice, uniform2());
    if next.pdf <= 0.0 {
        return false;
    }
    (*path).throughput = throughput * next.weight;
    let wi = to_world(local, next.wi);
    (*path).ray = Ray(offset_origin(surface.point, surface.normal, surface.slot, wi), wi, FAR);
    (*path).bsdf_pdf = next.pdf;
    (*path).bounce += 1u;

    // Russian roulette.
    let brightest = largest((*path).throughput);
    if (*path).bounce <= dispatch.paths.z {
        return brightest > 0.0;
    }
    let survival = min(brightest, RR_MAX_SURVIVAL);
    if survival <= 0.0 || uniform1() >= survival {
        return false;
    }
    (*path).throughput /= survival;
    return true;
}

// Radiance along a camera ray, estimated by one path.
fn radiance(camera_ray: Ray) -> PathSample {
    var path = begin_path(camera_ray);
    loop {
        if !extend(&path) {
            break;
        }
    }
    return end_path(path);
}
