//! Objects to insert: triangles with known materials, read from OBJ or glTF.

mod files;
mod gltf;
mod obj;
pub mod surface;

use crate::capture::mesh::bounds;
use crate::error::{Error, Result};
use crate::transport::material::Material;
use glam::{DQuat, DVec3, Vec2, Vec3};
use std::path::Path;
use std::sync::Arc;
use surface::{MaterialOverride, ObjectSurface};

/// Most triangles of an object.
const MAX_TRIANGLES: usize = 20_000_000;

/// An object in its file's coordinates.
///
/// The up axis is +y: the standard of glTF and the custom of OBJ.
#[derive(Debug, Clone)]
pub struct ObjectModel {
    /// The file's name without folder and extension.
    pub name: String,
    /// Corners of each triangle in the file's coordinates and units, counter-clockwise seen from the front.
    pub corners: Vec<[DVec3; 3]>,
    /// Unit normals at each triangle's corners, on its front side; empty where the file has none.
    pub corner_normals: Vec<[Vec3; 3]>,
    /// Linear colours at each triangle's corners, factors on the albedo; empty where the file has none.
    pub corner_colors: Vec<[Vec3; 3]>,
    /// For each triangle, an index into `materials`.
    pub material_of: Vec<u32>,
    /// Materials.
    pub materials: Vec<Material>,
    /// What was replaced or left out: full sentences that name the file.
    pub warnings: Vec<String>,
}

impl ObjectModel {
    /// Reads an OBJ, GLB or glTF file, by its extension.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind, is broken, holds no triangle with an area, or names a texture
    /// outside its own folder.
    pub fn read(path: &Path) -> Result<Self> {
        let ending = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase());
        let parts = match ending.as_deref() {
            Some("obj") => obj::read(path)?,
            Some("glb" | "gltf") => gltf::read(path)?,
            _ => {
                let problem = "is no object file";
                let remedy = "give an .obj, .glb or .gltf file";
                return Err(Error::file(path, problem, remedy));
            }
        };
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        parts.finish(name.into_owned(), path)
    }

    /// Builds an object with one material from triangles.
    ///
    /// # Errors
    /// No triangle has an area, or a coordinate is not finite.
    pub fn from_corners(name: &str, corners: Vec<[DVec3; 3]>, material: Material) -> Result<Self> {
        let mut parts = Parts::default();
        for triangle in corners {
            let corners = Corners {
                positions: triangle,
                ..Corners::default()
            };
            parts.push(corners, 0);
        }
        let mut model = parts.finish(name.to_owned(), Path::new(name))?;
        model.materials = vec![material];
        Ok(model)
    }

    /// Replaces all materials by one, and drops textures and vertex colours.
    pub fn with_material(mut self, material: &MaterialOverride) -> Self {
        self.materials = vec![material.surface().material(None)];
        self.material_of.fill(0);
        self.corner_colors.clear();
        self
    }

    /// Lowest and highest coordinates.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        bounds(self.corners.iter().flatten().copied())
    }

    /// The material with the largest area, as one that could replace them all.
    pub fn main_material(&self) -> MaterialOverride {
        let mut areas = vec![0.0; self.materials.len()];
        for ([a, b, c], &material) in self.corners.iter().zip(&self.material_of) {
            areas[material as usize] += (*b - *a).cross(*c - *a).length();
        }
        let materials = areas.into_iter().zip(&self.materials);
        let main = materials.max_by(|a, b| a.0.total_cmp(&b.0));
        main.map_or_else(MaterialOverride::default, |(_, material)| {
            MaterialOverride::like(material)
        })
    }

    /// Centre of the base of the model rotated by `tilt`: lowest height, centre of the bounding box.
    pub fn base(&self, tilt: DQuat) -> DVec3 {
        base(self.corners.iter().flatten().map(|&p| tilt * p))
    }
}

/// Centre of the base of points: lowest height, centre of their bounding box.
pub fn base(points: impl Iterator<Item = DVec3>) -> DVec3 {
    let (low, high) = bounds(points);
    DVec3::new((low.x + high.x) * 0.5, low.y, (low.z + high.z) * 0.5)
}

/// A triangle as it was read.
#[derive(Default)]
struct Corners {
    positions: [DVec3; 3],
    normals: Option<[Vec3; 3]>,
    uvs: Option<[Vec2; 3]>,
    colors: Option<[Vec3; 3]>,
}

/// Triangles and surfaces as they were read, before missing attributes are filled in.
#[derive(Default)]
struct Parts {
    triangles: Vec<(Corners, u32)>,
    surfaces: Vec<ObjectSurface>,
    warnings: Vec<String>,
    skipped: usize,
    not_finite: usize,
}

impl Parts {
    /// Adds a triangle. One without area or with a coordinate that is not finite is only counted.
    fn push(&mut self, corners: Corners, material: u32) {
        let [a, b, c] = corners.positions;
        let finite = a.is_finite() && b.is_finite() && c.is_finite();
        let area = (b - a).cross(c - a).length_squared();
        match (finite, area > 0.0 && area.is_finite()) {
            (false, _) => self.not_finite += 1,
            (true, false) => self.skipped += 1,
            (true, true) => self.triangles.push((corners, material)),
        }
    }

    /// Refuses an object with more than [`MAX_TRIANGLES`].
    fn check_size(&self, path: &Path) -> Result<()> {
        if self.triangles.len() > MAX_TRIANGLES {
            let problem = format!("has {} triangles or more", self.triangles.len());
            let remedy = format!("reduce the object to {MAX_TRIANGLES} triangles or fewer");
            return Err(Error::file(path, problem, remedy));
        }
        Ok(())
    }

    fn finish(mut self, name: String, path: &Path) -> Result<ObjectModel> {
        if self.triangles.is_empty() {
            let problem = "holds no triangle with an area";
            let remedy = "export the object as a triangle mesh";
            return Err(Error::file(path, problem, remedy));
        }
        self.check_size(path)?;
        for (count, what) in [
            (self.skipped, "have no area"),
            (self.not_finite, "have coordinates that are not finite"),
        ] {
            if count > 0 {
                self.warnings.push(format!(
                    "{}: {count} triangles {what} and are left out.",
                    path.display()
                ));
            }
        }

        // If some triangles have an attribute, the others get a default value.
        let has_normals = self.triangles.iter().any(|(c, _)| c.normals.is_some());
        let has_colors = self.triangles.iter().any(|(c, _)| c.colors.is_some());
        let corners = || self.triangles.iter().map(|(corners, _)| corners);
        let uvs = corners().map(|c| c.uvs.unwrap_or_default().map(usable_uv));
        let corner_uvs = Arc::new(uvs.collect());
        let normals = corners().filter(|_| has_normals).map(front_normals);
        let colors = corners().filter(|_| has_colors);
        let colors = colors.map(|c| c.colors.unwrap_or([Vec3::ONE; 3]).map(usable_color));
        Ok(ObjectModel {
            name,
            corners: corners().map(|c| c.positions).collect(),
            corner_normals: normals.collect(),
            corner_colors: colors.collect(),
            material_of: self.triangles.iter().map(|(_, of)| *of).collect(),
            materials: (self.surfaces.iter())
                .map(|surface| surface.material(Some(&corner_uvs)))
                .collect(),
            warnings: self.warnings,
        })
    }
}

fn usable_color(color: Vec3) -> Vec3 {
    match color.is_finite() {
        true => color.clamp(Vec3::ZERO, Vec3::ONE),
        false => Vec3::ONE,
    }
}

/// Texture coordinates; zero where they are not finite or far out of range.
fn usable_uv(uv: Vec2) -> Vec2 {
    const MANY_REPEATS: f32 = 1e5;
    match uv.abs().max_element() < MANY_REPEATS && uv.is_finite() {
        true => uv,
        false => Vec2::ZERO,
    }
}

/// Corner normals on the triangle's front side; the geometric normal where the file has none.
fn front_normals(corners: &Corners) -> [Vec3; 3] {
    let [a, b, c] = corners.positions;
    let geometric = (b - a).cross(c - a).normalize_or_zero().as_vec3();
    let own = corners.normals.unwrap_or([geometric; 3]);
    let mut normals = own.map(|n| n.normalize_or(geometric));
    if normals.iter().map(|n| n.dot(geometric)).sum::<f32>() < 0.0 {
        normals = normals.map(|n| -n);
    }
    normals
}
