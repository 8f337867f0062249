//! The light that arrives at what each pixel sees, from what it sends and what it reflects.

use crate::session::snapshot::{Picture, View};
use glam::Vec3;
use std::f32::consts::PI;
use std::sync::Arc;

/// Albedos below this tell nothing of the light that arrives.
const DARKEST: f32 = 0.01;

/// The picture of a view's irradiance, made anew when the view's pictures change: after the render and the albedo that it was
/// made of.
#[derive(Debug, Default)]
pub struct Irradiance(Option<[Arc<Picture>; 3]>);

impl Irradiance {
    /// Follows the pictures of a view; forgets all where there is none.
    pub fn update(&mut self, view: Option<&View>) {
        let parts = view.and_then(|view| {
            let (render, albedo) = (view.render.as_ref()?, view.albedo.as_ref()?);
            Some((render, albedo, view.emission.as_ref()?))
        });
        let Some((render, albedo, emission)) = parts else {
            self.0 = None;
            return;
        };
        let current = |[r, a, _]: &[_; 3]| Arc::ptr_eq(r, render) && Arc::ptr_eq(a, albedo);
        if !self.0.as_ref().is_some_and(current) {
            let picture = Arc::new(irradiance(render, albedo, emission));
            self.0 = Some([render.clone(), albedo.clone(), picture]);
        }
    }

    /// The picture, once there is one.
    pub fn picture(&self) -> Option<Arc<Picture>> {
        self.0.as_ref().map(|[_, _, picture]| picture.clone())
    }
}

/// E = π (L − Le) / ρ of diffuse surfaces, W·m⁻²; zero where the surface reflects next to nothing.
fn irradiance(render: &Picture, albedo: &Picture, emission: &Picture) -> Picture {
    let pixels = render.pixels.iter().zip(&albedo.pixels);
    let pixels = pixels.zip(&emission.pixels);
    let arriving = pixels.map(|((render, albedo), emission)| {
        let known = albedo.cmpgt(Vec3::splat(DARKEST));
        let light = (*render - *emission).max(Vec3::ZERO) * PI / albedo.max(Vec3::splat(DARKEST));
        Vec3::select(known, light, Vec3::ZERO)
    });
    Picture {
        pixels: arriving.collect(),
        ..*render
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_that_is_reflected_arrived_and_a_lamps_own_did_not() {
        let flat = |value: Vec3| Picture::from_fn(2, 1, |_, _| value);
        let albedo = flat(Vec3::new(0.5, 0.25, 0.0));
        // A wall of 0.5 that sends 1/π receives 2.
        let sent = Vec3::splat(1.0 / PI);
        let wall = irradiance(&flat(sent), &albedo, &flat(Vec3::ZERO));
        assert!((wall.pixels[1] - Vec3::new(2.0, 4.0, 0.0)).length() < 1e-5);
        let lamp = irradiance(&flat(sent), &albedo, &flat(sent));
        assert_eq!(lamp.pixels[0], Vec3::ZERO);
    }
}
