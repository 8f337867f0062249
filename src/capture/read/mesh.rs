//! Reads a mesh of any format, and the checks that all formats share.

use crate::capture::mesh::Mesh;
use crate::capture::read::RawMesh;
use crate::capture::read::confine::Confine;
use crate::capture::read::{gltf, obj, ply};
use crate::error::{Error, Result};
use crate::say::listed;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::Path;

/// Reads and checks a mesh.
pub fn read(path: &Path, confine: &Confine, warnings: &mut Vec<String>) -> Result<RawMesh> {
    let extension = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase());
    let mut raw = match extension.as_deref() {
        Some("obj") => obj::read(path)?,
        Some("ply") => ply::read(path)?,
        Some("glb" | "gltf") => gltf::read(path, confine)?,
        _ => {
            return Err(Error::file(
                path,
                "is not an OBJ, PLY, GLB or glTF mesh",
                "convert it to one of these",
            ));
        }
    };
    check(path, &raw.mesh)?;
    drop_unused(&mut raw.mesh);
    for warning in raw.warnings.drain(..) {
        warnings.push(format!("{}: {warning}", path.display()));
    }
    make_names_unique(path, &mut raw.mesh.objects, warnings);
    warn_about_triangles(path, &raw, warnings);
    Ok(raw)
}

/// Refuses a mesh that no scene can be built from.
fn check(path: &Path, mesh: &Mesh) -> Result<()> {
    if mesh.triangles.is_empty() {
        return Err(Error::file(
            path,
            "the mesh has no triangles",
            "export it with faces",
        ));
    }
    let mut vertices = mesh.positions.iter().enumerate();
    let mut triangles = mesh.triangles.iter();
    let count = mesh.positions.len();
    let problem = if let Some((index, p)) = vertices.find(|(_, p)| !p.is_finite()) {
        format!("vertex {index} (counted from 0) is not finite: {p}")
    } else if let Some(index) = triangles.position(|t| t.iter().any(|&i| i as usize >= count)) {
        format!(
            "triangle {index} (counted from 0) refers to a vertex beyond the {count} of the mesh"
        )
    } else {
        return Ok(());
    };
    Err(Error::file(path, problem, "repair the mesh"))
}

/// Removes unused vertices: they would change the scene's origin and size.
fn drop_unused(mesh: &mut Mesh) {
    let mut used = vec![false; mesh.positions.len()];
    for &corner in mesh.triangles.iter().flatten() {
        used[corner as usize] = true;
    }
    if used.iter().all(|&used| used) {
        return;
    }
    let mut new_index = vec![0u32; used.len()];
    let kept = new_index.iter_mut().zip(&used).filter(|(_, used)| **used);
    for (next, (index, _)) in (0..).zip(kept) {
        *index = next;
    }
    let mut flags = used.iter();
    mesh.positions.retain(|_| flags.next() == Some(&true));
    let mut flags = used.iter();
    mesh.vertex_colors.retain(|_| flags.next() == Some(&true));
    for corner in mesh.triangles.iter_mut().flatten() {
        *corner = new_index[*corner as usize];
    }
}

/// Numbers repeated names and names empty ones.
fn make_names_unique(path: &Path, names: &mut [String], warnings: &mut Vec<String>) {
    let mut taken: HashSet<String> = names.iter().cloned().collect();
    let mut seen = HashSet::new();
    let mut next = std::collections::HashMap::<String, usize>::new();
    let mut renamed: Vec<String> = Vec::new();
    for name in names.iter_mut() {
        if name.is_empty() {
            *name = "unnamed".into();
            taken.insert(name.clone());
        }
        if seen.insert(name.clone()) {
            continue;
        }
        let number = next.entry(name.clone()).or_insert(1);
        let unique = loop {
            let candidate = format!("{name}.{number:03}");
            *number += 1;
            if taken.insert(candidate.clone()) {
                break candidate;
            }
        };
        seen.insert(unique.clone());
        renamed.push(unique.clone());
        *name = unique;
    }
    if !renamed.is_empty() {
        warnings.push(format!(
            "{}: {} objects had duplicate names and were numbered: {}",
            path.display(),
            renamed.len(),
            listed(&renamed)
        ));
    }
}

/// Warns about duplicate triangles, triangles without area, and coarse single-precision positions.
fn warn_about_triangles(path: &Path, raw: &RawMesh, warnings: &mut Vec<String>) {
    let mesh = &raw.mesh;
    let place = path.display();
    let flat = mesh
        .triangles
        .par_iter()
        .filter(|t| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            (b - a).cross(c - a) == DVec3::ZERO
        })
        .count();
    if flat > 0 {
        warnings.push(format!("{place}: {flat} triangles have no area"));
    }
    let twice = duplicates(mesh);
    if twice > 0 {
        warnings.push(format!(
            "{place}: {twice} triangles lie exactly upon another one"
        ));
    }
    let (low, high) = mesh.bounds();
    // Rounding to f32 is 2⁻²⁵ of a number, so a mesh about the origin has 2⁻²⁵ of its own size; warn beyond 32 times more.
    if raw.rounding > 16.0 * (high - low).length() * f64::from(f32::EPSILON) {
        warnings.push(format!(
            "{place}: the mesh lies far from the origin in single precision; positions are rounded by up to {:.1e}, {:.1e} of its size",
            raw.rounding,
            raw.rounding / (high - low).length()
        ));
    }
}

/// Number of triangles whose corners coincide with those of an earlier one, in any order.
fn duplicates(mesh: &Mesh) -> usize {
    let welded = mesh.weld();
    let mut keys: Vec<[u32; 3]> = mesh
        .triangles
        .par_iter()
        .map(|t| {
            let mut key = t.map(|i| welded[i as usize]);
            key.sort_unstable();
            key
        })
        .filter(|[a, b, c]| a != b && b != c)
        .collect();
    keys.par_sort_unstable();
    keys.windows(2).filter(|pair| pair[0] == pair[1]).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn vertices_that_no_triangle_uses_are_left_out() {
        let at = |x: f64| DVec3::new(x, x * x, 0.0);
        let mut mesh = Mesh {
            positions: [1e6, 0.0, 1.0, -1e9, 2.0].map(at).to_vec(),
            vertex_colors: [0.0, 0.1, 0.2, 0.3, 0.4].map(Vec3::splat).to_vec(),
            triangles: vec![[1, 4, 2], [2, 1, 4]],
            object_of: vec![0; 2],
            objects: vec!["mesh".into()],
            ..Mesh::default()
        };
        drop_unused(&mut mesh);
        assert_eq!(mesh.positions, [0.0, 1.0, 2.0].map(at));
        assert_eq!(mesh.vertex_colors, [0.1, 0.2, 0.4].map(Vec3::splat));
        assert_eq!(mesh.triangles, [[0, 2, 1], [1, 0, 2]]);
    }
}
