//! Renders pictures of one lit scene.

use crate::gpu::{Tracer, View};
use crate::render::renderer::{Renderer, warn_card_failed};
use crate::scene::camera::Camera;
use crate::transport::film::Film;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;

/// Renders views of one lit scene.
#[derive(Debug)]
pub struct Pictures<'a> {
    lit: &'a LitScene,
    tracer: Option<Tracer>,
}

impl<'a> Pictures<'a> {
    /// Renders a scene on the card if the renderer has one that accepts it.
    pub fn new(renderer: &Renderer, lit: &'a LitScene) -> Self {
        Self {
            lit,
            tracer: renderer.tracer(lit, &[]),
        }
    }

    /// A picture from `samples` paths per pixel, keyed by (seed, frame). If the card fails, a warning is written and the processor
    /// renders this picture and all later ones.
    pub fn film(
        &mut self,
        camera: &Camera,
        options: &PathOptions,
        (seed, frame): (u64, u64),
        samples: u32,
    ) -> Film {
        let view = View {
            camera,
            options,
            seed,
            frame,
        };
        if let Some(tracer) = &mut self.tracer {
            match tracer.film(&view, samples) {
                Ok(film) => return film,
                Err(error) => warn_card_failed(&error),
            }
            self.tracer = None;
        }
        let mut film = Film::new(camera);
        film.add(self.lit, camera, options, seed, frame, samples);
        film
    }
}
