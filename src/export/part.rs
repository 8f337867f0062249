//! A scene cut into one part for each object, as the formats of other programs need it.

use crate::export::atlas::Atlas;
use crate::inverse::estimate::{Estimate, ObjectEstimate, TexelEstimate};
use crate::scene::{Object, Scene};
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// One object with its own vertices, in the capture's coordinates.
#[derive(Debug, Clone, Default)]
pub struct Part {
    /// The object's name.
    pub name: String,
    /// Its estimate; `albedo` is the mean if there are `colors`.
    pub estimate: ObjectEstimate,
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Vertex indices, counter-clockwise seen from the emitting side.
    pub triangles: Vec<[u32; 3]>,
    /// Albedo of each vertex where it varies over the object, else empty. Each texel then has three vertices of its own.
    pub colors: Vec<Vec3>,
    /// Texture coordinates of each vertex in an [`Atlas`], for parts with an atlas, else empty.
    pub uvs: Vec<Vec2>,
}

/// Cuts a scene into one part for each object that has triangles.
pub fn parts(scene: &Scene, estimate: &Estimate) -> Vec<Part> {
    cut(scene, estimate, |part, triangles, texels| {
        part.add_texels(scene, triangles, texels);
    })
}

/// The same, but textured objects keep their triangles and get coordinates in an atlas.
pub fn mapped_parts(scene: &Scene, estimate: &Estimate) -> (Vec<Part>, Option<Atlas>) {
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
    let part = |(index, object): (usize, &Object)| {
        let mut part = Part {
            name: object.name.clone(),
            estimate: estimate.objects.get(index).cloned().unwrap_or_default(),
            ..Part::default()
        };
        match estimate.texels.as_deref() {
            Some(texels) if texels.textured.get(index) == Some(&true) => {
                textured(&mut part, &object.triangles, texels);
            }
            _ => part.add_triangles(scene, &object.triangles),
        }
        part
    };
    let objects = scene.objects.iter().enumerate();
    let seen = objects.filter(|(_, object)| !object.triangles.is_empty());
    seen.map(part).collect()
}

impl Part {
    /// Adds triangles with shared vertices.
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

    /// Adds triangles with vertices of their own, and their texture coordinates.
    fn add_mapped(&mut self, scene: &Scene, triangles: &[u32], atlas: &Atlas) {
        for &triangle in triangles {
            let Some(uvs) = atlas.corners[triangle as usize] else {
                continue;
            };
            let start = self.positions.len() as u32;
            let corners = scene.corners(triangle).map(|p| p.as_dvec3() + scene.origin);
            self.positions.extend(corners);
            self.uvs.extend(uvs);
            self.triangles.push([start, start + 1, start + 2]);
        }
    }

    /// Adds triangles cut into their texels, each of one colour.
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
                    let color = texels.colors.colors[(first + texel) as usize];
                    self.colors.push(color);
                }
                self.triangles.push([start, start + 1, start + 2]);
            }
        }
    }

    /// The name without characters that would break a line or a path of a text format.
    pub fn plain_name(&self) -> String {
        let is_odd = |c: char| !c.is_alphanumeric() && !"-_.".contains(c);
        self.name.replace(is_odd, "_")
    }
}
