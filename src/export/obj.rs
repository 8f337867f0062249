//! Wavefront OBJ with MTL and textures.

use crate::error::Result;
use crate::export::atomic::write_atomically;
use crate::export::exr::{Precision, write_rgb};
use crate::export::part::Part;
use crate::export::picture::write_png;
use crate::math::picture::Picture;
use std::io::Write;
use std::path::Path;

/// Writes parts to PATH, and their materials beside it with the extension .mtl.
///
/// One `o` for each object. Kd and Ke are linear albedo and emission. Where an object's albedo varies, Kd is 1 and map_Kd names
/// the atlas (8-bit sRGB, .albedo.png); beside it is the linear one (.albedo.exr). A specular lobe is Ks with Pr, the roughness
/// √α of the physically based extension.
///
/// # Errors
/// A file cannot be written.
pub fn write(path: &Path, parts: &[Part], atlas: Option<&Picture>) -> Result<()> {
    let image = path.with_extension("albedo.png");
    if let Some(atlas) = atlas {
        write_png(&image, atlas, 1.0)?;
        write_rgb(&path.with_extension("albedo.exr"), atlas, Precision::Half)?;
    }
    let library = path.with_extension("mtl");
    write_atomically(&library, |out| {
        for (index, part) in parts.iter().enumerate() {
            let estimate = &part.estimate;
            let [kd, ke] = [estimate.albedo, estimate.emission];
            writeln!(out, "newmtl {}", material_name(index, part))?;
            if part.uvs.is_empty() {
                writeln!(out, "Kd {} {} {}", kd.x, kd.y, kd.z)?;
            } else {
                writeln!(out, "Kd 1 1 1\nmap_Kd {}", file_name(&image))?;
            }
            writeln!(out, "Ke {} {} {}", ke.x, ke.y, ke.z)?;
            match estimate.lobe() {
                Some((alpha, specular)) => {
                    writeln!(out, "Ks {specular} {specular} {specular}")?;
                    writeln!(out, "Pr {}\n", alpha.max(0.0).sqrt())?;
                }
                None => writeln!(out, "Ks 0 0 0\nillum 1\n")?,
            }
        }
        Ok(())
    })?;
    write_atomically(path, |out| {
        writeln!(out, "mtllib {}", file_name(&library))?;
        let (mut first, mut first_uv) = (1, 1);
        for (index, part) in parts.iter().enumerate() {
            let name = part.name.replace(char::is_control, "");
            writeln!(out, "o {name}\nusemtl {}", material_name(index, part))?;
            for p in &part.positions {
                writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
            }
            // OBJ counts v from the bottom.
            for uv in &part.uvs {
                writeln!(out, "vt {} {}", uv.x, 1.0 - uv.y)?;
            }
            for triangle in &part.triangles {
                write!(out, "f")?;
                for corner in triangle.map(u64::from) {
                    write!(out, " {}", first + corner)?;
                    if !part.uvs.is_empty() {
                        write!(out, "/{}", first_uv + corner)?;
                    }
                }
                writeln!(out)?;
            }
            first += part.positions.len() as u64;
            first_uv += part.uvs.len() as u64;
        }
        Ok(())
    })
}

fn file_name(path: &Path) -> std::borrow::Cow<'_, str> {
    path.file_name().unwrap_or_default().to_string_lossy()
}

/// A material name without spaces, unique by its number.
fn material_name(index: usize, part: &Part) -> String {
    format!("{}_{index}", part.plain_name())
}
