//! Reads camera-to-world matrices: small flaws are corrected, others refused.

use crate::capture::camera::Pose;
use crate::capture::read::fields::Fields;
use crate::error::{self, Error};
use glam::{DMat3, DVec3, DVec4};

/// Maximum deviation of the columns from orthonormal, after removal of the scale.
const MAX_SHEAR: f64 = 1e-2;
/// Deviations up to this are single-precision rounding and are not reported.
const ROUNDING: f64 = 1e-4;

/// The pose of a frame, and a remark if its matrix was corrected.
pub fn of_frame(fields: &Fields) -> error::Result<(Pose, Option<String>)> {
    const NAME: &str = "transform_matrix";
    let place = fields.place(NAME);
    let rows = fields
        .matrix(NAME)?
        .ok_or_else(|| Error::new(&place, "is absent", "add the camera-to-world matrix"))?;
    let (pose, remark) = from_rows(&rows).map_err(|problem| refused(&place, &problem))?;
    Ok((pose, remark.map(|remark| format!("{NAME} {remark}"))))
}

/// The error for a matrix at `place` that [`from_rows`] refuses with `problem`.
pub fn refused(place: &str, problem: &str) -> Error {
    Error::new(
        place,
        format!("the matrix {problem}"),
        "give the camera-to-world rotation and position",
    )
}

/// The nearest rigid pose to a 3×4 or 4×4 row-major matrix, and a remark if it differs by more than rounding.
///
/// # Errors
/// Why the matrix is not a rigid motion, as a phrase.
pub fn from_rows(rows: &[Vec<f64>]) -> Result<(Pose, Option<String>), String> {
    if !(rows.len() == 3 || rows.len() == 4) || rows.iter().any(|row| row.len() != 4) {
        return Err("is not a 4×4 (or 3×4) matrix".into());
    }
    if rows.iter().flatten().any(|x| !x.is_finite()) {
        return Err("holds a number that is not finite".into());
    }
    if let Some(last) = rows.get(3)
        && (DVec4::new(last[0], last[1], last[2], last[3]) - DVec4::W).length() > 1e-9
    {
        return Err("has a last row other than 0 0 0 1".into());
    }
    let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    let linear = DMat3::from_cols(column(0), column(1), column(2));
    let determinant = linear.determinant();
    let size = (linear.x_axis.length() + linear.y_axis.length() + linear.z_axis.length()) / 3.0;
    if determinant.abs() <= 1e-9 * size.powi(3) {
        return Err("is singular".into());
    }
    if determinant < 0.0 {
        return Err("mirrors (its determinant is negative)".into());
    }

    // Remove the mean scale, then take the nearest rotation by the polar decomposition (Newton's iteration).
    let scale = determinant.cbrt();
    let unscaled = linear * scale.recip();
    let shear = deviation(&unscaled);
    if shear > MAX_SHEAR {
        return Err(format!(
            "is not a rigid motion (its axes are {shear:.3} from orthonormal)"
        ));
    }
    let mut rotation = unscaled;
    for _ in 0..8 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    let remark = if (scale - 1.0).abs() > ROUNDING {
        Some(format!("scales by {scale:.6}; the scale was left out"))
    } else if shear > ROUNDING {
        Some(format!(
            "is {shear:.1e} from orthonormal; the nearest rotation was taken"
        ))
    } else {
        None
    };
    let center = column(3);
    Ok((Pose { rotation, center }, remark))
}

/// Largest entry of |RᵀR − 1|.
fn deviation(m: &DMat3) -> f64 {
    let gram = m.transpose() * *m - DMat3::IDENTITY;
    gram.to_cols_array()
        .iter()
        .fold(0.0, |largest, x| largest.max(x.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn rows(m: DMat3) -> Vec<Vec<f64>> {
        let t = m.transpose().to_cols_array_2d();
        let mut rows: Vec<Vec<f64>> = t.iter().map(|r| [r.as_slice(), &[1.0]].concat()).collect();
        rows.push(vec![0.0, 0.0, 0.0, 1.0]);
        rows
    }

    #[test]
    fn rotations_come_back_and_small_flaws_are_mended_with_a_remark() {
        let r = DMat3::from_quat(DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-0.3));
        let (pose, remark) = from_rows(&rows(r)).unwrap();
        assert!(remark.is_none() && pose.rotation.abs_diff_eq(r, 1e-14));
        let (pose, remark) = from_rows(&rows(r * 1.5)).unwrap();
        assert!(remark.unwrap().contains("scale") && deviation(&pose.rotation) < 1e-14);
        let mut sheared = r;
        sheared.x_axis += r.y_axis * 1e-3;
        let (pose, remark) = from_rows(&rows(sheared)).unwrap();
        assert!(remark.is_some() && deviation(&pose.rotation) < 1e-14);
    }

    /// Others are refused where a file holds them, by name.
    #[test]
    fn tiny_infinite_and_projective_matrices_are_refused() {
        for (m, word) in [
            (DMat3::IDENTITY * 1e-200, "singular"),
            (DMat3::IDENTITY * f64::NAN, "finite"),
        ] {
            assert!(from_rows(&rows(m)).unwrap_err().contains(word));
        }
        let mut projective = rows(DMat3::IDENTITY);
        projective[3][0] = 0.1;
        assert!(from_rows(&projective).is_err());
    }
}
