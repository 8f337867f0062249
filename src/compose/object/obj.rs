//! Wavefront OBJ with MTL.
//!
//! Base colour is Kd × map_Kd × vertex colour. Where `illum` asks for highlights, Ns and Ks become a specular lobe:
//! α = √(2 / (Ns + 2)), which matches the curvature of Blinn–Phong at its peak (Walter et al. 2007), and specular reflectance
//! 0.08 × Ks, since exporters write Ks as a strength rather than a colour. `Pr` and `Pm`, if present, are roughness (α = Pr²)
//! and metalness.

use crate::compose::object::files::TextureKind;
use crate::compose::object::surface::ObjectSurface;
use crate::compose::object::{Corners, Parts, files};
use crate::error::{Error, Result};
use crate::math::picture::Picture;
use crate::transport::material::DIELECTRIC;
use glam::{DVec2, DVec3, Vec3};
use std::cell::RefCell;
use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Specular reflectance at normal incidence for Ks = 1.
const SPECULAR_OF_KS: f32 = 0.08;

/// Reads an OBJ file with its MTL files and textures.
pub(super) fn read(path: &Path) -> Result<Parts> {
    let bytes = files::read_bytes(path)?;
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    // tobj's callback cannot return our error, so the first one is kept here.
    let library_error = RefCell::new(None);
    let library_path = RefCell::new(path.to_path_buf());
    let loaded = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, |name| {
        let (found, bytes) = open_library(path, name).map_err(|error| {
            library_error.borrow_mut().get_or_insert(error);
            tobj::LoadError::OpenFileFailed
        })?;
        *library_path.borrow_mut() = found;
        let whole = with_three_number_colors(&bytes);
        let whole = whole.ok_or(tobj::LoadError::MaterialParseError)?;
        tobj::load_mtl_buf(&mut Cursor::new(whole))
    });
    let (models, materials) = loaded.map_err(|e| {
        let problem = format!("is no readable OBJ file: {e}");
        Error::file(path, problem, "export it again as a triangle mesh")
    })?;

    let mut parts = Parts::default();
    if let Some(error) = library_error.into_inner() {
        return Err(error);
    }
    let library = library_path.into_inner();
    let materials = materials.map_err(|e| {
        let problem = format!("is no readable MTL file: {e}");
        Error::file(&library, problem, "export the object again")
    })?;
    let mut textures = HashMap::new();
    for material in &materials {
        let surface = surface(material, &library, &mut textures, &mut parts.warnings)?;
        parts.surfaces.push(surface);
    }
    // Triangles without a material are grey.
    let plain = parts.surfaces.len() as u32;
    let grey = ObjectSurface::diffuse(Vec3::splat(0.5));
    parts.surfaces.push(grey);

    for model in &models {
        let material = model.mesh.material_id;
        let material = material.map_or(plain, |id| (id as u32).min(plain));
        push_mesh(&mut parts, &model.mesh, material).ok_or_else(|| {
            let problem = format!("object `{}` refers to a vertex that it lacks", model.name);
            Error::file(path, problem, "export it again as a triangle mesh")
        })?;
    }
    Ok(parts)
}

fn open_library(referrer: &Path, name: &Path) -> Result<(PathBuf, Vec<u8>)> {
    let found = files::resolve(referrer, &name.to_string_lossy())?;
    let bytes = files::read_bytes(&found)?;
    Ok((found, bytes))
}

/// Completes an MTL file for tobj, which wants three numbers a colour: a single one is repeated. `None` where one has two or none.
fn with_three_number_colors(bytes: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(bytes);
    let mut whole = String::with_capacity(text.len());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let is_color = words
            .next()
            .is_some_and(|key| ["Ka", "Kd", "Ks", "Ke"].contains(&key));
        let values: Vec<&str> = words.take(3).collect();
        whole.push_str(line);
        match (is_color, &values[..]) {
            (false, _) | (true, [_, _, _]) => {}
            (true, [gray]) => whole.push_str(&format!(" {gray} {gray}")),
            (true, _) => return None,
        }
        whole.push('\n');
    }
    Some(whole)
}

/// Adds a mesh's triangles; `None` where an index is out of range.
fn push_mesh(parts: &mut Parts, mesh: &tobj::Mesh, material: u32) -> Option<()> {
    let vector = |values: &[f64], index: u32| {
        let values = values.get(index as usize * 3..)?.first_chunk();
        values.copied().map(DVec3::from_array)
    };
    for (number, triangle) in mesh.indices.chunks_exact(3).enumerate() {
        // Normals and texture coordinates have indices of their own.
        let corner_indices = |indices: &[u32]| -> Option<[u32; 3]> {
            indices.get(number * 3..number * 3 + 3)?.try_into().ok()
        };
        let own = [triangle[0], triangle[1], triangle[2]];
        let narrow = |values: &[f64], index| Some(vector(values, index)?.as_vec3());
        let normals = corner_indices(&mesh.normal_indices)
            .and_then(|indices| all(indices.map(|i| narrow(&mesh.normals, i))));
        let uv = |index: u32| {
            let uv = mesh.texcoords.get(index as usize * 2..)?.first_chunk()?;
            Some(DVec2::from_array(*uv).as_vec2())
        };
        let uvs = corner_indices(&mesh.texcoord_indices).and_then(|i| all(i.map(uv)));
        let corners = Corners {
            positions: all(own.map(|i| vector(&mesh.positions, i)))?,
            normals,
            uvs,
            colors: all(own.map(|i| narrow(&mesh.vertex_color, i))),
        };
        parts.push(corners, material);
    }
    Some(())
}

/// The three values, if there are all.
fn all<T>([a, b, c]: [Option<T>; 3]) -> Option<[T; 3]> {
    Some([a?, b?, c?])
}

/// The surface that an MTL material describes; each texture is read once.
fn surface(
    material: &tobj::Material,
    library: &Path,
    textures: &mut HashMap<String, Arc<Picture>>,
    warnings: &mut Vec<String>,
) -> Result<ObjectSurface> {
    let place = || format!("{}: material `{}`", library.display(), material.name);
    let number =
        |key: &str| -> Option<f32> { material.unknown_param.get(key)?.trim().parse().ok() };
    // With a texture, the default of Kd is 1.
    let missing = match material.diffuse_texture {
        Some(_) => Vec3::ONE,
        None => Vec3::splat(0.8),
    };
    let linear = |c: [f64; 3]| Vec3::from(c.map(|v| v as f32));
    let kd = material.diffuse.map_or(missing, linear);
    let mean = |c: [f64; 3]| (c.iter().sum::<f64>() / 3.0) as f32;
    let ks = material.specular.map_or(0.0, mean);
    let highlights = material.illumination_model.unwrap_or(2) >= 2 && ks > 0.0;
    let phong = material.shininess.filter(|_| highlights);
    let mut surface = ObjectSurface {
        texture: None,
        base_color: kd,
        metallic: number("Pm").unwrap_or(0.0),
        alpha: number("Pr")
            .map(|roughness| roughness * roughness)
            .or_else(|| phong.map(|ns| (2.0 / (ns.max(0.0) + 2.0)).sqrt() as f32)),
        dielectric: match number("Pr") {
            Some(_) => DIELECTRIC,
            None => SPECULAR_OF_KS * ks,
        },
    };

    if let Some(options) = &material.diffuse_texture {
        // Options such as `-s 1 1 1` precede the file's name.
        let mut name = options.as_str();
        if options.starts_with('-') {
            name = options.split_whitespace().last().unwrap_or_default();
            warnings.push(format!("{}: options of map_Kd are ignored.", place()));
        }
        let texture = match textures.get(name) {
            Some(texture) => texture.clone(),
            None => {
                let found = files::resolve(library, name)?;
                let bytes = files::read_bytes(&found)?;
                let place = found.display().to_string();
                Arc::new(files::decode(&bytes, TextureKind::Color, &place)?)
            }
        };
        textures.insert(name.to_owned(), texture.clone());
        surface.texture = Some(texture);
    }

    let transparent = material.dissolve.is_some_and(|d| d < 1.0)
        || number("Tr").is_some_and(|t| t > 0.0)
        || material.dissolve_texture.is_some();
    if transparent {
        warnings.push(format!(
            "{}: see-through materials (d, Tr) are not supported and are treated as opaque.",
            place()
        ));
    }
    let emits = |e: [f64; 3]| e.iter().any(|&v| v > 0.0);
    if material.emissive.is_some_and(emits) {
        warnings.push(format!("{}: emission (Ke) is ignored.", place()));
    }
    surface
        .checked()
        .ok_or_else(|| Error::new(place(), "a value is not finite", "correct the MTL file"))
}
