//! The PLY elements that are kept, filled by the parser; other properties are ignored.

use glam::{DVec3, Vec2, Vec3};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

#[derive(Debug, Clone, Copy, Default)]
pub struct Vertex {
    pub position: DVec3,
    /// red, green, blue, as linear values; integers are scaled to [0, 1].
    pub color: Vec3,
    /// s, t or u, v.
    pub uv: Vec2,
}

/// An element of another kind; nothing of it is stored.
pub struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

#[derive(Debug, Clone, Default)]
pub struct Face {
    /// vertex_indices; `u32::MAX` for a negative one.
    pub corners: Vec<u32>,
    /// texcoord: u, v of each corner.
    pub texcoord: Vec<f32>,
    /// object_id, or else segment_id or face_segment (Matterport3D).
    pub object_id: Option<i64>,
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
