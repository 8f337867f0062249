//! The pictures that can be looked at, and what their numbers mean.

use serde::{Deserialize, Serialize};

/// One of the pictures of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Quantity {
    /// What the camera saw, radiance.
    Photograph,
    /// What the estimate predicts, radiance.
    Render,
    /// Diffuse reflectance.
    Albedo,
    /// Emitted radiance.
    Emission,
    /// Light that arrives at the surface.
    Irradiance,
    /// Render − photograph, signed radiance.
    Error,
    /// Standard error of the albedo.
    StandardError,
    /// Objects pasted over the photograph, lit by harmonics of the photographs.
    Naive,
    /// Objects pasted over the photograph, lit by harmonics of the estimate.
    NaiveEstimate,
    /// The photograph in changed light, and with objects, by differential rendering with the estimate.
    Composite,
}

/// How numbers become colours.
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
    /// All, in the order in which menus show them.
    pub const ALL: [Quantity; 10] = [
        Self::Photograph,
        Self::Render,
        Self::Albedo,
        Self::Emission,
        Self::Irradiance,
        Self::Error,
        Self::StandardError,
        Self::Naive,
        Self::NaiveEstimate,
        Self::Composite,
    ];

    /// Name shown to people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Photograph => "Photograph",
            Self::Render => "Re-render",
            Self::Albedo => "Albedo",
            Self::Emission => "Emission",
            Self::Irradiance => "Irradiance",
            Self::Error => "Error",
            Self::StandardError => "Standard error",
            Self::Naive => "Naive composite",
            Self::NaiveEstimate => "Naive, our light",
            Self::Composite => "Composite",
        }
    }

    /// What is shown, in a sentence.
    pub fn help(self) -> &'static str {
        match self {
            Self::Photograph => "Radiance that the camera measured",
            Self::Render => "Radiance that the estimate predicts for this view",
            Self::Albedo => "Estimated diffuse reflectance; 1 is white",
            Self::Emission => "Estimated emitted radiance",
            Self::Irradiance => {
                "Light that arrives at each surface, by the re-render and the albedo"
            }
            Self::Error => "Re-render minus photograph: blue is too dark, red is too bright",
            Self::StandardError => "Standard error of the estimated albedo",
            Self::Naive => "Objects lit by harmonics of the photographs, pasted without shadow",
            Self::NaiveEstimate => {
                "Objects lit by harmonics of our estimate, pasted without shadow"
            }
            Self::Composite => {
                "The photograph in the light as you changed it, with objects lit and shadowed by the estimate"
            }
        }
    }

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
