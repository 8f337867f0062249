//! Binary and JSON glTF 2.0: the default scene's triangles with their metallic-roughness materials.

use super::files::{self, Meaning};
use super::surface::{DIELECTRIC, Surface, mean};
use super::{Corners, Parts};
use crate::error::{Error, Result};
use crate::math::picture::Picture;
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::material::AlphaMode;
use ::gltf::mesh::Mode;
use ::gltf::{Accessor, Document, Gltf, Primitive, Semantic};
use glam::{DMat3, DMat4, Mat4, Vec2, Vec3};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Most elements that one accessor may have.
const MAX_COUNT: usize = 100_000_000;

/// Reads a GLB or glTF file with the buffers and images that it names.
pub(super) fn read(path: &Path) -> Result<Parts> {
    let broken = |problem: String| {
        Error::file(
            path,
            problem,
            "export it again as glTF 2.0 without compression",
        )
    };
    let bytes = files::read_bytes(path)?;
    let unreadable = |e: ::gltf::Error| broken(format!("is no readable glTF file: {e}"));
    // The crate's own validation takes the accessors of positions for granted.
    let unchecked = Gltf::from_slice_without_validation(&bytes).map_err(unreadable)?;
    if !accessors_exist(&unchecked.document) {
        return Err(broken(
            "is no readable glTF file: an accessor is missing".to_owned(),
        ));
    }
    let Gltf { document, mut blob } = Gltf::from_slice(&bytes).map_err(unreadable)?;
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let data = match buffer.source() {
            ::gltf::buffer::Source::Bin => blob.take(),
            ::gltf::buffer::Source::Uri(uri) => Some(read_uri(path, uri)?),
        };
        let data = data.filter(|data| data.len() >= buffer.length());
        buffers
            .push(data.ok_or_else(|| broken(format!("buffer {} is cut short", buffer.index())))?);
    }

    let mut parts = Parts::default();
    for name in document.extensions_used() {
        let harmless = ["KHR_materials_emissive_strength", "KHR_lights_punctual"];
        if !harmless.contains(&name) {
            parts.warnings.push(format!(
                "{}: {name} is not supported; its materials are taken as opaque and plain.",
                path.display()
            ));
        }
    }
    let mut images = HashMap::new();
    for material in document.materials() {
        let surface = surface(&material, path, &buffers, &mut images, &mut parts.warnings)?;
        parts.surfaces.push(surface);
    }
    // Primitives without a material are what the format calls its default: white, wholly metal, wholly rough.
    parts.surfaces.push(Surface {
        base_color: Vec3::ONE,
        texture: None,
        metallic: 1.0,
        alpha: Some(1.0),
        dielectric: DIELECTRIC,
    });

    for (transform, mesh) in placed_meshes(&document).map_err(broken)? {
        for primitive in mesh.primitives() {
            push_primitive(&mut parts, &primitive, transform, &buffers, &document)
                .map_err(|problem| broken(format!("mesh {}: {problem}", mesh.index())))?;
        }
    }
    Ok(parts)
}

/// Whether every attribute names an accessor that is there.
fn accessors_exist(document: &Document) -> bool {
    let root = document.as_json();
    root.meshes
        .iter()
        .flat_map(|mesh| &mesh.primitives)
        .flat_map(|primitive| primitive.attributes.values())
        .all(|accessor| accessor.value() < root.accessors.len())
}

/// The bytes behind a URI: inline data, or a file of the same folder.
fn read_uri(path: &Path, uri: &str) -> Result<Vec<u8>> {
    if uri.starts_with("data:") {
        let source = ::gltf::buffer::Source::Uri(uri);
        return ::gltf::buffer::Data::from_source(source, None)
            .map(|data| data.0)
            .map_err(|e| Error::file(path, format!("holds broken inline data: {e}"), ""));
    }
    files::read_bytes(&files::beside(path, &percent_decoded(uri))?)
}

/// A URI's path with its %XX decoded.
fn percent_decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while let Some(&byte) = bytes.get(i) {
        let hex = bytes
            .get(i + 1..i + 3)
            .filter(|_| byte == b'%')
            .and_then(|h| std::str::from_utf8(h).ok())
            .and_then(|h| u8::from_str_radix(h, 16).ok());
        decoded.push(hex.unwrap_or(byte));
        i += if hex.is_some() { 3 } else { 1 };
    }
    String::from_utf8_lossy(&decoded).into_owned()
}

/// The default scene's meshes with their transforms to the file's coordinates.
fn placed_meshes(
    document: &Document,
) -> std::result::Result<Vec<(DMat4, ::gltf::Mesh<'_>)>, String> {
    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next())
        .ok_or("has no scene")?;
    let mut visited = vec![false; document.nodes().count()];
    let mut stack: Vec<_> = scene.nodes().map(|node| (DMat4::IDENTITY, node)).collect();
    stack.reverse();
    let mut placed = Vec::new();
    while let Some((parent, node)) = stack.pop() {
        // A node has one parent; a second visit means a cycle.
        if std::mem::replace(&mut visited[node.index()], true) {
            return Err(format!("node {} has two parents", node.index()));
        }
        let local = Mat4::from_cols_array_2d(&node.transform().matrix()).as_dmat4();
        let transform = parent * local;
        placed.extend(node.mesh().map(|mesh| (transform, mesh)));
        stack.extend(node.children().map(|child| (transform, child)));
    }
    Ok(placed)
}

/// Whether an accessor holds what its use demands, so that reading it stays in bounds.
fn holds(accessor: &Accessor<'_>, dimensions: Dimensions, types: &[DataType]) -> bool {
    let stride_fits = accessor
        .view()
        .and_then(|view| view.stride())
        .is_none_or(|stride| stride >= accessor.size());
    accessor.dimensions() == dimensions
        && types.contains(&accessor.data_type())
        && (1..=MAX_COUNT).contains(&accessor.count())
        && accessor.offset() < usize::MAX / 2
        && accessor
            .view()
            .is_none_or(|view| view.offset() < usize::MAX / 4 && view.length() < usize::MAX / 4)
        && accessor.sparse().is_none()
        && stride_fits
}

fn push_primitive(
    parts: &mut Parts,
    primitive: &Primitive<'_>,
    transform: DMat4,
    buffers: &[Vec<u8>],
    document: &Document,
) -> std::result::Result<(), String> {
    let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
    let attribute = |semantic: &Semantic, dimensions, types: &[DataType]| {
        primitive
            .get(semantic)
            .filter(|accessor| holds(accessor, dimensions, types))
    };
    let real = [DataType::F32];
    let fractions = [DataType::F32, DataType::U8, DataType::U16];

    // Attributes; positions must be there, the others may.
    let positions: Vec<_> = attribute(&Semantic::Positions, Dimensions::Vec3, &real)
        .and_then(|_| reader.read_positions())
        .ok_or("its positions cannot be read")?
        .map(|p| transform.transform_point3(Vec3::from(p).as_dvec3()))
        .collect();
    let linear = DMat3::from_mat4(transform);
    let mirrored = linear.determinant() < 0.0;
    let normal_transform = linear.inverse().transpose();
    let normals: Vec<Vec3> = attribute(&Semantic::Normals, Dimensions::Vec3, &real)
        .filter(|_| normal_transform.is_finite())
        .and_then(|_| reader.read_normals())
        .map(|normals| {
            normals
                .map(|n| {
                    (normal_transform * Vec3::from(n).as_dvec3())
                        .normalize_or_zero()
                        .as_vec3()
                })
                .collect()
        })
        .unwrap_or_default();
    let material = primitive.material();
    let uv_set = material
        .pbr_metallic_roughness()
        .base_color_texture()
        .map_or(0, |info| info.tex_coord());
    let uvs: Vec<Vec2> = attribute(&Semantic::TexCoords(uv_set), Dimensions::Vec2, &fractions)
        .and_then(|_| reader.read_tex_coords(uv_set))
        .map(|uvs| uvs.into_f32().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect())
        .unwrap_or_default();
    let colors: Vec<Vec3> = [Dimensions::Vec3, Dimensions::Vec4]
        .into_iter()
        .find_map(|dimensions| attribute(&Semantic::Colors(0), dimensions, &fractions))
        .and_then(|_| reader.read_colors(0))
        .map(|colors| colors.into_rgb_f32().map(Vec3::from).collect())
        .unwrap_or_default();
    let whole = [DataType::U8, DataType::U16, DataType::U32];
    let indices: Vec<u32> = match primitive.indices() {
        None => (0..positions.len() as u32).collect(),
        Some(accessor) if holds(&accessor, Dimensions::Scalar, &whole) => reader
            .read_indices()
            .ok_or("its indices cannot be read")?
            .into_u32()
            .collect(),
        Some(_) => return Err("its indices cannot be read".to_owned()),
    };

    let triangles: Vec<[u32; 3]> = match primitive.mode() {
        Mode::Triangles => indices
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, t)| {
                if i % 2 == 0 {
                    [t[0], t[1], t[2]]
                } else {
                    [t[1], t[0], t[2]]
                }
            })
            .collect(),
        Mode::TriangleFan => indices
            .windows(2)
            .skip(1)
            .map(|t| [indices[0], t[0], t[1]])
            .collect(),
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => Vec::new(),
    };
    let surface = material.index().unwrap_or(document.materials().count()) as u32;
    for [a, b, c] in triangles {
        let order = if mirrored { [a, c, b] } else { [a, b, c] };
        parts.push(
            Corners {
                positions: gather(&positions, order).ok_or("an index is out of range")?,
                normals: gather(&normals, order),
                uvs: gather(&uvs, order),
                colors: gather(&colors, order),
            },
            surface,
        );
    }
    Ok(())
}

fn gather<T: Copy>(values: &[T], order: [u32; 3]) -> Option<[T; 3]> {
    let [a, b, c] = order.map(|i| values.get(i as usize).copied());
    Some([a?, b?, c?])
}

fn surface(
    material: &::gltf::Material<'_>,
    path: &Path,
    buffers: &[Vec<u8>],
    images: &mut HashMap<(usize, Meaning), Arc<Picture>>,
    warnings: &mut Vec<String>,
) -> Result<Surface> {
    let place = format!(
        "{}: material `{}`",
        path.display(),
        material.name().unwrap_or("unnamed")
    );
    let pbr = material.pbr_metallic_roughness();
    let [r, g, b, _] = pbr.base_color_factor();
    let mut image = |texture: ::gltf::Texture<'_>, meaning: Meaning| -> Result<Arc<Picture>> {
        let source = texture.source();
        let key = (source.index(), meaning);
        if let Some(known) = images.get(&key) {
            return Ok(known.clone());
        }
        let bytes = match source.source() {
            ::gltf::image::Source::Uri { uri, .. } => read_uri(path, uri)?,
            ::gltf::image::Source::View { view, .. } => buffers
                .get(view.buffer().index())
                .and_then(|data| data.get(view.offset()..view.offset().checked_add(view.length())?))
                .ok_or_else(|| Error::new(&place, "its texture is cut short", "export it again"))?
                .to_vec(),
        };
        let decoded = Arc::new(files::decode(&bytes, meaning, &place)?);
        images.insert(key, decoded.clone());
        Ok(decoded)
    };
    let texture = match pbr.base_color_texture() {
        Some(info) => Some(image(info.texture(), Meaning::Color)?),
        None => None,
    };
    // One lobe an object: roughness (green) and metalness (blue) are the texture's means.
    let (mut roughness, mut metallic) = (pbr.roughness_factor(), pbr.metallic_factor());
    if let Some(info) = pbr.metallic_roughness_texture() {
        let data = image(info.texture(), Meaning::Data)?;
        let values = mean(&data);
        roughness *= values.y;
        metallic *= values.z;
        warnings.push(format!(
            "{place}: of the metallic-roughness texture only the mean is used."
        ));
    }

    if material.alpha_mode() != AlphaMode::Opaque {
        warnings.push(format!(
            "{place}: see-through is not supported and is taken as opaque."
        ));
    }
    if material.emissive_factor() != [0.0; 3] {
        warnings.push(format!("{place}: emission is ignored."));
    }
    if material.normal_texture().is_some() {
        warnings.push(format!("{place}: the normal texture is ignored."));
    }
    Surface {
        base_color: Vec3::new(r, g, b),
        texture,
        metallic,
        alpha: Some(roughness * roughness),
        dielectric: DIELECTRIC,
    }
    .checked()
    .ok_or_else(|| Error::new(&place, "a value is not finite", "export it again"))
}
