//! Reads intrinsics from transforms.json: shared fields, overridden per frame.

use crate::capture::camera::Intrinsics;
use crate::capture::read::fields::Fields;
use crate::error::{Error, Result};
use glam::DVec2;

const MODELS: [&str; 5] = [
    "PINHOLE",
    "SIMPLE_PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
];
/// Coefficients of unsupported lens models; they may be present but must be zero.
const HIGHER_COEFFICIENTS: [&str; 8] = ["k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"];

/// Limit on tan θ of the off-axis angle in a picture: the widest rectilinear lenses (9 mm for 36 × 24 mm) reach 2.4.
const MAX_TANGENT: f64 = 2.5;

/// Reads the lens of one frame for an image of `size` (width, height) pixels.
///
/// Also returns remarks about guessed fields.
pub fn read(
    shared: &Fields,
    frame: &Fields,
    size: [u32; 2],
) -> Result<(Intrinsics, Vec<&'static str>)> {
    let mut remarks = Vec::new();
    let fields_of = |name: &str| frame.or(shared, name);
    let number = |name: &str| fields_of(name).number(name);

    let fields = fields_of("camera_model");
    let model = fields.text("camera_model")?.map(str::to_ascii_uppercase);
    if let Some(model) = model.filter(|model| !MODELS.contains(&model.as_str())) {
        return Err(Error::new(
            fields.place("camera_model"),
            format!("the lens model {model:?} is not supported"),
            "undistort the photographs to PINHOLE or OPENCV first",
        ));
    }
    for name in HIGHER_COEFFICIENTS {
        if number(name)?.is_some_and(|k| k != 0.0) {
            return Err(Error::new(
                fields_of(name).place(name),
                "this lens coefficient is not supported",
                "undistort the photographs first, or refit the lens with k1 k2 p1 p2",
            ));
        }
    }

    // Scale a lens that is given for another size of the same photograph.
    let [width, height] = size;
    let mut scale = DVec2::ONE;
    if let Some([stated_width, stated_height]) = stated_size(shared, frame)?
        && [stated_width, stated_height] != size
    {
        let ratio = |a: u32, b: u32| f64::from(a) / f64::from(b);
        scale = DVec2::new(ratio(width, stated_width), ratio(height, stated_height));
        let same_shape = (scale.x * f64::from(stated_height) - f64::from(height)).abs() < 1.0;
        if !same_shape {
            let photograph = frame.text("file_path")?.unwrap_or("the photograph");
            let remedy = match (stated_width, stated_height) == (height, width) {
                true => "turn the photographs: pass --turn 90 or --turn 270",
                false => "correct the intrinsics or use photographs of the camera's size",
            };
            let (name, stated) = match stated_width == width {
                true => ("h", stated_height),
                false => ("w", stated_width),
            };
            return Err(Error::new(
                fields_of(name).place(name),
                format!("is {stated}, but {photograph} is {width}×{height} pixels"),
                remedy,
            ));
        }
        remarks.push("the lens is given for another size of the same photograph, and scaled to it");
    }

    let mut intrinsics = pinhole(shared, frame, size, scale, &mut remarks)?;
    for (value, name) in (intrinsics.distortion.iter_mut()).zip(["k1", "k2", "p1", "p2"]) {
        *value = number(name)?.unwrap_or(0.0);
    }
    if !invertible(&intrinsics) {
        remarks
            .push("the lens distortion turns back inside the photograph; its corners may be wrong");
    }
    Ok((intrinsics, remarks))
}

/// The lens of one frame without distortion, for a photograph that is `scale` times as large as the size that it is given for.
pub fn pinhole(
    shared: &Fields,
    frame: &Fields,
    [width, height]: [u32; 2],
    scale: DVec2,
    remarks: &mut Vec<&'static str>,
) -> Result<Intrinsics> {
    let fields_of = |name: &str| frame.or(shared, name);
    let number = |name: &str| fields_of(name).number(name);

    // Focal length in pixels, or from the field of view.
    let focal = |extent: u32, angle: f64| f64::from(extent) * 0.5 / (angle * 0.5).tan();
    let fx = match (number("fl_x")?, number("camera_angle_x")?) {
        (Some(f), _) => f * scale.x,
        (None, Some(angle)) => focal(width, angle),
        (None, None) => {
            return Err(Error::new(
                frame.place("fl_x"),
                "there is neither fl_x nor camera_angle_x",
                "give the focal length in pixels",
            ));
        }
    };
    let fy = match (number("fl_y")?, number("camera_angle_y")?) {
        (Some(f), _) => f * scale.y,
        (None, Some(angle)) => focal(height, angle),
        (None, None) => {
            remarks.push("fl_y is absent and taken equal to fl_x");
            fx
        }
    };
    let mut center = |name: &str, extent: u32, scale: f64| -> Result<f64> {
        Ok(match number(name)? {
            Some(c) => c * scale,
            None => {
                remarks.push("cx or cy is absent and taken as the middle of the photograph");
                f64::from(extent) * 0.5
            }
        })
    };
    let (cx, cy) = (
        center("cx", width, scale.x)?,
        center("cy", height, scale.y)?,
    );
    for (name, f) in [("fl_x", fx), ("fl_y", fy)] {
        if !(f.is_finite() && f > 0.0) {
            return Err(Error::new(
                fields_of(name).place(name),
                format!("a focal length of {f} pixels is impossible"),
                "give a positive focal length in pixels",
            ));
        }
    }
    for (name, c, extent, f) in [("cx", cx, width, fx), ("cy", cy, height, fy)] {
        // Distance from the principal point to the nearest edge; positive outside the picture.
        let outside = (-c).max(c - f64::from(extent));
        if outside > MAX_TANGENT * f {
            return Err(Error::new(
                fields_of(name).place(name),
                format!(
                    "a principal point at {c} pixels is far outside the picture of {width}×{height}"
                ),
                "give it in pixels from the picture's top-left corner",
            ));
        }
        if outside > 0.0 {
            remarks.push("the principal point (cx, cy) lies outside the picture");
        }
    }
    Ok(Intrinsics::plain([width, height], [fx, fy], [cx, cy]))
}

/// Width and height that the lens is given for, if both are present.
pub fn stated_size(shared: &Fields, frame: &Fields) -> Result<Option<[u32; 2]>> {
    let count = |name: &str| frame.or(shared, name).count(name);
    Ok(match (count("w")?, count("h")?) {
        (Some(w), Some(h)) => Some([w, h]),
        _ => None,
    })
}

/// Whether the distortion can be undone at the photograph's corners and edges, to a tenth of a pixel.
fn invertible(k: &Intrinsics) -> bool {
    let (w, h) = (f64::from(k.width), f64::from(k.height));
    (0..9).all(|i| {
        let pixel = DVec2::new(w * f64::from(i % 3) * 0.5, h * f64::from(i / 3) * 0.5);
        let distorted = k.normalized(pixel);
        k.distort(k.undistort(distorted))
            .is_some_and(|d| ((d - distorted) * DVec2::new(k.fx, k.fy)).length() < 0.1)
    })
}
