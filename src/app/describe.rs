//! Names of segments: their number, size and colour, so that people can find them.

use crate::math::color::linear_to_srgb;
use crate::scene::Object;
use egui::ecolor::Hsva;
use glam::Vec3;

/// The name of an object; a segment's says whether it is large or small (in the scene's area), and its colour.
pub fn described(object: &Object, area: f64, albedo: Option<Vec3>) -> String {
    if !object.name.starts_with("segment ") {
        return object.name.clone();
    }
    let size = match object.area / area {
        fraction if fraction > 0.05 => " large",
        fraction if fraction < 0.003 => " small",
        _ => "",
    };
    let color = albedo.map_or(String::new(), |albedo| format!(" {}", color_word(albedo)));
    match (size, color.as_str()) {
        ("", "") => object.name.clone(),
        _ => format!("{},{size}{color}", object.name),
    }
}

/// The word of a linear colour.
fn color_word(albedo: Vec3) -> &'static str {
    let srgb = albedo.clamp(Vec3::ZERO, Vec3::ONE).to_array();
    let Hsva { h, s, v, .. } = Hsva::from_rgb(srgb.map(linear_to_srgb));
    if v < 0.2 {
        return "black";
    }
    if s < 0.2 {
        return match v {
            v if v < 0.45 => "dark grey",
            v if v < 0.75 => "grey",
            v if v < 0.9 => "light grey",
            _ => "white",
        };
    }
    match h * 360.0 {
        20.0..70.0 if v < 0.6 => "brown",
        20.0..70.0 if s < 0.45 => "beige",
        20.0..45.0 => "orange",
        45.0..70.0 => "yellow",
        70.0..165.0 => "green",
        165.0..195.0 => "cyan",
        195.0..255.0 => "blue",
        255.0..290.0 => "purple",
        290.0..340.0 => "pink",
        _ if s < 0.5 => "brown",
        _ => "red",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_told_by_size_and_colour_and_named_objects_by_their_names() {
        for (name, area, albedo, expected) in [
            (
                "segment 004",
                20.0,
                Some([0.8; 3]),
                "segment 004, large white",
            ),
            (
                "segment 040",
                0.1,
                Some([0.3, 0.02, 0.02]),
                "segment 040, small red",
            ),
            (
                "segment 041",
                1.0,
                Some([0.05, 0.1, 0.4]),
                "segment 041, blue",
            ),
            ("segment 9", 1.0, None, "segment 9"),
            ("wall", 20.0, Some([0.8; 3]), "wall"),
        ] {
            let object = Object {
                name: name.to_owned(),
                triangles: Vec::new(),
                area,
            };
            let albedo = albedo.map(Vec3::from_array);
            assert_eq!(described(&object, 100.0, albedo), expected);
        }
    }
}
