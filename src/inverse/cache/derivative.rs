//! Radiance of a stored path and its derivative with respect to every albedo and emission on it.

use super::{NO_LAMP, Vertex};
use crate::inverse::parameters::Unknowns;
use glam::Vec3;

/// Derivative of a radiance: dense over parameters (albedos first, then emissions), with the list of
/// those that were touched.
pub struct Gradient {
    /// Derivative with respect to each parameter.
    pub values: Vec<Vec3>,
    /// Parameters with a derivative, in the order in which paths met them.
    pub touched: Vec<u32>,
    /// Whether a parameter is in `touched`.
    pub marked: Vec<bool>,
}

impl Gradient {
    /// All zero.
    pub fn new(parameters: usize) -> Self {
        Self {
            values: vec![Vec3::ZERO; parameters],
            touched: Vec::new(),
            marked: vec![false; parameters],
        }
    }

    #[inline]
    fn add(&mut self, index: usize, value: Vec3) {
        if !self.marked[index] {
            self.marked[index] = true;
            self.touched.push(index as u32);
        }
        self.values[index] += value;
    }

    /// Sets everything touched back to zero.
    pub fn clear(&mut self) {
        for &index in &self.touched {
            self.values[index as usize] = Vec3::ZERO;
            self.marked[index as usize] = false;
        }
        self.touched.clear();
    }
}

/// Radiance of one path, its derivative added to `gradient`.
///
/// With G_i the radiance gathered at vertex i, L_i = w_i E_i + ρ_i G_i is what leaves it towards the camera; the
/// derivative with respect to ρ_i is G_i, with respect to an emission its weight, each times the albedos before it.
#[inline]
pub fn differentiate(
    vertices: &[Vertex],
    unknowns: &Unknowns,
    gathered: &mut Vec<Vec3>,
    gradient: &mut Gradient,
) -> Vec3 {
    let surfaces = unknowns.surfaces();
    gathered.clear();
    let mut beyond = Vec3::ZERO;
    for vertex in vertices.iter().rev() {
        let mut g = beyond + vertex.known;
        if vertex.lamp != NO_LAMP {
            g += unknowns.emission[vertex.lamp as usize] * vertex.lamp_weight;
        }
        gathered.push(g);
        let surface = vertex.surface as usize;
        beyond = unknowns.emission[surface] * vertex.emission_weight + unknowns.albedo[surface] * g;
    }
    let mut throughput = Vec3::ONE;
    for (vertex, g) in vertices.iter().zip(gathered.iter().rev()) {
        let surface = vertex.surface as usize;
        if vertex.emission_weight != 0.0 {
            gradient.add(surfaces + surface, throughput * vertex.emission_weight);
        }
        gradient.add(surface, throughput * *g);
        throughput *= unknowns.albedo[surface];
        if vertex.lamp != NO_LAMP {
            gradient.add(
                surfaces + vertex.lamp as usize,
                throughput * vertex.lamp_weight,
            );
        }
    }
    beyond
}
