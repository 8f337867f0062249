//! glTF 2.0 (.glb and .gltf): the triangles of the default scene with their metallic-roughness materials.

use crate::capture::read::gltf_file::{self, Buffer, ReadFile, numbers};
use crate::capture::read::gltf_scene;
use crate::compose::object::files::TextureKind;
use crate::compose::object::surface::{ObjectSurface, mean};
use crate::compose::object::{Corners, Parts, files};
use crate::error::{Error, Result};
use crate::math::picture::Picture;
use crate::transport::material::DIELECTRIC;
use ::gltf::accessor::Dimensions;
use ::gltf::material::AlphaMode;
use ::gltf::{Primitive, Semantic};
use glam::{DMat3, DMat4, DVec3, Vec2, Vec3};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Reads a glTF file with its buffers and images.
pub(super) fn read(path: &Path) -> Result<Parts> {
    let broken = |problem: String| {
        let remedy = "export it again as glTF 2.0 without compression";
        Error::file(path, problem, remedy)
    };
    let gltf = gltf_file::parse(path, &files::read_bytes(path)?)?;
    let file = |_: &str, name: &str| files::read_bytes(&files::resolve(path, name)?);
    let buffers = gltf_file::buffers(&gltf, path, &file)?;

    let mut parts = Parts::default();
    for name in gltf.extensions_used() {
        let harmless = ["KHR_materials_emissive_strength", "KHR_lights_punctual"];
        if !harmless.contains(&name) {
            parts.warnings.push(format!(
                "{}: {name} is not supported; its materials are taken as opaque and plain.",
                path.display()
            ));
        }
    }
    let mut images = HashMap::new();
    for material in gltf.materials() {
        let (file, warnings) = ((path, &file as ReadFile<'_>), &mut parts.warnings);
        let surface = surface(&material, file, &buffers, &mut images, warnings)?;
        parts.surfaces.push(surface);
    }
    // glTF's default material, for primitives without one: white, fully metallic, roughness 1.
    parts.surfaces.push(ObjectSurface {
        base_color: Vec3::ONE,
        texture: None,
        metallic: 1.0,
        alpha: Some(1.0),
        dielectric: DIELECTRIC,
    });

    let plain = parts.surfaces.len() as u32 - 1;
    for (node, transform) in gltf_scene::nodes(&gltf, &buffers).map_err(broken)? {
        let Some(mesh) = node.mesh() else { continue };
        parts.check_size(path)?;
        for primitive in mesh.primitives() {
            push_primitive(&mut parts, &primitive, transform, &buffers, plain)
                .map_err(|problem| broken(format!("meshes[{}]: {problem}", mesh.index())))?;
        }
    }
    Ok(parts)
}

/// Adds a primitive's transformed triangles; `plain` is the index of the default material.
fn push_primitive(
    parts: &mut Parts,
    primitive: &Primitive<'_>,
    transform: DMat4,
    buffers: &[Buffer],
    plain: u32,
) -> std::result::Result<(), String> {
    let Some(accessor) = primitive.get(&Semantic::Positions) else {
        return Ok(());
    };
    let attribute = |semantic: &Semantic, dimensions: &[Dimensions]| match primitive.get(semantic) {
        Some(accessor) => numbers(&accessor, buffers, dimensions),
        None => Ok((Vec::new(), 1)),
    };

    // Positions are required, other attributes optional.
    let place = |p: &[f64]| transform.transform_point3(DVec3::from_slice(p));
    let (values, _) = numbers(&accessor, buffers, &[Dimensions::Vec3])?;
    let positions: Vec<DVec3> = values.chunks_exact(3).map(place).collect();
    let linear = DMat3::from_mat4(transform);
    let mirrored = linear.determinant() < 0.0;
    let normal_transform = linear.inverse().transpose();
    let turn = |n: &[f64]| (normal_transform * DVec3::from_slice(n)).normalize_or_zero();
    let (values, _) = attribute(&Semantic::Normals, &[Dimensions::Vec3])?;
    let normals: Vec<Vec3> = values.chunks_exact(3).map(|n| turn(n).as_vec3()).collect();
    let material = primitive.material();
    let texture = material.pbr_metallic_roughness().base_color_texture();
    let uv_set = texture.map_or(0, |info| info.tex_coord());
    let uv = |uv: &[f64]| Vec2::new(uv[0] as f32, 1.0 - uv[1] as f32);
    let (values, _) = attribute(&Semantic::TexCoords(uv_set), &[Dimensions::Vec2])?;
    let uvs: Vec<Vec2> = values.chunks_exact(2).map(uv).collect();
    let three_or_four = [Dimensions::Vec3, Dimensions::Vec4];
    let (values, components) = attribute(&Semantic::Colors(0), &three_or_four)?;
    let colors: Vec<Vec3> = (values.chunks_exact(components.max(3)))
        .map(|c| DVec3::from_slice(c).as_vec3())
        .collect();
    let indices: Vec<u32> = match primitive.indices() {
        None => (0..positions.len() as u32).collect(),
        Some(accessor) => {
            let (indices, _) = numbers(&accessor, buffers, &[Dimensions::Scalar])?;
            indices.iter().map(|&i| i as u32).collect()
        }
    };

    let Some(triangles) = gltf_scene::triangles(primitive.mode(), &indices) else {
        let mode = primitive.mode();
        (parts.warnings).push(format!("a primitive of {mode:?} was left out."));
        return Ok(());
    };
    let surface = material.index().map_or(plain, |index| index as u32);
    for [a, b, c] in triangles {
        let order = if mirrored { [a, c, b] } else { [a, b, c] };
        let corners = Corners {
            positions: gather(&positions, order).ok_or("an index is out of range")?,
            normals: gather(&normals, order),
            uvs: gather(&uvs, order),
            colors: gather(&colors, order),
        };
        parts.push(corners, surface);
    }
    Ok(())
}

fn gather<T: Copy>(values: &[T], order: [u32; 3]) -> Option<[T; 3]> {
    let [a, b, c] = order.map(|i| values.get(i as usize).copied());
    Some([a?, b?, c?])
}

fn surface(
    material: &::gltf::Material<'_>,
    (path, file): (&Path, ReadFile<'_>),
    buffers: &[Buffer],
    images: &mut HashMap<(usize, TextureKind), Arc<Picture>>,
    warnings: &mut Vec<String>,
) -> Result<ObjectSurface> {
    let name = material.name().unwrap_or("unnamed");
    let place = format!("{}: material `{name}`", path.display());
    let pbr = material.pbr_metallic_roughness();
    let [r, g, b, _] = pbr.base_color_factor();
    let mut image = |texture: ::gltf::Texture<'_>, meaning: TextureKind| -> Result<Arc<Picture>> {
        let source = texture.source();
        let key = (source.index(), meaning);
        if let Some(known) = images.get(&key) {
            return Ok(known.clone());
        }
        let bytes = match source.source() {
            ::gltf::image::Source::Uri { uri, .. } => gltf_file::resource(&place, uri, file)?,
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
    let texture = (pbr.base_color_texture())
        .map(|info| image(info.texture(), TextureKind::Color))
        .transpose()?;
    // An object has one lobe, so roughness (green) and metalness (blue) are means of the texture.
    let (mut roughness, mut metallic) = (pbr.roughness_factor(), pbr.metallic_factor());
    if let Some(info) = pbr.metallic_roughness_texture() {
        let data = image(info.texture(), TextureKind::Data)?;
        let values = mean(&data.pixels);
        roughness *= values.y;
        metallic *= values.z;
        warnings.push(format!(
            "{place}: only the mean of the metallic-roughness texture is used."
        ));
    }

    if material.alpha_mode() != AlphaMode::Opaque {
        warnings.push(format!(
            "{place}: see-through materials are not supported and are treated as opaque."
        ));
    }
    if material.emissive_factor() != [0.0; 3] {
        warnings.push(format!("{place}: emission is ignored."));
    }
    if material.normal_texture().is_some() {
        warnings.push(format!("{place}: the normal texture is ignored."));
    }
    ObjectSurface {
        base_color: Vec3::new(r, g, b),
        texture,
        metallic,
        alpha: Some(roughness * roughness),
        dielectric: DIELECTRIC,
    }
    .checked()
    .ok_or_else(|| Error::new(&place, "a value is not finite", "export it again"))
}
