//! Wavefront OBJ with its MTL beside it.

use crate::error::Result;
use crate::export::atomic::write_atomically;
use crate::export::scene::Part;
use std::io::Write;
use std::path::Path;

/// Writes parts as PATH and their materials beside it with the ending .mtl.
///
/// One `o` an object. Kd and Ke are linear albedo and emission. Where the albedo of an object varies, Kd is its mean,
/// and all vertices carry their linear albedo (readers want colours on all or none). A specular lobe is Ks with Pr, the physically based extension's roughness (√α).
///
/// # Errors
/// A file cannot be written.
pub fn write(path: &Path, parts: &[Part]) -> Result<()> {
    let library = path.with_extension("mtl");
    write_atomically(&library, |out| {
        for (index, part) in parts.iter().enumerate() {
            let estimate = &part.estimate;
            let [kd, ke] = [estimate.albedo, estimate.emission];
            writeln!(out, "newmtl {}", material_name(index, part))?;
            writeln!(out, "Kd {} {} {}", kd.x, kd.y, kd.z)?;
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
    let colored = parts.iter().any(|part| !part.colors.is_empty());
    write_atomically(path, |out| {
        let name = library.file_name().unwrap_or_default().to_string_lossy();
        writeln!(out, "mtllib {name}")?;
        let mut first = 1;
        for (index, part) in parts.iter().enumerate() {
            let name: String = part.name.chars().filter(|c| !c.is_control()).collect();
            writeln!(out, "o {name}\nusemtl {}", material_name(index, part))?;
            for (vertex, p) in part.positions.iter().enumerate() {
                write!(out, "v {} {} {}", p.x, p.y, p.z)?;
                if colored {
                    let c = part.colors.get(vertex).unwrap_or(&part.estimate.albedo);
                    write!(out, " {} {} {}", c.x, c.y, c.z)?;
                }
                writeln!(out)?;
            }
            for [a, b, c] in part
                .triangles
                .iter()
                .map(|t| t.map(|i| u64::from(i) + first))
            {
                writeln!(out, "f {a} {b} {c}")?;
            }
            first += part.positions.len() as u64;
        }
        Ok(())
    })
}

/// A name without spaces, unique by its number.
fn material_name(index: usize, part: &Part) -> String {
    format!("{}_{index}", part.plain_name())
}
