//! Pictures of one lit scene.

use crate::gpu::{Tracer, View};
use crate::render::{Renderer, went_wrong};
use crate::scene::camera::Camera;
use crate::transport::film::Film;
use crate::transport::lit::Lit;
use crate::transport::path::PathOptions;

/// Renders views of one lit scene.
#[derive(Debug)]
pub struct Pictures<'a> {
    lit: &'a Lit,
    tracer: Option<Tracer>,
}

impl<'a> Pictures<'a> {
    /// Views of a scene, by the card if the renderer has one that takes it.
    pub fn new(renderer: &Renderer, lit: &'a Lit) -> Self {
        Self {
            lit,
            tracer: renderer.tracer(lit, &[]),
        }
    }

    /// A picture from `samples` paths a pixel, keyed by (seed, frame). A card that fails costs a line, and the processor renders the
    /// picture and all later ones.
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
                Err(error) => went_wrong(&error),
            }
            self.tracer = None;
        }
        let mut film = Film::new(camera);
        film.add(self.lit, camera, options, seed, frame, samples);
        film
    }
}
