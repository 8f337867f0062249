//! Reads PLY, ASCII and binary of either byte order, with ply-rs-bw.
//!
//! Vertex colours are linear. A face's `object_id` (or Matterport3D's `segment_id`) is its object; a header line `comment object_id
//! 3 wall` names object 3.

use crate::capture::mesh::Mesh;
use crate::capture::read::RawMesh;
use crate::error::{Error, Result};
use glam::{DVec3, Vec2, Vec3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult,
};
use ply_rs_bw::ply::{PropertyType, ScalarType};
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

const MAX_HEADER: u64 = 1 << 26;

#[derive(Debug, Clone, Copy, Default)]
struct Vertex {
    position: DVec3,
    /// red, green, blue, as linear values; integers are scaled to [0, 1].
    color: Vec3,
    /// s, t or u, v.
    uv: Vec2,
}

/// An element of another kind; nothing of it is stored.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

#[derive(Debug, Clone, Default)]
struct Face {
    /// vertex_indices; `u32::MAX` for a negative one.
    corners: Vec<u32>,
    /// texcoord: u, v of each corner.
    texcoord: Vec<f32>,
    /// object_id, or else segment_id or face_segment (Matterport3D).
    object_id: Option<i64>,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let (value, full_scale) = match property {
            Property::Float(x) => (f64::from(x), 1.0),
            Property::Double(x) => (x, 1.0),
            Property::UChar(x) => (f64::from(x), 255.0),
            Property::UShort(x) => (f64::from(x), 65535.0),
            Property::Char(x) => (f64::from(x), 127.0),
            Property::Short(x) => (f64::from(x), 32767.0),
            Property::Int(x) => (f64::from(x), 1.0),
            Property::UInt(x) => (f64::from(x), 1.0),
            _ => return PropertyAccessResult::Ignored,
        };
        let color = (value / full_scale) as f32;
        match name {
            "x" => self.position.x = value,
            "y" => self.position.y = value,
            "z" => self.position.z = value,
            "red" => self.color.x = color,
            "green" => self.color.y = color,
            "blue" => self.color.z = color,
            "s" | "u" => self.uv.x = value as f32,
            "t" | "v" => self.uv.y = value as f32,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match name {
            "vertex_indices" | "vertex_index" => match indices(property) {
                Some(corners) => self.corners = corners,
                None => return PropertyAccessResult::UnsupportedType,
            },
            "object_id" => match integer(&property) {
                Some(id) => self.object_id = Some(id),
                None => return PropertyAccessResult::UnsupportedType,
            },
            "segment_id" | "face_segment" if self.object_id.is_none() => {
                self.object_id = integer(&property);
            }
            "texcoord" => match property {
                Property::ListFloat(list) => self.texcoord = list,
                Property::ListDouble(list) => {
                    self.texcoord = list.iter().map(|&x| x as f32).collect();
                }
                _ => return PropertyAccessResult::UnsupportedType,
            },
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Vertex indices from a list of any integer type.
fn indices(property: Property) -> Option<Vec<u32>> {
    fn convert<T: TryInto<u32>>(list: Vec<T>) -> Vec<u32> {
        let index = |x: T| x.try_into().unwrap_or(u32::MAX);
        list.into_iter().map(index).collect()
    }
    match property {
        Property::ListInt(list) => Some(convert(list)),
        Property::ListUInt(list) => Some(list),
        Property::ListShort(list) => Some(convert(list)),
        Property::ListUShort(list) => Some(convert(list)),
        Property::ListChar(list) => Some(convert(list)),
        Property::ListUChar(list) => Some(convert(list)),
        _ => None,
    }
}

fn integer(property: &Property) -> Option<i64> {
    match *property {
        Property::Char(x) => Some(x.into()),
        Property::UChar(x) => Some(x.into()),
        Property::Short(x) => Some(x.into()),
        Property::UShort(x) => Some(x.into()),
        Property::Int(x) => Some(x.into()),
        Property::UInt(x) => Some(x.into()),
        _ => None,
    }
}

/// Reads a PLY file; polygons become fans of triangles.
pub fn read(path: &Path) -> Result<RawMesh> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let length = file.metadata().map_err(|e| Error::io(path, &e))?.len();
    parse(path, BufReader::new(file), length)
}

fn parse(path: &Path, source: impl BufRead, length: u64) -> Result<RawMesh> {
    let broken = |e: ParseError| {
        let text = e.to_string();
        let first = text.lines().next().unwrap_or_default();
        Error::file(
            path,
            format!("is a broken PLY file: {first}"),
            "export it again",
        )
    };
    let mut reader = Reader::new(source.take(MAX_HEADER.min(length)));
    let header = Parser::<Vertex>::new()
        .read_header(&mut reader)
        .map_err(broken)?;
    let rest = length - (MAX_HEADER.min(length) - reader.get_ref().limit());
    reader.get_mut().set_limit(rest);

    // Elements come in the header's order; others before the faces must be parsed to be skipped.
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut faces: Vec<Face> = Vec::new();
    for element in header.elements.values() {
        check_count(path, element, header.encoding, reader.get_ref().limit())?;
        if element.name == "vertex" {
            vertices = Parser::new()
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(broken)?;
        } else if element.name == "face" {
            faces = Parser::new()
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(broken)?;
            break;
        } else {
            Parser::<Skipped>::new()
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(broken)?;
        }
    }
    assemble(path, &header, &vertices, &faces)
}

/// Refuses an element count that the remaining `left` bytes of the file cannot hold.
fn check_count(path: &Path, element: &ElementDef, encoding: Encoding, left: u64) -> Result<()> {
    let size = |scalar: &ScalarType| match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    };
    let types = element.properties.values().map(|p| &p.data_type);
    let min_size: u64 = match encoding {
        // A digit and a separator for each property.
        Encoding::Ascii => 2 * types.count() as u64,
        _ => types
            .map(|t| match t {
                PropertyType::Scalar(scalar) => size(scalar),
                // Assume at least one corner per face.
                PropertyType::List(length, item) if element.name == "face" => {
                    size(length) + size(item)
                }
                PropertyType::List(length, _) => size(length),
            })
            .sum(),
    };
    // The last line of an ASCII file may lack its line break.
    let needed = (element.count as u64)
        .saturating_mul(min_size)
        .saturating_sub(1);
    if element.count > 0 && (min_size == 0 || needed > left) {
        return Err(Error::file(
            path,
            format!(
                "the header promises {} elements {:?}, but only {left} bytes follow",
                element.count, element.name
            ),
            "export the mesh again",
        ));
    }
    Ok(())
}

fn assemble(path: &Path, header: &Header, vertices: &[Vertex], faces: &[Face]) -> Result<RawMesh> {
    let vertex_has = |name: &str| {
        let element = header.elements.get("vertex");
        element.and_then(|e| e.properties.get(name))
    };
    let mut mesh = Mesh {
        positions: vertices.iter().map(|v| v.position).collect(),
        ..Mesh::default()
    };
    if u32::try_from(mesh.positions.len()).is_err() {
        return Err(Error::file(
            path,
            "has more than 2³² vertices",
            "make the mesh smaller",
        ));
    }
    for axis in ["x", "y", "z"] {
        if vertex_has(axis).is_none() {
            return Err(Error::file(
                path,
                format!("the vertices have no property {axis:?}"),
                "export the mesh again",
            ));
        }
    }
    if vertex_has("red").is_some() {
        mesh.vertex_colors = vertices.iter().map(|v| v.color).collect();
    }
    let single_precision = ["x", "y", "z"].iter().any(|axis| {
        vertex_has(axis).is_some_and(|p| p.data_type == PropertyType::Scalar(ScalarType::Float))
    });
    let largest = mesh
        .positions
        .iter()
        .fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
    let rounding = if single_precision {
        largest * f64::from(f32::EPSILON) * 0.25
    } else {
        0.0
    };

    // Fans of triangles, each with its face's object and texture coordinates.
    let ids: BTreeMap<i64, u32> = {
        let mut ids: Vec<i64> = faces.iter().filter_map(|f| f.object_id).collect();
        ids.sort_unstable();
        ids.dedup();
        ids.into_iter().zip(0..).collect()
    };
    let textured = vertex_has("s").or_else(|| vertex_has("u")).is_some()
        || faces.iter().any(|f| !f.texcoord.is_empty());
    let mut dropped = 0;
    for (index, face) in faces.iter().enumerate() {
        let corners = face.corners.as_slice();
        if corners.len() < 3 {
            dropped += 1;
            continue;
        }
        if let Some(&bad) = corners.iter().find(|&&i| i as usize >= vertices.len()) {
            return Err(Error::file(
                path,
                format!(
                    "face {index} (counted from 0) refers to vertex {bad}, but there are {}",
                    vertices.len()
                ),
                "repair the mesh",
            ));
        }
        let object = face.object_id.and_then(|id| ids.get(&id)).copied();
        let uv = |corner: usize| match face.texcoord.get(2 * corner..2 * corner + 2) {
            Some(&[u, v]) => Vec2::new(u, v),
            _ => vertices[corners[corner] as usize].uv,
        };
        for k in 1..corners.len() - 1 {
            mesh.triangles
                .push([corners[0], corners[k], corners[k + 1]]);
            mesh.object_of.push(object.unwrap_or(0));
            if textured {
                mesh.corner_uvs.push([uv(0), uv(k), uv(k + 1)]);
            }
        }
    }
    let names = object_names(header);
    mesh.objects = ids
        .keys()
        .map(|id| {
            names
                .get(id)
                .cloned()
                .unwrap_or_else(|| format!("object {id}"))
        })
        .collect();
    let has_objects = !ids.is_empty();
    if !has_objects {
        mesh.objects = vec!["mesh".into()];
    }
    let mut warnings = Vec::new();
    if dropped > 0 {
        warnings.push(format!(
            "{dropped} faces of fewer than three corners left out"
        ));
    }
    Ok(RawMesh {
        mesh,
        has_objects,
        rounding,
        warnings,
    })
}

fn object_names(header: &Header) -> HashMap<i64, String> {
    header
        .comments
        .iter()
        .filter_map(|comment| {
            let (id, name) = comment.trim().strip_prefix("object_id ")?.split_once(' ')?;
            Some((id.parse().ok()?, name.trim().to_owned()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_bytes(bytes: &[u8]) -> Result<RawMesh> {
        parse(Path::new("mesh.ply"), bytes, bytes.len() as u64)
    }

    const HEADER: &str = "comment object_id 7 red wall\nelement vertex 4\nproperty double x\nproperty double y\n\
        property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\n\
        property list uchar int vertex_indices\nproperty int object_id\nend_header\n";

    /// A quad and a triangle over four coloured vertices, in the given encoding.
    fn sample(encoding: &str) -> Vec<u8> {
        let big = encoding.contains("big");
        let mut bytes = format!("ply\nformat {encoding} 1.0\n{HEADER}").into_bytes();
        if encoding == "ascii" {
            bytes.extend_from_slice(
                b"0 0 0 255 0 0\n1 0 0 0 255 0\n1 1 0 0 0 255\n0 1 0.1 51 51 51\n4 0 1 2 3 9\n3 0 2 1 7\n",
            );
            return bytes;
        }
        let double = |x: f64| [x.to_le_bytes(), x.to_be_bytes()][usize::from(big)];
        let int = |x: i32| [x.to_le_bytes(), x.to_be_bytes()][usize::from(big)];
        for (p, c) in [
            ([0.0, 0.0, 0.0], [255, 0, 0]),
            ([1.0, 0.0, 0.0], [0, 255, 0]),
            ([1.0, 1.0, 0.0], [0, 0, 255]),
            ([0.0, 1.0, 0.1], [51, 51, 51]),
        ] {
            bytes.extend(p.into_iter().flat_map(double));
            bytes.extend_from_slice(&c);
        }
        for (corners, id) in [(vec![0, 1, 2, 3], 9), (vec![0, 2, 1], 7)] {
            bytes.push(corners.len() as u8);
            bytes.extend(corners.into_iter().flat_map(int));
            bytes.extend(int(id));
        }
        bytes
    }

    #[test]
    fn all_three_encodings_give_the_same_mesh() {
        for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let raw = parse_bytes(&sample(encoding)).unwrap();
            let mesh = raw.mesh;
            let triangles = [[0, 1, 2], [0, 2, 3], [0, 2, 1]];
            assert_eq!(mesh.triangles, triangles, "{encoding}");
            assert_eq!(mesh.object_of, [1, 1, 0]);
            assert_eq!(mesh.objects, ["red wall", "object 9"]);
            assert_eq!(mesh.positions[3], DVec3::new(0.0, 1.0, 0.1));
            assert!((mesh.vertex_colors[3] - Vec3::splat(0.2)).length() < 1e-6);
            assert_eq!(raw.rounding, 0.0);
        }
    }

    #[test]
    fn headers_that_promise_more_than_the_file_holds_are_refused_at_once() {
        for (from, to) in [
            ("element face 2", "element face 4611686018427387904"),
            ("element vertex 4", "element vertex 18446744073709551615"),
            ("comment", "element ghost 4611686018427387904\ncomment"),
        ] {
            for encoding in ["ascii", "binary_little_endian"] {
                let bytes = sample(encoding);
                let at = bytes
                    .windows(from.len())
                    .position(|w| w == from.as_bytes())
                    .unwrap();
                let hostile = [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat();
                let error = parse_bytes(&hostile).unwrap_err();
                assert!(error.problem.contains("promises"), "{error}");
            }
        }
    }

    #[test]
    fn indices_out_of_range_and_truncations_are_errors_that_name_the_place() {
        let text = String::from_utf8(sample("ascii")).unwrap();
        let error = parse_bytes(text.replace("3 0 2 1 7", "3 0 2 4 7").as_bytes()).unwrap_err();
        assert!(error.problem.contains("face 1") && error.problem.contains("vertex 4"));
        assert!(parse_bytes(text.replace("3 0 2 1 7", "3 0 2 -1 7").as_bytes()).is_err());
        for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let bytes = sample(encoding);
            for length in 0..bytes.len() - 2 {
                let cut = parse_bytes(&bytes[..length]);
                assert!(cut.is_err(), "{encoding} cut at {length}");
            }
        }
    }
}
