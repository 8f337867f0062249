//! A hand-made session: a small room, snapshots that tests write, and the commands that the window sent.

use egui_kittest::Harness;
use glam::{DMat3, DVec3, Vec3};
use relit::app::layout::Workspace;
use relit::app::preferences::Preferences;
use relit::app::state::App;
use relit::app::window::Window;
use relit::app::worker::Connection;
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::mesh::Mesh;
use relit::capture::photograph::{Encoding, Photograph, PhotographSource};
use relit::capture::{Capture, Frame};
use relit::inverse::estimate::{Estimate, ObjectEstimate};
use relit::inverse::solver::{LossPoint, Progress, Stage};
use relit::scene::Scene;
use relit::session::command::{Command, OpenOptions, Source};
use relit::session::snapshot::{
    Event, Insertion, Level, LightLayers, LightSource, OpenCapture, Phase, Picture, Snapshot, View,
};
use std::sync::{Arc, Mutex, PoisonError};

/// Both ends of the session.
#[derive(Clone, Default)]
pub struct Recorder {
    sent: Arc<Mutex<Vec<Command>>>,
    snapshot: Arc<Mutex<Arc<Snapshot>>>,
    full: Arc<Mutex<bool>>,
}

impl Connection for Recorder {
    fn send(&self, command: Command) -> bool {
        if *self.full.lock().unwrap_or_else(PoisonError::into_inner) {
            return false;
        }
        self.sent
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(command);
        true
    }

    fn latest(&self) -> Arc<Snapshot> {
        self.snapshot
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

impl Recorder {
    /// The commands sent since the last call.
    pub fn sent(&self) -> Vec<Command> {
        std::mem::take(&mut self.sent.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Whether commands are refused.
    pub fn refuse(&self, full: bool) {
        *self.full.lock().unwrap_or_else(PoisonError::into_inner) = full;
    }

    /// Shows a snapshot changed by `change`.
    pub fn show(&self, change: impl FnOnce(&mut Snapshot)) {
        let mut slot = self.snapshot.lock().unwrap_or_else(PoisonError::into_inner);
        let mut snapshot = Snapshot::clone(&slot);
        change(&mut snapshot);
        snapshot.sequence += 1;
        *slot = Arc::new(snapshot);
    }
}

/// A window of 1280 × 800 with the grid of pictures on an idle session.
pub fn idle(builder: egui_kittest::HarnessBuilder<Window>) -> (Harness<'static, Window>, Recorder) {
    let recorder = Recorder::default();
    let connection = recorder.clone();
    let harness = builder
        .with_size(egui::vec2(1280.0, 800.0))
        .with_max_steps(20)
        .build_eframe(move |cc| {
            let preferences = Preferences {
                workspace: Workspace::Inspect,
                ..Preferences::default()
            };
            let app = App::new(Box::new(connection), preferences);
            Window::new(cc, app, None)
        });
    (harness, recorder)
}

/// A window on a session that solves the small room.
pub fn solving(
    builder: egui_kittest::HarnessBuilder<Window>,
) -> (Harness<'static, Window>, Recorder) {
    let (mut harness, recorder) = idle(builder);
    recorder.show(solve);
    harness.run_steps(4);
    recorder.sent();
    (harness, recorder)
}

/// What is shown while the small room is solved.
pub fn solve(snapshot: &mut Snapshot) {
    let capture = Arc::new(room());
    snapshot.phase = Phase::Solving;
    snapshot.estimate = Arc::new(estimate());
    snapshot.progress = Arc::new(progress());
    snapshot.view = Some(Arc::new(view(&capture, 0)));
    snapshot.iterations_per_second = 12.0;
    snapshot.rays_per_second = 2.5e6;
    snapshot.seconds_left = Some(8.0);
    snapshot.events = Arc::new(vec![Event {
        level: Level::Info,
        message: "opened the small room".into(),
    }]);
    snapshot.capture = Some(capture);
}

/// A floor, a wall and a lamp, seen by three cameras.
pub fn room() -> OpenCapture {
    let corner = |x, y, z| DVec3::new(x, y, z);
    let intrinsics = Intrinsics {
        width: 64,
        height: 48,
        fx: 50.0,
        fy: 50.0,
        cx: 32.0,
        cy: 24.0,
        distortion: [0.0; 4],
    };
    let frames = (0..3).map(|index| Frame {
        intrinsics,
        pose: Pose {
            rotation: DMat3::from_rotation_x(-0.35),
            center: corner(0.2 * f64::from(index) - 0.2, 1.6, 3.0),
        },
        exposure: None,
        photograph: PhotographSource::Memory(Arc::new(photograph(index))),
        depth: None,
    });
    let capture = Capture {
        name: "small room".into(),
        folder: None,
        segmentation: None,
        mesh: Mesh {
            positions: vec![
                corner(-1.0, 0.0, 1.0),
                corner(1.0, 0.0, 1.0),
                corner(1.0, 0.0, -1.0),
                corner(-1.0, 0.0, -1.0),
                corner(1.0, 2.0, -1.0),
                corner(-1.0, 2.0, -1.0),
                corner(-0.3, 1.9, 0.2),
                corner(0.3, 1.9, 0.2),
                corner(0.0, 1.9, 0.6),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5], [6, 7, 8]],
            object_of: vec![0, 0, 1, 1, 2],
            objects: vec!["floor".into(), "wall".into(), "lamp".into()],
            ..Mesh::default()
        },
        frames: frames.collect(),
        up: DVec3::Y,
        warnings: vec!["one triangle has no area".into()],
    };
    OpenCapture {
        source: Source::BuiltInRoom,
        options: OpenOptions::default(),
        hash: String::new(),
        name: capture.name.clone(),
        scene: Arc::new(Scene::new(&capture).expect("a scene")),
        photographs: (0..3).map(|index| Arc::new(photograph(index))).collect(),
        alignment: None,
        summary: vec!["5 triangles in 3 objects".into()],
        warnings: capture.warnings.clone(),
        capture: Arc::new(capture),
    }
}

fn photograph(index: u32) -> Photograph {
    let picture = gradient(index as f32 * 0.1);
    Photograph {
        width: picture.width,
        height: picture.height,
        pixels: picture.pixels,
        usable: Vec::new(),
        encoding: Encoding::Linear,
        saturation: Vec3::INFINITY,
        limits: Vec::new(),
    }
}

/// Brighter to the right and, in green, to the bottom.
pub fn gradient(blue: f32) -> Picture {
    Picture::from_fn(64, 48, |x, y| {
        Vec3::new(x as f32 / 63.0, y as f32 / 47.0, blue)
    })
}

fn constant(value: Vec3) -> Option<Arc<Picture>> {
    Some(Arc::new(Picture::from_fn(64, 48, |_, _| value)))
}

fn flat(value: f32) -> Arc<Picture> {
    Arc::new(Picture::from_fn(64, 48, |_, _| Vec3::splat(value)))
}

/// Pictures of a frame.
pub fn view(capture: &OpenCapture, frame: usize) -> View {
    let camera = &capture.scene.cameras[frame];
    let objects = (0..48 * 64).map(|index| {
        let pixel = glam::vec2((index % 64) as f32 + 0.5, (index / 64) as f32 + 0.5);
        let hit = capture.scene.intersect(&camera.ray(pixel));
        hit.map_or(u32::MAX, |hit| {
            capture.scene.object_of[hit.triangle as usize]
        })
    });
    View {
        sequence: frame as u64 + 1,
        frame: Some(frame),
        photograph: Some(Arc::new(gradient(frame as f32 * 0.1))),
        render: constant(Vec3::splat(0.25)),
        samples: 4,
        albedo: constant(Vec3::new(0.8, 0.4, 0.2)),
        emission: constant(Vec3::ZERO),
        error: constant(Vec3::splat(-0.1)),
        stderr: constant(Vec3::splat(0.01)),
        objects: Some(Arc::new(objects.collect())),
        layers: Some(Arc::new(LightLayers {
            layers: [(LightSource::Lamp(2), 0.2), (LightSource::Outside, 0.05)]
                .map(|(source, light)| (source, flat(light)))
                .into(),
            samples: 4,
        })),
    }
}

/// Composites of a frame.
pub fn insertion(frame: usize) -> Insertion {
    Insertion {
        sequence: 1,
        frame,
        photograph: flat(0.5),
        composite: flat(0.9),
        naive: flat(0.6),
        naive_estimate: flat(0.7),
        samples: Some(16),
        seconds: 0.4,
    }
}

fn estimate() -> Estimate {
    let object = |albedo: f32, error, emission, seen_pixels| ObjectEstimate {
        albedo: Vec3::splat(albedo),
        albedo_stderr: Vec3::splat(error),
        emission: Vec3::splat(emission),
        seen_pixels,
        ..ObjectEstimate::default()
    };
    Estimate {
        objects: vec![
            object(0.5, 0.01, 0.0, 900),
            object(0.7, 0.03, 0.0, 1200),
            ObjectEstimate {
                albedo_identifiable: false,
                note: "a lamp's own albedo is not to be known".into(),
                ..object(0.0, 0.0, 9.0, 40)
            },
        ],
        ..Estimate::default()
    }
}

fn progress() -> Progress {
    let losses = (0..50).map(|i| LossPoint {
        seconds: f64::from(i) * 0.1,
        iteration: i as u64,
        train: Some((-0.1 * f64::from(i)).exp()),
        held_out: Some((-0.09 * f64::from(i)).exp()),
    });
    Progress {
        phase: "fitting".into(),
        fraction: Some(0.4),
        iterations: 50,
        seconds: 5.0,
        losses: losses.collect(),
        stages: vec![Stage {
            name: "objects".into(),
            seconds: 2.0,
            ended: 2.0,
            iterations: 20,
            train_loss: Some(0.13),
            held_out_loss: Some(0.16),
            kept: true,
            why: "it halves the loss".into(),
        }],
        ..Progress::default()
    }
}
