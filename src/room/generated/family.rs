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

/// A row of the table of families.
struct Row {
    family: Family,
    name: &'static str,
    about: &'static str,
}

const TABLE: [Row; Family::ALL.len()] = [
    Row {
        family: Family::Plain,
        name: "plain",
        about: "boxes, drums and tables in the light of lamps that are in view",
    },
    Row {
        family: Family::Unseen,
        name: "unseen",
        about: "lamps light the room, and no photograph sees one",
    },
    Row {
        family: Family::Window,
        name: "window",
        about: "sky and sun through openings that photographs see in part; no lamps, or a weak one",
    },
    Row {
        family: Family::Clutter,
        name: "clutter",
        about: "300 to 1000 small objects on floor, furniture and shelves",
    },
    Row {
        family: Family::Patterned,
        name: "patterned",
        about: "stripes, checks, noise and prints on most surfaces",
    },
    Row {
        family: Family::Glossy,
        name: "glossy",
        about: "GGX lobes of roughness 0.1 and more over the diffuse base of several objects",
    },
    Row {
        family: Family::White,
        name: "white",
        about: "albedos of 0.9 and more on the shell and most furniture",
    },
    Row {
        family: Family::Sparse,
        name: "sparse",
        about: "6 photographs with 5 to 15 % noise a pixel",
    },
    Row {
        family: Family::Phone,
        name: "phone",
        about: "8-bit JPEG, automatic exposure, vignetting and slight blur",
    },
    Row {
        family: Family::Scanned,
        name: "scanned",
        about: "as phone, the mesh fused from noisy depth images with holes, poses jittered, no objects",
    },
];

impl Family {
    /// All families, in the order of the table.
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
            names[i] = TABLE[i].name;
            i += 1;
        }
        names
    };

    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// One-line description.
    pub fn about(self) -> &'static str {
        self.row().about
    }

    /// The family with a name.
    pub fn of_name(name: &str) -> Option<Self> {
        (TABLE.iter().find(|row| row.name == name)).map(|row| row.family)
    }

    fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_one_row_a_family_in_order() {
        for (family, row) in Family::ALL.into_iter().zip(&TABLE) {
            assert_eq!(family, row.family);
            assert_eq!(Family::of_name(family.name()), Some(family));
        }
        assert_eq!(Family::of_name("none"), None);
    }
}
