//! A scene and its estimate, cut into parts as other programs want them.

use crate::error::Result;
use crate::export::atlas::Atlas;
use crate::export::{glb, mitsuba, obj, objects, overwrite, ply, probe};
use crate::inverse::estimate::{Estimate, ObjectEstimate, TexelEstimate};
use crate::scene::Scene;
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Formats that other programs read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Format {
    /// Scene with base colours and emissive strength.
    Glb,
    /// Scene as OBJ and MTL, with textures as images.
    Obj,
    /// Scene as PLY with vertex colours.
    Ply,
    /// Scene as a Mitsuba 3 XML file.
    Mitsuba,
    /// Table of objects.
    Csv,
    /// The light at a point as a panorama.
    Probe {
        /// The point, in the capture's coordinates.
        at: DVec3,
    },
}

impl Format {
    /// What names of its files end with, the usual one first.
    pub const fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Glb => &["glb"],
            Self::Obj => &["obj"],
            Self::Ply => &["ply"],
            Self::Mitsuba => &["xml"],
            Self::Csv => &["csv"],
            Self::Probe { .. } => &["hdr", "exr"],
        }
    }
}

/// One object with its own vertices, in the capture's coordinates.
#[derive(Debug, Clone)]
pub struct Part {
    /// The object's name.
    pub name: String,
    /// What is known of it. `albedo` is the mean where there are `colors`.
    pub estimate: ObjectEstimate,
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Vertex indices, counter-clockwise seen from the emitting side.
    pub triangles: Vec<[u32; 3]>,
    /// Albedo of each vertex where it varies over the object, else empty. Each texel is then three vertices of its own.
    pub colors: Vec<Vec3>,
    /// Texture coordinates of each vertex in an [`Atlas`], where the part was made for one, else empty.
    pub uvs: Vec<Vec2>,
}

/// What a file of a format cannot hold of an estimate, in a sentence; `None` where nothing is lost.
pub fn lost(estimate: &Estimate, format: Format) -> Option<&'static str> {
    let holds_light = matches!(format, Format::Glb | Format::Obj | Format::Mitsuba);
    (holds_light && estimate.outside.is_some()).then_some(
        "light from outside the mesh is not in the file; write it as a panorama (a light probe) beside it",
    )
}

/// Writes a scene and its estimate for another program.
///
/// # Errors
/// The file may not be replaced (see [`overwrite`]) or cannot be written, its ending does not fit a panorama, or the format
/// cannot hold the scene.
pub fn write(scene: &Arc<Scene>, estimate: &Estimate, format: Format, path: &Path) -> Result<()> {
    // Before anything is written beside it.
    overwrite::check(path)?;
    match format {
        Format::Glb => {
            let (parts, atlas) = mapped_parts(scene, estimate);
            glb::write(path, scene, &parts, atlas.as_ref().map(|a| &a.picture))
        }
        Format::Obj => {
            let (parts, atlas) = mapped_parts(scene, estimate);
            obj::write(path, &parts, atlas.as_ref().map(|a| &a.picture))
        }
        Format::Ply => ply::write_scene(path, &parts(scene, estimate)),
        Format::Mitsuba => mitsuba::write(path, scene, &parts(scene, estimate)),
        Format::Csv => objects::table(scene, estimate).write(path),
        Format::Probe { at } => probe::write(path, &estimate.lit(scene), at),
    }
}

/// Cuts a scene into one part an object; objects without triangles are left out.
pub fn parts(scene: &Scene, estimate: &Estimate) -> Vec<Part> {
    cut(scene, estimate, |part, triangles, texels| {
        part.add_texels(scene, triangles, texels);
    })
}

/// The same with whole triangles and coordinates in an atlas where albedo varies.
fn mapped_parts(scene: &Scene, estimate: &Estimate) -> (Vec<Part>, Option<Atlas>) {
    let atlas = (estimate.texels.as_deref()).and_then(|texels| Atlas::new(scene, texels));
    let parts = match &atlas {
        Some(atlas) => cut(scene, estimate, |part, triangles, _| {
            part.add_mapped(scene, triangles, atlas);
        }),
        None => parts(scene, estimate),
    };
    (parts, atlas)
}

fn cut(
    scene: &Scene,
    estimate: &Estimate,
    textured: impl Fn(&mut Part, &[u32], &TexelEstimate),
) -> Vec<Part> {
    let unknown = ObjectEstimate::default();
    scene
        .objects
        .iter()
        .enumerate()
        .filter(|(_, object)| !object.triangles.is_empty())
        .map(|(index, object)| {
            let texels = estimate
                .texels
                .as_deref()
                .filter(|texels| texels.textured.get(index) == Some(&true));
            let mut part = Part {
                name: object.name.clone(),
                estimate: estimate.objects.get(index).unwrap_or(&unknown).clone(),
                positions: Vec::new(),
                triangles: Vec::new(),
                colors: Vec::new(),
                uvs: Vec::new(),
            };
            match texels {
                Some(texels) => textured(&mut part, &object.triangles, texels),
                None => part.add_triangles(scene, &object.triangles),
            }
            part
        })
        .collect()
}

impl Part {
    /// Triangles as they are, vertices shared.
    fn add_triangles(&mut self, scene: &Scene, triangles: &[u32]) {
        let mut vertex_of = HashMap::new();
        for &triangle in triangles {
            let corners = scene.triangles[triangle as usize].map(|vertex| {
                *vertex_of.entry(vertex).or_insert_with(|| {
                    let local = scene.positions[vertex as usize];
                    self.positions.push(local.as_dvec3() + scene.origin);
                    self.positions.len() as u32 - 1
                })
            });
            self.triangles.push(corners);
        }
    }

    /// Triangles as they are, each with corners of its own.
    fn add_mapped(&mut self, scene: &Scene, triangles: &[u32], atlas: &Atlas) {
        for &triangle in triangles {
            let Some(uvs) = atlas.corners[triangle as usize] else {
                continue;
            };
            let start = self.positions.len() as u32;
            let corners = scene.corners(triangle);
            self.positions
                .extend(corners.map(|local| local.as_dvec3() + scene.origin));
            self.uvs.extend(uvs);
            self.triangles.push([start, start + 1, start + 2]);
        }
    }

    /// Triangles cut into their texels, each of one colour.
    fn add_texels(&mut self, scene: &Scene, triangles: &[u32], texels: &TexelEstimate) {
        let layout = &texels.colors.layout;
        for &triangle in triangles {
            let [a, b, c] = scene.corners(triangle).map(|p| p.as_dvec3());
            let first = layout.first[triangle as usize];
            for texel in 0..layout.first[triangle as usize + 1] - first {
                let start = self.positions.len() as u32;
                for [b1, b2] in layout.corners(triangle as usize, texel) {
                    let local = a + (b - a) * f64::from(b1) + (c - a) * f64::from(b2);
                    self.positions.push(local + scene.origin);
                    self.colors
                        .push(texels.colors.colors[(first + texel) as usize]);
                }
                self.triangles.push([start, start + 1, start + 2]);
            }
        }
    }

    /// The name without what would break a line or a path of a text format.
    pub fn plain_name(&self) -> String {
        self.name
            .chars()
            .map(|c| {
                if c.is_alphanumeric() || "-_.".contains(c) {
                    c
                } else {
                    '_'
                }
            })
            .collect()
    }
}
