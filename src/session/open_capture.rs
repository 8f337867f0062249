//! An open capture: what is solved, shown and measured, and its frames at the working resolution and at the size of their files.

use crate::calibrate::alignment::Alignment;
use crate::calibrate::problem::Problem;
use crate::capture::photograph::Photograph;
use crate::capture::truth::Truth;
use crate::capture::{Capture, Frame};
use crate::error::{Error, Result};
use crate::export::picture::shown_at;
use crate::math::picture::Picture;
use crate::room::Room;
use crate::room::photographs::STORED;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::session::command::{OpenOptions, Source};
use crate::session::view::sized::box_filter;
use crate::study::evaluate::Reference;
use crate::study::experiments::Subject;
use crate::study::trade::Metric;
use std::sync::Arc;

/// An open capture.
#[derive(Debug)]
pub struct OpenCapture {
    /// Where it comes from.
    pub source: Source,
    /// Options it was read with.
    pub options: OpenOptions,
    /// Hash of the mesh, the cameras and the photographs.
    pub hash: String,
    /// The capture itself, with cameras at the photographs' full size.
    pub capture: Arc<Capture>,
    /// Display name.
    pub name: String,
    /// Geometry and cameras.
    pub scene: Arc<Scene>,
    /// Photographs at the working resolution, one a camera.
    pub photographs: Vec<Arc<Photograph>>,
    /// Summary, one fact a line.
    pub summary: Vec<String>,
    /// Warnings about the capture.
    pub warnings: Vec<String>,
    /// How well the photographs agree with the mesh, if that was checked.
    pub alignment: Option<Alignment>,
}

impl OpenCapture {
    /// A frame's camera and photograph at the working resolution.
    ///
    /// # Errors
    /// The frame does not exist.
    pub fn frame(&self, index: usize) -> Result<(&Camera, &Arc<Photograph>)> {
        let camera = self.scene.cameras.get(index);
        let pair = camera.zip(self.photographs.get(index));
        pair.ok_or_else(|| self.no_frame(index))
    }

    /// A frame's camera and photograph with a long side of at most `long_side` pixels; read again from the file if the working
    /// resolution is lower.
    pub(crate) fn frame_at(
        &self,
        index: usize,
        long_side: u32,
    ) -> Result<(Camera, Arc<Photograph>)> {
        let size = |camera: &Camera| camera.intrinsics.width.max(camera.intrinsics.height);
        let (camera, photograph) = self.frame(index)?;
        let (mut camera, mut photograph) = (camera.clone(), photograph.clone());
        if long_side > size(&camera) {
            let full = self.full_camera(index)?;
            if size(&full) > size(&camera) {
                (camera, photograph) = (full, self.full_photograph(index)?);
            }
        }
        let camera = camera.shrunk(long_side);
        let k = &camera.intrinsics;
        if (photograph.width, photograph.height) == (k.width, k.height) {
            return Ok((camera, photograph));
        }
        let whole = photograph.picture();
        let sized = Photograph {
            width: k.width,
            height: k.height,
            pixels: box_filter(&whole, k.width, k.height).pixels,
            usable: Vec::new(),
            limits: Vec::new(),
            encoding: photograph.encoding,
            saturation: photograph.saturation,
        };
        Ok((camera, Arc::new(sized)))
    }

    /// A frame's camera at the size of its photograph's file.
    pub(crate) fn full_camera(&self, index: usize) -> Result<Camera> {
        let frame = self.full_frame(index)?;
        let origin = self.scene.origin;
        Ok(Camera::new(&frame.intrinsics, &frame.pose, origin))
    }

    /// A frame's photograph at the size of its file.
    ///
    /// # Errors
    /// The frame does not exist, or the file cannot be read again.
    pub fn full_photograph(&self, index: usize) -> Result<Arc<Photograph>> {
        self.full_frame(index)?.load()
    }

    /// A frame's photograph, box-filtered to a camera's size, and the exposure for its display: its own if it
    /// saturates, else the one that maps the 99th percentile to 1.
    pub(crate) fn sized_photograph(&self, index: usize, camera: &Camera) -> Result<(Picture, f32)> {
        let photograph = self.full_photograph(index)?;
        let whole = photograph.picture();
        let k = &camera.intrinsics;
        let picture = box_filter(&whole, k.width, k.height);
        let shown_at = shown_at(photograph.saturation, &picture.pixels);
        Ok((picture, shown_at))
    }

    fn full_frame(&self, index: usize) -> Result<&Frame> {
        let frame = self.capture.frames.get(index);
        frame.ok_or_else(|| self.no_frame(index))
    }

    fn no_frame(&self, index: usize) -> Error {
        let count = self.capture.frames.len();
        let problem = format!("{index} does not exist; {} has {count} frames", self.name);
        let remedy = format!("count from 0 to {}", count.saturating_sub(1));
        Error::usage("--frame", problem, remedy)
    }

    /// What a solver is given.
    pub fn problem(&self) -> Problem {
        Problem {
            scene: self.scene.clone(),
            photographs: self.photographs.clone(),
        }
    }

    /// Measures estimates by the truth if there is one, else by held-out pixels.
    pub(crate) fn metric(&self) -> Result<Metric> {
        let truth = match &self.source {
            Source::BuiltInRoom => Room::new().truth(STORED.size)?,
            Source::Folder(folder) if folder.join("truth.json").is_file() => Truth::read(folder)?,
            Source::Folder(_) => return Ok(Metric::HeldOut),
        };
        let reference = Reference::new(truth, &self.capture, &self.scene, &self.photographs);
        Ok(Metric::Truth(Box::new(reference)))
    }

    /// The capture as a subject of studies.
    pub(crate) fn subject(&self) -> Result<Subject> {
        Ok(Subject {
            name: self.name.clone(),
            capture: self.capture.clone(),
            problem: self.problem(),
            metric: self.metric()?,
        })
    }
}
