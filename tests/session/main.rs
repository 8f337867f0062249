//! The session's protocol: what a window may rely on, whatever the solver does.

#[path = "../common/mod.rs"]
mod common;
mod keeping;
mod recut;
mod regroup;

use relit::calibrate::problem::Problem;
use relit::capture::Capture;
use relit::capture::place::Coordinates;
use relit::error::Result;
use relit::inverse::estimate::Estimate;
use relit::inverse::settings::Settings;
use relit::inverse::solver::{Checkpoint, Control, LossPoint, Observer, Solution, Termination};
use relit::render::Renderer;
use relit::session::Session;
use relit::session::command::{Command, OpenOptions, Source, Start, ViewCamera, ViewRequest};
use relit::session::edits::{Edits, ObjectEdit};
use relit::session::snapshot::{Level, OpenCapture, Phase, Picture, Snapshot};
use relit::session::worker::Backend;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

static ROOM: LazyLock<Capture> = LazyLock::new(common::room);

/// How the solver of these tests behaves.
#[derive(Clone, Copy)]
struct Stub {
    /// The step that panics.
    panic_at: Option<u64>,
    /// How long a step takes.
    step: Duration,
}

impl Stub {
    const NONE: Self = Self {
        panic_at: None,
        step: Duration::from_millis(1),
    };
}

/// Iterates until told to stop, counting its steps; the estimate says how many.
fn count_up(
    observer: &mut dyn Observer,
    steps: &AtomicU64,
    stub: Stub,
    resume: Option<&Checkpoint>,
    resumable: bool,
) -> Solution {
    let mut progress = resume.map(|c| c.progress.clone()).unwrap_or_default();
    let mut estimate = common::truth();
    let known = observer.known();
    estimate.objects[1].roughness = known.object(1).albedo.map(|albedo| albedo.x);
    loop {
        progress.iterations += 1;
        progress.rays += 1000;
        progress.seconds = progress.iterations as f64 * 1e-3;
        progress.losses = vec![LossPoint {
            seconds: progress.seconds,
            iteration: progress.iterations,
            train: Some(1.0),
            held_out: None,
        }];
        estimate.objects[1].seen_pixels = progress.iterations;
        steps.store(progress.iterations, Ordering::SeqCst);
        assert!(stub.panic_at != Some(progress.iterations), "injected fault");
        std::thread::sleep(stub.step);
        observer.offer(&|| Checkpoint::new(&progress, &progress.iterations));
        if observer.observe(&progress, &estimate) == Control::Stop {
            return Solution {
                estimate,
                checkpoint: resumable.then(|| Checkpoint::new(&progress, &progress.iterations)),
                progress,
                termination: Termination::Cancelled,
            };
        }
    }
}

struct Rig {
    session: Session,
    steps: Arc<AtomicU64>,
}

impl Rig {
    /// A session on the tiny room whose first solve panics at a step, if one is given.
    fn new(panic_at: Option<u64>) -> Self {
        let stub = Stub {
            panic_at,
            ..Stub::NONE
        };
        Self::spawn(|_| Ok(ROOM.clone()), stub, false, None)
    }

    /// A session whose solver takes long steps.
    fn slow(step: Duration) -> Self {
        let stub = Stub { step, ..Stub::NONE };
        Self::spawn(|_| Ok(ROOM.clone()), stub, false, None)
    }

    /// A session whose solves can be gone on with after their end.
    fn resumable() -> Self {
        Self::spawn(|_| Ok(ROOM.clone()), Stub::NONE, true, None)
    }

    /// The same, keeping its sessions under a folder.
    fn keeping(sessions: &Path) -> Self {
        let sessions = Some(sessions.to_owned());
        Self::spawn(|_| Ok(ROOM.clone()), Stub::NONE, true, sessions)
    }

    fn spawn(
        read: impl Fn(&OpenOptions) -> Result<Capture> + Send + 'static,
        mut stub: Stub,
        resumable: bool,
        sessions: Option<PathBuf>,
    ) -> Self {
        let steps = Arc::new(AtomicU64::new(0));
        let shared = steps.clone();
        let backend = Backend {
            open: Box::new(move |source, options| {
                OpenCapture::new(source.clone(), options.clone(), read(options)?)
            }),
            sessions,
            renderer: Renderer::processor(),
            solve: Box::new(move |_: &Problem, _: &Settings, resume, observer| {
                // Only the first solve panics.
                let panic_at = stub.panic_at.take();
                let stub = Stub { panic_at, ..stub };
                Ok(count_up(observer, &shared, stub, resume, resumable))
            }),
        };
        let session = Session::spawn_with(
            Some(Start::Capture(Source::BuiltInRoom, OpenOptions::default())),
            Settings::default(),
            Arc::new(|| {}),
            backend,
        )
        .expect("a thread");
        Self { session, steps }
    }

    /// Waits for a snapshot that satisfies a condition.
    fn until(&self, what: &str, mut holds: impl FnMut(&Snapshot) -> bool) -> Arc<Snapshot> {
        let started = Instant::now();
        loop {
            let snapshot = self.session.latest();
            if holds(&snapshot) {
                return snapshot;
            }
            assert!(
                started.elapsed() < Duration::from_secs(60),
                "no snapshot with {what}: {:?} {:?}",
                snapshot.phase,
                snapshot.events
            );
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn look(&self, long_side: u32) {
        let camera = ViewCamera::Frame(0);
        assert!(self.session.send(Command::View(ViewRequest {
            camera,
            long_side,
            composite: long_side,
            render: true,
            layers: false
        })));
    }
}

/// The albedo of the second object held at a value.
fn pinned(albedo: f32) -> Edits {
    let mut edits = Edits::default();
    let held = ObjectEdit {
        albedo: Some(glam::Vec3::splat(albedo)),
        albedo_known: true,
        ..ObjectEdit::default()
    };
    edits.set(1, held);
    edits
}

fn iterations(snapshot: &Snapshot) -> u64 {
    snapshot.progress.iterations
}

#[test]
fn a_pause_holds_the_solver_a_step_moves_it_by_one_and_run_lets_it_go() {
    let rig = Rig::new(None);
    rig.until("some steps", |s| iterations(s) > 3);
    assert!(rig.session.send(Command::Pause));
    let paused = rig.until("the pause", |s| s.phase == Phase::Paused);
    // From the moment the pause shows, the solver stands where the snapshot says.
    let at = rig.until("the last step", |s| {
        s.phase == Phase::Paused && iterations(s) == rig.steps.load(Ordering::SeqCst)
    });
    assert!(iterations(&at) >= iterations(&paused));
    for step in 1..=3 {
        assert!(rig.session.send(Command::Step));
        rig.until("one more step", |s| iterations(s) == iterations(&at) + step);
    }
    assert_eq!(rig.steps.load(Ordering::SeqCst), iterations(&at) + 3);
    assert!(rig.session.send(Command::Run));
    let running = rig.until("running on", |s| iterations(s) > iterations(&at) + 10);
    assert_eq!(running.phase, Phase::Solving);
}

#[test]
fn views_sharpen_while_solving_while_paused_and_after_the_end() {
    let rig = Rig::new(None);
    rig.look(16);
    rig.until("a first view", |s| {
        s.view.as_ref().is_some_and(|v| {
            v.photograph.is_some() && v.render.is_some() && v.error.is_some() && v.samples >= 1
        })
    });
    for (command, phase) in [
        (Command::Pause, Phase::Paused),
        (Command::Finish, Phase::Finished(Termination::Cancelled)),
    ] {
        assert!(rig.session.send(command));
        rig.until("the phase", |s| s.phase == phase);
        rig.look(12);
        let sharp = rig.until("a sharp view", |s| {
            s.view
                .as_ref()
                .is_some_and(|v| v.samples > 200 && v.objects.is_some())
        });
        assert_eq!(sharp.phase, phase);
    }
    let snapshot = rig.session.latest();
    let view = snapshot.view.as_ref().expect("a view");
    let (render, photograph) = (
        view.render.as_ref().expect("a render"),
        view.photograph.as_ref().expect("a photograph"),
    );
    assert_eq!((render.width, render.height), (12, 12));
    // The estimate is the truth, so that render and photograph agree in the mean.
    let mean = |p: &relit::math::picture::Picture| {
        p.pixels.iter().map(|c| f64::from(c.x)).sum::<f64>() / p.pixels.len() as f64
    };
    let (a, b) = (mean(render), mean(photograph));
    assert!((a / b - 1.0).abs() < 0.1, "{a} {b}");
}

#[test]
fn views_have_their_share_of_a_solve_of_long_steps() {
    let rig = Rig::slow(Duration::from_millis(400));
    rig.look(16);
    let sharp = rig.until("a sharp view", |s| {
        s.view.as_ref().is_some_and(|v| v.samples >= 16)
    });
    assert!(iterations(&sharp) <= 4, "{}", iterations(&sharp));
}

#[test]
fn edits_show_while_the_solver_makes_one_long_step() {
    let rig = Rig::slow(Duration::from_secs(3));
    rig.look(16);
    let composite = |s: &Snapshot| Some(mean(&s.insertion.as_ref()?.composite));
    let before = rig.until("an estimate and a composite", |s| {
        iterations(s) == 1 && composite(s).is_some()
    });
    assert!(composite(&before) > Some(0.0));
    assert!(rig.session.send(Command::Edit(lamp_off())));
    let dark = rig.until("the photograph without the lamp", |s| {
        composite(s) == Some(0.0)
    });
    assert_eq!(iterations(&dark), 1);
}

#[test]
fn a_panic_becomes_an_event_the_estimate_stays_and_the_session_goes_on() {
    let rig = Rig::new(Some(200));
    let failed = rig.until("the failure", |s| s.phase == Phase::Failed);
    let message = &failed.events.last().expect("an event").message;
    assert!(message.contains("injected fault"), "{message}");
    assert_eq!(failed.events.last().map(|e| e.level), Some(Level::Error));
    // The estimate says of which step it is; the fault came at the two hundredth.
    let step = failed.estimate.objects[1].seen_pixels;
    assert!((1..200).contains(&step), "{step}");

    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(rig.session.send(Command::Save(folder.path().join("saved"))));
    rig.until("the save", |s| {
        s.events.iter().any(|e| e.message.starts_with("saved to"))
    });
    let saved = relit::session::save::load(&folder.path().join("saved")).expect("reads");
    let kept = saved.file().objects.get("floor").expect("the floor");
    assert!((step..200).contains(&kept.seen_pixels), "{kept:?}");
    assert!(rig.session.send(Command::Reset));
    rig.until("solving again", |s| {
        s.phase == Phase::Solving && iterations(s) > 3
    });
}

#[test]
fn save_writes_the_workers_own_estimate_and_resume_brings_it_back() {
    let rig = Rig::new(None);
    rig.until("some steps", |s| iterations(s) > 20);
    assert!(rig.session.send(Command::Finish));
    let done = rig.until("the end", |s| matches!(s.phase, Phase::Finished(_)));
    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(rig.session.send(Command::Save(folder.path().to_owned())));
    rig.until("the save", |s| {
        s.events.iter().any(|e| e.message.starts_with("saved to"))
    });
    let other = Rig::new(None);
    other.until("some steps", |s| iterations(s) > 3);
    assert!(
        other
            .session
            .send(Command::Resume(folder.path().to_owned()))
    );
    let resumed = other.until("the saved estimate", |s| {
        matches!(s.phase, Phase::Finished(_)) && iterations(s) == 0
    });
    assert_eq!(resumed.estimate.objects, done.estimate.objects);
    let same = |a: &Estimate, b: &Estimate| a.objects[1].seen_pixels == b.objects[1].seen_pixels;
    assert!(same(&resumed.estimate, &done.estimate));
}

#[test]
fn a_save_during_a_solve_holds_the_solvers_state_and_a_resume_goes_on_from_it() {
    let rig = Rig::new(None);
    rig.until("some steps", |s| iterations(s) > 100);
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (paused, name) in [(false, "running"), (true, "paused")] {
        if paused {
            assert!(rig.session.send(Command::Pause));
            rig.until("the pause", |s| s.phase == Phase::Paused);
        }
        let path = folder.path().join(name);
        assert!(rig.session.send(Command::Save(path.clone())));
        rig.until("the save", |s| {
            s.events.iter().any(|e| e.message.ends_with(name))
        });
        let saved = relit::session::save::load(&path).expect("reads");
        let checkpoint = saved.checkpoint.as_ref().expect("a checkpoint");
        // The estimate that was saved with it is that of the same step.
        let object = saved.file().objects.get("floor").expect("the floor");
        assert_eq!(checkpoint.progress.iterations, object.seen_pixels);
    }
    let at = iterations(&rig.session.latest());
    let other = Rig::new(None);
    let first = other.until("a few steps", |s| s.phase == Phase::Solving);
    assert!(iterations(&first) < at);
    let command = Command::Resume(folder.path().join("paused"));
    assert!(other.session.send(command));
    let resumed = other.until("going on", |s| iterations(s) >= at);
    assert!(iterations(&resumed) < at + 50, "{}", iterations(&resumed));
}

#[test]
fn pinned_values_are_handed_to_the_solver_which_goes_on_from_its_checkpoint() {
    let rig = Rig::new(None);
    rig.until("some steps", |s| iterations(s) > 100);
    assert!(rig.session.send(Command::Edit(pinned(0.4))));
    assert!(rig.session.send(Command::SolveOn));
    // The solver of these tests says what it was told by the roughness of the floor.
    let on = rig.until("the pinned value", |s| {
        s.estimate.objects.get(1).and_then(|o| o.roughness) == Some(0.4)
    });
    assert!(iterations(&on) >= 100, "{}", iterations(&on));
}

#[test]
fn a_capture_is_put_into_other_coordinates_with_all_that_was_found_and_changed() {
    let rig = Rig::resumable();
    rig.until("some steps", |s| iterations(s) > 50);
    let mut edits = Edits::default();
    edits.set_outside(glam::Vec3::splat(0.5));
    assert!(rig.session.send(Command::Edit(edits.clone())));
    let options = OpenOptions {
        coordinates: Coordinates {
            scale: Some(2.0),
            ground: Some(0.25),
        },
        ..OpenOptions::default()
    };
    assert!(rig.session.send(Command::Reframe(Box::new(options))));
    let scaled = rig.until("a larger room", |s| {
        s.capture.as_ref().is_some_and(|c| c.scene.diameter > 6.0)
    });
    let capture = scaled.capture.as_ref().expect("open");
    let heights = capture.capture.mesh.positions.iter().map(|p| p.y);
    let lowest = heights.fold(f64::INFINITY, f64::min);
    assert!((lowest + 0.5).abs() < 1e-9, "{lowest}");
    assert_eq!(scaled.edits, edits);
    let on = rig.until("solving on", |s| {
        s.phase == Phase::Solving && iterations(s) > iterations(&scaled)
    });
    assert!(iterations(&on) > 50);

    // What is saved is read in the same coordinates, and belongs to the same capture.
    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(rig.session.send(Command::Save(folder.path().to_owned())));
    rig.until("the save", |s| {
        s.events.iter().any(|e| e.message.starts_with("saved to"))
    });
    let saved = relit::session::save::load(folder.path()).expect("reads");
    assert_eq!(saved.options.coordinates.scale, Some(2.0));
    saved.estimate_for(capture).expect("the same capture");
}

#[test]
fn what_cannot_be_opened_is_an_event_and_what_was_open_stays() {
    let rig = Rig::new(None);
    rig.until("some steps", |s| iterations(s) > 3);
    assert!(rig.session.send(Command::Resume("no/such/folder".into())));
    let snapshot = rig.until("the error", |s| {
        s.events.iter().any(|e| e.level == Level::Error)
    });
    assert!(snapshot.capture.is_some());
    rig.session.join();
}

/// The room's lamp.
fn lamp() -> usize {
    let mut objects = common::OBJECTS.iter();
    objects.position(|o| o.0 == "lamp").expect("a lamp")
}

fn lamp_off() -> Edits {
    let off = ObjectEdit {
        off: true,
        ..ObjectEdit::default()
    };
    let mut edits = Edits::default();
    edits.set(lamp(), off);
    edits
}

/// The mean over a picture.
fn mean(picture: &Picture) -> f32 {
    let sum: glam::Vec3 = picture.pixels.iter().sum();
    sum.element_sum() / 3.0 / picture.pixels.len() as f32
}

#[test]
fn edits_show_at_once_are_saved_and_come_back_while_the_estimate_stays() {
    let rig = Rig::new(None);
    rig.until("some steps", |s| iterations(s) > 3);
    rig.look(32);
    let lamp = lamp();
    let light = |s: &Snapshot| Some(mean(s.view.as_ref()?.render.as_ref()?));
    rig.until("light", |s| light(s).is_some_and(|l| l > 0.0));
    let edits = lamp_off();
    let asked = Instant::now();
    assert!(rig.session.send(Command::Edit(edits.clone())));
    let dark = rig.until("the lamp off", |s| light(s) == Some(0.0));
    let composite = |s: &Snapshot| Some(mean(&s.insertion.as_ref()?.composite));
    rig.until("the photograph without the lamp", |s| {
        composite(s) == Some(0.0)
    });
    println!("first picture after {:?}", asked.elapsed());
    assert_eq!(dark.edits, edits);
    assert!(dark.estimate.objects[lamp].emission.max_element() > 0.0);

    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    assert!(rig.session.send(Command::Save(out.clone())));
    rig.until("the save", |s| {
        s.events.iter().any(|e| e.message.starts_with("saved"))
    });
    let saved = image::open(out.join("views/000.render.exr")).expect("an image");
    assert!(saved.to_rgb32f().pixels().all(|p| p.0 == [0.0; 3]));
    assert!(rig.session.send(Command::Edit(Edits::default())));
    rig.until("light again", |s| {
        light(s).is_some_and(|l| l > 0.0)
            && s.insertion
                .as_ref()
                .is_some_and(|i| i.samples.is_none() && i.composite == i.photograph)
    });
    assert!(rig.session.send(Command::Resume(out)));
    let resumed = rig.until("the edits again", |s| {
        !s.edits.is_empty() && composite(s).is_some_and(|light| light < 0.01)
    });
    assert_eq!(resumed.edits, edits);
    assert!(resumed.estimate.objects[lamp].emission.max_element() > 0.0);
}

#[test]
fn layers_are_shown_when_asked_for_and_add_up_to_the_render() {
    let rig = Rig::new(None);
    rig.until("some steps", |s| iterations(s) > 3);
    assert!(rig.session.send(Command::View(ViewRequest {
        camera: ViewCamera::Frame(0),
        long_side: 32,
        composite: 0,
        render: true,
        layers: true,
    })));
    let shown = rig.until("layers", |s| {
        s.view
            .as_ref()
            .is_some_and(|v| v.layers.is_some() && v.samples > 1)
    });
    let view = shown.view.as_ref().expect("a view");
    let layers = view.layers.as_ref().expect("layers");
    let render = view.render.as_ref().expect("a render");
    let sum = layers.mix(|_| glam::Vec3::ONE).expect("a lamp");
    let brightest = render
        .pixels
        .iter()
        .map(|p| p.max_element())
        .fold(0.0, f32::max);
    for (a, b) in sum.pixels.iter().zip(&render.pixels) {
        assert!((*a - *b).abs().max_element() <= 1e-5 * brightest);
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("lights.exr");
    assert!(rig.session.send(Command::SaveLayers(file.clone())));
    rig.until("the file", |s| {
        s.events.iter().any(|e| e.message.starts_with("layers at"))
    });
    let image = exr::prelude::read_all_flat_layers_from_file(&file).expect("layers");
    let names: Vec<String> = (image.layer_data.iter())
        .filter_map(|layer| Some(layer.attributes.layer_name.as_ref()?.to_string()))
        .collect();
    assert!(names.iter().any(|name| name == "lamp"), "{names:?}");
}
