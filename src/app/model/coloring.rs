//! What the 3D view's faces are coloured by.

use crate::app::controls::choices;
use crate::app::model::surface::Surface;
use crate::inverse::estimate::Estimate;
use crate::scene::Scene;
use glam::Vec3;

choices! {
    /// A quantity shown on the mesh.
    Coloring {
        Photograph, "Photograph", "Radiance in the photographs";
        Albedo, "Albedo", "Estimated diffuse reflectance";
        Emission, "Emission", "Estimated emitted radiance";
        Object, "Object", "One colour an object";
    }
}

/// Marks faces that no photograph sees; the shader gives them a colour that no exposure changes.
const UNSEEN: Vec3 = Vec3::splat(-1.0);

impl Coloring {
    /// Whether exposure and tone curve apply.
    pub fn is_radiance(self) -> bool {
        matches!(self, Self::Emission | Self::Photograph)
    }

    /// A linear colour a face, with the object's index in the fourth component.
    pub fn colors(
        self,
        surface: &Surface,
        scene: &Scene,
        estimate: &Estimate,
        photographed: &[Option<Vec3>],
    ) -> Vec<[f32; 4]> {
        (surface.middles.iter().enumerate())
            .map(|(face, middle)| {
                let object = scene.object_of[middle.triangle as usize];
                let found = estimate.objects.get(object as usize);
                let color = match self {
                    Self::Object => of_object(object),
                    Self::Emission => found.map_or(Vec3::ZERO, |o| o.emission),
                    Self::Photograph => photographed.get(face).copied().flatten().unwrap_or(UNSEEN),
                    Self::Albedo => match &estimate.texels {
                        Some(texels) if texels.textured.get(object as usize) == Some(&true) => {
                            texels.colors.colors[texels.colors.layout.texel(middle) as usize]
                        }
                        _ => found.map_or(Vec3::splat(0.5), |o| o.albedo),
                    },
                };
                color.extend(object as f32).to_array()
            })
            .collect()
    }
}

/// A colour for an object: hues a golden angle apart, so that neighbours differ.
pub fn of_object(object: u32) -> Vec3 {
    let hue = (object as f32 * 0.618_034).fract();
    let light = 0.45 + 0.2 * ((object as f32 * 0.754_878).fract() - 0.5);
    let rgba = egui::epaint::Hsva::new(hue, 0.6, light * 1.6, 1.0);
    let [r, g, b] = rgba.to_rgb();
    Vec3::new(r, g, b)
}
