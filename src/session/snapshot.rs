//! What the worker shows: immutable, shared, latest wins.

use crate::calibrate::alignment::Alignment;
use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::compose::placement::Placement;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Progress, Termination};
use crate::scene::Scene;
use crate::session::command::{OpenOptions, Source};
use crate::session::edits::Edits;
use crate::session::keep::Kept;
use crate::transport::layers;
use glam::Vec3;
use std::sync::Arc;

pub use crate::math::picture::Picture;
pub use crate::transport::layers::LightSource;

/// The state of a session at one moment.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    /// Grows with every snapshot.
    pub sequence: u64,
    /// What the worker is doing.
    pub phase: Phase,
    /// What is open.
    pub capture: Option<Arc<OpenCapture>>,
    /// The parameters in force.
    pub settings: Settings,
    /// How far the solve has come.
    pub progress: Arc<Progress>,
    /// Iterations a second over the last second or so.
    pub iterations_per_second: f64,
    /// Rays a second over the last second or so.
    pub rays_per_second: f64,
    /// Seconds until the end, where that can be said.
    pub seconds_left: Option<f64>,
    /// The estimate so far, as it was found.
    pub estimate: Arc<Estimate>,
    /// The changes made by hand to the estimate, which all pictures and exports show.
    pub edits: Edits,
    /// How many requests for other objects were answered, whether or not they could be met.
    pub regroupings: u64,
    /// The inserted objects that the open capture came with, as a session that was taken up.
    pub inserted: Arc<Vec<Placement>>,
    /// The photograph that was shown when the open capture's session was saved.
    pub frame: usize,
    /// Which session the open capture goes on with, in words; `None` where a new one began.
    pub continued: Option<String>,
    /// All sessions that are kept, the newest first.
    pub kept: Arc<Vec<Kept>>,
    /// Pictures of the requested view.
    pub view: Option<Arc<View>>,
    /// The requested frame's photograph as it was changed, once that was looked at.
    pub insertion: Option<Arc<Insertion>>,
    /// Events since the session began, oldest first.
    pub events: Arc<Vec<Event>>,
}

/// What the worker is doing.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Phase {
    /// Nothing is open.
    #[default]
    Idle,
    /// Reading a capture.
    Loading,
    /// Solving.
    Solving,
    /// Held between two iterations.
    Paused,
    /// At the end.
    Finished(Termination),
    /// The worker met an error it could not go on from; the message is in `events`.
    Failed,
}

/// What is open, unchanging while it is.
#[derive(Debug)]
pub struct OpenCapture {
    /// Where it came from.
    pub source: Source,
    /// How it was read.
    pub options: OpenOptions,
    /// Hash of the mesh, the cameras and the photographs.
    pub hash: String,
    /// The capture itself, with cameras at the photographs' full size.
    pub capture: Arc<Capture>,
    /// Name shown to people.
    pub name: String,
    /// Geometry and cameras.
    pub scene: Arc<Scene>,
    /// Photographs at the working resolution, one a camera.
    pub photographs: Vec<Arc<Photograph>>,
    /// The checked summary, one fact a line.
    pub summary: Vec<String>,
    /// What is odd about it.
    pub warnings: Vec<String>,
    /// How well the photographs agree with the mesh, where the options ask for that.
    pub alignment: Option<Alignment>,
}

/// Pictures of one view.
#[derive(Debug, Clone)]
pub struct View {
    /// Grows with every change, so that uploads can be skipped.
    pub sequence: u64,
    /// The frame, if the view is a photograph's.
    pub frame: Option<usize>,
    /// The photograph, radiance.
    pub photograph: Option<Arc<Picture>>,
    /// The re-render from the estimate, radiance.
    pub render: Option<Arc<Picture>>,
    /// Samples a pixel in `render`.
    pub samples: u32,
    /// Estimated diffuse reflectance.
    pub albedo: Option<Arc<Picture>>,
    /// Estimated emission, radiance.
    pub emission: Option<Arc<Picture>>,
    /// Render − photograph, signed radiance.
    pub error: Option<Arc<Picture>>,
    /// Standard error of the albedo.
    pub stderr: Option<Arc<Picture>>,
    /// Object index of each pixel; `u32::MAX` where the ray leaves the mesh.
    pub objects: Option<Arc<Vec<u32>>>,
    /// The re-render by lamp, where the request asked for it.
    pub layers: Option<Arc<LightLayers>>,
}

/// A re-render with the light of each lamp apart; the layers add up to it.
#[derive(Debug, Clone)]
pub struct LightLayers {
    /// What each layer holds the light of, and that light, radiance.
    pub layers: Vec<(LightSource, Arc<Picture>)>,
    /// Samples a pixel.
    pub samples: u32,
}

impl LightLayers {
    /// The picture with each layer's red, green and blue times a factor; `None` where nothing emits.
    pub fn mix(&self, factor: impl Fn(LightSource) -> Vec3) -> Option<Picture> {
        let layers = self.layers.iter();
        layers::mix(layers.map(|(source, picture)| (&**picture, factor(*source))))
    }
}

/// Composites of the requested frame: its photograph in the light as it was changed, with the inserted objects.
#[derive(Debug, Clone)]
pub struct Insertion {
    /// Grows with every change.
    pub sequence: u64,
    /// The frame.
    pub frame: usize,
    /// The photograph as it was taken.
    pub photograph: Arc<Picture>,
    /// The same in the changed light, with the objects lit and shadowed by the estimate.
    pub composite: Arc<Picture>,
    /// Pasted, lit by harmonics of the photographs alone.
    pub naive: Arc<Picture>,
    /// Pasted, lit by harmonics of the estimate.
    pub naive_estimate: Arc<Picture>,
    /// Samples a pixel in `composite`, of the changed light or of the objects, whichever are fewer; `None` where it is the
    /// photograph as taken.
    pub samples: Option<u32>,
    /// Seconds from the request to this picture.
    pub seconds: f64,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// How bad.
    pub level: Level,
    /// What happened, in one line.
    pub message: String,
}

/// How much an event matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Worth knowing.
    Info,
    /// Worked around.
    Warning,
    /// Failed.
    Error,
}
