//! The gradient of one pixel: colour and derivative from independent paths.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::inverse::paper::patches::Patches;
use crate::inverse::paths::derivative::{Gradient, differentiate, radiance};
use crate::inverse::paths::trace::Tracer;
use crate::inverse::paths::{NO_LAMP, NO_TEXEL, SPECULAR, Vertex};
use crate::inverse::settings::{Loss, Settings};
use crate::inverse::unknowns::Unknowns;
use crate::math::rng::Stream;
use crate::transport::arrival::Cast;
use glam::{Vec2, Vec3, Vec3A};

/// Draws of a pixel before giving up on finding one that may be used.
const TRIES: u32 = 64;

/// A pixel of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    /// Frame index.
    pub frame: u32,
    /// Row by row from the top left.
    pub pixel: u32,
    /// Factor on its gradient: its chance if drawn uniformly over its chance, or 1 to fit what is drawn more often more.
    pub weight: f32,
}

/// Draws the pixels of a batch; `None` leaves one out.
pub type Draw<'a> = &'a (dyn Fn(&mut Stream) -> Option<Drawn> + Sync);

/// A pixel uniform over all photographs; `None` where none may be used.
pub fn draw(problem: &Problem, settings: &Settings, stream: &mut Stream) -> Option<Drawn> {
    let total: usize = problem.photographs.iter().map(|p| p.pixels.len()).sum();
    if total == 0 {
        return None;
    }
    for _ in 0..TRIES {
        let mut at = stream.below(total);
        for (frame, photograph) in problem.photographs.iter().enumerate() {
            if at >= photograph.pixels.len() {
                at -= photograph.pixels.len();
                continue;
            }
            let usable = photograph.is_usable(at);
            if usable && !HoldOut::from(settings).contains(frame as u32, at as u32) {
                return Some(Drawn {
                    frame: frame as u32,
                    pixel: at as u32,
                    weight: 1.0,
                });
            }
            break;
        }
    }
    None
}

/// What a pixel's paths are traced and evaluated with.
pub struct Rendering<'a> {
    /// Scene and photographs.
    pub problem: &'a Problem,
    /// Traces paths whose surfaces are objects.
    pub tracer: Tracer<'a>,
    /// What has an albedo of its own below objects.
    pub patches: Option<&'a Patches>,
    /// Albedo of each object, then of each patch.
    pub albedo: &'a [Vec3],
    /// Emission of each object.
    pub emission: &'a [Vec3],
}

/// Gradient of the data term of one pixel, and what it took.
#[derive(Default)]
pub struct PixelGradient {
    /// Parameter (albedos first, then emissions) and derivative; one parameter may have several.
    pub entries: Vec<(u32, Vec3)>,
    /// Rays cast, and paths dropped.
    pub cast: Cast,
}

/// A path under names of its own: each vertex's albedo and emission are entries of `unknowns`.
pub struct Path {
    vertices: Vec<Vertex>,
    /// Albedo and emission parameter of each entry.
    names: Vec<[u32; 2]>,
    unknowns: Unknowns,
    gathered: Vec<Vec3A>,
}

impl Default for Path {
    fn default() -> Self {
        Self {
            vertices: Vec::new(),
            names: Vec::new(),
            unknowns: Unknowns::new(0),
            gathered: Vec::new(),
        }
    }
}

impl Rendering<'_> {
    /// Differentiates the loss of a pixel: colour from `samples[0]` paths, derivative from `samples[1]` others.
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
        // What exceeds a saturated value is right.
        let right = photograph.saturated(drawn.pixel as usize) & residual.cmpgt(Vec3::ZERO);
        let residual = Vec3::select(right, Vec3::ZERO, residual);
        let sign = |r: f32| f32::from(r != 0.0) * r.signum();
        let slope = match loss {
            Loss::L1 => Vec3::from_array(residual.to_array().map(sign)),
            Loss::L2 => residual * 2.0,
        } * drawn.weight
            / samples[1] as f32;

        let emissions = self.albedo.len() as u32;
        for _ in 0..samples[1] {
            self.trace(drawn, &mut stream, &mut path, &mut result.cast);
            let count = path.names.len();
            let mut gradient = Gradient::new(2 * count);
            differentiate(
                &path.vertices,
                &path.unknowns,
                &[],
                &mut path.gathered,
                &mut gradient,
            );
            for &touched in &gradient.touched {
                let touched = touched as usize;
                let parameter = match touched.checked_sub(count) {
                    None => path.names[touched][0],
                    Some(of) => emissions + path.names[of][1],
                };
                let derivative = Vec3::from(gradient.values[touched]);
                result.entries.push((parameter, derivative * slope));
            }
        }
        result
    }

    /// Mean radiance of so many paths through a pixel.
    pub fn colour(
        &self,
        drawn: Drawn,
        samples: u64,
        stream: &mut Stream,
        path: &mut Path,
        cast: &mut Cast,
    ) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for _ in 0..samples {
            self.trace(drawn, stream, path, cast);
            sum += radiance(&path.vertices, &path.unknowns);
        }
        sum / samples as f32
    }

    /// Traces a path and names what it met.
    fn trace(&self, drawn: Drawn, stream: &mut Stream, path: &mut Path, cast: &mut Cast) {
        let width = self.problem.photographs[drawn.frame as usize].width;
        let corner = Vec2::new((drawn.pixel % width) as f32, (drawn.pixel / width) as f32);
        let camera = &self.problem.scene.cameras[drawn.frame as usize];
        path.vertices.clear();
        let traced = (self.tracer).pixel_path(camera, corner, stream, &mut path.vertices);
        cast.rays += traced.0;
        cast.rejected += u64::from(!traced.1);
        path.names.clear();
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
                path.vertices[index].surface = self.named(path, [albedo, vertex.surface]);
            }
            if vertex.lamp != NO_LAMP {
                path.vertices[index].lamp = self.named(path, [vertex.lamp, vertex.lamp]);
            }
        }
    }

    /// The entry of an albedo and an emission.
    fn named(&self, path: &mut Path, name: [u32; 2]) -> u32 {
        let known = path.names.iter().position(|known| *known == name);
        known.unwrap_or_else(|| {
            path.names.push(name);
            path.unknowns.albedo.push(self.albedo[name[0] as usize]);
            path.unknowns.emission.push(self.emission[name[1] as usize]);
            path.names.len() - 1
        }) as u32
    }
}
