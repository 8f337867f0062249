//! Chooses between the graphics card and the processor.

use crate::error::{Error, Result};
use crate::gpu::{Adapters, Card, Geometry, Inserted, Tracer};
use crate::render::device::Device;
use crate::say;
use crate::scene::Scene;
use crate::transport::lit::LitScene;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::JoinHandle;

/// The graphics card to use, if any. A clone shares it, and what is on it.
#[derive(Debug, Clone, Default)]
pub struct Renderer(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    card: Option<Card>,
    opening: Option<JoinHandle<Result<Option<Card>>>>,
    /// The triangles of the last scene without inserted objects.
    geometry: Option<(Weak<Scene>, Arc<Geometry>)>,
    /// The last scene that the card refused, and the number of triangles inserted into it.
    refused: Option<(Weak<Scene>, usize)>,
    /// Warnings that nobody has taken yet.
    warnings: Vec<String>,
}

impl Renderer {
    /// The processor alone.
    pub fn processor() -> Self {
        Self::default()
    }

    /// The renderer for a `--device` option.
    ///
    /// # Errors
    /// A card is required, but no adapter can trace paths.
    pub fn find(device: Device) -> Result<Self> {
        let renderer = Self::default();
        renderer.lock().card = open(device)?;
        Ok(renderer)
    }

    /// [`Renderer::find`] without waiting: until drivers are loaded, it is the processor. A missing card is a warning.
    pub fn find_later(device: Device) -> Self {
        let renderer = Self::default();
        let thread = std::thread::Builder::new().name("relit-card".to_owned());
        renderer.lock().opening = thread.spawn(move || open(device)).ok();
        renderer
    }

    /// The card's name, if one is used.
    pub fn card(&self) -> Option<String> {
        self.state()
            .card
            .as_ref()
            .map(|card| card.name().to_owned())
    }

    /// Uploads a scene to the card; `None` without a card, or with a warning if the card refuses the scene.
    pub fn tracer(&self, lit: &LitScene, objects: &[Inserted<'_>]) -> Option<Tracer> {
        let scene = &lit.scene;
        let is_this = |other: &Weak<Scene>| other.as_ptr() == Arc::as_ptr(scene);
        let inserted = objects.iter().map(|object| object.corners.len()).sum();
        let (card, known) = {
            let state = self.state();
            let refused = state.refused.as_ref();
            if refused.is_some_and(|(of, least)| is_this(of) && inserted >= *least) {
                return None;
            }
            let card = state.card.clone()?;
            let known = state.geometry.as_ref();
            let known = known.filter(|(of, _)| objects.is_empty() && is_this(of));
            (card, known.map(|(_, geometry)| geometry.clone()))
        };
        let made = match known {
            Some(geometry) => Tracer::on(&card, geometry, lit, objects),
            None => Tracer::new(&card, lit, objects),
        };
        let mut state = self.state();
        match made {
            Ok(tracer) => {
                if objects.is_empty() {
                    state.geometry = Some((Arc::downgrade(scene), tracer.geometry().clone()));
                }
                Some(tracer)
            }
            Err(error) if card.is_lost() => {
                drop(state);
                self.give_up(&error);
                None
            }
            Err(error) => {
                state.refused = Some((Arc::downgrade(scene), inserted));
                state.warn(&error);
                None
            }
        }
    }

    /// Uploads a scene in two lights.
    pub fn tracers(&self, [a, b]: &[Arc<LitScene>; 2]) -> Option<[Tracer; 2]> {
        Some([self.tracer(a, &[])?, self.tracer(b, &[])?])
    }

    /// Runs `act` on the card; `None` without a tracer, or if the card failed: it is then no longer used, and a warning is given.
    pub fn on_card<W, C, T>(
        &self,
        work: &mut W,
        tracer: &mut Option<C>,
        act: impl FnOnce(&mut W, &mut C) -> Result<T>,
    ) -> Option<T> {
        let done = act(work, tracer.as_mut()?);
        if let Err(error) = &done {
            self.give_up(error);
            *tracer = None;
        }
        done.ok()
    }

    /// Leaves the card for good. The first who finds it failed warns.
    fn give_up(&self, error: &Error) {
        let mut state = self.state();
        let (card, geometry) = (state.card.take(), state.geometry.take());
        if card.is_some() {
            state.warn(error);
        }
        // The last clone waits for the card, which others need not.
        drop(state);
        drop((card, geometry));
    }

    /// Warnings since the last call.
    pub fn take_warnings(&self) -> Vec<String> {
        std::mem::take(&mut self.state().warnings)
    }

    /// The state, with a card that has been opened meanwhile.
    fn state(&self) -> MutexGuard<'_, State> {
        let mut state = self.lock();
        if state.opening.as_ref().is_some_and(JoinHandle::is_finished) {
            match state.opening.take().map(JoinHandle::join) {
                Some(Ok(Ok(card))) => state.card = card,
                Some(Ok(Err(error))) => state.warn(&error),
                Some(Err(_)) | None => {}
            }
        }
        state
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Warns that the card failed and that the processor continues.
    fn warn(&mut self, error: &Error) {
        let text = format!(
            "{}: {}; the processor continues without the card",
            error.place, error.problem
        );
        say::warning(&text);
        self.warnings.push(text);
    }
}

fn open(device: Device) -> Result<Option<Card>> {
    let none = || {
        Error::new(
            "--device gpu",
            "no graphics adapter can trace paths",
            "install its Vulkan driver, or leave the option out",
        )
    };
    match device {
        Device::Cpu => Ok(None),
        Device::Auto => Ok(Card::open(Adapters::Cards)),
        Device::Gpu => Card::open(Adapters::Any).map(Some).ok_or_else(none),
    }
}
