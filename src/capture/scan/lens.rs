//! Lens models of other programs.

use crate::capture::camera::Intrinsics;
use glam::{DVec2, DVec3};

/// A camera with any supported lens model.
///
/// Pixel (i, j) covers [i, i+1] × [j, j+1], y down. Camera axes are OpenCV's: x right, y down, looking along +z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Focal lengths, principal point and size; its distortion is zero and is ignored.
    pub pinhole: Intrinsics,
    /// Lens distortion.
    pub model: Model,
}

/// Distortion of normalised image coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Model {
    /// k1, k2, p1, p2 of OpenCV: the model of captures.
    Brown([f64; 4]),
    /// OpenCV's rational model: radial (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶), tangential p1, p2.
    Rational {
        /// k1 to k6.
        k: [f64; 6],
        /// p1, p2.
        p: [f64; 2],
    },
    /// OpenCV's fisheye: θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) for the angle θ from the axis (Kannala and Brandt).
    Fisheye([f64; 4]),
}

impl Lens {
    /// A lens without distortion.
    pub fn plain(size: [u32; 2], focal: [f64; 2], center: [f64; 2]) -> Self {
        Self {
            pinhole: Intrinsics::plain(size, focal, center),
            model: Model::Brown([0.0; 4]),
        }
    }

    /// The lens with a distortion; a rational model with only k1 k2 p1 p2 becomes [`Model::Brown`].
    pub fn with(self, model: Model) -> Self {
        let model = match model {
            Model::Rational { k, p } if k[2..].iter().all(|&k| k == 0.0) => {
                Model::Brown([k[0], k[1], p[0], p[1]])
            }
            model => model,
        };
        Self { model, ..self }
    }

    /// Whether every number is finite and the focal lengths are positive.
    pub fn is_possible(&self) -> bool {
        let k = &self.pinhole;
        let mut numbers = vec![k.fx, k.fy, k.cx, k.cy];
        match &self.model {
            Model::Brown(k) | Model::Fisheye(k) => numbers.extend(k),
            Model::Rational { k, p } => numbers.extend(k.iter().chain(p)),
        }
        k.fx > 0.0 && k.fy > 0.0 && numbers.iter().all(|x| x.is_finite())
    }

    /// Whether a capture supports this lens; otherwise the photograph has to be resampled.
    pub fn fits_a_capture(&self) -> bool {
        matches!(self.model, Model::Brown(_))
    }

    /// The capture's intrinsics: this lens, or the pinhole of the same focal length that the photograph is resampled to.
    pub fn intrinsics(&self) -> Intrinsics {
        match self.model {
            Model::Brown(distortion) => Intrinsics {
                distortion,
                ..self.pinhole
            },
            _ => self.pinhole,
        }
    }

    /// The same lens on an image scaled to another size.
    pub fn resized(&self, size: [u32; 2]) -> Self {
        Self {
            pinhole: self.pinhole.resized(size),
            ..*self
        }
    }

    /// The pixel position of a point in camera coordinates; `None` behind the camera and where [`Lens::distort`] has none.
    pub fn project(&self, point: DVec3) -> Option<DVec2> {
        if point.z <= 0.0 {
            return None;
        }
        let distorted = self.distort(point.truncate() / point.z)?;
        Some(self.pinhole.pixel(distorted))
    }

    /// Distorted normalised coordinates of undistorted ones; `None` where the radial function no longer increases.
    pub fn distort(&self, p: DVec2) -> Option<DVec2> {
        let r2 = p.length_squared();
        match self.model {
            Model::Brown(_) => self.intrinsics().distort(p),
            Model::Rational { k, p: [p1, p2] } => {
                let numerator = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
                let denominator = 1.0 + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
                let numerator_slope = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[2]);
                let denominator_slope = k[3] + r2 * (2.0 * k[4] + r2 * 3.0 * k[5]);
                // d(r · numerator / denominator)/dr, times denominator².
                let slope = numerator * denominator
                    + 2.0 * r2 * (numerator_slope * denominator - numerator * denominator_slope);
                if slope <= 0.0 || denominator <= 0.0 {
                    return None;
                }
                let radial = numerator / denominator;
                Some(DVec2::new(
                    p.x * radial + 2.0 * p1 * p.x * p.y + p2 * (r2 + 2.0 * p.x * p.x),
                    p.y * radial + p1 * (r2 + 2.0 * p.y * p.y) + 2.0 * p2 * p.x * p.y,
                ))
            }
            Model::Fisheye(k) => {
                let r = r2.sqrt();
                let angle = r.atan();
                let a2 = angle * angle;
                let radial = 1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])));
                let slope = 1.0
                    + a2 * (3.0 * k[0] + a2 * (5.0 * k[1] + a2 * (7.0 * k[2] + a2 * 9.0 * k[3])));
                if slope <= 0.0 {
                    return None;
                }
                let scale = if r > 1e-12 { angle * radial / r } else { 1.0 };
                Some(p * scale)
            }
        }
    }

    /// Undistorted normalised coordinates of a pixel position, by fixed-point iteration; `None` where it does not converge.
    pub fn ray(&self, pixel: DVec2) -> Option<DVec2> {
        let distorted = self.pinhole.normalized(pixel);
        if self.model == Model::Brown([0.0; 4]) {
            return Some(distorted);
        }
        let mut p = distorted;
        for _ in 0..50 {
            let error = distorted - self.distort(p)?;
            p += error;
            if error.length_squared() < 1e-20 {
                return Some(p);
            }
        }
        let error = distorted - self.distort(p)?;
        (error.length_squared() < 1e-10).then_some(p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_undo_projections_for_every_model() {
        for model in [
            Model::Brown([0.1, -0.05, 1e-3, -2e-3]),
            Model::Rational {
                k: [0.2624, -0.9531, 1.1633, 0.0, 0.0, 0.0],
                p: [-0.0054, 0.0026],
            },
            Model::Fisheye([0.02, -0.01, 0.003, 0.0]),
        ] {
            let lens = Lens::plain([640, 480], [500.0, 510.0], [318.0, 241.0]).with(model);
            for point in [
                DVec3::new(0.3, -0.2, 1.0),
                DVec3::new(0.0, 0.0, 2.0),
                DVec3::new(-1.0, 0.7, 2.5),
            ] {
                let pixel = lens.project(point).unwrap();
                let off = lens.ray(pixel).unwrap() - point.truncate() / point.z;
                assert!(off.length() < 1e-6, "{model:?} {point}");
            }
            assert!(lens.project(DVec3::new(0.0, 0.0, -1.0)).is_none());
        }
    }
}
