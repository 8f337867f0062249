//! The images and camera models of a COLMAP model.

use crate::capture::scan::lens::{Lens, Model};
use glam::DVec3;

/// An image of the model.
pub struct Image {
    /// Quaternion w, x, y, z of the rotation from world to camera.
    pub quaternion: [f64; 4],
    /// The world's origin in camera coordinates.
    pub translation: DVec3,
    /// The id of its camera.
    pub camera: u32,
    /// Its file, relative to the folder of photographs.
    pub name: String,
}

/// Camera models: number, name and count of parameters.
pub const MODELS: [(i32, &str, usize); 11] = [
    (0, "SIMPLE_PINHOLE", 3),
    (1, "PINHOLE", 4),
    (2, "SIMPLE_RADIAL", 4),
    (3, "RADIAL", 5),
    (4, "OPENCV", 8),
    (5, "OPENCV_FISHEYE", 8),
    (6, "FULL_OPENCV", 12),
    (7, "FOV", 5),
    (8, "SIMPLE_RADIAL_FISHEYE", 4),
    (9, "RADIAL_FISHEYE", 5),
    (10, "THIN_PRISM_FISHEYE", 12),
];

/// The lens of a model with the parameters `p`.
///
/// # Errors
/// What is wrong, as a phrase.
pub fn lens(model: &str, size: [u32; 2], p: &[f64]) -> Result<Lens, String> {
    let known = MODELS.iter().find(|(_, name, _)| *name == model);
    let Some((_, _, count)) = known else {
        return Err(format!("the camera model {model:?} is not known"));
    };
    if p.len() != *count {
        return Err(format!(
            "the camera model {model} has {count} parameters, not {}",
            p.len()
        ));
    }
    if size[0] == 0 || size[1] == 0 {
        return Err("the camera has no pixels".into());
    }
    let one_focal = |k| Lens::plain(size, [p[0]; 2], [p[1], p[2]]).with(k);
    let two_focals = |k| Lens::plain(size, [p[0], p[1]], [p[2], p[3]]).with(k);
    let lens = match model {
        "SIMPLE_PINHOLE" => one_focal(Model::Brown([0.0; 4])),
        "PINHOLE" => two_focals(Model::Brown([0.0; 4])),
        "SIMPLE_RADIAL" => one_focal(Model::Brown([p[3], 0.0, 0.0, 0.0])),
        "RADIAL" => one_focal(Model::Brown([p[3], p[4], 0.0, 0.0])),
        "OPENCV" => two_focals(Model::Brown([p[4], p[5], p[6], p[7]])),
        "OPENCV_FISHEYE" => two_focals(Model::Fisheye([p[4], p[5], p[6], p[7]])),
        "FULL_OPENCV" => two_focals(Model::Rational {
            k: [p[4], p[5], p[8], p[9], p[10], p[11]],
            p: [p[6], p[7]],
        }),
        "SIMPLE_RADIAL_FISHEYE" => one_focal(Model::Fisheye([p[3], 0.0, 0.0, 0.0])),
        "RADIAL_FISHEYE" => one_focal(Model::Fisheye([p[3], p[4], 0.0, 0.0])),
        _ => {
            return Err(format!(
                "the camera model {model} is not supported; undistort with COLMAP's image_undistorter"
            ));
        }
    };
    if !lens.is_possible() {
        return Err("a focal length or coefficient is impossible".into());
    }
    Ok(lens)
}
