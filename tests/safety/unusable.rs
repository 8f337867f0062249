//! Captures that cannot be solved: refused with the true cause.

use crate::place::Place;
use crate::{change, heard, refused, solve};
use image::{ImageFormat, Rgb, RgbImage};
use relit::export::exr::{Precision, write_rgb};
use relit::math::picture::Picture;
use serde_json::json;
use std::fs;

/// Grey photographs of a format, with a fine pattern that compresses badly.
fn write_photographs(place: &Place, ending: &str, format: ImageFormat) {
    for frame in 0..2u32 {
        let picture = RgbImage::from_fn(24, 24, |x, y| {
            Rgb([x * 7 + frame * 5, y * 9, x * y * 11].map(|v| 60 + (v % 120) as u8))
        });
        let path = place.path(&format!("room/images/00{frame}.{ending}"));
        picture.save_with_format(path, format).expect("writes");
    }
    change(place, "room", |file| {
        for frame in 0..2 {
            let name = format!("images/00{frame}.{ending}");
            file["frames"][frame]["file_path"] = json!(name);
        }
    });
}

#[test]
fn a_photograph_that_is_cut_short_is_named() {
    let place = Place::new();
    let remedy = "take its frame out of transforms.json";
    let cut = |name: &str, most: usize| {
        let path = place.path(&format!("room/images/{name}"));
        let whole = fs::read(&path).expect("reads");
        for part in [whole.len() / 2, whole.len() * 8 / 10, whole.len() - most] {
            fs::write(&path, &whole[..part]).expect("writes");
            refused(&place.relit(&solve("room", "out")), 1, &[name, remedy]);
        }
        fs::write(&path, &whole).expect("writes");
    };
    cut("001.exr", 2);
    write_photographs(&place, "jpg", ImageFormat::Jpeg);
    cut("001.jpg", 2);
    // What a phone adds behind the picture does no harm.
    let path = place.path("room/images/001.jpg");
    let longer = [&fs::read(&path).expect("reads")[..], b"\0\0MotionPhoto"].concat();
    fs::write(&path, longer).expect("writes");
    let output = place.relit(&solve("room", "out"));
    assert_eq!(output.status.code(), Some(0), "{}", heard(&output));
    write_photographs(&place, "png", ImageFormat::Png);
    // The last 12 bytes only say that the picture has ended.
    cut("001.png", 14);
}

#[test]
fn photographs_without_light_are_no_capture_to_solve() {
    let place = Place::new();
    for value in [0.0, f32::NAN, f32::INFINITY] {
        for frame in 0..2 {
            let picture = Picture {
                width: 24,
                height: 24,
                pixels: vec![glam::Vec3::splat(value); 24 * 24],
            };
            let path = place.path(&format!("room/images/00{frame}.exr"));
            write_rgb_over(&path, &picture);
        }
        let words = ["room", "no photograph holds light"];
        refused(&place.relit(&solve("room", "out")), 1, &words);
        assert!(!place.path("out").exists());
    }
}

/// Writes a photograph of a capture, as a test may.
fn write_rgb_over(path: &std::path::Path, picture: &Picture) {
    fs::remove_file(path).expect("removes");
    write_rgb(path, picture, Precision::Float).expect("writes");
}

#[test]
fn a_principal_point_far_outside_the_picture_is_named() {
    let place = Place::new();
    for (field, value) in [("cx", 5000.0), ("cy", -5000.0)] {
        change(&place, "room", |file| {
            file["cx"] = json!(12.0);
            file[field] = json!(value);
        });
        let refusal = place.relit(&solve("room", "out"));
        refused(
            &refusal,
            1,
            &["transforms.json", field, "far outside the picture"],
        );
    }
    // A part cut out of a larger photograph.
    change(&place, "room", |file| {
        (file["cx"], file["cy"]) = (json!(26.0), json!(12.0))
    });
    let output = place.relit(&solve("room", "out"));
    let said = heard(&output);
    assert!(
        said.contains("principal point (cx, cy) lies outside"),
        "{said}"
    );
}

#[test]
fn a_compressed_mesh_is_refused_by_the_name_of_its_compression() {
    let place = Place::new();
    let mesh = r#"{"asset": {"version": "2.0"}, "extensionsUsed": ["KHR_draco_mesh_compression"],
        "extensionsRequired": ["KHR_draco_mesh_compression"], "meshes": [{"primitives": [{"attributes": {},
        "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}}]}]}"#;
    fs::write(place.path("room/mesh.gltf"), mesh).expect("writes");
    change(&place, "room", |file| {
        file["mesh_path"] = json!("mesh.gltf")
    });
    let refusal = place.relit(&solve("room", "out"));
    refused(&refusal, 1, &["mesh.gltf", "Draco", "without compression"]);
}
