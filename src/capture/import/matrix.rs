//! Parses matrices and poses in text files.

use crate::capture::camera::Pose;
use crate::capture::import::folder::Folder;
use crate::capture::read::pose::from_rows;
use crate::error::{Error, Result};
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

/// A number as C, Python and MATLAB write it, including `nan`, `-nan` and `-inf`.
pub fn number(word: &str) -> Option<f64> {
    let lower = word.to_ascii_lowercase();
    match lower.as_str() {
        "-nan" | "+nan" | "-nan(ind)" | "1.#qnan" | "-1.#ind" => Some(f64::NAN),
        "1.#inf" => Some(f64::INFINITY),
        "-1.#inf" => Some(f64::NEG_INFINITY),
        _ => lower.parse().ok(),
    }
}

/// All numbers of a text, separated by white space, commas or semicolons; `None` if one is malformed.
pub fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split(|c: char| c.is_whitespace() || c == ',' || c == ';')
        .filter(|word| !word.is_empty())
        .map(number)
        .collect()
}

/// The 3×3, 3×4 or 4×4 matrix of a text file, in rows.
pub fn rows(folder: &Folder, name: &str) -> Result<Vec<Vec<f64>>> {
    let numbers = numbers(&folder.text(name)?).unwrap_or_default();
    let width = match numbers.len() {
        9 => 3,
        12 | 16 => 4,
        _ => {
            return Err(Error::file(
                &folder.path(name),
                "is not a 3×3, 3×4 or 4×4 matrix of numbers",
                "export it again",
            ));
        }
    };
    Ok(numbers.chunks(width).map(<[f64]>::to_vec).collect())
}

/// The matrix of 3 or 4 rows of 4 numbers; `None` for another shape.
pub fn matrix_of_rows(rows: &[Vec<f64>]) -> Option<DMat4> {
    let fits = (3..=4).contains(&rows.len()) && rows.iter().all(|row| row.len() == 4);
    fits.then(|| {
        let row = |i: usize| match rows.get(i) {
            Some(row) => DVec4::new(row[0], row[1], row[2], row[3]),
            None => DVec4::W,
        };
        DMat4::from_cols(row(0), row(1), row(2), row(3)).transpose()
    })
}

/// The pose of a camera-to-world matrix with OpenCV's camera axes; `None` if a number is not finite.
pub fn pose_of_rows(place: &str, rows: &[Vec<f64>]) -> Result<Option<Pose>> {
    if rows.iter().flatten().any(|x| !x.is_finite()) {
        return Ok(None);
    }
    let (pose, _) = from_rows(rows).map_err(|problem| {
        Error::new(
            place,
            format!("the camera-to-world matrix {problem}"),
            "correct the pose or leave the frame out",
        )
    })?;
    Ok(Some(from_opencv(pose.rotation, pose.center)))
}

/// The pose of a camera-to-world rotation with OpenCV's camera axes (x right, y down, looking along +z) and a camera centre.
pub fn from_opencv(rotation: DMat3, center: DVec3) -> Pose {
    Pose {
        rotation: DMat3::from_cols(rotation.x_axis, -rotation.y_axis, -rotation.z_axis),
        center,
    }
}

/// The rotation of a quaternion of any length; `None` if it is zero or not finite.
pub fn rotation(x: f64, y: f64, z: f64, w: f64) -> Option<DMat3> {
    let q = DQuat::from_xyzw(x, y, z, w);
    let length = q.length();
    (length.is_finite() && length > 1e-9).then(|| DMat3::from_quat(q / length))
}

pub fn no_quaternion(place: &str) -> Error {
    Error::new(
        place,
        "the quaternion is zero",
        "correct the pose or leave the line out",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_as_programs_write_them() {
        assert_eq!(numbers("1 -2e3;0.5,\n7"), Some(vec![1.0, -2e3, 0.5, 7.0]));
        assert_eq!(number("-inf"), Some(f64::NEG_INFINITY));
        assert!(number("-nan").is_some_and(f64::is_nan));
        assert_eq!(numbers("1 two"), None);
    }
}
