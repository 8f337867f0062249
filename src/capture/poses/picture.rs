//! A photograph as points are looked up in it: grey, small, smoothed, with its depth image.

use crate::capture::scan::depth::DepthMap;
use crate::capture::scan::{ImportedFrame, Lens};
use crate::capture::working::reduce;
use crate::error::Result;
use crate::math::blur::blurred;
use crate::math::color::luminance;
use glam::{DVec2, DVec3};

/// Pixels of a picture at most; more add time, not accuracy, to what depth images and tracking allow.
const MAX_PIXELS: u64 = 640 * 480;
/// Standard deviations in pixels of the two Gaussians whose difference is a band. The narrow one of a pixel makes bilinear
/// interpolation nearly exact, that of three finds points from further away; the wide one takes away shading and
/// vignetting, which stay with the light and the lens instead of moving with the surface.
const BANDS: [[f32; 2]; 2] = [[1.0, 4.0], [3.0, 10.0]];

/// A decoded photograph: square roots of luminance, so that noise is about the same everywhere.
pub struct Picture {
    /// The lens at this size.
    pub lens: Lens,
    /// Fine details, for accuracy.
    pub fine: Grey,
    /// Coarse ones, to find points far from where they are expected.
    pub coarse: Grey,
    depth: DepthMap,
    /// Whether each pixel is clipped, whose edges move with the exposure, or masked.
    spoiled: Vec<bool>,
}

/// An image of one channel.
pub struct Grey {
    /// Size in pixels.
    pub width: usize,
    pub height: usize,
    /// Row by row from the top left.
    values: Vec<f32>,
}

impl Picture {
    /// Decodes a frame that has depth.
    pub fn load(frame: &ImportedFrame) -> Result<Self> {
        let (photograph, depth) = frame.load()?;
        let k = &frame.lens.pinhole;
        // The smallest factor that meets the limit; the remainder at the right and the bottom is cropped.
        let pixels = |factor: &u32| u64::from(k.width / factor) * u64::from(k.height / factor);
        let factor = (1..)
            .find(|factor| pixels(factor) <= MAX_PIXELS)
            .unwrap_or(1);
        let photograph = match factor {
            1 => photograph,
            _ => reduce(&photograph, factor),
        };
        let grey = Grey {
            width: photograph.width as usize,
            height: photograph.height as usize,
            values: (photograph.pixels.iter())
                .map(|&p| luminance(p).max(0.0).sqrt())
                .collect(),
        };
        let [fine, coarse] = BANDS.map(|[narrow, wide]| grey.band(narrow, wide));
        let spoiled = (0..photograph.pixels.len())
            .map(|i| photograph.is_saturated(i) || !photograph.is_usable(i))
            .collect();
        let lens = Lens {
            pinhole: k.reduced(factor),
            model: frame.lens.model,
        };
        Ok(Self {
            lens,
            fine,
            coarse,
            depth,
            spoiled,
        })
    }

    /// The depth in metres, along the optical axis, of what the photograph shows at undistorted normalised coordinates.
    pub fn depth_along(&self, ray: DVec2) -> Option<f64> {
        let pixel = self.depth.lens.project(ray.extend(1.0))?;
        self.depth.at(pixel).map(f64::from)
    }

    /// Whether no pixel of the patch of `radius` around a position is clipped or masked; the patch must be inside.
    pub fn is_clear(&self, center: DVec2, radius: usize) -> bool {
        let (x, y) = (center.x as usize, center.y as usize);
        let mut rows = y - radius..=y + radius;
        rows.all(|j| {
            let row = j * self.fine.width;
            !self.spoiled[row + x - radius..=row + x + radius].contains(&true)
        })
    }

    /// The pixel position of a point in camera coordinates; `None` where a patch of `margin` pixels around it leaves the picture.
    pub fn project(&self, point: DVec3, margin: f64) -> Option<DVec2> {
        let pixel = self.lens.project(point)?;
        let far = DVec2::new(self.fine.width as f64, self.fine.height as f64) - margin;
        let inside = pixel.x >= margin && pixel.y >= margin && pixel.x <= far.x && pixel.y <= far.y;
        inside.then_some(pixel)
    }
}

impl Grey {
    fn band(&self, narrow: f32, wide: f32) -> Self {
        let mut band = self.smoothed(narrow);
        let wide = self.smoothed(wide);
        (band.values.iter_mut().zip(&wide.values)).for_each(|(v, w)| *v -= w);
        band
    }

    /// Convolved with a Gaussian; the edge is repeated beyond it.
    fn smoothed(&self, deviation: f32) -> Self {
        let shape = [self.width, self.height];
        let rows = blurred(&self.values, shape, deviation, false);
        Self {
            values: blurred(&rows, shape, deviation, true),
            ..*self
        }
    }

    /// The value of a pixel, which must be inside.
    pub fn pixel(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// The value at a pixel position, interpolated bilinearly; the edge is repeated beyond it.
    pub fn at(&self, p: DVec2) -> f32 {
        let x = (p.x - 0.5).clamp(0.0, (self.width - 1) as f64);
        let y = (p.y - 0.5).clamp(0.0, (self.height - 1) as f64);
        let (i, j) = (x as usize, y as usize);
        let (u, v) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let (right, below) = ((i + 1).min(self.width - 1), (j + 1).min(self.height - 1));
        let upper = self.pixel(i, j) * (1.0 - u) + self.pixel(right, j) * u;
        let lower = self.pixel(i, below) * (1.0 - u) + self.pixel(right, below) * u;
        upper * (1.0 - v) + lower * v
    }

    /// Half the difference of the neighbours of a pixel inside the outermost ones, to the right and below.
    pub fn gradient(&self, x: usize, y: usize) -> [f32; 2] {
        [
            0.5 * (self.pixel(x + 1, y) - self.pixel(x - 1, y)),
            0.5 * (self.pixel(x, y + 1) - self.pixel(x, y - 1)),
        ]
    }
}
