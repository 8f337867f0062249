// The GGX lobe with height-correlated Smith masking and Schlick's Fresnel term (`transport::microfacet`), in single precision.

struct Microfacet {
    alpha: f32,
    wo: vec3<f32>,
    wi: vec3<f32>,
    // Denominator of the distribution: sin²θh / α² + cos²θh.
    q: f32,
    // Schlick's (1 − wo · h)⁵.
    schlick: f32,
}

fn fifth(x: f32) -> f32 {
    return x * x * x * x * x;
}

// Recomputes z of a unit direction from x and y where z is the largest: its rounding error would dominate theirs.
fn renormalized_z(w: vec3<f32>) -> vec3<f32> {
    let rest = w.x * w.x + w.y * w.y;
    return vec3<f32>(w.xy, select(w.z, sqrt(max(1.0 - rest, 0.0)), rest < 0.5));
}

fn microfacet(alpha: f32, wo: vec3<f32>, wi: vec3<f32>) -> Microfacet {
    let o = renormalized_z(wo);
    let i = renormalized_z(wi);
    let h = normal_or(o + i, vec3<f32>(0.0, 0.0, 1.0));
    let slope = h.xy / alpha;
    let schlick = fifth(clamp(1.0 - 0.5 * dot(h, o + i), 0.0, 1.0));
    return Microfacet(alpha, o, i, dot(slope, slope) + h.z * h.z, schlick);
}

// Density of normals at the half vector.
fn distribution(m: Microfacet) -> f32 {
    return 1.0 / (PI * m.alpha * m.alpha * m.q * m.q);
}

// √(cos² + α² sin²) = cosθ (1 + 2Λ).
fn smith(alpha: f32, w: vec3<f32>) -> f32 {
    let across = alpha * w.xy;
    return sqrt(w.z * w.z + dot(across, across));
}

// f cosθi without the Fresnel term.
fn microfacet_eval(m: Microfacet) -> f32 {
    let masking = m.wi.z * smith(m.alpha, m.wo) + m.wo.z * smith(m.alpha, m.wi);
    return 0.5 * distribution(m) * m.wi.z / max(masking, SMALLEST);
}

// The pdf per solid angle of reflection on a visible normal.
fn microfacet_pdf(m: Microfacet) -> f32 {
    return 0.5 * distribution(m) / max(m.wo.z + smith(m.alpha, m.wo), SMALLEST);
}

// Reflects `w` on a sampled visible normal; the result may point below the horizon.
fn reflect_on_visible_normal(alpha: f32, w: vec3<f32>, u: vec2<f32>) -> vec3<f32> {
    let wo = renormalized_z(w);
    let stretched = normal_or(vec3<f32>(alpha * wo.xy, wo.z), vec3<f32>(0.0, 0.0, 1.0));
    let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    let sine = sqrt(max(1.0 - z * z, 0.0));
    let half_way = vec3<f32>(sine * circle(u.x), z) + stretched;
    let h = normal_or(vec3<f32>(alpha * half_way.xy, half_way.z), vec3<f32>(0.0, 0.0, 1.0));
    return normal_or(h * (2.0 * dot(h, wo)) - wo, vec3<f32>(0.0, 0.0, 1.0));
}
