//! The families of generated rooms.

/// A kind of generated room. Its number is a key of the random numbers of its rooms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
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

    /// The names, in the same order.
    pub const NAMES: [&'static str; Self::ALL.len()] = {
        let mut names = [""; Self::ALL.len()];
        let mut i = 0;
        while i < names.len() {
            names[i] = Self::ALL[i].name();
            i += 1;
        }
        names
    };

    /// Name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Unseen => "unseen",
            Self::Window => "window",
            Self::Clutter => "clutter",
            Self::Patterned => "patterned",
            Self::Glossy => "glossy",
            Self::White => "white",
            Self::Sparse => "sparse",
            Self::Phone => "phone",
            Self::Scanned => "scanned",
        }
    }

    /// One-line description.
    pub fn about(self) -> &'static str {
        match self {
            Self::Plain => "boxes, drums and tables in the light of lamps that are in view",
            Self::Unseen => "lamps light the room, and no photograph sees one",
            Self::Window => {
                "sky and sun through openings that photographs see in part; no lamps, or a weak one"
            }
            Self::Clutter => "300 to 1000 small objects on floor, furniture and shelves",
            Self::Patterned => "stripes, checks, noise and prints on most surfaces",
            Self::Glossy => {
                "GGX lobes of roughness 0.1 and more over the diffuse base of several objects"
            }
            Self::White => "albedos of 0.9 and more on the shell and most furniture",
            Self::Sparse => "6 photographs with 5 to 15 % noise a pixel",
            Self::Phone => "8-bit JPEG, automatic exposure, vignetting and slight blur",
            Self::Scanned => {
                "as phone, the mesh fused from noisy depth images with holes, poses jittered, no objects"
            }
        }
    }

    /// The family with a name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|family| family.name() == name)
    }
}
