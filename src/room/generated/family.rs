//! The families of generated rooms.

use serde::{Deserialize, Serialize};

/// A kind of generated room. Its number is a key of the random numbers of its rooms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Lamps in view.
    Plain = 0,
    /// No lamp in view.
    Unseen = 1,
    /// Light from outside.
    Window = 2,
    /// Hundreds of objects.
    Clutter = 3,
    /// Textures.
    Patterned = 4,
    /// Specular lobes.
    Glossy = 5,
    /// Many bounces.
    White = 6,
    /// Few and noisy photographs.
    Sparse = 7,
    /// Photographs like a phone's.
    Phone = 8,
    /// Photographs like a phone's, and a mesh fused from depth images.
    Scanned = 9,
}

impl Family {
    /// All families.
    pub const ALL: [Self; 10] = [
        Self::Plain,
        Self::Unseen,
        Self::Window,
        Self::Clutter,
        Self::Patterned,
        Self::Glossy,
        Self::White,
        Self::Sparse,
        Self::Phone,
        Self::Scanned,
    ];

    /// Their names on the command line and in files, in the same order.
    pub const NAMES: [&'static str; Self::ALL.len()] = [
        "plain",
        "unseen",
        "window",
        "clutter",
        "patterned",
        "glossy",
        "white",
        "sparse",
        "phone",
        "scanned",
    ];

    /// Name on the command line and in files.
    pub const fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The family with a name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|family| family.name() == name)
    }
}
