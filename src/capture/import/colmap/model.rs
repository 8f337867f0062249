//! COLMAP's camera models.

use crate::capture::import::lens::{Lens, Model};

/// A camera model: its number, its name and how many parameters it has.
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

/// The lens of a model with its parameters.
///
/// # Errors
/// What is wrong with it, as a phrase.
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
    let one = |k| Lens::plain(size, [p[0]; 2], [p[1], p[2]]).with(k);
    let two = |k| Lens::plain(size, [p[0], p[1]], [p[2], p[3]]).with(k);
    let lens = match model {
        "SIMPLE_PINHOLE" => one(Model::Brown([0.0; 4])),
        "PINHOLE" => two(Model::Brown([0.0; 4])),
        "SIMPLE_RADIAL" => one(Model::Brown([p[3], 0.0, 0.0, 0.0])),
        "RADIAL" => one(Model::Brown([p[3], p[4], 0.0, 0.0])),
        "OPENCV" => two(Model::Brown([p[4], p[5], p[6], p[7]])),
        "OPENCV_FISHEYE" => two(Model::Fisheye([p[4], p[5], p[6], p[7]])),
        "FULL_OPENCV" => two(Model::Rational {
            k: [p[4], p[5], p[8], p[9], p[10], p[11]],
            p: [p[6], p[7]],
        }),
        "SIMPLE_RADIAL_FISHEYE" => one(Model::Fisheye([p[3], 0.0, 0.0, 0.0])),
        "RADIAL_FISHEYE" => one(Model::Fisheye([p[3], p[4], 0.0, 0.0])),
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
