//! Snapshots of the worker's state: immutable and shared; readers take the newest.

use crate::compose::placement::Placement;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Progress, Termination};
use crate::session::edits::Edits;
use crate::session::store::Kept;
use crate::transport::layers;
use glam::Vec3;
use std::sync::Arc;

pub use crate::math::picture::Picture;
pub use crate::session::open_capture::OpenCapture;
pub use crate::transport::layers::LightSource;

/// The state of a session at one moment.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    /// Incremented with every snapshot.
    pub sequence: u64,
    /// What the worker is doing.
    pub phase: Phase,
    /// The open capture.
    pub capture: Option<Arc<OpenCapture>>,
    /// The current parameters.
    pub settings: Settings,
    /// Progress of the solve.
    pub progress: Arc<Progress>,
    /// Iterations per second, over about the last second.
    pub iterations_per_second: f64,
    /// Rays per second, over about the last second.
    pub rays_per_second: f64,
    /// Remaining seconds, if known.
    pub seconds_left: Option<f64>,
    /// The current estimate, without the edits.
    pub estimate: Arc<Estimate>,
    /// Edits of the estimate, which all pictures and exports show.
    pub edits: Edits,
    /// Number of commands to change objects that were answered, successfully or not.
    pub regroupings: u64,
    /// The inserted objects of the session that the open capture continues.
    pub inserted: Arc<Vec<Placement>>,
    /// The frame that was shown when the session was saved.
    pub frame: usize,
    /// Name of the session that the open capture continues; `None` for a new session.
    pub continued: Option<String>,
    /// All kept sessions, newest first.
    pub kept: Arc<Vec<Kept>>,
    /// Pictures of the requested view.
    pub view: Option<Arc<View>>,
    /// Composites of the requested frame, if they are shown.
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
    /// Paused between two iterations.
    Paused,
    /// The solve has ended.
    Finished(Termination),
    /// The worker stopped at an error; the message is in `events`.
    Failed,
}

/// Pictures of one view.
#[derive(Debug, Clone)]
pub struct View {
    /// Incremented with every change, so that uploads can be skipped.
    pub sequence: u64,
    /// The frame, if the view is a photograph's.
    pub frame: Option<usize>,
    /// The photograph, in radiance.
    pub photograph: Option<Arc<Picture>>,
    /// The render of the estimate, in radiance.
    pub render: Option<Arc<Picture>>,
    /// Samples per pixel of `render`.
    pub samples: u32,
    /// Estimated diffuse reflectance.
    pub albedo: Option<Arc<Picture>>,
    /// Estimated emission, in radiance.
    pub emission: Option<Arc<Picture>>,
    /// Render − photograph, signed radiance.
    pub error: Option<Arc<Picture>>,
    /// Standard error of the albedo.
    pub stderr: Option<Arc<Picture>>,
    /// Object index of each pixel; `u32::MAX` where the ray leaves the mesh.
    pub objects: Option<Arc<Vec<u32>>>,
    /// The render by lamp, if requested.
    pub layers: Option<Arc<LightLayers>>,
}

/// A render as layers by lamp, which add up to it.
#[derive(Debug, Clone)]
pub struct LightLayers {
    /// Source and radiance of each layer.
    pub layers: Vec<(LightSource, Arc<Picture>)>,
    /// Samples per pixel.
    pub samples: u32,
}

impl LightLayers {
    /// The sum of the layers, each times an RGB factor; `None` if nothing emits.
    pub fn mix(&self, factor: impl Fn(LightSource) -> Vec3) -> Option<Picture> {
        let layers = self.layers.iter();
        layers::mix(layers.map(|(source, picture)| (&**picture, factor(*source))))
    }
}

/// Composites of the requested frame: its photograph, relit by the edits, with the inserted objects.
#[derive(Debug, Clone)]
pub struct Insertion {
    /// Incremented with every change.
    pub sequence: u64,
    /// The frame.
    pub frame: usize,
    /// The photograph, unchanged.
    pub photograph: Arc<Picture>,
    /// The relit photograph with the inserted objects.
    pub composite: Arc<Picture>,
    /// Pasted objects, lit by harmonics of the photographs.
    pub naive: Arc<Picture>,
    /// Pasted objects, lit by harmonics of the estimate.
    pub naive_estimate: Arc<Picture>,
    /// Samples per pixel of relighting or objects, whichever are fewer; `None` if `composite` is the unchanged photograph.
    pub samples: Option<u32>,
    /// Seconds from the request to this picture.
    pub seconds: f64,
}

/// An event to report to the user.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Its severity.
    pub level: Level,
    /// Its message in one line.
    pub message: String,
}

/// Severity of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Information.
    Info,
    /// A problem that was worked around.
    Warning,
    /// A failure.
    Error,
}
