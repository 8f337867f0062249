//! Camera poses of the room's photographs.

use crate::capture::camera::{Intrinsics, Pose};
use glam::{DMat3, DVec3};

/// Tangent of half the horizontal field of view in the built-in and generated rooms.
const HALF_FIELD: f64 = 0.82;

/// Pose and field of view of a photograph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The camera in room coordinates.
    pub pose: Pose,
    /// Tangent of half the horizontal field of view.
    pub half_field: f64,
}

impl View {
    /// A level view from `eye` towards `target`, with the built-in room's field of view.
    pub fn towards(eye: DVec3, target: DVec3) -> Self {
        let back = (eye - target).normalize_or_zero();
        let right = DVec3::Y.cross(back).normalize_or_zero();
        Self {
            pose: Pose {
                rotation: DMat3::from_cols(right, back.cross(right), back),
                center: eye,
            },
            half_field: HALF_FIELD,
        }
    }

    /// Views from a table of eyes and targets.
    pub fn all(table: &[[[f64; 3]; 2]]) -> Vec<Self> {
        let view = |&[eye, target]: &[[f64; 3]; 2]| Self::towards(eye.into(), target.into());
        table.iter().map(view).collect()
    }
}

/// Eye and target of the views of the built-in room.
pub const VIEWS: [[[f64; 3]; 2]; 16] = [
    // The four corners, across the room.
    [[1.95, 1.55, 1.75], [-0.6, 0.75, -0.9]],
    [[-2.1, 1.60, 1.05], [0.9, 0.75, -0.9]],
    [[-1.2, 1.65, -1.75], [0.7, 0.65, 1.2]],
    [[1.75, 1.60, -1.55], [-0.9, 0.7, 1.0]],
    // The walls.
    [[0.1, 1.25, 1.5], [0.05, 1.1, -2.0]],
    [[1.6, 1.2, -0.2], [-2.5, 0.62, -0.1]],
    [[-0.2, 1.25, -0.85], [0.3, 0.95, 2.0]],
    [[-0.9, 1.30, 0.1], [2.5, 1.30, -0.15]],
    // Ceiling and floor.
    [[-0.9, 0.55, 1.75], [0.5, 2.15, -0.9]],
    [[1.9, 0.70, -1.6], [-0.5, 2.15, 0.8]],
    [[0.9, 2.2, 1.1], [-0.1, 0.0, -0.1]],
    [[-1.3, 2.15, -0.6], [0.1, 0.1, 0.4]],
    // Furniture from nearby.
    [[1.0, 0.95, 1.25], [-0.4, 0.45, -0.9]],
    [[0.4, 1.05, -0.7], [2.3, 1.05, -0.6]],
    [[-0.4, 1.1, -0.7], [-1.9, 0.75, 1.5]],
    [[-0.6, 0.85, 1.5], [1.5, 0.5, 0.2]],
];

/// Intrinsics and poses of the views at a size in pixels: square pixels, no distortion, principal point in the middle.
pub fn cameras(views: &[View], size: [u32; 2]) -> Vec<(Intrinsics, Pose)> {
    let lens = |half_field: f64| {
        let middle = size.map(|side| f64::from(side) * 0.5);
        Intrinsics::plain(size, [middle[0] / half_field; 2], middle)
    };
    let camera = |view: &View| (lens(view.half_field), view.pose);
    views.iter().map(camera).collect()
}
