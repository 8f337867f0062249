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
    /// The last scene that the card refused.
    refused: Weak<Scene>,
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
        let mut state = self.state();
        let card = state.card.clone()?;
        let scene = &lit.scene;
        if state.refused.as_ptr() == Arc::as_ptr(scene) {
            return None;
        }
        let known = state.geometry.as_ref();
        let known = known.filter(|(of, _)| objects.is_empty() && of.as_ptr() == Arc::as_ptr(scene));
        let made = match known {
            Some((_, geometry)) => Tracer::on(&card, geometry.clone(), lit, objects),
            None => Tracer::new(&card, lit, objects),
        };
        match made {
            Ok(tracer) => {
                if objects.is_empty() {
                    state.geometry = Some((Arc::downgrade(scene), tracer.geometry().clone()));
                }
                Some(tracer)
            }
            Err(error) => {
                state.refused = Arc::downgrade(scene);
                state.warn(&error);
                None
            }
        }
    }

    /// Does work on the card with what is there; `None` if nothing is, or if the card failed: then it is given up with a warning.
    pub fn on_card<W, C, T>(
        &self,
        work: &mut W,
        there: &mut Option<C>,
        act: impl FnOnce(&mut W, &mut C) -> Result<T>,
    ) -> Option<T> {
        let done = act(work, there.as_mut()?);
        if let Err(error) = &done {
            let mut state = self.state();
            state.card = None;
            state.geometry = None;
            state.warn(error);
            *there = None;
        }
        done.ok()
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
