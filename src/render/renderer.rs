//! Chooses between the graphics card and the processor.

use crate::error::{Error, Result};
use crate::gpu::{Adapters, Card, Inserted, Tracer};
use crate::render::device::Device;
use crate::say;
use crate::transport::lit::LitScene;

/// The graphics card to use, if any.
#[derive(Debug, Clone, Default)]
pub struct Renderer {
    card: Option<Card>,
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
        let card = match device {
            Device::Cpu => None,
            Device::Auto => Card::open(Adapters::Cards),
            Device::Gpu => Some(Card::open(Adapters::Any).ok_or_else(|| {
                Error::new(
                    "--device gpu",
                    "no graphics adapter can trace paths",
                    "install its Vulkan driver, or leave the option out",
                )
            })?),
        };
        Ok(Self { card })
    }

    /// The card's name, if one is used.
    pub fn card(&self) -> Option<&str> {
        self.card.as_ref().map(Card::name)
    }

    /// Uploads a scene to the card; `None` without a card, or with a warning if the card refuses the scene.
    pub fn tracer(&self, lit: &LitScene, objects: &[Inserted<'_>]) -> Option<Tracer> {
        let made = Tracer::new(self.card.as_ref()?, lit, objects);
        made.map_err(|error| warn_card_failed(&error)).ok()
    }
}

/// Warns that the card failed and that the processor continues.
pub fn warn_card_failed(error: &Error) {
    say::warning(format_args!(
        "{}: {}; the processor continues without the card",
        error.place, error.problem
    ));
}
