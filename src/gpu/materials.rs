//! Materials and their tables in the shader's layout.

use crate::gpu::layout::Material as Shared;
use crate::gpu::layout::{ALBEDO_CONSTANT, ALBEDO_IMAGE, ALBEDO_TEXELS, NONE};
use crate::transport::bsdf::MIN_ROUGHNESS;
use crate::transport::lit::LitScene;
use crate::transport::material::{Albedo, Material};
use glam::Vec3;
use std::collections::HashMap;
use std::sync::Arc;

/// An inserted object in scene coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Inserted<'a> {
    /// Corners of each triangle.
    pub corners: &'a [[Vec3; 3]],
    /// Unit geometric normal of each triangle's front.
    pub normals: &'a [Vec3],
    /// Unit shading normals at the corners; empty where there are none.
    pub corner_normals: &'a [[Vec3; 3]],
    /// Factors on the albedo at the corners; empty where there are none.
    pub corner_colors: &'a [[Vec3; 3]],
    /// For each triangle, an index into `materials`.
    pub material_of: &'a [u32],
    /// Materials; emission is ignored.
    pub materials: &'a [Material],
}

/// Materials and the data that they refer to.
#[derive(Debug, Default)]
pub(super) struct Materials {
    /// One per object of the scene, then those of each inserted object.
    pub materials: Vec<Shared>,
    /// Tables of colours, texels, coordinates and normals.
    pub data: Vec<u32>,
    /// Index of each stored table by its address: materials share tables.
    stored: HashMap<usize, u32>,
}

impl Materials {
    /// The materials of a scene, with the pdf of light sampling; `None` if tables differ in length, which the shader does not check.
    pub fn new(lit: &LitScene) -> Option<Self> {
        let mut all = Self::default();
        let triangles = lit.scene.triangles.len();
        let fit = lit
            .materials
            .iter()
            .all(|material| is_whole(material, triangles));
        if !fit || lit.materials.len() != lit.scene.objects.len() {
            return None;
        }
        for (object, material) in lit.materials.iter().enumerate() {
            let mut packed = all.pack(material, 0);
            let density = lit.emitters.pdf(object as u32);
            packed.emission = with(material.emission, density);
            all.materials.push(packed);
        }
        Some(all)
    }

    /// Adds the materials of an inserted object whose first triangle has index `first`; `None` if tables differ in length.
    pub fn insert(&mut self, object: &Inserted<'_>, first: u32) -> Option<()> {
        let triangles = object.corners.len();
        let corners = [object.corner_normals, object.corner_colors];
        let fit = (corners.iter()).all(|table| table.is_empty() || table.len() == triangles)
            && [object.normals.len(), object.material_of.len()] == [triangles; 2]
            && (object.material_of.iter()).all(|&m| (m as usize) < object.materials.len())
            && (object.materials.iter()).all(|material| is_whole(material, triangles));
        if !fit {
            return None;
        }
        let normals = self.corners(object.corner_normals);
        let colors = self.corners(object.corner_colors);
        for material in object.materials {
            let packed = self.pack(material, first);
            self.materials.push(Shared {
                corners: [normals, colors, 0, 0],
                ..packed
            });
        }
        Some(())
    }

    /// Packs a material without emission.
    fn pack(&mut self, material: &Material, first: u32) -> Shared {
        let (albedo, kind, size) = match &material.albedo {
            Albedo::Constant(color) => (*color, [ALBEDO_CONSTANT, 0, 0, 0], [0; 2]),
            Albedo::Texels(texels) => {
                let first = self.table(&texels.layout.first, |word| [*word]);
                let colors = self.table(&texels.colors, |color| color.to_array().map(f32::to_bits));
                (Vec3::ONE, [ALBEDO_TEXELS, first, colors, 0], [0; 2])
            }
            Albedo::Image(texture, tint) => {
                let pixels =
                    self.table(&texture.pixels, |color| color.to_array().map(f32::to_bits));
                let corners: &Arc<Vec<_>> = &texture.corner_uvs;
                let uvs = self.table(corners, |[a, b, c]: &[glam::Vec2; 3]| {
                    [a.x, a.y, b.x, b.y, c.x, c.y].map(f32::to_bits)
                });
                let size = [texture.width, texture.height];
                (*tint, [ALBEDO_IMAGE, pixels, uvs, 0], size)
            }
        };
        let lobe = material.lobe;
        let roughness = lobe.map_or(-1.0, |lobe| lobe.roughness.max(MIN_ROUGHNESS));
        let specular = lobe.map_or(Vec3::ZERO, |lobe| lobe.specular);
        Shared {
            albedo: with(albedo, 0.0),
            emission: [0.0; 4],
            specular: with(specular, roughness),
            kind,
            image: [size[0], size[1], first, 0],
            corners: [NONE, NONE, 0, 0],
        }
    }

    /// Stores values at the corners of triangles; returns their index, or [`NONE`] if there are none.
    fn corners(&mut self, values: &[[Vec3; 3]]) -> u32 {
        if values.is_empty() {
            return NONE;
        }
        let place = self.data.len() as u32;
        let numbers = values.iter().flatten().flat_map(|v| v.to_array());
        self.data.extend(numbers.map(f32::to_bits));
        place
    }

    /// Stores a table once; returns its index.
    fn table<T, const N: usize>(&mut self, items: &[T], words: impl Fn(&T) -> [u32; N]) -> u32 {
        let place = self.data.len() as u32;
        let stored = *self.stored.entry(items.as_ptr() as usize).or_insert(place);
        if stored == place {
            self.data.extend(items.iter().flat_map(words));
        }
        stored
    }
}

/// Whether the tables of a material hold an entry for every triangle, texel and pixel.
fn is_whole(material: &Material, triangles: usize) -> bool {
    match &material.albedo {
        Albedo::Constant(_) => true,
        Albedo::Texels(texels) => {
            texels.layout.first.len() == triangles + 1 && texels.colors.len() == texels.layout.len()
        }
        Albedo::Image(texture, _) => {
            let size = texture.width as usize * texture.height as usize;
            size > 0 && texture.pixels.len() == size && texture.corner_uvs.len() == triangles
        }
    }
}

fn with(v: Vec3, w: f32) -> [f32; 4] {
    v.extend(w).to_array()
}
