//! Who traces paths for a picture: the graphics card where one is there and wanted, else the processor. Both estimate the same.

mod device;
mod pictures;

pub use device::Device;
pub use pictures::Pictures;

use crate::error::{Error, Result};
use crate::gpu::{Adapters, Card, Inserted, Tracer};
use crate::say;
use crate::transport::lit::Lit;

/// The card, if there is one to use.
#[derive(Debug, Clone, Default)]
pub struct Renderer {
    card: Option<Card>,
}

impl Renderer {
    /// The processor alone.
    pub fn processor() -> Self {
        Self::default()
    }

    /// What a person asked for.
    ///
    /// # Errors
    /// A card is demanded and there is no adapter that can trace paths.
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

    /// The card's name, where there is one to use.
    pub fn card(&self) -> Option<&str> {
        self.card.as_ref().map(Card::name)
    }

    /// A scene on the card; `None` where there is no card, or where it is refused, which is said in a line.
    pub fn tracer(&self, lit: &Lit, objects: &[Inserted<'_>]) -> Option<Tracer> {
        let made = Tracer::new(self.card.as_ref()?, lit, objects);
        made.map_err(|error| went_wrong(&error)).ok()
    }
}

/// Says that the card failed and the processor goes on.
pub fn went_wrong(error: &Error) {
    say::warning(format_args!(
        "{}: {}; the processor goes on without the card",
        error.place, error.problem
    ));
}
