//! Radiance of a stored path, and its derivatives with respect to all albedos and emissions on it.

use crate::inverse::paths::{NO_LAMP, NO_PATCH, SPECULAR, Vertex};
use crate::inverse::unknowns::Unknowns;
use glam::{Vec3, Vec3A};

/// Derivatives of a radiance, dense over albedos of all surfaces, then emissions, with a list of the non-zero ones.
pub struct Gradient {
    /// Derivative with respect to each parameter.
    pub values: Vec<Vec3A>,
    /// Parameters with a derivative, in the order in which paths met them.
    pub touched: Vec<u32>,
    /// Whether a parameter is in `touched`.
    pub marked: Vec<bool>,
}

impl Gradient {
    /// The zero gradient.
    pub fn new(parameters: usize) -> Self {
        Self {
            values: vec![Vec3A::ZERO; parameters],
            touched: Vec::new(),
            marked: vec![false; parameters],
        }
    }

    #[inline]
    fn add(&mut self, index: usize, value: Vec3A) {
        if !self.marked[index] {
            self.marked[index] = true;
            self.touched.push(index as u32);
        }
        self.values[index] += value;
    }

    /// Resets the touched parameters to zero.
    pub fn clear(&mut self) {
        for &index in &self.touched {
            self.values[index as usize] = Vec3A::ZERO;
            self.marked[index as usize] = false;
        }
        self.touched.clear();
    }
}

/// Radiance of one path.
#[inline]
pub fn radiance(vertices: &[Vertex], unknowns: &Unknowns) -> Vec3 {
    radiance_with(vertices, unknowns, |vertex| {
        unknowns.albedo[vertex.surface as usize]
    })
}

/// Radiance of one path with the albedo of each vertex's texel, and of its surface where it has none.
#[inline]
pub fn textured_radiance(vertices: &[Vertex], unknowns: &Unknowns, texels: &[Vec3]) -> Vec3 {
    radiance_with(vertices, unknowns, |vertex| {
        let texel = texels.get(vertex.texel as usize).copied();
        texel.unwrap_or(unknowns.albedo[vertex.surface as usize])
    })
}

#[inline]
fn radiance_with(
    vertices: &[Vertex],
    unknowns: &Unknowns,
    albedo: impl Fn(&Vertex) -> Vec3,
) -> Vec3 {
    let outgoing = |next: Vec3A, vertex: &Vertex| {
        let incident = incident_at(vertex, next, unknowns);
        outgoing(vertex, incident, unknowns, &albedo)
    };
    vertices.iter().rev().fold(Vec3A::ZERO, outgoing).into()
}

/// Radiance that leaves a vertex towards the previous one: emission plus albedo times the incident estimate.
#[inline]
fn outgoing(
    vertex: &Vertex,
    incident: Vec3A,
    unknowns: &Unknowns,
    albedo: impl Fn(&Vertex) -> Vec3,
) -> Vec3A {
    if vertex.surface == SPECULAR {
        return incident;
    }
    let emission = Vec3A::from(unknowns.emission[vertex.surface as usize]);
    emission * vertex.emission_weight + Vec3A::from(albedo(vertex)) * incident
}

/// Weighted incident radiance at a vertex: `next`, which leaves the following vertex, known radiance, and the light sample.
#[inline]
fn incident_at(vertex: &Vertex, next: Vec3A, unknowns: &Unknowns) -> Vec3A {
    let mut incident = next + Vec3A::from(vertex.known);
    if vertex.lamp != NO_LAMP {
        incident += Vec3A::from(unknowns.emission[vertex.lamp as usize]) * vertex.lamp_weight;
    }
    incident
}

/// Radiance of one path; adds its derivatives to `gradient`. `incident` is scratch memory.
///
/// With G_i the incident radiance at vertex i, L_i = w_i E_i + ρ_i G_i leaves it towards the camera. The derivative with
/// respect to ρ_i is G_i, and with respect to an emission its weight, each times the albedos of the preceding vertices. A
/// vertex on a lobe has no ρ_i: L_i = G_i. Lamps have albedo zero; for an albedo of one a patch of a lamp would send
/// `reflected` (radiance, one per patch), which gives the derivative with respect to the lamp's albedo.
#[inline]
pub fn differentiate(
    vertices: &[Vertex],
    unknowns: &Unknowns,
    reflected: &[Vec3],
    incident: &mut Vec<Vec3A>,
    gradient: &mut Gradient,
) -> Vec3 {
    let surfaces = unknowns.surfaces();
    incident.resize(vertices.len().max(incident.len()), Vec3A::ZERO);
    let mut radiance = Vec3A::ZERO;
    for (vertex, incident) in vertices.iter().zip(&mut *incident).rev() {
        *incident = incident_at(vertex, radiance, unknowns);
        radiance = outgoing(vertex, *incident, unknowns, |v| {
            unknowns.albedo[v.surface as usize]
        });
    }
    let patch = |patch: u32| Vec3A::from(reflected[patch as usize]);
    let mut throughput = Vec3A::ONE;
    for (vertex, g) in vertices.iter().zip(&*incident) {
        // What follows on a long path adds less than a float holds, and arithmetic on subnormal numbers is slow.
        let largest = throughput.max_element();
        if largest > 0.0 && largest < f32::MIN_POSITIVE {
            break;
        }
        if vertex.surface != SPECULAR {
            let surface = vertex.surface as usize;
            if vertex.emission_weight != 0.0 {
                let weight = throughput * vertex.emission_weight;
                gradient.add(surfaces + surface, weight);
                if vertex.patch != NO_PATCH && vertex.lamp == NO_LAMP {
                    gradient.add(surface, weight * patch(vertex.patch));
                }
            }
            gradient.add(surface, throughput * *g);
            throughput *= Vec3A::from(unknowns.albedo[surface]);
        }
        if vertex.lamp != NO_LAMP {
            let (lamp, weight) = (vertex.lamp as usize, throughput * vertex.lamp_weight);
            gradient.add(surfaces + lamp, weight);
            if vertex.patch != NO_PATCH {
                gradient.add(lamp, weight * patch(vertex.patch));
            }
        }
    }
    radiance.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;
    use glam::DVec3;

    const SURFACES: usize = 4;

    fn color(stream: &mut Stream) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| 0.1 + 0.8 * stream.uniform()))
    }

    fn random_unknowns(stream: &mut Stream) -> Unknowns {
        let mut colors = || (0..SURFACES).map(|_| color(stream)).collect();
        Unknowns {
            albedo: colors(),
            emission: colors(),
        }
    }

    /// The sum over all light that the path finds, term by term in f64.
    fn radiance(vertices: &[Vertex], albedo: &[DVec3], emission: &[DVec3]) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for (i, vertex) in vertices.iter().enumerate() {
            let factor = |v: &Vertex| {
                albedo
                    .get(v.surface as usize)
                    .copied()
                    .unwrap_or(DVec3::ONE)
            };
            let before: DVec3 = vertices[..i].iter().map(factor).product();
            let after = before * factor(vertex);
            let own = emission.get(vertex.surface as usize).copied();
            sum += before * own.unwrap_or_default() * f64::from(vertex.emission_weight);
            sum += after * vertex.known.as_dvec3();
            if vertex.lamp != NO_LAMP {
                sum += after * emission[vertex.lamp as usize] * f64::from(vertex.lamp_weight);
            }
        }
        sum
    }

    #[test]
    fn derivatives_agree_with_central_differences_for_every_parameter() {
        let (mut gathered, mut gradient) = (Vec::new(), Gradient::new(2 * SURFACES));
        for index in 0..200 {
            let mut stream = Stream::new(11, 0, 0, index);
            let path = Vertex::random_path(SURFACES, &mut stream);
            let unknowns = random_unknowns(&mut stream);
            let widen = |values: &[Vec3]| values.iter().map(|v| v.as_dvec3()).collect::<Vec<_>>();
            let (albedo, emission) = (widen(&unknowns.albedo), widen(&unknowns.emission));
            gradient.clear();
            let found =
                differentiate(&path, &unknowns, &[], &mut gathered, &mut gradient).as_dvec3();
            let wanted = radiance(&path, &albedo, &emission);
            assert!((found - wanted).length() < 1e-5 * (1.0 + wanted.length()));
            for parameter in 0..2 * SURFACES {
                // The polynomial's third derivative leaves an error of the order of h².
                let h = 1e-5;
                let at = |step: f64| {
                    let (mut albedo, mut emission) = (albedo.clone(), emission.clone());
                    match parameter.checked_sub(SURFACES) {
                        None => albedo[parameter] += step,
                        Some(surface) => emission[surface] += step,
                    }
                    radiance(&path, &albedo, &emission)
                };
                let difference = (at(h) - at(-h)) / (2.0 * h);
                let off = gradient.values[parameter].as_dvec3() - difference;
                let relative = off.length() / (1.0 + difference.length());
                assert!(
                    relative < 1e-5,
                    "path {index}, parameter {parameter}: {off}"
                );
                assert!(gradient.marked[parameter] || difference == DVec3::ZERO);
            }
        }
    }

    /// A patch sends its reflected light in addition to its emission, both to light samples and to paths that end at it.
    #[test]
    fn a_lamp_s_albedo_changes_what_its_patches_send() {
        let path = [
            Vertex {
                lamp: 1,
                lamp_weight: 0.25,
                patch: 1,
                ..Vertex::on(0)
            },
            Vertex {
                patch: 0,
                emission_weight: 0.5,
                ..Vertex::on(1)
            },
        ];
        let unknowns = Unknowns::grey([0.4, 0.0], [0.0, 10.0]);
        let reflected = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.1, 0.2, 0.4)];
        let mut gradient = Gradient::new(4);
        let found = differentiate(&path, &unknowns, &reflected, &mut Vec::new(), &mut gradient);
        assert!((found - Vec3::splat(0.4 * 10.0 * 0.75)).length() < 1e-6);
        let wanted = (reflected[1] * 0.25 + reflected[0] * 0.5) * 0.4;
        assert!((Vec3::from(gradient.values[1]) - wanted).length() < 1e-6);
        assert!((Vec3::from(gradient.values[3]) - Vec3::splat(0.4 * 0.75)).length() < 1e-6);
    }
}
