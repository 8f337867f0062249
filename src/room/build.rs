//! Geometry and materials of the built-in room.

use crate::capture::mesh::Mesh;
use crate::math::picture::Picture;
use crate::room::furniture::{seats as seating, vessels, woodwork};
use crate::room::shape::{Modeller, Projection};
use crate::room::texture;
use crate::transport::material::{Albedo, Material, Texture};
use glam::{DAffine3, DVec2, DVec3, Vec3};
use std::sync::Arc;

/// Half the room's width in metres. The floor is y = 0, with its centre at the origin.
pub const HALF_WIDTH: f64 = 2.5;
/// Half the room's depth in metres.
pub const HALF_DEPTH: f64 = 2.0;
/// The room's height in metres.
pub const HEIGHT: f64 = 2.55;

/// Radiance of the ceiling lamp, a neutral white panel.
const CEILING_LAMP: Vec3 = Vec3::new(17.0, 16.0, 14.2);
/// Radiance of the floor lamp, a warm paper lantern.
const FLOOR_LAMP: Vec3 = Vec3::new(9.5, 5.2, 2.1);

/// Collects objects with their materials.
#[derive(Default)]
struct Builder {
    modeller: Modeller,
    materials: Vec<Material>,
    /// The pictures of textured objects.
    prints: Vec<(usize, Picture)>,
}

impl Builder {
    /// Adds an object built in room coordinates.
    fn add(&mut self, name: &str, material: Material, shapes: impl FnOnce(&mut Modeller)) {
        self.modeller.object(name);
        self.materials.push(material);
        shapes(&mut self.modeller);
    }

    /// Adds an object of constant albedo.
    fn plain(&mut self, name: &str, albedo: [f32; 3], shapes: impl FnOnce(&mut Modeller)) {
        let material = Material::diffuse(albedo.into(), Vec3::ZERO);
        self.add(name, material, shapes);
    }

    /// Adds an object with a picture for its albedo.
    fn printed(&mut self, name: &str, picture: Picture, shapes: impl FnOnce(&mut Modeller)) {
        self.prints.push((self.materials.len(), picture));
        self.plain(name, [1.0; 3], shapes);
    }
}

/// Textures objects with pictures, by the mesh's texture coordinates.
pub fn print(materials: &mut [Material], mesh: &Mesh, prints: Vec<(usize, Picture)>) {
    let corner_uvs = Arc::new(mesh.corner_uvs.clone());
    for (object, picture) in prints {
        let texture = Texture {
            width: picture.width,
            height: picture.height,
            pixels: picture.pixels,
            corner_uvs: corner_uvs.clone(),
        };
        materials[object].albedo = Albedo::Image(Arc::new(texture), Vec3::ONE);
    }
}

/// Placement at (x, y, z), rotated by degrees about the vertical, counter-clockwise seen from above.
fn at(x: f64, y: f64, z: f64, degrees: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
        * DAffine3::from_rotation_y(degrees.to_radians())
}

/// The room's mesh and the material of each object.
pub fn build() -> (Mesh, Vec<Material>) {
    let mut b = Builder::default();
    shell(&mut b);
    lamps(&mut b);
    seats(&mut b);
    tables(&mut b);
    shelves(&mut b);
    decoration(&mut b);

    print(&mut b.materials, &b.modeller.mesh, b.prints);
    (b.modeller.mesh, b.materials)
}

/// Floor, ceiling, walls, skirting and door.
fn shell(b: &mut Builder) {
    let (x, z, y) = (HALF_WIDTH, HALF_DEPTH, HEIGHT);
    let (width, depth, height) = (DVec3::X * 2.0 * x, DVec3::Z * 2.0 * z, DVec3::Y * y);
    let low = DVec3::new(-x, 0.0, -z);
    let high = DVec3::new(x, y, z);
    b.plain("floor", [0.42, 0.27, 0.15], |m| {
        m.grid(low, depth, width, 8, 10)
    });
    b.plain("ceiling", [0.82, 0.81, 0.79], |m| {
        m.grid(high, -width, -depth, 10, 8)
    });
    b.plain("north-wall", [0.72, 0.69, 0.62], |m| {
        m.grid(low, width, height, 10, 5)
    });
    b.plain("south-wall", [0.72, 0.69, 0.62], |m| {
        m.grid(high, -height, -width, 5, 10)
    });
    b.plain("west-wall", [0.56, 0.13, 0.065], |m| {
        m.grid(low, height, depth, 5, 8)
    });
    b.plain("east-wall", [0.58, 0.66, 0.60], |m| {
        m.grid(high, -depth, -height, 8, 5)
    });
    b.plain("skirting", [0.80, 0.79, 0.76], |m| {
        let (tall, thick) = (0.09, 0.014);
        for s in [-1.0, 1.0] {
            let center = DVec3::new(0.0, tall * 0.5, s * (z - thick * 0.5));
            let half = DVec3::new(x - thick, tall * 0.5, thick * 0.5);
            m.rounded_box(center, half, 0.0, 0);
        }
        let low = DVec3::new(-x, 0.0, -z);
        m.cuboid(low, DVec3::new(-x + thick, tall, z));
        m.cuboid(DVec3::new(x - thick, 0.0, -z), DVec3::new(x, tall, 0.28));
        m.cuboid(DVec3::new(x - thick, 0.0, 1.32), DVec3::new(x, tall, z));
    });
    b.plain("door", [0.74, 0.73, 0.69], |m| {
        m.placed(at(x - 0.012, 0.0, 0.8, -90.0), woodwork::door);
    });
}

/// The ceiling lamp in its rim, and the floor lamp on its stand.
fn lamps(b: &mut Builder) {
    let (width, depth) = (0.84, 0.46);
    let panel = Material::diffuse(Vec3::splat(0.70), CEILING_LAMP);
    b.add("ceiling-lamp", panel, |m| {
        let corner = DVec3::new(-width * 0.5, HEIGHT - 0.035, -depth * 0.5);
        m.grid(corner, DVec3::X * width, DVec3::Z * depth, 4, 2);
    });
    b.plain("ceiling-lamp-rim", [0.35, 0.35, 0.36], |m| {
        let down = DAffine3::from_translation(DVec3::Y * HEIGHT)
            * DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
        m.placed(down, |m| {
            woodwork::rim(m, width + 0.04, depth + 0.04, 0.02, 0.055)
        });
    });
    let place = at(-1.72, 0.0, -1.52, 0.0);
    let paper = Material::diffuse(Vec3::new(0.72, 0.66, 0.54), FLOOR_LAMP);
    b.add("floor-lamp", paper, |m| {
        m.placed(place, |m| vessels::lantern(m, 1.42))
    });
    b.plain("floor-lamp-stand", [0.045, 0.045, 0.05], |m| {
        m.placed(place, |m| vessels::lamp_stand(m, 1.42));
    });
}

/// Sofa, armchair, their feet, cushions and the stool.
fn seats(b: &mut Builder) {
    let sofa = at(0.05, 0.0, -1.42, 0.0);
    let armchair = at(1.42, 0.0, 0.42, -68.0);
    b.plain("sofa", [0.045, 0.17, 0.21], |m| {
        m.placed(sofa, |m| seating::upholstery(m, 2.05, 0.88, 2));
    });
    b.plain("armchair", [0.30, 0.33, 0.10], |m| {
        m.placed(armchair, |m| seating::upholstery(m, 0.86, 0.82, 1));
    });
    b.plain("seat-feet", [0.10, 0.055, 0.03], |m| {
        m.placed(sofa, |m| seating::feet(m, 2.05, 0.88));
        m.placed(armchair, |m| seating::feet(m, 0.86, 0.82));
    });
    let leaning = |x: f64, turn: f64, roll: f64| {
        at(x, 0.625, -1.27, turn)
            * DAffine3::from_rotation_x(-0.38)
            * DAffine3::from_rotation_z(roll)
    };
    b.plain("cushion-mustard", [0.62, 0.36, 0.035], |m| {
        m.placed(leaning(-0.62, 24.0, 0.06), |m| seating::cushion(m, 0.46));
    });
    b.plain("cushion-cream", [0.76, 0.71, 0.60], |m| {
        m.placed(leaning(0.68, -20.0, -0.05), |m| seating::cushion(m, 0.44));
    });
    b.plain("stool", [0.66, 0.20, 0.025], |m| {
        m.placed(at(-1.12, 0.0, 0.72, 0.0), seating::stool);
    });
}

/// The rug, and the coffee table with its vessels.
fn tables(b: &mut Builder) {
    let center = DVec3::new(0.02, 0.0, 0.22);
    let (length, width) = (2.5, 1.65);
    b.printed("rug", texture::rug(), |m| {
        m.projection = Some(Projection {
            origin: center,
            u_axis: DVec3::X / length,
            v_axis: DVec3::NEG_Z / width,
            offset: DVec2::splat(0.5),
        });
        // Sunk into the floor to hide the rounding of its lower edge.
        let half = DVec3::new(length * 0.5, 0.0125, width * 0.5);
        m.rounded_box(center + DVec3::Y * 0.0005, half, 0.005, 1);
    });
    let place = at(center.x, 0.013, center.z, 0.0);
    b.plain("coffee-table", [0.24, 0.12, 0.055], |m| {
        m.placed(place, |m| woodwork::table(m, 1.10, 0.58, 0.42));
    });
    let top = 0.013 + 0.42;
    b.plain("bowl", [0.78, 0.76, 0.70], |m| {
        m.placed(at(0.26, top, 0.30, 0.0), |m| vessels::bowl(m, 0.15));
    });
    b.plain("vase", [0.035, 0.075, 0.38], |m| {
        m.placed(at(-0.26, top, 0.14, 0.0), |m| vessels::vase(m, 0.28));
    });
}

/// The bookcase with its books and the sideboard.
fn shelves(b: &mut Builder) {
    let bookcase = at(HALF_WIDTH - 0.17, 0.0, -1.02, -90.0);
    b.plain("bookcase", [0.16, 0.085, 0.045], |m| {
        m.placed(bookcase, |m| woodwork::bookcase(m, 0.98, 0.30));
    });
    b.printed("books", texture::books(), |m| {
        m.placed(bookcase, |m| woodwork::books(m, 0.98, 0.30));
    });
    b.plain("sideboard", [0.78, 0.77, 0.74], |m| {
        m.placed(at(0.35, 0.0, HALF_DEPTH - 0.24, 180.0), |m| {
            woodwork::sideboard(m, 1.55, 0.42, 0.68)
        });
    });
    b.plain("jar", [0.10, 0.38, 0.33], |m| {
        m.placed(at(-0.12, 0.68, HALF_DEPTH - 0.26, 0.0), |m| {
            vessels::vase(m, 0.34)
        });
    });
    b.plain("speaker", [0.055, 0.05, 0.05], |m| {
        m.placed(at(0.82, 0.68, HALF_DEPTH - 0.25, 172.0), |m| {
            m.rounded_box(DVec3::Y * 0.10, DVec3::new(0.17, 0.10, 0.08), 0.02, 1);
        });
    });
}

/// The poster in its frame and the plant in its pot.
fn decoration(b: &mut Builder) {
    let (width, height) = (1.0, 0.70);
    let wall = at(0.05, 1.52, -HALF_DEPTH, 0.0);
    b.printed("poster", texture::poster(), |m| {
        m.projection = Some(Projection {
            origin: wall.translation,
            u_axis: DVec3::X / width,
            v_axis: DVec3::Y / height,
            offset: DVec2::splat(0.5),
        });
        m.placed(wall, |m| {
            let low = DVec3::new(-width * 0.5, -height * 0.5, 0.012);
            m.grid(low, DVec3::X * width, DVec3::Y * height, 4, 3);
        });
    });
    b.plain("poster-frame", [0.035, 0.03, 0.03], |m| {
        m.placed(wall, |m| {
            woodwork::rim(m, width + 0.05, height + 0.05, 0.026, 0.025)
        });
    });
    for (name, albedo, x) in [
        ("canvas-blue", [0.06, 0.13, 0.34], 0.05),
        ("canvas-ochre", [0.58, 0.34, 0.07], 0.67),
    ] {
        let center = DVec3::new(x, 1.45, HALF_DEPTH - 0.018);
        let half = DVec3::new(0.24, 0.32, 0.018);
        b.plain(name, albedo, |m| m.rounded_box(center, half, 0.008, 1));
    }
    let corner = at(-2.02, 0.0, 1.45, 0.0);
    b.plain("pot", [0.50, 0.47, 0.43], |m| {
        m.placed(corner, |m| vessels::pot(m, 0.21, 0.36))
    });
    b.plain("plant", [0.075, 0.24, 0.05], |m| {
        m.placed(corner * DAffine3::from_translation(DVec3::Y * 0.31), |m| {
            vessels::leaves(m, 18, 0.95)
        });
    });
}
