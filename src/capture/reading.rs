//! Conventions of a capture's files: axes, units, image sizes, and which photograph belongs to which pose.
//!
//! Files rarely state them. The default is the format's own convention; options override it, and [`crate::calibrate::alignment`]
//! finds the conventions that the photographs agree with.

use crate::capture::camera::Intrinsics;
use crate::capture::orientation::Orientation;
use crate::capture::photograph::PhotographSource;
use crate::capture::{Capture, Frame};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Convention of camera axes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axes {
    /// x right, y up, looking down −z.
    #[default]
    OpenGl,
    /// x right, y down, looking down +z.
    OpenCv,
}

/// The conventions by which a capture's files are read.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Reading {
    /// Camera axes of the poses.
    pub axes: Axes,
    /// Quarter turns of the mesh about the x axis, 0 to 3: 3 takes a mesh whose z is up to poses whose y is up.
    pub mesh_turns: u8,
    /// Factor from the mesh's unit to the poses' unit.
    pub mesh_scale: f64,
    /// Factor on focal lengths.
    pub focal: f64,
    /// Factor on focal lengths and principal points: the photographs' size over the size that the lens is given for.
    pub lens_scale: f64,
    /// Orientation of all photographs, applied after that of their files.
    pub orientation: Orientation,
    /// Pose k has the photograph of frame (k + `shift`) modulo the number of frames.
    pub shift: i32,
}

impl Default for Reading {
    fn default() -> Self {
        Self {
            axes: Axes::OpenGl,
            mesh_turns: 0,
            mesh_scale: 1.0,
            focal: 1.0,
            lens_scale: 1.0,
            orientation: Orientation::default(),
            shift: 0,
        }
    }
}

impl Reading {
    /// Whether the files follow the format's conventions.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// This reading followed by `next`, which applies to the capture as this one reads it.
    pub fn then(&self, next: &Self) -> Self {
        Self {
            axes: match (self.axes, next.axes) {
                (a, b) if a == b => Axes::OpenGl,
                _ => Axes::OpenCv,
            },
            mesh_turns: (self.mesh_turns + next.mesh_turns) % 4,
            mesh_scale: self.mesh_scale * next.mesh_scale,
            focal: self.focal * next.focal,
            lens_scale: self.lens_scale * next.lens_scale,
            orientation: self.orientation.then(next.orientation),
            shift: self.shift + next.shift,
        }
    }

    /// The rotation from the mesh's coordinates to the poses'.
    pub fn mesh_rotation(&self) -> DMat3 {
        match self.mesh_turns % 4 {
            0 => DMat3::IDENTITY,
            turns => DMat3::from_rotation_x(f64::from(turns) * FRAC_PI_2),
        }
    }

    /// The command-line options for this reading; empty for the default.
    pub fn options(&self) -> String {
        self.changes(0).join(" ")
    }

    /// A description in words of what this reading does to the files; empty for the default.
    pub fn words(&self) -> String {
        self.changes(1).join(" and ")
    }

    /// The conditions under which the photographs show the mesh as this reading says; empty for the default.
    pub fn conditions(&self) -> String {
        self.changes(2).join(" and ")
    }

    /// What differs from the format's conventions: as command-line options (0), in words (1), or as conditions (2).
    fn changes(&self, form: usize) -> Vec<String> {
        let [mesh_turn, turn] =
            [self.mesh_turns, self.orientation.turns].map(|turns| 90 * u32::from(turns));
        let [mesh_scale, focal, lens_scale] =
            [self.mesh_scale, self.focal, self.lens_scale].map(number);
        let shown = match self.shift {
            1 => "the next photograph".to_owned(),
            -1 => "the photograph before".to_owned(),
            n => format!("the photograph {n} frames later"),
        };
        let all = [
            (
                self.axes == Axes::OpenCv,
                "--axes opencv".to_owned(),
                "read the poses with OpenCV's axes".to_owned(),
                "if poses have OpenCV's axes".to_owned(),
            ),
            (
                self.mesh_turns != 0,
                format!("--mesh-turn {mesh_turn}"),
                format!("turn the mesh by {mesh_turn}° about its x axis"),
                format!("if the mesh is turned about its x axis by {mesh_turn}°"),
            ),
            (
                self.mesh_scale != 1.0,
                format!("--mesh-scale {mesh_scale}"),
                format!("multiply the mesh's size by {mesh_scale}"),
                format!("if the mesh is {:.4} times as large", self.mesh_scale),
            ),
            (
                self.focal != 1.0,
                format!("--focal {focal}"),
                format!("multiply the focal lengths by {focal}"),
                format!("if focal lengths are {:.3} times as long", self.focal),
            ),
            (
                self.lens_scale != 1.0,
                format!("--lens-scale {lens_scale}"),
                format!("fit the lens to the photographs' size: multiply it by {lens_scale}"),
                "if the lens is given for another size of the photographs".to_owned(),
            ),
            (
                self.orientation.mirrored,
                "--mirror".to_owned(),
                "mirror the photographs".to_owned(),
                "if they are mirrored".to_owned(),
            ),
            (
                self.orientation.turns != 0,
                format!("--turn {turn}"),
                format!("turn the photographs by {turn}°"),
                format!("if they are turned by {turn}°"),
            ),
            (
                self.shift != 0,
                format!("--shift={}", self.shift),
                format!("give each pose {shown}"),
                "if each pose has the photograph of the frame beside it".to_owned(),
            ),
        ];
        all.into_iter()
            .filter(|change| change.0)
            .map(|(_, option, words, condition)| [option, words, condition][form].clone())
            .collect()
    }
}

/// A factor with a relative precision of 1/1000 or better, without an exponent.
fn number(factor: f64) -> String {
    let places = 3 - factor.log10().floor().min(0.0) as i32;
    let text = format!("{factor:.0$}", places.max(0) as usize);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

impl Intrinsics {
    /// The lens under a reading. A quarter turn of the photographs swaps width and height. A principal point at the picture's
    /// middle stays at the middle; any other is taken as given for the turned picture.
    pub fn read_as(&self, reading: &Reading) -> Self {
        let mut lens = *self;
        lens.fx *= reading.focal * reading.lens_scale;
        lens.fy *= reading.focal * reading.lens_scale;
        lens.cx *= reading.lens_scale;
        lens.cy *= reading.lens_scale;
        if reading.orientation.turns % 2 == 1 {
            (lens.width, lens.height) = (self.height, self.width);
            let middle = |center: f64, from: u32, to: u32| {
                let (from, to) = (f64::from(from) * 0.5, f64::from(to) * 0.5);
                match (center - from).abs() < (center - to).abs() {
                    true => center * to / from,
                    false => center,
                }
            };
            lens.cx = middle(lens.cx, self.width, lens.width);
            lens.cy = middle(lens.cy, self.height, lens.height);
        }
        lens
    }
}

impl Capture {
    /// The capture under a reading. Photographs in files are turned when they are loaded.
    pub fn read_as(mut self, reading: &Reading) -> Self {
        if reading.is_default() {
            return self;
        }
        let mean_up = |frames: &[Frame]| -> DVec3 {
            let sum: DVec3 = frames.iter().map(|f| f.pose.rotation.y_axis).sum();
            sum.normalize_or_zero()
        };
        let up_is_the_cameras = mean_up(&self.frames).abs_diff_eq(self.up, 1e-9);
        let to_poses = reading.mesh_rotation() * reading.mesh_scale;
        for position in &mut self.mesh.positions {
            *position = to_poses * *position;
        }
        for frame in &mut self.frames {
            if reading.axes == Axes::OpenCv {
                frame.pose.rotation.y_axis *= -1.0;
                frame.pose.rotation.z_axis *= -1.0;
            }
            // The reader has already swapped the size of photographs in files.
            let in_file = matches!(frame.photograph, PhotographSource::File(..));
            let lens = Reading {
                orientation: match in_file {
                    true => Orientation::default(),
                    false => reading.orientation,
                },
                ..*reading
            };
            frame.intrinsics = frame.intrinsics.read_as(&lens);
            frame.photograph = frame.photograph.oriented(reading.orientation);
        }
        if up_is_the_cameras {
            self.up = mean_up(&self.frames);
        }
        let count = self.frames.len();
        let shown: Vec<_> = (self.frames.iter())
            .map(|frame| {
                (
                    frame.photograph.clone(),
                    frame.exposure,
                    frame.depth.clone(),
                )
            })
            .collect();
        for (index, frame) in self.frames.iter_mut().enumerate() {
            let source =
                (index as i64 + i64::from(reading.shift)).rem_euclid(count as i64) as usize;
            (frame.photograph, frame.exposure, frame.depth) = shown[source].clone();
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_from_the_format_is_said_as_options_in_words_and_as_conditions() {
        let given = Reading::default();
        assert_eq!(given.options() + &given.words() + &given.conditions(), "");
        let reading = Reading {
            axes: Axes::OpenCv,
            mesh_turns: 3,
            mesh_scale: 0.01,
            focal: 1.25,
            lens_scale: 0.5,
            orientation: Orientation::turned(2),
            shift: -1,
        };
        assert_eq!(
            reading.options(),
            "--axes opencv --mesh-turn 270 --mesh-scale 0.01 --focal 1.25 --lens-scale 0.5 --turn 180 --shift=-1"
        );
        let (axes, shift) = (given.axes, given.shift);
        let words = "turn the mesh by 270° about its x axis and multiply the mesh's size by 0.01 and multiply the focal lengths by 1.25 \
                     and fit the lens to the photographs' size: multiply it by 0.5 and turn the photographs by 180°";
        let some = Reading {
            axes,
            shift,
            ..reading
        };
        assert_eq!(some.words(), words);
        let focal = given.focal;
        let conditions = "if poses have OpenCV's axes and if the mesh is turned about its x axis by 270° and if the mesh is 0.0100 times as \
                          large and if the lens is given for another size of the photographs and if they are turned by 180° and if each \
                          pose has the photograph of the frame beside it";
        assert_eq!(Reading { focal, ..reading }.conditions(), conditions);
    }

    #[test]
    fn a_reading_after_another_is_their_product() {
        let first = Reading {
            mesh_scale: 0.01,
            axes: Axes::OpenCv,
            ..Reading::default()
        };
        let second = Reading {
            mesh_scale: 0.95,
            axes: Axes::OpenCv,
            shift: 1,
            ..Reading::default()
        };
        let both = first.then(&second);
        assert_eq!(both.axes, Axes::OpenGl);
        assert!((both.mesh_scale - 0.0095).abs() < 1e-12);
        assert_eq!(both.shift, 1);
    }
}
