//! The pictures that can be looked at, and what their numbers mean.

use crate::app::controls::choices;

choices! {
    /// One of the pictures of a view.
    Quantity {
        Photograph, "Photograph", "Radiance that the camera measured";
        Render, "Re-render", "Radiance that the estimate predicts for this view";
        Albedo, "Albedo", "Estimated diffuse reflectance; 1 is white";
        Emission, "Emission", "Estimated emitted radiance";
        Irradiance, "Irradiance", "Light that arrives at each surface, by the re-render and the albedo";
        Error, "Error", "Re-render minus photograph: blue is too dark, red is too bright";
        StandardError, "Standard error", "Standard error of the estimated albedo";
        Naive, "Naive composite", "Objects lit by harmonics of the photographs, pasted without shadow";
        NaiveEstimate, "Naive, our light", "Objects lit by harmonics of our estimate, pasted without shadow";
        Composite, "Composite", "The photograph in the light as you changed it, with objects lit and shadowed by the estimate";
    }
}

/// How numbers become colours; numbered as in `picture.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shading {
    /// Radiance: exposure, tone curve, sRGB curve.
    Radiance,
    /// Reflectance: sRGB curve alone, so that 1 is white.
    Reflectance,
    /// False colour of the mean over RGB, zero in the middle.
    Signed,
    /// False colour of the mean over RGB, from zero up.
    Positive,
}

impl Quantity {
    /// Unit of its numbers, or empty, where radiance is measured in a unit.
    pub fn unit(self, radiance: &'static str) -> &'static str {
        match (self, radiance) {
            (Self::Albedo | Self::StandardError, _) => "",
            (Self::Irradiance, "W/(sr·m²)") => "W/m²",
            _ => radiance,
        }
    }

    /// How its numbers become colours.
    pub fn shading(self) -> Shading {
        match self {
            Self::Albedo => Shading::Reflectance,
            Self::Error => Shading::Signed,
            Self::StandardError | Self::Irradiance => Shading::Positive,
            _ => Shading::Radiance,
        }
    }
}
