//! Binary glTF 2.0: a node, mesh and material for each object, and the cameras.

use crate::error::{Error, Result};
use crate::export::atomic::write_atomically;
use crate::export::part::Part;
use crate::export::picture::png_bytes;
use crate::math::picture::Picture;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use glam::{Mat4, Vec3};
use gltf_json as json;
use json::accessor::{ComponentType, Type};
use json::buffer::Target;
use json::mesh::Semantic;
use json::validation::Checked::Valid;
use json::validation::USize64;
use std::collections::BTreeMap;
use std::path::Path;

/// Writes parts and cameras as a GLB file.
///
/// Base colour is the albedo, from the atlas (8-bit sRGB PNG) where it varies. Emission is emissiveFactor ×
/// KHR_materials_emissive_strength. glTF's roughness is √α, and 1 without a specular lobe. Positions are the capture's, in
/// f32. The cameras lack distortion and have their principal point in the middle.
///
/// # Errors
/// The file cannot be written, or it would be larger than the format's 4 GiB.
pub fn write(path: &Path, scene: &Scene, parts: &[Part], atlas: Option<&Picture>) -> Result<()> {
    let mut file = Document::default();
    if let Some(atlas) = atlas {
        let encoded = png_bytes(atlas, 1.0).map_err(|error| Error::file(path, error, ""))?;
        file.image(&encoded);
    }
    let mut nodes: Vec<_> = parts.iter().map(|part| file.part(part)).collect();
    for (index, camera) in scene.cameras.iter().enumerate() {
        nodes.push(file.camera(index, camera, scene));
    }
    file.finish(nodes);

    let text = json::serialize::to_vec(&file.root)
        .map_err(|error| Error::file(path, error, "nothing was written there"))?;
    if u32::try_from(text.len() + file.bytes.len() + 64).is_err() {
        let remedy = "export as ply or obj, or estimate with fewer texels";
        let problem = "the scene is larger than a GLB file can be";
        return Err(Error::file(path, problem, remedy));
    }
    let glb = gltf::binary::Glb {
        header: gltf::binary::Header {
            magic: *b"glTF",
            version: 2,
            length: 0,
        },
        json: text.into(),
        bin: Some(file.bytes.into()),
    };
    write_atomically(path, |writer| Ok(glb.to_writer(writer)?))
}

/// The JSON and the binary chunk under construction.
#[derive(Default)]
struct Document {
    root: json::Root,
    bytes: Vec<u8>,
    atlas: Option<json::Index<json::Texture>>,
}

impl Document {
    fn part(&mut self, part: &Part) -> json::Index<json::Node> {
        let material = self.material(part);
        let mut attributes = BTreeMap::new();
        let positions: Vec<Vec3> = part.positions.iter().map(|p| p.as_vec3()).collect();
        let ends = |start, end: fn(Vec3, Vec3) -> Vec3| {
            let end = positions.iter().copied().fold(start, end);
            Some(json::Value::from(end.to_array().to_vec()))
        };
        let floats = positions.iter().flat_map(|p| p.to_array());
        let bytes = floats.map(f32::to_le_bytes);
        let mut accessor = self.accessor(bytes, ComponentType::F32, Type::Vec3);
        accessor.min = ends(Vec3::INFINITY, Vec3::min);
        accessor.max = ends(Vec3::NEG_INFINITY, Vec3::max);
        attributes.insert(Valid(Semantic::Positions), self.root.push(accessor));
        if !part.uvs.is_empty() {
            let floats = part.uvs.iter().flat_map(|uv| uv.to_array());
            let bytes = floats.map(f32::to_le_bytes);
            let accessor = self.accessor(bytes, ComponentType::F32, Type::Vec2);
            attributes.insert(Valid(Semantic::TexCoords(0)), self.root.push(accessor));
        }
        let bytes = part.triangles.iter().flatten().map(|i| i.to_le_bytes());
        let accessor = self.accessor(bytes, ComponentType::U32, Type::Scalar);
        let primitive = json::mesh::Primitive {
            attributes,
            extensions: None,
            extras: Default::default(),
            indices: Some(self.root.push(accessor)),
            material: Some(material),
            mode: Valid(json::mesh::Mode::Triangles),
            targets: None,
        };

        let mesh = self.root.push(json::Mesh {
            extensions: None,
            extras: Default::default(),
            name: Some(part.name.clone()),
            primitives: vec![primitive],
            weights: None,
        });
        self.root.push(json::Node {
            mesh: Some(mesh),
            name: Some(part.name.clone()),
            ..Default::default()
        })
    }

    fn material(&mut self, part: &Part) -> json::Index<json::Material> {
        let estimate = &part.estimate;
        let texture = self.atlas.filter(|_| !part.uvs.is_empty());
        let color = match texture {
            Some(_) => Vec3::ONE,
            None => estimate.albedo.clamp(Vec3::ZERO, Vec3::ONE),
        };
        let brightest = estimate.emission.max_element();
        let strength = brightest.max(1.0);
        let factor = (estimate.emission / strength).clamp(Vec3::ZERO, Vec3::ONE);
        let extension = (brightest > 1.0).then_some(json::extensions::material::EmissiveStrength {
            emissive_strength: json::extensions::material::EmissiveStrengthFactor(strength),
        });
        if extension.is_some() {
            let name = "KHR_materials_emissive_strength".to_owned();
            if !self.root.extensions_used.contains(&name) {
                self.root.extensions_used.push(name);
            }
        }
        let roughness = |alpha: f32| alpha.max(0.0).sqrt().min(1.0);
        let roughness = estimate.roughness.map_or(1.0, roughness);
        self.root.push(json::Material {
            name: Some(part.name.clone()),
            double_sided: true,
            emissive_factor: json::material::EmissiveFactor(factor.to_array()),
            pbr_metallic_roughness: json::material::PbrMetallicRoughness {
                base_color_factor: json::material::PbrBaseColorFactor(color.extend(1.0).to_array()),
                base_color_texture: texture.map(|index| json::texture::Info {
                    index,
                    tex_coord: 0,
                    extensions: None,
                    extras: Default::default(),
                }),
                metallic_factor: json::material::StrengthFactor(0.0),
                roughness_factor: json::material::StrengthFactor(roughness),
                ..Default::default()
            },
            extensions: Some(json::extensions::material::Material {
                emissive_strength: extension,
            }),
            ..Default::default()
        })
    }

    fn camera(&mut self, index: usize, camera: &Camera, scene: &Scene) -> json::Index<json::Node> {
        let lens = &camera.intrinsics;
        let name = Some(format!("camera {index:03}"));
        let aspect = f64::from(lens.width) / f64::from(lens.height) * lens.fy / lens.fx;
        let perspective = json::camera::Perspective {
            aspect_ratio: Some(aspect as f32),
            yfov: (2.0 * (f64::from(lens.height) * 0.5 / lens.fy).atan()) as f32,
            zfar: None,
            znear: scene.diameter * 1e-4,
            extensions: None,
            extras: Default::default(),
        };
        let camera_index = self.root.push(json::Camera {
            name: name.clone(),
            orthographic: None,
            perspective: Some(perspective),
            type_: Valid(json::camera::Type::Perspective),
            extensions: None,
            extras: Default::default(),
        });
        let center = (camera.center.as_dvec3() + scene.origin).as_vec3();
        let pose = Mat4::from_translation(center) * Mat4::from_mat3(camera.rotation);
        self.root.push(json::Node {
            camera: Some(camera_index),
            matrix: Some(pose.to_cols_array()),
            name,
            ..Default::default()
        })
    }

    /// Appends the atlas, sampled linearly and clamped at its edges.
    fn image(&mut self, encoded: &[u8]) {
        let start = self.bytes.len();
        self.bytes.extend(encoded);
        // What follows must be aligned to four bytes.
        let length = encoded.len();
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = self.view(start, length, None);
        let source = self.root.push(json::Image {
            buffer_view: Some(view),
            mime_type: Some(json::image::MimeType("image/png".to_owned())),
            name: Some("albedo".to_owned()),
            uri: None,
            extensions: None,
            extras: Default::default(),
        });
        let sampler = self.root.push(json::texture::Sampler {
            mag_filter: Some(Valid(json::texture::MagFilter::Linear)),
            min_filter: Some(Valid(json::texture::MinFilter::Linear)),
            wrap_s: Valid(json::texture::WrappingMode::ClampToEdge),
            wrap_t: Valid(json::texture::WrappingMode::ClampToEdge),
            ..Default::default()
        });
        self.atlas = Some(self.root.push(json::Texture {
            name: Some("albedo".to_owned()),
            sampler: Some(sampler),
            source,
            extensions: None,
            extras: Default::default(),
        }));
    }

    /// Appends numbers of four bytes, and describes them as elements of a type.
    fn accessor(
        &mut self,
        numbers: impl Iterator<Item = [u8; 4]>,
        component: ComponentType,
        type_: Type,
    ) -> json::Accessor {
        let start = self.bytes.len();
        self.bytes.extend(numbers.flatten());
        let length = self.bytes.len() - start;
        let target = match type_ {
            Type::Scalar => Target::ElementArrayBuffer,
            _ => Target::ArrayBuffer,
        };
        json::Accessor {
            buffer_view: Some(self.view(start, length, Some(target))),
            byte_offset: None,
            count: USize64::from(length / (4 * type_.multiplicity())),
            component_type: Valid(json::accessor::GenericComponentType(component)),
            extensions: None,
            extras: Default::default(),
            type_: Valid(type_),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
        }
    }

    fn view(
        &mut self,
        start: usize,
        length: usize,
        target: Option<Target>,
    ) -> json::Index<json::buffer::View> {
        self.root.push(json::buffer::View {
            buffer: json::Index::new(0),
            byte_length: USize64::from(length),
            byte_offset: Some(USize64::from(start)),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: Default::default(),
        })
    }

    fn finish(&mut self, nodes: Vec<json::Index<json::Node>>) {
        self.root.push(json::Buffer {
            byte_length: USize64::from(self.bytes.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        });
        let scene = self.root.push(json::Scene {
            extensions: None,
            extras: Default::default(),
            name: None,
            nodes,
        });
        self.root.scene = Some(scene);
        self.root.asset.generator = Some(concat!("relit ", env!("CARGO_PKG_VERSION")).to_owned());
    }
}
