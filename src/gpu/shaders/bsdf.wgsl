// The BSDF (`transport::bsdf`): a diffuse base under an optional rough specular lobe. Directions are local: the z axis is the
// normal on the side of `wo`.

struct BsdfSample {
    wi: vec3<f32>,
    // f(wo, wi) cosθi / pdf.
    weight: vec3<f32>,
    // Pdf per solid angle; zero for samples that contribute nothing.
    pdf: f32,
}

// Cosine and sine of a fraction of the full turn; arguments stay within ±π, where their precision is specified.
fn circle(fraction: f32) -> vec2<f32> {
    let angle = 2.0 * PI * (fraction - select(0.0, 1.0, fraction > 0.5));
    return vec2<f32>(cos(angle), sin(angle));
}

// Unit disk, uniform in area (Shirley and Chiu 1997, concentric).
fn concentric_disk(u: vec2<f32>) -> vec2<f32> {
    let p = 2.0 * u - 1.0;
    if p.x == 0.0 && p.y == 0.0 {
        return vec2<f32>(0.0);
    }
    if abs(p.x) > abs(p.y) {
        let angle = 0.25 * PI * (p.y / p.x);
        return p.x * vec2<f32>(cos(angle), sin(angle));
    }
    let angle = 0.5 * PI - 0.25 * PI * (p.x / p.y);
    return p.y * vec2<f32>(cos(angle), sin(angle));
}

// Density cosθ/π per solid angle.
fn cosine_hemisphere(u: vec2<f32>) -> vec3<f32> {
    let disk = concentric_disk(u);
    return vec3<f32>(disk, sqrt(max(1.0 - dot(disk, disk), 0.0)));
}

// Upper bound of the directional reflectance of a lobe with F0 = 0.
fn reflected(cosine: f32) -> f32 {
    return fifth(1.0 - COUPLING_SLOPE * cosine);
}

// f cosθi of the base for unit albedo, without the factor (1 − F0).
fn coupling(wo: vec3<f32>, wi: vec3<f32>) -> f32 {
    return COUPLING_SCALE * wi.z * (1.0 - reflected(wo.z)) * (1.0 - reflected(wi.z));
}

// Probability of sampling the lobe.
fn lobe_fraction(surface: Surface, wo: vec3<f32>) -> f32 {
    let specular = (surface.specular.x + surface.specular.y + surface.specular.z) / 3.0;
    return specular + (1.0 - specular) * reflected(wo.z);
}

// f(wo, wi) cosθi and, in w, the pdf of `bsdf_sample`; zero at or below the horizon.
fn bsdf_eval(surface: Surface, wo: vec3<f32>, wi: vec3<f32>) -> vec4<f32> {
    if wo.z <= 0.0 || wi.z <= 0.0 {
        return vec4<f32>(0.0);
    }
    let base = wi.z / PI;
    if surface.roughness < 0.0 {
        return vec4<f32>(surface.albedo * base, base);
    }
    let m = microfacet(surface.roughness, wo, wi);
    let fresnel = surface.specular + (1.0 - surface.specular) * m.schlick;
    let value = surface.albedo * (1.0 - surface.specular) * coupling(wo, wi) + fresnel * microfacet_eval(m);
    let fraction = lobe_fraction(surface, wo);
    return vec4<f32>(value, fraction * microfacet_pdf(m) + (1.0 - fraction) * base);
}

// Samples a direction: `choice` selects lobe or base, `u` the direction.
fn bsdf_sample(surface: Surface, wo: vec3<f32>, choice: f32, u: vec2<f32>) -> BsdfSample {
    if wo.z <= 0.0 {
        return BsdfSample(vec3<f32>(0.0), vec3<f32>(0.0), 0.0);
    }
    var wi: vec3<f32>;
    if surface.roughness >= 0.0 && choice < lobe_fraction(surface, wo) {
        wi = reflect_on_visible_normal(surface.roughness, wo, u);
    } else {
        wi = cosine_hemisphere(u);
    }
    let value = bsdf_eval(surface, wo, wi);
    if !(value.w > 0.0 && value.w < FAR) {
        return BsdfSample(wi, vec3<f32>(0.0), 0.0);
    }
    let weight = select(surface.albedo, value.xyz / value.w, surface.roughness >= 0.0);
    return BsdfSample(wi, weight, value.w);
}
