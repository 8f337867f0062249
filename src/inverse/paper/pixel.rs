//! The gradient of one pixel's loss, with colour and derivative from independent paths.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::inverse::paper::patches::Patches;
use crate::inverse::paths::derivative::{Gradient, differentiate, radiance};
use crate::inverse::paths::trace::Tracer;
use crate::inverse::paths::{NO_LAMP, NO_TEXEL, SPECULAR, Vertex};
use crate::inverse::settings::{Loss, Settings};
use crate::inverse::unknowns::Unknowns;
use crate::math::rng::Stream;
use crate::transport::arrival::RayCount;
use glam::{Vec3, Vec3A};

/// Attempts to draw a usable pixel.
const TRIES: u32 = 64;

/// A pixel of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    /// Frame index.
    pub frame: u32,
    /// Pixel index, row by row from the top left.
    pub pixel: u32,
    /// Factor on its gradient: the uniform probability over its own for an unbiased batch, or 1 to weight by the distribution.
    pub weight: f32,
}

/// Draws a pixel of a batch; `None` leaves it out.
pub type Draw<'a> = &'a (dyn Fn(&mut Stream) -> Option<Drawn> + Sync);

/// Draws a usable pixel that is not held out, uniformly over all photographs; `None` if no attempt finds one.
pub fn draw(problem: &Problem, settings: &Settings, stream: &mut Stream) -> Option<Drawn> {
    (0..TRIES).find_map(|_| {
        let (frame, pixel) = problem.locate(stream.below(problem.pixels()))?;
        let held_out = HoldOut::from(settings).contains(frame as u32, pixel as u32);
        let fitted = problem.photographs[frame].is_usable(pixel) && !held_out;
        fitted.then_some(Drawn {
            frame: frame as u32,
            pixel: pixel as u32,
            weight: 1.0,
        })
    })
}

/// Traces and evaluates the paths of pixels.
pub struct Rendering<'a> {
    /// Scene and photographs.
    pub problem: &'a Problem,
    /// Traces paths whose surfaces are objects.
    pub tracer: Tracer<'a>,
    /// The parts of triangles with their own albedo.
    pub patches: Option<&'a Patches>,
    /// Albedo of each object, then of each patch.
    pub albedo: &'a [Vec3],
    /// Emission of each object.
    pub emission: &'a [Vec3],
}

/// Gradient of the data term of one pixel.
#[derive(Default)]
pub struct PixelGradient {
    /// Parameter (albedos first, then emissions) and derivative; a parameter may have several entries.
    pub entries: Vec<(u32, Vec3)>,
    /// Number of rays cast and paths rejected.
    pub cast: RayCount,
}

/// A path with local indices: the surfaces of its vertices are indices into `unknowns`, which holds only what the path meets.
#[derive(Default)]
pub struct Path {
    vertices: Vec<Vertex>,
    /// Global albedo and emission index of each local index.
    global: Vec<[u32; 2]>,
    unknowns: Unknowns,
    /// Scratch memory of [`differentiate`].
    incident: Vec<Vec3A>,
}

impl Rendering<'_> {
    /// The gradient of a pixel's loss: colour from `samples[0]` paths, derivative from `samples[1]` independent ones.
    pub fn gradient(
        &self,
        loss: Loss,
        samples: [u64; 2],
        drawn: Drawn,
        mut stream: Stream,
    ) -> PixelGradient {
        let mut result = PixelGradient::default();
        let mut path = Path::default();
        let colour = self.colour(drawn, samples[0], &mut stream, &mut path, &mut result.cast);
        let photograph = &self.problem.photographs[drawn.frame as usize];
        let residual = colour - photograph.pixels[drawn.pixel as usize];
        // A saturated value is a lower bound.
        let bound_met = photograph.saturated(drawn.pixel as usize) & residual.cmpgt(Vec3::ZERO);
        let residual = Vec3::select(bound_met, Vec3::ZERO, residual);
        let sign = |r: f32| f32::from(r != 0.0) * r.signum();
        let slope = match loss {
            Loss::L1 => Vec3::from_array(residual.to_array().map(sign)),
            Loss::L2 => residual * 2.0,
        } * drawn.weight
            / samples[1] as f32;

        let emissions = self.albedo.len() as u32;
        for _ in 0..samples[1] {
            self.trace(drawn, &mut stream, &mut path, &mut result.cast);
            let count = path.global.len();
            let mut gradient = Gradient::new(2 * count);
            differentiate(
                &path.vertices,
                &path.unknowns,
                &[],
                &mut path.incident,
                &mut gradient,
            );
            for &touched in &gradient.touched {
                let touched = touched as usize;
                let parameter = match touched.checked_sub(count) {
                    None => path.global[touched][0],
                    Some(local) => emissions + path.global[local][1],
                };
                let derivative = Vec3::from(gradient.values[touched]);
                result.entries.push((parameter, derivative * slope));
            }
        }
        result
    }

    /// Mean radiance of `samples` paths through a pixel.
    pub fn colour(
        &self,
        drawn: Drawn,
        samples: u64,
        stream: &mut Stream,
        path: &mut Path,
        cast: &mut RayCount,
    ) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for _ in 0..samples {
            self.trace(drawn, stream, path, cast);
            sum += radiance(&path.vertices, &path.unknowns);
        }
        sum / samples as f32
    }

    /// Traces a path and replaces its surfaces by local indices.
    fn trace(&self, drawn: Drawn, stream: &mut Stream, path: &mut Path, cast: &mut RayCount) {
        let camera = &self.problem.scene.cameras[drawn.frame as usize];
        let corner = camera.corner(drawn.pixel as usize);
        path.vertices.clear();
        *cast += (self.tracer).pixel_path(camera, corner, stream, &mut path.vertices);
        path.global.clear();
        path.unknowns.albedo.clear();
        path.unknowns.emission.clear();
        let objects = self.emission.len() as u32;
        for index in 0..path.vertices.len() {
            let vertex = path.vertices[index];
            if vertex.surface != SPECULAR {
                let albedo = match self.patches {
                    Some(patches) if vertex.texel != NO_TEXEL => {
                        objects + patches.of_texel(vertex.texel) as u32
                    }
                    _ => vertex.surface,
                };
                path.vertices[index].surface = self.local(path, [albedo, vertex.surface]);
            }
            if vertex.lamp != NO_LAMP {
                path.vertices[index].lamp = self.local(path, [vertex.lamp, vertex.lamp]);
            }
        }
    }

    /// The local index of an albedo and an emission.
    fn local(&self, path: &mut Path, [albedo, emission]: [u32; 2]) -> u32 {
        let known = (path.global.iter()).position(|known| *known == [albedo, emission]);
        known.unwrap_or_else(|| {
            path.global.push([albedo, emission]);
            path.unknowns.albedo.push(self.albedo[albedo as usize]);
            path.unknowns
                .emission
                .push(self.emission[emission as usize]);
            path.global.len() - 1
        }) as u32
    }
}
